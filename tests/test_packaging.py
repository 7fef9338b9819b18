"""What is built from the sources and installed: the archive, the wheel, the command, the version."""

import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import zipfile
from email import message_from_string
from email.message import Message
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import minimal
import pytest

from placerec.version import __version__

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
SOURCES = ("LICENSE", "README.md", "pyproject.toml", "arpa_models", "bin", "docs", "placerec", "tests")
# What the backend says of itself in an archive, beside the sources.
ADDED = {"PKG-INFO", "setup.cfg"}


def files(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def backend(hook: str, folder: Path, out: Path) -> None:
    """Call setuptools as pip does, without the isolation that would need a network."""
    code = f"from setuptools import build_meta; build_meta.{hook}({str(out)!r})"
    subprocess.run([sys.executable, "-c", code], cwd=folder, check=True, capture_output=True)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the archive of a copy of the sources, unpacked, and in `wheel/` what is built from it, unpacked."""
    (required,) = PROJECT["build-system"]["requires"]
    try:
        installed = version("setuptools")
    except PackageNotFoundError:
        installed = "0"
    if int(installed.split(".")[0]) < int(required.removeprefix("setuptools>=")):
        pytest.skip(f"needs {required} to build with; there is {installed}")
    out = tmp_path_factory.mktemp("built")
    copy = out / "copy"
    copy.mkdir()
    for name in SOURCES:
        if (ROOT / name).is_file():
            shutil.copy(ROOT / name, copy)
        else:
            shutil.copytree(ROOT / name, copy / name)
    (copy / "tests/.cache").mkdir()
    (copy / "tests/.cache/rubbish").touch()
    backend("build_sdist", copy, out)
    with tarfile.open(out / f"placerec-{__version__}.tar.gz") as archive:
        archive.extractall(out, filter="data")
    backend("build_wheel", out / f"placerec-{__version__}", out)
    with zipfile.ZipFile(out / f"placerec-{__version__}-py3-none-any.whl") as wheel:
        wheel.extractall(out / "wheel")
    return out


@pytest.fixture(scope="module")
def metadata(built: Path) -> Message:
    return message_from_string((built / f"wheel/placerec-{__version__}.dist-info/METADATA").read_text("utf-8"))


def test_the_archive_holds_all_that_its_tests_need(built: Path) -> None:
    found = {
        name for name in files(built / f"placerec-{__version__}") if not name.startswith(("placerec.egg", "build"))
    }
    sources = {
        name for name in files(built / "copy") if not re.search(r"(^|/)(__pycache__|\.\w+|placerec.egg-info)/", name)
    }
    assert found == sources | ADDED
    assert {"bin/ngram-count", "arpa_models/README.md", "docs/changelog.md", "tests/helpers/typed_commands.py"} < found
    assert os.access(built / f"placerec-{__version__}/bin/ngram-count", os.X_OK)


def test_the_wheel_holds_the_package_and_nothing_else(built: Path) -> None:
    information = f"placerec-{__version__}.dist-info/"
    package = files(ROOT / "placerec")
    expected = {f"placerec/{name}" for name in package if name.endswith(".py") or name.startswith("page/static/")}
    expected.add("placerec/py.typed")
    found = files(built / "wheel")
    assert len(expected) > 100
    assert {"placerec/page/static/strip.js", "placerec/page/static/page.css"} < expected
    assert {name for name in found if not name.startswith(information)} == expected
    names = ("METADATA", "RECORD", "WHEEL", "entry_points.txt", "licenses/LICENSE", "top_level.txt")
    assert found - expected == {information + name for name in names}


def test_the_metadata_are_those_of_the_project(metadata: Message) -> None:
    assert metadata["Name"] == "placerec"
    assert metadata["Version"] == __version__
    assert metadata["License-Expression"] == "MIT"
    assert metadata["Requires-Python"] == PROJECT["project"]["requires-python"]
    assert set(metadata.get_all("Provides-Extra", [])) == set(PROJECT["project"]["optional-dependencies"])
    assert metadata.get_payload() == (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_installed_command_and_the_module_are_the_same(built: Path, tmp_path: Path) -> None:
    """From the wheel alone, in a folder that has nothing of the sources."""
    code = (
        "import sys; from importlib.metadata import distributions; wheel = sys.path[1]\n"
        "(found,) = distributions(name='placerec', path=[wheel])\n"
        "(script,) = found.entry_points.select(group='console_scripts')\n"
        "assert script.name == 'placerec'\n"
        "sys.argv = ['/usr/bin/placerec', *sys.argv[1:]]; main = script.load()\n"
        "import placerec; assert placerec.__file__.startswith(wheel), placerec.__file__\n"
        "main()"
    )

    def run(*command: str) -> tuple[int, str, str]:
        environment = {**os.environ, "PYTHONPATH": str(built / "wheel")}
        done = subprocess.run([sys.executable, *command], cwd=tmp_path, env=environment, capture_output=True, text=True)
        return done.returncode, done.stdout, done.stderr

    assert run("-c", code, "--version") == (0, f"placerec, version {__version__}\n", "")
    for arguments, status in (
        (["--help"], 0),
        (["ngram-count", "-version"], 0),
        (["train-lm"], 2),
        (["check", "x"], 1),
    ):
        script = run("-c", code, *arguments)
        assert script[0] == status, script
        assert run("-m", "placerec", *arguments) == script


def test_the_version_is_written_in_one_place() -> None:
    here = re.compile(rf"(?<![\w.]){re.escape(__version__)}(?![\w.])")
    looked_at = [ROOT / "README.md", ROOT / "pyproject.toml", *filter(Path.is_file, (ROOT / "bin").iterdir())]
    looked_at += [path for name in ("placerec", "tests") for path in (ROOT / name).rglob("*.py")]
    assert len(looked_at) > 300
    assert [path for path in looked_at if here.search(path.read_text(encoding="utf-8"))] == [
        ROOT / "placerec/version.py"
    ]


def test_the_newest_version_of_the_changelog_is_this_one() -> None:
    text = (ROOT / "docs/changelog.md").read_text(encoding="utf-8")
    versions = re.findall(r"^## (\S+)", text, re.M)
    assert versions[0] == __version__
    kinds = re.findall(r"^### (.*)$", text, re.M)
    assert set(kinds) <= {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}
    assert kinds


def test_help_costs_little_more_than_importing_click() -> None:
    """In processor time, which other work on the machine changes less than the time on the clock."""
    resource = pytest.importorskip("resource")

    def cost(*command: str) -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, *command], check=True, stdout=subprocess.DEVNULL)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return float(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)

    runs = [(cost("-m", "placerec", "--help"), cost("-c", "import click")) for _ in range(5)]
    assert min(ours for ours, _ in runs) < min(click for _, click in runs) + 0.1


def test_the_page_on_installing_names_every_extra() -> None:
    page = (ROOT / "docs/install.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \| (.*) \|$", page, re.M)
    extras = PROJECT["project"]["optional-dependencies"]
    assert [name for name, _ in rows] == list(extras)
    # What is installed for users is told by name.
    for name, row in rows[:-1]:
        for requirement in extras[name]:
            assert re.split(r"[\[>]", requirement)[0].split("-")[-1].lower() in row.lower(), name
    assert PROJECT["project"]["requires-python"].removeprefix(">=") in page


def test_the_oldest_packages_are_those_of_the_lower_bounds() -> None:
    lines = minimal.constraints()
    assert {re.split("[=<]", line)[0] for line in lines} >= {requirement.name for requirement in minimal.requirements()}
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    bounds = [line.split("==") for line in lines if line not in minimal.NEWEST]
    assert len(bounds) > 15
    assert [line for line in bounds if not re.search(rf'"{line[0]}(\[\w+\])?>={re.escape(line[1])}["; ]', text)] == []


def test_an_editable_install_is_a_path_that_type_checkers_follow(tmp_path: Path) -> None:
    """Not a hook, which gives way to a folder of the package's name, as a clone has it for those who stand above it."""
    clone = tmp_path / "placerec"
    clone.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, clone)
    for name in ("placerec", "bin"):
        shutil.copytree(ROOT / name, clone / name)
    backend("build_editable", clone, tmp_path)
    with zipfile.ZipFile(tmp_path / f"placerec-{__version__}-0.editable-py3-none-any.whl") as wheel:
        wheel.extractall(tmp_path / "site")
    (path,) = filter(Path.is_file, (tmp_path / "site").iterdir())
    assert path.suffix == ".pth"
    assert path.read_text("utf-8").splitlines() == [str(clone)]
    # Without this environment's own site, which has the real clone.
    code = (
        f"import sys, site; sys.path.append({sysconfig.get_path('purelib')!r}); site.addsitedir({str(path.parent)!r})\n"
        "import placerec; print(placerec.__file__, placerec.gist.__module__)"
    )
    done = subprocess.run([sys.executable, "-S", "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == (f"{clone / 'placerec/__init__.py'} placerec.vision.gist\n", "")


@pytest.mark.parametrize("before", ["kenlm-0.3.0", "ufal_kenlm-26.4.1", ""])
def test_an_environment_made_with_kenlm_gives_it_up_first(before: str, tmp_path: Path) -> None:
    """Else both would own the module's file, and uninstalling one would take it from the other."""
    for name in ("bin", "placerec"):
        (tmp_path / name).mkdir()
    for name in ("bin/environment", "pyproject.toml"):
        shutil.copy(ROOT / name, tmp_path / name)
    bin_of_venv = tmp_path / ".venv/bin"
    bin_of_venv.mkdir(parents=True)
    for name in ("python", "pip"):
        (bin_of_venv / name).write_text(f'#!/bin/sh\necho "$*" >> {shlex.quote(str(tmp_path / "asked"))}\n', "utf-8")
        (bin_of_venv / name).chmod(0o755)
    if before:
        (tmp_path / f".venv/lib/python3.11/site-packages/{before}.dist-info").mkdir(parents=True)

    command = ["sh", "-c", ". bin/environment", "bin/demo"]
    for _ in range(2):
        done = subprocess.run(
            command, cwd=tmp_path, env={**os.environ, "EXTRAS": "plot"}, capture_output=True, text=True, check=True
        )
    assert done.stderr == "", "the second time there is nothing to install"
    asked = (tmp_path / "asked").read_text("utf-8").splitlines()
    gone = ["-m pip uninstall --quiet --yes kenlm ufal-kenlm"] if before.startswith("kenlm") else []
    installed = "-m pip install --quiet --disable-pip-version-check --editable .[plot]"
    compiled = "-m compileall -q placerec"
    assert asked == [*gone, installed, compiled, compiled]
