"""What a command needs at its end is looked for before it begins."""

import sys
from pathlib import Path

import pytest
from helpers.missing_packages import run_without

PIP = f"{sys.executable} -m pip install"
PICTURE = f"placerec: a picture needs the package matplotlib, which is not installed: {PIP} matplotlib\n"
KNN = (
    "placerec: knn needs the package scikit-learn, which is not installed: "
    f"{PIP} scikit-learn, or leave it out of --methods\n"
)


@pytest.mark.parametrize(
    ("absent", "arguments", "told"),
    [
        ("matplotlib", "demo -o OUT", PICTURE),
        ("matplotlib", "evaluate nothing.tsv --plot OUT.png", PICTURE),
        ("matplotlib", "compare nothing --test nothing -o OUT", PICTURE),
        ("sklearn", "compare nothing --test nothing -o OUT --methods knn,majority", KNN),
        ("matplotlib", "experiment nothing.toml -o OUT", PICTURE),
        ("matplotlib", "show-words nothing.npz nothing -o OUT.png", PICTURE),
        ("matplotlib", "show-frame nothing.png -w nothing.npz -o OUT.png", PICTURE),
        ("matplotlib", "stability nothing -w nothing.npz -o OUT.png", PICTURE),
    ],
    ids=lambda value: value.partition(" ")[0] if " -" in value else "",
)
def test_a_missing_package_is_named_before_anything_is_read(
    absent: str, arguments: str, told: str, tmp_path: Path
) -> None:
    """What is to be read does not exist, and that is not what the command complains of."""
    done = run_without((absent,), *arguments.replace("OUT", str(tmp_path / "out")).split())
    assert (done.returncode, done.stdout, done.stderr) == (1, "", told)
    assert list(tmp_path.iterdir()) == []


def test_without_a_picture_no_package_is_missed(tmp_path: Path) -> None:
    told = run_without(("matplotlib", "sklearn"), "evaluate", tmp_path / "nothing.tsv")
    assert (told.returncode, told.stderr) == (1, f"placerec: {tmp_path / 'nothing.tsv'}: no such file\n")
