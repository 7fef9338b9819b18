"""How much CPU time and memory the tools in bin/ take on large texts, counts and models, beside others in one run.

    python tests/benchmarks/ngram_tools.py [CASE...] [--turns 3]

Cases: `train-1m` and `train-5m` (models of order 3 of visual words), `train-zipf` (of 2 million words of Zipf's
frequencies), `merge` (100 MB of counts), `prune` and `mix` (models of 5 million n-grams), `start`. Others are

- KenLM's Python module, which loads the model that was read or written last, and `sort -m`, which merges the lines of
  counts files but adds nothing up;
- with the environment variable LMPLZ, KenLM's program of that name on the same text, to the same order;
- with REFERENCE, the folder of another ngram-count, ngram and ngram-merge, such as SRILM's: the same runs, with what a
  start takes taken off both; whether the files are equal is said.

CPU time is user and system time. Ratios are medians over turns, of ours to the other's.
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from ngram_count import make_text

BIN = Path(__file__).parents[2] / "bin"
TRAIN = ["-wbdiscount", "-interpolate", "-gt3min", "1", "-gt4min", "1"]
WORDS, SENTENCE = 10_000, 25
# Runs a command, and prints the CPU seconds of that and the peak of memory in MB.
CHILD = """
import os, resource, subprocess, sys
os.environ["LC_ALL"], nowhere = "C", subprocess.DEVNULL
subprocess.run(sys.argv[1:], check=True, stdout=nowhere, stderr=nowhere)
use = resource.getrusage(resource.RUSAGE_CHILDREN)
print(use.ru_utime + use.ru_stime, use.ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3))
"""
# Loads models, and prints the CPU seconds of that and the peak of memory in MB.
LOAD = """
import kenlm, resource, sys, time
config = kenlm.Config()
config.show_progress, config.arpa_complain = False, kenlm.ARPALoadComplain.NONE
start = time.process_time()
models = [kenlm.Model(name, config) for name in sys.argv[1:]]
print(time.process_time() - start)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3))
"""
ROW = "{:<12}{:<14}" + "{:>9}" * 6


@dataclass(frozen=True)
class Use:
    """CPU seconds and MB at most of one run."""

    seconds: float
    peak: float


@dataclass(frozen=True)
class Case:
    """A run of `tool`, whose output `out` a reference's is compared with, and what others do meanwhile, by name."""

    tool: str
    arguments: Sequence[str]
    out: Path | None
    others: Mapping[str, Callable[[], Use]]


def main() -> None:
    """Print a row for each case and each other."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", nargs="*", metavar="CASE")
    parser.add_argument("--turns", type=int, default=3)
    given = parser.parse_args()
    say(ROW.format("case", "beside", "ours s", "MB", "theirs s", "MB", "time", "memory"))
    with tempfile.TemporaryDirectory() as folder:
        for name, make in CASES.items():
            if name in (given.cases or CASES):
                for row in compared(make(Path(folder)), given.turns):
                    say(f"{name:<12}{row}")


def say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def compared(case: Case, turns: int) -> Iterator[str]:
    """The rows of a case, without its name: ours beside each other one, turn by turn."""
    reference = os.environ.get("REFERENCE")
    command = [str(BIN / case.tool), *case.arguments]
    others = dict(case.others)
    off = dict.fromkeys((*others, "reference"), (0.0, 0.0))
    if reference:
        their = f"{reference}/{case.tool}"
        others["reference"] = partial(run, [their, *case.arguments])
        if case.out:
            off["reference"] = started(str(BIN / case.tool)), started(their)
    uses: dict[str, list[tuple[Use, Use]]] = {name: [] for name in others}
    for _ in range(turns):
        ours = run(command)
        written = case.out.read_bytes() if case.out else b""
        for name, other in others.items():
            theirs = other()
            if name == "reference" and case.out and case.out.read_bytes() != written:
                say("the files differ:")
            mine, its = off[name]
            uses[name].append((Use(ours.seconds - mine, ours.peak), Use(theirs.seconds - its, theirs.peak)))
    for name, pairs in uses.items():
        ours, our_peak, theirs, their_peak, time, memory = (
            statistics.median(value) for value in zip(*map(_figures, pairs), strict=True)
        )
        figures = f"{ours:.3f}", f"{our_peak:.0f}", f"{theirs:.3f}", f"{their_peak:.0f}", f"{time:.2f}", f"{memory:.2f}"
        yield ROW.format("", name, *figures)[12:]


def _figures(pair: tuple[Use, Use]) -> tuple[float, ...]:
    ours, theirs = pair
    return ours.seconds, ours.peak, theirs.seconds, theirs.peak, ours.seconds / theirs.seconds, ours.peak / theirs.peak


def started(tool: str) -> float:
    """CPU seconds of a start, the median of several."""
    return statistics.median(run([tool, "-version"]).seconds for _ in range(9))


def run(command: Sequence[str]) -> Use:
    """One run of a program, without its output."""
    # In a process of its own, since a new process's peak begins with its parent's size.
    child = subprocess.run([sys.executable, "-S", "-c", CHILD, *command], check=True, capture_output=True, text=True)
    return Use(*map(float, child.stdout.split()))


def load(*models: Path) -> Use:
    """KenLM's Python module loads models: the seconds of that alone, and the memory of a Python that does it."""
    child = subprocess.run([sys.executable, "-c", LOAD, *models], check=True, capture_output=True, text=True)
    seconds, peak = map(float, child.stdout.split())
    return Use(seconds, peak)


