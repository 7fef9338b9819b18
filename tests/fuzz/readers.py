"""Feeds damaged files to the readers, and shows what they should not have done, with the smallest file that shows it.

    python tests/fuzz/readers.py [NAME] [--seconds 600] [--seed 0]

`text`, `counts` and `arpa` are read as bin/ngram-count and bin/ngram read them, `arpa-strict` as `placerec inspect`
does, the files of tools.py as SRILM's other tools do. A finding is an exception that is not one of placerec's own, a
warning, a run that takes too long, or a result that contradicts itself: what was written is read back as something
else, two ways to the same result differ, or a strictly read model holds what is no log probability. Exit status 1 if
there is any.
"""

import argparse
import logging
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from random import Random
from unittest.mock import patch

import mutations
import numpy as np
import tools
from harness import FindingError, Reader, fixed_model, run, same

from placerec.errors import PlacerecError
from placerec.lm import estimation
from placerec.lm.arpa import format_arpa, read_arpa, write_arpa
from placerec.lm.inspect import inspect_model
from placerec.srilm.model import arpa_reader
from placerec.srilm.text import sentences
from placerec.srilm.tools.ngram import ngram
from placerec.srilm.tools.ngram_count import ngram_count

LONGEST_RUN = 20.0
_SMALL = 5000


def check_text(path: Path, rng: Random) -> None:
    """One of: counts, which a comment behind does not change; totals, at every debug level; weights and the like."""
    rng.choice((check_counting, check_scoring, check_weights))(path, rng)


def check_counting(path: Path, rng: Random) -> None:
    """Counts are read back as they were written, and a comment at the end does not change them."""
    options = [rng.choice(("-tolower", "-no-sos", "-unk", "-no-eos")), "-order", str(rng.randrange(1, 5))]
    command = ["-text", str(path), *options, "-sort", "-write", "-"]
    status, out, _ = run(ngram_count, *command)
    check_counts_again(out, status)
    data = path.read_bytes()
    if path.suffix != ".gz" and b"\0" not in data and data[:2] not in (b"\xff\xfe", b"\xfe\xff"):
        path.write_bytes(data + b"\n## a comment\n")
        same("a comment changes the counts", out, run(ngram_count, *command)[1])


def check_scoring(path: Path, rng: Random) -> None:
    """Totals are the same at every debug level: of many lines at once, line by line, and from the whole model."""
    option = rng.choice(("-tolower", "-no-sos", "-reverse", "-unk"))
    command = ["-lm", fixed_model(path), option, "-ppl", str(path), "-debug"]
    # At level 3 every word of the model is scored in the place of each word, of which a packed file may hold many.
    small = path.suffix != ".gz" and path.stat().st_size < _SMALL
    levels = ("0", "1", "3") if small else ("0", "1")
    (status, first, _), *others = (run(ngram, *command, debug) for debug in levels)
    for debug, (other, out, _) in zip(levels[1:], others, strict=True):
        # How far a damaged file is read is another matter.
        if status == other == 0:
            same(f"debug level {debug} changes the totals", first, out[out.rindex(b"file ") :])


def check_weights(path: Path, rng: Random) -> None:
    """Whatever else is done with texts."""
    run(ngram_count, "-text", path, "-text-has-weights", *rng.choice(([], ["-float-counts"])), "-write", "-")
    extra = rng.choice((["-text-has-weights"], ["-escape", "#"], ["-cache", "5"], ["-noise", "a"]))
    run(ngram, "-lm", fixed_model(path), "-ppl", path, *extra)


def check_counts_again(out: bytes, status: int) -> None:
    """Sorted counts that were written are read back as they are.

    But for what looks like a comment, and sums beyond 2^63 - 1, which wrap as SRILM's do beyond 2^64 - 1.
    """
    if status == 0 and not out.startswith(b"##") and b"\n##" not in out and b"\t-" not in out:
        again = run(ngram_count, "-read", "-", "-order", "9", "-sort", "-write", "-", stdin=out)[1]
        same("counts read back", out, again)


