"""The commands that look at words, as a user meets them."""

import json
from pathlib import Path

import pytest
from helpers.pictures import drawn_texts
from helpers.small_world import write_images
from helpers.typed_commands import fails, placerec

from placerec.frames import read_gray
from placerec.inspection.changes import CHANGES
from placerec.vision import DescriptorSpec, DictionaryOptions, DictionarySet, DictionarySetOptions, train_dictionary
from placerec.vision.light import LIGHTS


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("world")
    for seed, name in enumerate(("seq1", "seq2")):
        write_images(root / "runs" / name, seed)
    train_dictionary(
        [root / "runs/seq1"], root / "words.npz", spec=DescriptorSpec(image_size=16), options=DictionaryOptions(size=3)
    )
    return root


@pytest.fixture(scope="module")
def several(world: Path) -> Path:
    """A words.npz of four dictionaries."""
    spec, options = DescriptorSpec(image_size=16), DictionarySetOptions(sizes=(3, 4))
    train_dictionary([world / "runs/seq1"], world / "several.npz", spec=spec, options=options)
    return world / "several.npz"


@pytest.mark.parametrize(("name", "size"), [("", 3), ("plain4", 4), ("pn3", 3)])
def test_each_of_several_dictionaries_can_be_looked_at(world: Path, several: Path, name: str, size: int) -> None:
    which = ("--dictionary", name, "--json", "-q") if name else ("--json", "-q")
    start = f"{name}.w" if name else "w"
    dictionary = DictionarySet.load(several).named(name)
    sheet = json.loads(placerec("show-words", several, world / "runs", *which).stdout)
    assert [unit["word"] for unit in sheet["units"]] == list(dictionary.vocabulary)
    assert len(sheet["units"]) == size**2
    seen = json.loads(placerec("show-frame", image(world), "-w", several, *which).stdout)
    assert seen["word"] == dictionary.word_of(read_gray(image(world)))[0]
    assert seen["word"].startswith(start)
    header, *rows = placerec("show-frame", image(world), "-w", several, *which[:-2], "-q").stdout.splitlines()[2:]
    hits = header.index("hits") + len("hits")
    assert all(row[hits - 1].isdigit() and row[hits : hits + 2].isspace() == (len(row) > hits) for row in rows)
    pytest.importorskip("matplotlib")
    placerec("show-words", several, world / "runs", "-o", world / "sheet.svg", *which)
    title = f"The words of several.npz{f', dictionary {name}' if name else ''}"
    assert {title, "w0" if size == 3 else "w00"} <= set(drawn_texts(world / "sheet.svg"))
    frames = json.loads(placerec("stability", world / "runs/seq2", "-w", several, *which).stdout)
    dictionary.save(world / "alone.npz")
    assert frames == json.loads(
        placerec("stability", world / "runs/seq2", "-w", world / "alone.npz", *which[-2:]).stdout
    )


def test_a_dictionary_that_is_not_there_is_refused(world: Path, several: Path) -> None:
    message = "no dictionary is called 'pn9'; there is the first, without a name, and plain4, pn3, pn4"
    fails(message, "show-words", several, world / "runs", "--dictionary", "pn9")
    alone = "no dictionary is called 'pn9'; there is the first, without a name, and no other dictionary"
    fails(alone, "stability", world / "runs", "-w", world / "words.npz", "--dictionary", "pn9")


def image(world: Path) -> Path:
    return min((world / "runs/seq1/std_cam").iterdir())


def test_show_words(world: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    told = placerec("show-words", world / "words.npz", world / "runs", "-o", tmp_path / "words.png")
    assert told.exit_code == 0, told.output
    assert (tmp_path / "words.png").read_bytes().startswith(b"\x89PNG")
    assert told.stdout.startswith("9 units, ")
    assert " 24 frames in 2 sequences.\n" in told.stdout
    found = json.loads(placerec("show-words", world / "words.npz", world / "runs", "--json", "-q").stdout)
    assert len(found["units"]) == 9
    assert found["places"] == ["hall", "kitchen"]
    assert sum(unit["frames"] for unit in found["units"]) == 24


def test_show_frame(world: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    words = ("-w", world / "words.npz")
    told = placerec("show-frame", image(world), *words, "-o", tmp_path / "seen.svg")
    assert told.exit_code == 0, told.output
    assert (tmp_path / "seen.svg").read_bytes().startswith(b"<?xml")
    word = told.stdout.split(": ")[1].split(",")[0]
    found = json.loads(placerec("show-frame", image(world), world / "runs", *words, "--json", "-q").stdout)
    assert found["word"] == word
    assert len(found["nearest"]) == 5
    assert {"place", "typical_frame", "distance"} <= set(found["nearest"][0])


def test_stability(world: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    args = ("stability", world / "runs/seq2", "-w", world / "words.npz")
    told = placerec(*args, "-o", tmp_path / "bars.pdf")
    assert told.exit_code == 0, told.output
    assert (tmp_path / "bars.pdf").read_bytes().startswith(b"%PDF")
    assert len(told.stdout.splitlines()) == 3 + len(CHANGES)
    found = json.loads(placerec(*args, "--json").stdout)
    assert found["frames"] == 12
    assert [change["kind"] for change in found["changes"]] == [change.kind for change in CHANGES]
    assert placerec(*args).stdout == told.stdout


def test_stability_in_other_lights_says_that_they_are_simulated(world: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    args = ("stability", world / "runs/seq2", "-w", world / "words.npz", "--light", "--seed", "1")
    told = placerec(*args, "-o", tmp_path / "bars.svg")
    assert [line[:32].strip() for line in told.stdout.splitlines()[2:6]] == [f"simulated light {one}" for one in LIGHTS]
    assert {f"simulated light {one}" for one in LIGHTS} <= set(drawn_texts(tmp_path / "bars.svg"))
    found = json.loads(placerec(*args, "--json").stdout)
    assert [(one["kind"], one["amount"]) for one in found["changes"]] == [("simulated light", one) for one in LIGHTS]


@pytest.mark.parametrize("command", ["show-words", "show-frame", "stability"])
def test_errors_are_one_line(world: Path, tmp_path: Path, command: str) -> None:
    given: dict[str, list[object]] = {
        "show-words": [world / "words.npz", world / "runs"],
        "show-frame": [image(world), "-w", world / "words.npz"],
        "stability": [world / "runs", "-w", world / "words.npz"],
    }
    broken = placerec(command, *given[command], "-o", tmp_path / "a.bmp")
    assert broken.exit_code == 1
    assert (
        broken.stderr == f"placerec: {tmp_path / 'a.bmp'}: no kind of picture; let its name end in .png, .svg or .pdf\n"
    )
    missing = [world / "no.npz" if arg == world / "words.npz" else arg for arg in given[command]]
    broken = placerec(command, *missing)
    assert broken.exit_code == 1
    assert broken.stderr == f"placerec: {world / 'no.npz'}: no such file; name another\n"
