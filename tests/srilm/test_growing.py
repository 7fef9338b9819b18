"""The recipes of docs/srilm.md for models that change, run as they stand there."""

import os
import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_a_model_grows_from_counts_as_if_made_of_all_text(tmp_path: Path) -> None:
    section = (ROOT / "docs/srilm.md").read_text().partition("## A model that grows\n")[2].partition("\n## ")[0]
    recipe = "\n".join(line.strip() for line in re.findall(r"^    .*$", section, re.MULTILINE))
    assert recipe.count("\n") >= 4
    old, new = ["a b c", "b b a"] * 3, ["c c a b", "d a b"] * 2
    (tmp_path / "old.txt").write_text("".join(f"{line}\n" for line in old))
    (tmp_path / "new.txt").write_text("".join(f"{line}\n" for line in new))
    run = {"cwd": tmp_path, "check": True, "env": {**os.environ, "PATH": f"{ROOT / 'bin'}:{os.environ['PATH']}"}}
    subprocess.run(["sh", "-ec", recipe], **run)  # type: ignore[call-overload]
    (tmp_path / "both.txt").write_text("".join(f"{line}\n" for line in [*old, *new]))
    whole = "ngram-count -text both.txt -order 3 -wbdiscount -interpolate -lm both.lm"
    subprocess.run(["sh", "-ec", whole], **run)  # type: ignore[call-overload]
    assert (tmp_path / "grown.lm").read_bytes() == (tmp_path / "both.lm").read_bytes()
