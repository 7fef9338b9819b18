"""The models to read by hand: the README's commands make them again, and all that it computes is so."""

import ast
import json
import math
import operator
import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest
from helpers.opencv import same_jpegs

from placerec.lm import SMOOTHINGS

ROOT = Path(__file__).resolve().parent.parent
MODELS = ROOT / "arpa_models"
README = (MODELS / "README.md").read_text(encoding="utf-8")
BLOCKS = [re.sub(r"^    ", "", block, flags=re.M) for block in re.findall(r"(?m)(?:^    .*\n|^\n(?=    ))+", README)]
FOLDERS = sorted(path.name for path in MODELS.iterdir() if path.is_dir())
PLACES = json.loads((MODELS / "witten-bell/model.json").read_text())["places"]
# Of one there is no folder: its weights are found step by step, and not by hand.
REFUSED = sorted(set(SMOOTHINGS) - set(FOLDERS) - {"jelinek-mercer"})
Entry = tuple[float, float]


def block(beginning: str) -> str:
    """The one block of code of the README that begins like this."""
    (found,) = [text.strip("\n") + "\n" for text in BLOCKS if text.lstrip("\n").startswith(beginning)]
    return found


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def shell(script: str, folder: Path) -> str:
    """What a script prints on both streams, in which `placerec` is that of this checkout."""
    define = f'set -e\nplacerec() {{ "{sys.executable}" -m placerec "$@"; }}\n'
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        ["sh", "-c", define + script],
        cwd=folder,
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    return done.stdout


# --- the folders ---


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the README's commands were run."""
    folder = tmp_path_factory.mktemp("made")
    said = shell(block("placerec lab"), folder)
    assert (folder / FOLDERS[-1]).is_dir(), said
    return folder


@same_jpegs
@pytest.mark.parametrize("name", FOLDERS)
def test_the_commands_of_the_readme_make_the_same_bytes(made: Path, name: str) -> None:
    kept = files(MODELS / name)
    assert len(kept) == 3 * len(PLACES) + 3
    assert files(made / name) == kept


def test_the_other_smoothings_fail_as_the_readme_says(made: Path) -> None:
    assert sorted(name + end for name in ("kneser-ney", "modified-kneser-ney") for end in ("", "-backoff")) == REFUSED
    said = [
        shell(f"placerec train-lm tokens/*.tsv -o {name} --order 2 --select unique --smoothing {name}", made)
        for name in REFUSED
    ]
    assert said[:2] == [block("placerec: place KT-B: Kneser-Ney fails")] * 2
    assert all("Kneser-Ney fails at order" in line for line in said)


def test_they_are_small_enough_to_read_and_differ_where_the_readme_says() -> None:
    assert len(FOLDERS) == 6
    same = [{name: text for name, text in files(MODELS / f).items() if "arpa" not in name} for f in FOLDERS]
    assert [texts.pop("model.json") for texts in same]
    assert same == [same[0]] * 6
    assert len(same[0]) == 2 * len(PLACES) + 2
    assert sum(map(len, files(MODELS).values())) < 200_000


# --- what the README computes ---


def read_entries(name: str) -> dict[tuple[str, ...], Entry]:
    """log10 p and log10 of the backoff weight of every line of the kitchen's model, read as the README says."""
    entries = {}
    for line in (MODELS / name / "KT-B.arpa").read_text().splitlines():
        fields = line.split("\t")
        if len(fields) > 1:
            entries[tuple(fields[1].split(" "))] = (float(fields[0]), float(fields[2]) if len(fields) > 2 else 0.0)
    return entries


ENTRIES = {name: read_entries(name) for name in FOLDERS}
NAMED = re.compile(r"p\((\w+)(?: \| (\w+))?\)|b\((\w+)\)")


def log10(named: re.Match[str], entries: dict[tuple[str, ...], Entry]) -> float:
    """log10 of p(w), p(w | h) or b(h), of what stands in the model's file."""
    word, history, context = named.groups()
    if context or not history:
        return entries[(context or word,)][1 if context else 0]
    return entries[history, word][0] if (history, word) in entries else entries[(history,)][1] + entries[(word,)][0]


OPERATIONS: dict[type, Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}


def value(text: str, entries: dict[tuple[str, ...], Entry]) -> float:
    """The value of an expression with p(w | h) and b(h), as the model's file has these."""
    numbers = NAMED.sub(lambda named: repr(10 ** log10(named, entries)), text).replace(" x ", " * ")

    def walk(node: ast.expr) -> float:
        if isinstance(node, ast.BinOp):
            return OPERATIONS[type(node.op)](walk(node.left), walk(node.right))
        assert isinstance(node, ast.Constant), text
        return float(node.value)  # type: ignore[arg-type]

    return walk(ast.parse(numbers, mode="eval").body)


# The folder that a computation is about is that of its heading.
SECTIONS = re.split(r"^## ", README, flags=re.M)
SUMS = [
    (re.findall(r"`([\w-]+)`", section.split("\n")[0])[0], line.strip())
    for section in SECTIONS[1:]
    for line in section.splitlines()
    if line.startswith("    ") and " = " in line and section.startswith("`")
]


