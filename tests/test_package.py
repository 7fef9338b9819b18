"""The package as a whole: what importing it costs, what it exports, and which room may know which."""

import ast
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import placerec

PACKAGE = Path(placerec.__file__).parent
ROOT = PACKAGE.parent
HEAVY = ("numpy", "cv2", "scipy", "matplotlib", "kenlm", "sklearn")
# A room imports only from rooms to its left, and these anyone may import.
LINE = (
    *("frames", "vision", "words", "lm", "hohmm", "model", "methods"),
    *("evaluation", "learning", "figures", "inspection", "page", "experiments", "demo", "cli"),
)
COMMON = {"ahead", "arrays", "cluster", "errors", "files", "jobs", "journal", "version"}
ALLOWED = {room: COMMON | set(LINE[: i + 1]) for i, room in enumerate(LINE)} | {
    # A toolkit for text alone.
    "lm": COMMON | {"lm"},
    "lab": COMMON | {"lab"},
    # SRILM's surface hangs off the language models alone.
    "srilm": COMMON | {"lm", "srilm"},
    "demo": COMMON | set(LINE[:-1]) | {"lab"},
    "cli": COMMON | set(LINE) | {"lab", "srilm"},
    "files": {"errors"},
    "ahead": set(),
    "jobs": {"ahead", "errors"},
    "journal": {"errors", "files", "jobs"},
    "cluster": {"ahead", "errors", "jobs", "version"},
    "errors": set(),
    "version": set(),
    "arrays": set(),
    "reference": set(),
}
FILES = sorted(PACKAGE.rglob("*.py"))


def room_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path: Path) -> list[tuple[int, str]]:
    """Line and full name of every module that a file imports, inside functions and for types too."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [(node.lineno, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: relative import"
            module = node.module or ""
            names = [alias.name for alias in node.names] if module == "placerec" else [""]
            found += [(node.lineno, f"{module}.{name}".rstrip(".")) for name in names]
    return found


def loaded_by(statement: str) -> set[str]:
    code = f"import sys; {statement}; print(' '.join(m for m in {HEAVY!r} if m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


def test_there_are_files_to_look_at() -> None:
    assert len(FILES) > 40
    assert {room_of(path) for path in FILES} - {"__init__", "__main__"} <= set(ALLOWED)


def test_nothing_that_git_ignores_is_in_the_history() -> None:
    """An environment once committed stays in every clone, also when a later commit removes it."""
    git = shutil.which("git")
    if git is None or not (ROOT / ".git").exists():
        pytest.skip("these sources are no clone")

    def run(*command: str) -> str:
        return subprocess.run([git, *command], cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()

    tracked = run("ls-files", "--cached", "--ignored", "--exclude-standard").splitlines()
    if tracked:
        commit = run("log", "--diff-filter=A", "-1", "--format=%h %s", "--", tracked[0])
        remedy = "take it out: git rebase --onto main COMMIT, or git rm --cached and git commit --amend"
        pytest.fail(f"{len(tracked)} ignored files are tracked, {tracked[0]} since the commit {commit!r}; {remedy}")


@pytest.mark.parametrize("statement", ["import placerec", "import placerec.cli", "import placerec.errors"])
def test_importing_is_cheap(statement: str) -> None:
    assert loaded_by(statement) == set()


def test_help_loads_nothing_heavy() -> None:
    run = "from placerec.cli import commands; commands.main(['train-lm', '--help'], standalone_mode=False)"
    code = f"import sys; {run}; sys.exit(' '.join(m for m in {HEAVY!r} if m in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr.strip()) in ((0, ""), (1, "")), done.stderr


def test_words_are_decoded_without_images_libraries() -> None:
    """A robot that gets words from elsewhere needs neither OpenCV nor scipy in memory."""
    assert loaded_by("import placerec; placerec.load_recognizer, placerec.read_stream") == {"numpy"}


def test_the_parts_of_srilm_import_from_the_parts_below_alone() -> None:
    parts = ("text", "order", "model", "tools")
    for i, part in enumerate(parts):
        for path in (PACKAGE / "srilm" / part).rglob("*.py"):
            above = tuple(f"placerec.srilm.{other}" for other in parts[i + 1 :])
            assert [name for _, name in imports(path) if name.startswith(above)] == []


def test_every_public_name_resolves() -> None:
    assert placerec.__all__ == sorted(placerec.__all__)
    for name in placerec.__all__:
        assert getattr(placerec, name) is not None
    assert set(placerec._HOME) | {"__version__"} == set(placerec.__all__)


def test_type_checkers_and_the_library_page_see_the_same_names() -> None:
    """They follow the imports that are written down, where Python imports by the table."""
    tree = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    written = {
        alias.name: node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    assert {name: written.get(name) for name in placerec._HOME} == placerec._HOME


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_rooms_know_only_rooms_to_their_left(path: Path) -> None:
    room = room_of(path)
    if room in ("__init__", "__main__"):
        return
    for line, module in imports(path):
        if module.split(".")[0] == "placerec":
            other = [*module.split("."), ""][1]
            assert other in ALLOWED[room], f"{path}:{line}: {room} imports {module}"
        foreign = module.split(".")[0]
        assert foreign not in ("dask", "distributed") or room == "cluster", f"{path}:{line}: everyone is handed a map"
        assert foreign != "click" or room == "cli", f"{path}:{line}: only cli/ knows click"
        assert foreign != "waitress" or room == "page", f"{path}:{line}: only page/ serves"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_the_library_neither_prints_nor_exits(path: Path) -> None:
    # srilm/tools/run.py is where the process begins and ends for the tools in bin/.
    if room_of(path) == "cli" or path == PACKAGE / "srilm/tools/run.py":
        return
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            assert called not in ("print", "sys.exit", "exit", "quit", "input", "os._exit"), f"{path}:{node.lineno}"
            assert not called.startswith(("sys.stdout.", "sys.stderr.")), f"{path}:{node.lineno}: {called}"


def test_the_rules_would_be_seen_to_be_broken(tmp_path: Path) -> None:
    broken = tmp_path / "broken.py"
    broken.write_text("def f():\n    from placerec.words import x\n    from placerec import lm\n    import click\n")
    assert imports(broken) == [(2, "placerec.words"), (3, "placerec.lm"), (4, "click")]
