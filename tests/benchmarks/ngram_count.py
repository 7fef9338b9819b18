"""How long bin/ngram-count takes from a text to an ARPA file, in units of what KenLM takes to load that file.

Also the most memory that it uses, for the text and for the same text eight times over.

    python tests/benchmarks/ngram_count.py [TOKENS]

The text is made from a seed: 400 visual words, each likely to repeat, in sentences of 500. With the environment
variable REFERENCE, the path of another ngram-count, its time on the same text is measured too, turn by turn.
"""

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import kenlm
import numpy as np

TOOL = Path(__file__).parents[2] / "bin" / "ngram-count"
OPTIONS = ["-order", "4", "-wbdiscount", "-interpolate", "-gt3min", "1", "-gt4min", "1"]
TURNS = 5
# Runs a command and prints its peak of memory, in bytes on macOS and in kB elsewhere.
CHILD = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stderr=subprocess.DEVNULL)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3))
"""
WORDS, SENTENCE, REPEAT = 400, 500, 0.7


def make_text(path: Path, tokens: int) -> None:
    """A word stays with probability REPEAT, and is otherwise drawn anew; frequent words are more frequent."""
    rng = np.random.default_rng(0)
    drawn = np.minimum(rng.geometric(0.01, tokens) - 1, WORDS - 1)
    moves = rng.random(tokens) >= REPEAT
    moves[0] = True
    words = drawn[np.flatnonzero(moves)[np.cumsum(moves) - 1]]
    names = np.array([f"w{number:03d}" for number in range(WORDS)])
    lines = (" ".join(names[words[start : start + SENTENCE]]) for start in range(0, tokens, SENTENCE))
    path.write_text("".join(f"{line}\n" for line in lines), encoding="ascii")


def seconds(work: Callable[[], object]) -> float:
    """Wall time."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def count(tool: str | Path, text: Path, model: Path) -> None:
    """One run of an ngram-count."""
    command = [str(tool), "-text", str(text), *OPTIONS, "-lm", str(model)]
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)


def peak(tool: str | Path, text: Path, model: Path) -> float:
    """The most memory that one run of an ngram-count uses, in MB."""
    # In a process of its own, since a new process's peak begins with its parent's size.
    command = [sys.executable, "-c", CHILD, str(tool), "-text", str(text), *OPTIONS, "-lm", str(model)]
    return float(subprocess.run(command, check=True, capture_output=True).stdout)


def main(tokens: int) -> None:
    """Print the median times and their ratios, and the memory."""
    config = kenlm.Config()
    config.show_progress, config.arpa_complain = False, kenlm.ARPALoadComplain.NONE
    reference = os.environ.get("REFERENCE")
    ours, loads, theirs = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        text, model, other = Path(folder) / "text", Path(folder) / "ours.arpa", Path(folder) / "theirs.arpa"
        make_text(text, tokens)
        for _ in range(TURNS):
            ours.append(seconds(lambda: count(TOOL, text, model)))
            loads.append(seconds(lambda: kenlm.Model(str(model), config)))
            if reference:
                theirs.append(seconds(lambda: count(reference, text, other)))
                if other.read_bytes() != model.read_bytes():
                    print("the files differ")
        peaks = [peak(TOOL, text, model)]
        text.write_bytes(text.read_bytes() * 8)
        peaks.append(peak(TOOL, text, model))
    print(f"{tokens} tokens: ngram-count {statistics.median(ours):.3f} s, KenLM loads {statistics.median(loads):.3f} s")
    print(f"ngram-count / KenLM: {statistics.median(a / b for a, b in zip(ours, loads, strict=True)):.2f}")
    print(f"most memory: {peaks[0]:.0f} MB; for the text eight times over: {peaks[1]:.0f} MB")
    if reference:
        print(f"ngram-count / reference: {statistics.median(a / b for a, b in zip(ours, theirs, strict=True)):.2f}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000)