def zipf(path: Path, tokens: int, seed: int) -> Path:
    """A text of words with Zipf's frequencies."""
    weight = 1 / np.arange(1, WORDS + 1)
    drawn = np.random.default_rng(seed).choice(WORDS, tokens, p=weight / weight.sum())
    words = np.array([f"v{number}" for number in range(WORDS)])[drawn]
    lines = (" ".join(words[start : start + SENTENCE]) for start in range(0, tokens, SENTENCE))
    path.write_text("".join(f"{line}\n" for line in lines), encoding="ascii")
    return path


def train(text: Path, order: int) -> tuple[list[str], Path]:
    """The arguments of ngram-count for a model of a text, and the model."""
    model = text.with_suffix(".arpa")
    return ["-text", str(text), "-order", str(order), *TRAIN, "-lm", str(model)], model


def trained(text: Path, order: int) -> Path:
    arguments, model = train(text, order)
    subprocess.run([BIN / "ngram-count", *arguments], check=True)
    return model


def visual_words(tokens: int, folder: Path) -> Case:
    text = folder / f"visual{tokens}.txt"
    make_text(text, tokens)
    arguments, model = train(text, 3)
    return Case("ngram-count", arguments, model, {"KenLM loads": partial(load, model)})


def zipf_words(folder: Path) -> Case:
    text = zipf(folder / "zipf.txt", 2_000_000, 0)
    arguments, model = train(text, 3)
    others = {"KenLM loads": partial(load, model)}
    if lmplz := os.environ.get("LMPLZ"):
        options = ["-o", "3", "-S", "1G", "-T", str(folder), "--discount_fallback"]
        others["lmplz"] = partial(run, [lmplz, *options, "--text", str(text), "--arpa", str(folder / "lmplz.arpa")])
    return Case("ngram-count", arguments, model, others)


def merge(folder: Path) -> Case:
    names = []
    for seed in (1, 2):
        text, counts = zipf(folder / "half.txt", 2_600_000, seed), folder / f"{seed}.counts"
        subprocess.run([BIN / "ngram-count", "-text", text, "-order", "3", "-sort", "-write", counts], check=True)
        names.append(str(counts))
    out = folder / "sum.counts"
    others = {"sort -m": partial(run, ["sort", "-m", "-o", str(folder / "sorted.counts"), *names])}
    return Case("ngram-merge", ["-write", str(out), *names], out, others)


def prune(folder: Path) -> Case:
    model, out = trained(zipf(folder / "prune.txt", 2_300_000, 3), 4), folder / "pruned.arpa"
    arguments = ["-order", "4", "-lm", str(model), "-prune", "1e-7", "-write-lm", str(out)]
    return Case("ngram", arguments, out, {"KenLM loads": partial(load, model)})


def mix(folder: Path) -> Case:
    one, other = (trained(zipf(folder / f"mix{seed}.txt", 1_150_000, seed), 4) for seed in (4, 5))
    out = folder / "mixed.arpa"
    arguments = ["-order", "4", "-lm", str(one), "-mix-lm", str(other), "-lambda", "0.4", "-write-lm", str(out)]
    return Case("ngram", arguments, out, {"KenLM loads": partial(load, one, other)})


def start(folder: Path) -> Case:
    return Case("ngram", ["-version"], None, {"import numpy": partial(run, [sys.executable, "-c", "import numpy"])})


CASES: dict[str, Callable[[Path], Case]] = {
    "train-1m": partial(visual_words, 1_000_000),
    "train-5m": partial(visual_words, 5_000_000),
    "train-zipf": zipf_words,
    "merge": merge,
    "prune": prune,
    "mix": mix,
    "start": start,
}

if __name__ == "__main__":
    main()