def check_counts(path: Path, rng: Random) -> None:
    """One of: counts are written and read back; models; scoring."""
    order = str(rng.randrange(1, 5))
    method = rng.choice((["-wbdiscount", "-interpolate"], ["-addsmooth", "1"], ["-cdiscount", "0.5"], []))
    extra = rng.choice((["-float-counts"], ["-recompute"], ["-intersect", str(path)], ["-read-with-mincounts"]))
    match rng.randrange(3):
        case 0:
            status, out, _ = run(ngram_count, "-read", path, "-order", order, "-sort", "-write", "-")
            check_counts_again(out, status)
        case 1:
            run(ngram_count, "-read", path, "-order", order, *extra, *method, "-lm", path.with_name("model.arpa"))
        case 2:
            option = rng.choice((["-float-counts"], ["-counts-entropy"], ["-debug", "3"]))
            run(ngram, "-lm", fixed_model(path), "-counts", path, *option)


def check_arpa(path: Path, rng: Random) -> None:
    """One of: a model is written and read back; a text is scored the same in both ways of reading; changes."""
    options = ["-order", str(rng.randrange(1, 5)), *rng.choice(([], ["-unk"], ["-tolower"]))]
    match rng.randrange(3):
        case 0:
            written = [path.with_name(f"again{k}.arpa") for k in range(2)]
            if run(ngram, "-lm", path, *options, "-write-lm", written[0])[0] == 0:
                _, _, said = run(ngram, "-lm", written[0], *options, "-write-lm", written[1])
                # A context that no line lists was one as the ending of another; in what is written it is none.
                if b"no bow for prefix" not in said:
                    same("models written again", *(file.read_bytes() for file in written))
        case 1:
            command = ["-lm", str(path), *options, "-ppl", "-", "-debug"]
            stdin = b"a b c\n\xc3\xa9 wwwwwwww wwwwwwwww a a\n b# zzz </s>\n"
            runs = [run(ngram, *command, debug, stdin=stdin) for debug in ("0", "3")]
            same("reading the whole model changes the status", runs[0][0], runs[1][0])
            totals = [out.rpartition(b"file ")[2] for _, out, _ in runs]
            same("reading the whole model changes the totals", *totals)
        case 2:
            change = rng.choice((["-renorm"], ["-prune", "1e-3"], ["-prune-lowprobs"]))
            run(ngram, "-lm", path, *options, *change, "-write-lm", "-")


def check_strict(path: Path, rng: Random) -> None:
    """A model that is accepted holds log probabilities and weights, and is written and read back as itself."""
    try:
        model = read_arpa(path)
    except PlacerecError:
        return
    for n, (log10_p, backoff) in enumerate(zip(model.log10_probs, model.backoffs, strict=True), start=1):
        if not (log10_p <= 0).all():
            raise FindingError(f"no log10 probability in order {n}: {log10_p[~(log10_p <= 0)]}")
        if np.isposinf(backoff).any():
            raise FindingError(f"no weight in order {n}: {backoff}")
    listed = model.trie.texts(model.order)[-1:]
    inspect_model(path, [*listed, *(" ".join(reversed(ngram.split(" "))) for ngram in listed)])
    again = path.with_name("again.arpa")
    write_arpa(model, again)
    same("models written again", format_arpa(model), format_arpa(read_arpa(again)))


