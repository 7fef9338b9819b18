"""Decoding: token streams, images or lines of words in, beliefs out."""

import json
import logging
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from placerec.errors import ModelError, StreamError, at
from placerec.files import whole_folder, write_text
from placerec.hohmm import Beliefs, Recognizer, format_header, format_row
from placerec.model.corpus import read_streams
from placerec.model.load import load_recognizer

OWNED = ("*.tsv", "*.jsonl")
log = logging.getLogger(__name__)


def decode(
    sources: Sequence[Path | str],
    model: Path | str,
    *,
    words: Path | str | None = None,
    out: Path | str | None = None,
    stay: float = 0.99,
    scorer: str = "native",
    as_json: bool = False,
) -> list[Beliefs]:
    """`placerec decode`: the beliefs over every sequence that `sources` name, written to the folder `out` if given.

    `sources`: token streams, or image sources if `words` (a words.npz) is given. Without `out` there must be one
    sequence only. Raises ModelError or StreamError for what cannot be read.
    """
    if words is None:
        streams = read_streams(sources)
        recognizer = load_recognizer(model, stay=stay, scorer=scorer)
    else:
        # Only images need OpenCV and scipy.
        from placerec.vision import Dictionary
        from placerec.words.tokenize import streams_of

        dictionary = Dictionary.load(Path(words))
        recognizer = load_recognizer(model, stay=stay, scorer=scorer, dictionary=dictionary)
        streams = streams_of(sources, dictionary)
    if out is None and len(streams) > 1:
        raise ModelError(f"{len(streams)} sequences to decode: name a folder for their beliefs with -o")
    decoded = [recognizer.decode(stream) for stream in streams]
    if out is not None:
        with whole_folder(Path(out), OWNED) as folder:
            for beliefs in decoded:
                suffix = "jsonl" if as_json else "tsv"
                write_text(folder / f"{beliefs.name}.{suffix}", format_beliefs(beliefs, as_json=as_json))
    return decoded


def format_beliefs(beliefs: Beliefs, *, as_json: bool = False) -> str:
    """The text of a beliefs file: TSV with a header, or one JSON object a line."""
    rows = zip(
        beliefs.frames,
        beliefs.times.tolist(),
        beliefs.truth,
        beliefs.words,
        beliefs.selected.tolist(),
        beliefs.best,
        beliefs.belief.tolist(),
        strict=True,
    )
    lines = [] if as_json else [format_header(beliefs.places)]
    lines += [_line(beliefs.places, *row, as_json=as_json) for row in rows]
    return "".join(f"{line}\n" for line in lines)


def decode_lines(recognizer: Recognizer, lines: Iterable[str], *, as_json: bool = False) -> Iterator[str]:
    """`placerec decode -`: an answer for each line `word` or `word TAB seconds`, as soon as it is read.

    The TSV header comes before the first line is read. A word that the models do not list holds the belief; the first
    one and the number of them are logged. Raises StreamError for seconds that are no number.
    """
    if not as_json:
        yield format_header(recognizer.places)
    strange = 0
    belief = recognizer.belief()
    for frame, line in enumerate(lines):
        word, _, seconds = line.rstrip("\r\n").partition("\t")
        word = word.strip()
        time = _seconds(seconds, frame)
        if word in recognizer:
            belief = recognizer.update(word, time)
            selected = belief.selected
        else:
            if not strange:
                log.warning("line %d: the word %r is not in the models' vocabulary; skipped", frame + 1, word)
            strange += 1
            selected = False
        probability = belief.probability.tolist()
        yield _line(recognizer.places, str(frame), time, "", word, selected, belief.best, probability, as_json=as_json)
    if strange:
        log.warning("%d lines skipped whose words the models do not list", strange)
    if recognizer.unexplained:
        log.warning("%d words that no place explains left the prediction as it was", recognizer.unexplained)


def _seconds(text: str, frame: int) -> float:
    try:
        return float(text) if text.strip() else math.nan
    except ValueError:
        raise StreamError(at("<stdin>", frame + 1, f"time {text!r} is not a number of seconds")) from None


def _line(
    places: Sequence[str],
    frame: str,
    time: float,
    truth: str,
    word: str,
    selected: bool,
    best: str,
    belief: Sequence[float],
    *,
    as_json: bool,
) -> str:
    if not as_json:
        return format_row(frame, time, truth, word, selected, best, belief)
    return json.dumps(
        {
            "frame": frame,
            "time": None if math.isnan(time) else time,
            "place": truth or None,
            "word": word,
            "selected": selected,
            "best": best,
            "belief": dict(zip(places, belief, strict=True)),
        },
        ensure_ascii=False,
    )
