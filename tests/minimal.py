"""All tests with the oldest packages that pyproject.toml allows, in `.venv-minimal`.

    python tests/minimal.py [PYTEST-ARGUMENT...]

The constraints file is made of the lower bounds in pyproject.toml, so that these are what is tested. They are for the
oldest Python that is allowed: newer ones begin with newer packages, of which the first environment has the newest.
"""

import os
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
ENVIRONMENT = ROOT / ".venv-minimal"
# What asks for a newer numpy than the package does: its tests are skipped.
LEFT_OUT = "rerun"
# Of packages that are nobody's but another package's.
NEWEST = ("pyparsing<3.3",)  # matplotlib 3.8 calls what later ones deprecate, and the tests take that for an error


def extras() -> dict[str, list[str]]:
    """The extras that are installed, and what each asks for."""
    return {name: asked for name, asked in PROJECT["optional-dependencies"].items() if name != LEFT_OUT}


def requirements() -> Iterator[Requirement]:
    """Every requirement of the package and of its extras that there is for this Python."""
    for text in [*PROJECT["dependencies"], *(text for extra in extras().values() for text in extra)]:
        requirement = Requirement(text)
        if requirement.marker is None or requirement.marker.evaluate():
            yield requirement


def constraints() -> list[str]:
    """A line of pip's constraints for every requirement: the lower bound itself."""
    lines = []
    for requirement in requirements():
        (bound,) = requirement.specifier
        assert bound.operator == ">=", f"{requirement}: one lower bound is wanted, and no other"
        lines.append(f"{requirement.name}=={bound.version}")
    return sorted({*lines, *NEWEST})


def install() -> None:
    """Make the environment, or leave it if it is what the constraints and pyproject.toml ask for."""
    file, stamp = ENVIRONMENT / "constraints.txt", ENVIRONMENT / "pyproject.toml"
    wanted = "\n".join(constraints()) + "\n"
    project = (ROOT / "pyproject.toml").read_bytes()
    if stamp.exists() and stamp.read_bytes() == project and file.read_text(encoding="utf-8") == wanted:
        return
    subprocess.run([sys.executable, "-m", "venv", "--clear", ENVIRONMENT], check=True)
    file.write_text(wanted, encoding="utf-8")
    package = f"{ROOT}[{','.join(extras())}]"
    pip = [str(ENVIRONMENT / "bin/python"), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "--constraint", str(file), "--editable", package], check=True)
    stamp.write_bytes(project)


def main() -> None:
    oldest = PROJECT["requires-python"].removeprefix(">=")
    if "{}.{}".format(*sys.version_info) != oldest:
        print(f"The oldest packages are tested with Python {oldest}, and this is {sys.version.split()[0]}: not tested")
        return
    print(f"All tests with the oldest packages that are allowed, in {ENVIRONMENT.name} ...", flush=True)
    install()
    python = str(ENVIRONMENT / "bin/python")
    os.chdir(ROOT)
    os.execv(python, [python, "-m", "pytest", *sys.argv[1:]])


if __name__ == "__main__":
    main()