READERS = {
    "text": Reader(mutations.text, check_text),
    "counts": Reader(mutations.counts, check_counts),
    "arpa": Reader(mutations.arpa, check_arpa),
    "arpa-strict": Reader(mutations.arpa, check_strict),
    "map": Reader(tools.word_map, tools.check_map),
    "classes": Reader(tools.classes, tools.check_classes),
    "count-model": Reader(tools.count_model, tools.check_count_model),
    "events": Reader(tools.events, tools.check_events),
    "classed": Reader(mutations.text, tools.check_classed),
    "scored": Reader(tools.scored, tools.check_scored),
    "scripts": Reader(tools.any_of_scripts, tools.check_scripts),
}


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raises TimeoutError in what takes longer."""

    def stop(*_: object) -> None:
        raise TimeoutError(f"more than {seconds:g} s")

    # The processor's time: how much else the machine has to do is no fault of the reader.
    former = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, former)


def fault(reader: Reader, data: bytes, name: str, seed: str) -> str:
    """What goes wrong with an input, and where; an empty text if nothing does."""
    rng = Random(seed)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(), scaled(rng.random() < 0.5):
        warnings.simplefilter("error")
        path = Path(folder) / name
        path.write_bytes(data)
        try:
            with limited(LONGEST_RUN), np.errstate(all="warn"):
                reader.check(path, rng)
        except PlacerecError:
            return ""
        except FindingError as error:
            return str(error).partition(":")[0]
        except Exception as error:
            frame = traceback.extract_tb(error.__traceback__)[-1]
            ours = [f for f in traceback.extract_tb(error.__traceback__) if "placerec" in f.filename]
            at = ours[-1] if ours else frame
            return f"{type(error).__name__} in {Path(at.filename).name}, {at.name}: {error!s:.200}"
    return ""


@contextmanager
def scaled(small: bool) -> Iterator[None]:
    """With `small`, files are taken in blocks of a few lines, so that there are several. Estimation gives up soon."""
    with ExitStack() as stack:
        if small:
            stack.enter_context(patch.multiple(arpa_reader, _BLOCK=40))
            stack.enter_context(patch.multiple(sentences, _BLOCK=40))
        stack.enter_context(patch.multiple(estimation, _MOST_STEPS=1e4))
        yield


def smallest(data: bytes, still: Callable[[bytes], bool], seconds: float = 30) -> bytes:
    """`data` without whatever can be left out, first large pieces, then small ones, as long as `still` holds."""
    size, end = len(data) // 2, time.process_time() + seconds
    while size and time.process_time() < end:
        start = 0
        while start < len(data) and time.process_time() < end:
            shorter = data[:start] + data[start + size :]
            if still(shorter):
                data = shorter
            else:
                start += size
        size //= 2
    return data


def fuzz(kind: str, seed: int, *, seconds: float = np.inf, cases: int | None = None) -> dict[str, str]:
    """Try inputs until the time is over or so many are done: a report for each kind of fault."""
    reader, found = READERS[kind], dict[str, str]()
    end, number = time.monotonic() + seconds, 0
    while time.monotonic() < end and number != cases:
        case = f"{kind}/{seed}/{number}"
        rng = Random(case)
        data = mutations.mutated(reader.valid(rng), rng)
        zipped = rng.random() < 0.1
        name, content = ("input.gz", mutations.packed(data, rng)) if zipped else ("input", data)
        message = fault(reader, content, name, case)
        if message and message not in found:
            small = smallest(content, lambda shorter: fault(reader, shorter, name, case) == message)  # noqa: B023
            found[message] = f"{case}: {message}\n  {name} of {len(small)} bytes: {small!r:.2000}"
        number += 1
    found[""] = f"{kind}: {number} inputs, {len(found)} findings"
    return found


def main() -> int:
    """Fuzz one reader, or all in turn."""
    parser = argparse.ArgumentParser(description="Feeds damaged files to the readers.")
    parser.add_argument("reader", nargs="?", choices=READERS)
    parser.add_argument("--seconds", type=float, default=600)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    logging.disable()
    failed = False
    for kind in [options.reader] if options.reader else READERS:
        found = fuzz(kind, options.seed, seconds=options.seconds)
        print("\n".join(found.values()), flush=True)
        failed |= len(found) > 1
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
