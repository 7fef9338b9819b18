"""How long bin/ngram -ppl takes on a text, in units of what bin/ngram-count took to train the model on it.

    python tests/benchmarks/ngram_ppl.py [TOKENS]

The text is that of ngram_count.py beside this program. What both tools need before they begin is shown too: ratios
cannot be smaller than it allows.
"""

import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from ngram_count import OPTIONS, TOOL, count, make_text, seconds

TURNS = 9


def run(*arguments: str | Path) -> None:
    """One run of ngram."""
    subprocess.run([TOOL.with_name("ngram"), *arguments], check=True, capture_output=True)


def main(tokens: int) -> None:
    """Print the median times and their ratio, turn by turn."""
    trained, scored, started = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        text, model = Path(folder) / "text", Path(folder) / "model.arpa"
        make_text(text, tokens)
        for _ in range(TURNS):
            trained.append(seconds(lambda: count(TOOL, text, model)))
            scored.append(seconds(lambda: run(*OPTIONS[:2], "-lm", model, "-ppl", text)))
            started.append(seconds(lambda: run("-version")))
    ratio = statistics.median(a / b for a, b in zip(scored, trained, strict=True))
    print(f"{tokens} tokens: ngram -ppl {statistics.median(scored):.3f} s, training {statistics.median(trained):.3f} s")
    print(f"ngram -ppl / training: {ratio:.2f}; a start alone: {statistics.median(started):.3f} s")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000)
