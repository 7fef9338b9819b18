"""What the pages show is what their commands print today, and what the commands wrote is by the grammars."""

import re
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import pytest
from helpers.ebnf import read_grammars
from helpers.opencv import same_jpegs

from placerec.experiments.grid.results import COLUMNS
from placerec.lm import SMOOTHINGS

DOCS = Path(__file__).resolve().parents[2] / "docs"
RUN = ("tutorial", "extend", "troubleshooting")
CONSOLE = re.compile(r"^```console\n(.*?)^```$", re.MULTILINE | re.DOTALL)


class Ran(NamedTuple):
    """A page as it stands, as it would be written today, and the folder where its commands ran."""

    page: str
    today: str
    folder: Path


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Ran]:
    """All pages' commands, run side by side."""
    if shutil.which("sh") is None:
        pytest.skip("the pages' commands are a Unix shell's, which is not here")

    def run(name: str) -> Ran:
        folder = tmp_path_factory.mktemp(name)
        copy = folder / f"{name}.md"
        page = (DOCS / copy.name).read_text(encoding="utf-8")
        copy.write_text(page, encoding="utf-8")
        program = [sys.executable, str(DOCS / "make/consoles.py"), str(copy), str(folder)]
        subprocess.run(program, check=True)
        return Ran(page, copy.read_text(encoding="utf-8"), folder)

    with ThreadPoolExecutor() as pool:
        return dict(zip(RUN, pool.map(run, RUN), strict=True))


def same(shown: str, printed: str) -> bool:
    """Whether two lines agree but for what differs from one kind of processor to another.

    A number may be off by a fifth, or by five; any visual word may be another; there may be more or fewer of a kind.
    """
    if shown == printed:
        return True
    word = re.compile(r"\b[wc]\d\d\b")
    number = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]\d+)?")
    bare = [" ".join(number.sub("#", word.sub(" W ", line)).split()) for line in (shown, printed)]
    kinds = [re.sub(r"W(?: W)+", "W", line) for line in bare]
    pairs = zip(*([float(n) for n in number.findall(word.sub("", line))] for line in (shown, printed)), strict=False)
    return kinds[0] == kinds[1] and all(abs(a - b) <= max(5, abs(a) / 5) for a, b in pairs)


@same_jpegs
@pytest.mark.parametrize("name", RUN)
def test_the_commands_print_what_the_page_shows(ran: dict[str, Ran], name: str) -> None:
    assert CONSOLE.sub("", ran[name].page) == CONSOLE.sub("", ran[name].today)
    shown, printed = CONSOLE.findall(ran[name].page), CONSOLE.findall(ran[name].today)
    assert len(shown) == len(printed) >= 5
    for before, today in zip(shown, printed, strict=True):
        lines = before.splitlines(), today.splitlines()
        assert len(lines[0]) == len(lines[1]), today
        assert [pair for pair in zip(*lines, strict=True) if not same(*pair)] == []


@pytest.mark.parametrize(
    ("shown", "printed", "agree"),
    [
        ("accuracy 74.6 %", "accuracy 75.9 %", True),
        ("accuracy 74.6 %", "accuracy 54.6 %", False),
        ("accuracy 74.6 %", "balanced 74.6 %", False),
        ("w01 w01 w22", "w05", True),
        ("model: 5 places", "placerec: model: no such folder", False),
    ],
)
def test_what_counts_as_the_same(shown: str, printed: str, agree: bool) -> None:
    assert same(shown, printed) == agree


def test_no_command_of_a_page_that_should_work_fails(ran: dict[str, Ran]) -> None:
    for name in ("tutorial", "extend"):
        assert "\nplacerec: " not in ran[name].page
        assert "Traceback" not in ran[name].page


def test_the_tutorials_accuracy_is_told_where_others_are_compared_with_it(ran: dict[str, Ran]) -> None:
    told = re.search(
        r"the tutorial's words .* give ([\d.]+) %.*, and always answering \*corridor\* ([\d.]+) %", ran["extend"].page
    )
    assert told is not None
    line = f"accuracy           {told[1]} %   (majority class, always 'CR-B': {told[2]} %)"
    assert ran["tutorial"].page.count(line) == 1


def test_every_error_that_is_shown_is_one_line_of_placerec(ran: dict[str, Ran]) -> None:
    page = ran["troubleshooting"].page
    assert page.count("\nplacerec: ") >= 12
    assert "Traceback (" not in page


@pytest.mark.parametrize("example", ["colours", "network"])
def test_the_page_quotes_its_examples(example: str) -> None:
    page = (DOCS / "extend.md").read_text(encoding="utf-8")
    program = (DOCS / f"examples/{example}.py").read_text(encoding="utf-8")
    quoted = [
        block for block in re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL) if block in program
    ]
    assert len(quoted) == 1
    assert f"python docs/examples/{example}.py" in page


FILES = {
    "places.lst": "tutorial/lab/*/localization/places.lst",
    "token-stream": "tutorial/tokens/*.tsv",
    "vocab.txt": "tutorial/*/vocab.txt",
    "sentences": "tutorial/*/sentences/*.txt",
    "arpa": "tutorial/*/*.arpa",
    "counts": "tutorial/model/counts/*.counts",
    "beliefs": "tutorial/*/*3.tsv",
}


@pytest.mark.parametrize("name", FILES)
def test_what_was_written_is_by_the_grammar(ran: dict[str, Ran], name: str) -> None:
    grammar = re.compile(read_grammars((DOCS / "files.md").read_text(encoding="utf-8"))[name])
    page, _, glob = FILES[name].partition("/")
    found = sorted(path for path in ran[page].folder.glob(glob) if name != "beliefs" or path.parent.name != "tokens")
    assert len(found) >= 3
    for path in found:
        text = path.read_text(encoding="utf-8")
        assert grammar.fullmatch(text), path
        assert not grammar.fullmatch(text + "\n\n"), path
        assert not grammar.fullmatch(text[:-1]), path


def test_the_grammars_of_names_tables_and_choices() -> None:
    grammar = read_grammars((DOCS / "files.md").read_text(encoding="utf-8"))
    for name in ("t1152292394.730711_x0.19_y0.002_a-1e-3.jpeg", "t1152292394.730711.jpeg"):
        assert re.fullmatch(grammar["image-name"], name)
    assert {name for name in SMOOTHINGS if not re.fullmatch(grammar["smoothing"], name)} == set()
    assert not re.fullmatch(grammar["select"], "every:3")
    assert grammar["results.csv"].startswith("(?:" + ",".join(COLUMNS))
    tables = sorted(DOCS.glob("systems/*/*.csv"))
    assert len(tables) > 6
    for path in tables:
        assert re.fullmatch(grammar[path.name.replace("-size10", "")], path.read_text(encoding="utf-8")), path
    assert re.fullmatch(grammar["transitions"], "hall\troom\n0.99\t0.01\n1e-3\t0.999\n")
    assert not re.fullmatch(grammar["transitions"], "hall\troom\n0.99 0.01\n")
