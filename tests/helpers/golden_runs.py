"""The reference trainer's runs on text that the library can make without the SRILM command line."""

import gzip
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from placerec.lm import Smoothing, smoothing

FLAGS = {"-wbdiscount", "-interpolate", "-unk", "-no-sos", "-no-eos"}
MINIMA = {f"-gt{n}min" for n in range(1, 10)}
VALUES = {"-text", "-order", "-addsmooth", "-lm", "-vocab", "-nonevents"} | MINIMA
# Their inputs need SRILM's own reading of lines: byte-order marks, NUL bytes, the word -pau-.
READER_CASES = {"bom.txt", "nul.txt", "special.txt"}


@dataclass(frozen=True)
class Case:
    name: str
    sentences: list[list[str]]
    vocabulary: list[str] | None
    non_events: list[str]
    order: int
    smoothing: Smoothing
    min_count: list[int]
    markers: bool
    unknown_is_word: bool
    expected: str


def text_cases(folder: Path) -> Iterator[Case]:
    """Every successful ngram-count run that makes a Witten-Bell or additive model of a text."""
    for line in (folder / "cases.jsonl").read_text().splitlines():
        case = json.loads(line)
        options = _options(case["args"])
        if case["tool"] == "ngram-count" and case["exit"] == 0 and options and _supported(options):
            yield _case(folder, case, options)


def _options(args: list[str]) -> dict[str, str] | None:
    options: dict[str, str] = {}
    rest = iter(args)
    for argument in rest:
        if argument in FLAGS:
            options[argument] = ""
        elif argument in VALUES:
            options[argument] = next(rest, "")
        else:
            return None
    return options


def _supported(options: dict[str, str]) -> bool:
    return (
        options.get("-text") not in (None, "-", *READER_CASES)
        and options.get("-lm", "-").endswith("lm")
        and ("-wbdiscount" in options) != (float(options.get("-addsmooth", 0)) > 0)
        and ("-no-sos" in options) == ("-no-eos" in options)
        and all(value.isdigit() for option, value in options.items() if option in MINIMA)
        and int(options.get("-order", 3)) > 0
    )


def _case(folder: Path, case: dict[str, Any], options: dict[str, str]) -> Case:
    inputs = {Path(path).name.removesuffix(".gz"): folder / path for path in case["inputs"]}
    vocabulary = _lines(inputs[options["-vocab"]]) if "-vocab" in options else None
    if "-wbdiscount" in options:
        rule = smoothing("witten-bell" if "-interpolate" in options else "witten-bell-backoff")
    else:
        rule = smoothing("lidstone-backoff", float(options["-addsmooth"]))
    return Case(
        name=case["id"],
        sentences=_lines(inputs[options["-text"]]),
        vocabulary=None if vocabulary is None else [line[0] for line in vocabulary if line],
        non_events=[line[0] for line in _lines(inputs[options["-nonevents"]]) if line]
        if "-nonevents" in options
        else [],
        order=int(options.get("-order", 3)),
        smoothing=rule,
        min_count=[max(1, int(options.get(f"-gt{n}min", 1 if n < 3 else 2))) for n in range(1, 10)],
        markers="-no-sos" not in options,
        unknown_is_word="-unk" in options,
        expected=_text(folder / "expected" / case["id"] / options["-lm"]),
    )


def _text(path: Path) -> str:
    zipped = path.with_name(path.name + ".gz")
    data = gzip.decompress(zipped.read_bytes()) if zipped.exists() else path.read_bytes()
    # SRILM reads bytes; Latin-1 keeps each of them, and their order.
    return data.decode("latin-1")


def _lines(path: Path) -> list[list[str]]:
    lines = _text(path).replace("\r", " ").replace("\t", " ").split("\n")
    return [[word for word in line.split(" ") if word] for line in lines if not line.startswith("##")]