def test_there_is_something_to_compute() -> None:
    assert len(SUMS) == 35
    assert {name for name, line in SUMS} == set(FOLDERS) - {"absolute-backoff"}


@pytest.mark.parametrize(("name", "line"), SUMS)
def test_the_computations_are_right_and_are_the_files(name: str, line: str) -> None:
    equal, _, logarithm = line.partition(", log10 = ")
    said = equal.split(" = ")
    values = [value(text, ENTRIES[name]) for text in said]
    assert len(values) >= 2
    # Numbers on the way have six digits; the last number is right to its last digit.
    assert values == pytest.approx([values[0]] * len(values), abs=1e-6)
    assert said[-1] == f"{values[0]:.{len(said[-1].partition('.')[2])}f}"
    if logarithm:
        named = NAMED.fullmatch(said[0])
        assert named is not None
        assert logarithm == f"{log10(named, ENTRIES[name]):.7g}"


@pytest.mark.parametrize("name", FOLDERS)
def test_the_table_is_that_of_the_files(name: str) -> None:
    row = re.search(rf"^\| `{name}` \| (\S+) \| (\S+) \| (\S+) \| (.*) \|$", README, re.M)
    assert row is not None
    names = ("p(w8 | w7)", "p(w2 | w7)", "b(w7)")
    assert list(row.groups()[:3]) == [f"{value(text, ENTRIES[name]):.6f}" for text in names]
    command = json.loads((MODELS / name / "model.json").read_text())["ngram_count"]["KT-B"]
    assert row[4] == ("(has none)" if command is None else f"`{re.search('-gt2min 1 (.*) -lm', command)[1]}`")  # type: ignore[index]


def test_numbers_in_the_text_are_right() -> None:
    added, total = re.search(r"that is one addition: (.*) = (\S+)\. ", README).groups()  # type: ignore[union-attr]
    assert sum(map(float, added.split(" + "))) == pytest.approx(float(total), abs=1e-9)
    assert float(total) == pytest.approx(math.log10(value("p(w2 | w7)", ENTRIES["witten-bell"])), abs=1e-7)
    assert "p(w8 | w7) is just (1 - 0.5) / 3 = 0.166667" in README
    assert value("p(w8 | w7)", ENTRIES["absolute-backoff"]) == pytest.approx(0.5 / 3, rel=1e-6)
    backoff = ENTRIES["witten-bell-backoff"]
    assert value("p(w2) / p(w1)", backoff) == pytest.approx(2, rel=1e-6)
    assert "*twice as probable*" in README


def test_the_readme_shows_the_files() -> None:
    assert block("# placerec") == (MODELS / "witten-bell/KT-B.arpa").read_text()
    assert block("w7\n") == (MODELS / "witten-bell/sentences/KT-B.txt").read_text()


def test_the_table_of_counts_is_that_of_the_sentences() -> None:
    after: dict[str, Counter[str]] = {"": Counter()}
    for line in (MODELS / "witten-bell/sentences/KT-B.txt").read_text().splitlines():
        after[""].update(line.split())
        for context, word in pairwise(line.split()):
            after.setdefault(context, Counter())[word] += 1
    rows = re.findall(r"^\| (?:\(none\)|`(\w+)`) \| (\d+) \| (\d+) \| (.*) \|$", README, re.M)
    assert {context: (int(N), int(T)) for context, N, T, _ in rows} == {
        context: (words.total(), len(words)) for context, words in after.items()
    }
    for context, _, _, followed in rows:
        assert dict(re.findall(r"`(\w+)` (\d+)", followed)) == {w: str(c) for w, c in after[context].items()}


# --- with SRILM's commands ---


def test_ngram_count_and_ngram_print_what_the_readme_shows(tmp_path: Path) -> None:
    commands = block("../../bin/ngram-count").replace("../../bin/", f"{ROOT}/bin/").replace("KT-B.lm", "$TMP/KT-B.lm")
    folder = MODELS / "witten-bell"
    assert shell(f"TMP={tmp_path}\n{commands}", folder) == block("0a1")
    probabilities = shell(block("echo w7").replace("../../bin/", f"{ROOT}/bin/"), folder)
    assert block("\tp(") in probabilities


@pytest.mark.parametrize("name", [name for name in FOLDERS if name != "lidstone"])
def test_the_commands_of_model_json_make_the_same_numbers(name: str, tmp_path: Path) -> None:
    folder = MODELS / name
    command = json.loads((folder / "model.json").read_text())["ngram_count"]["KT-B"]
    command = command.replace("-lm KT-B.arpa", f"-lm {tmp_path}/KT-B.lm")
    assert shell(f"{ROOT}/bin/{command}", folder) == ""
    added = ("#", "ngram 1=", "-99\t</s>", "-99\t<unk>")
    ours, srilm = (
        [line for line in path.read_text().splitlines() if not line.startswith(added)]
        for path in (folder / "KT-B.arpa", tmp_path / "KT-B.lm")
    )
    assert ours == srilm
