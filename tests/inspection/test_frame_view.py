"""What a dictionary sees in an image: the nearest units, and edges where they are."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.small_world import write_images

from placerec.errors import SourceError
from placerec.frames import find_sequences
from placerec.inspection.frame import FrameView, energies, format_frame, show_frame, view_frame
from placerec.vision import DescriptorSpec, Dictionary, DictionaryOptions, describe, gist

SPEC = DescriptorSpec(image_size=16)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("world")
    write_images(root / "seq")
    values = describe(find_sequences([root / "seq"]), SPEC).values
    Dictionary.fit(values, spec=SPEC, options=DictionaryOptions(size=4)).save(root / "words.npz")
    return root


def first_image(world: Path) -> Path:
    return min((world / "seq/std_cam").iterdir())


def test_the_nearest_units_are_told_by_distance(world: Path) -> None:
    dictionary = Dictionary.load(world / "words.npz")
    view = view_frame(first_image(world), dictionary)
    values = describe(find_sequences([world / "seq"]), SPEC).values[:1]
    unit, distance = dictionary.words(values)
    assert view.unit == unit[0]
    assert view.distances[view.unit] == pytest.approx(distance[0], rel=1e-6)
    assert list(view.nearest[:5]) == sorted(range(16), key=lambda unit: view.distances[unit])[:5]
    assert view.unit in view.nearest
    assert view.picture.shape == (16, 16)


def test_the_word_is_among_the_units_though_dead_ones_are_nearer(world: Path) -> None:
    dictionary = Dictionary.load(world / "words.npz")
    nearest = view_frame(first_image(world), dictionary).nearest
    hits = np.where(np.isin(np.arange(16), nearest), 0, 5)
    view = view_frame(first_image(world), replace(dictionary, hits=hits))
    assert view.nearest == (*nearest[:5], view.unit)
    assert view.unit not in nearest
    lines = format_frame(view).splitlines()
    assert all(line.endswith("hit by no training frame, so no word") for line in lines[3:8])
    assert len(lines) == 9


def test_a_second_image_is_no_source(world: Path) -> None:
    first, second = sorted((world / "seq/std_cam").iterdir())[:2]
    with pytest.raises(SourceError) as caught:
        show_frame(first, world / "words.npz", [second])
    assert str(caught.value) == f"{second}: is a second image; show one at a time (SOURCE is a folder of frames)"


def test_a_source_tells_places_and_typical_frames(world: Path) -> None:
    bare = show_frame(first_image(world), world / "words.npz")
    assert bare.table is None
    assert set(bare.row(bare.unit)) == {"unit", "word", "distance", "hits"}
    view = show_frame(first_image(world), world / "words.npz", [world / "seq"])
    assert view.table is not None
    row = view.row(view.unit)
    assert row["place"] == "hall"
    assert row["typical_sequence"] == "seq"
    assert row["distance"] == bare.row(bare.unit)["distance"]
    assert "hall (" in format_frame(view).splitlines()[3]
    json.dumps(view.to_json(), allow_nan=False)


def test_an_image_that_cannot_be_used_is_named(world: Path, tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"nothing\.png: no such file"):
        show_frame(tmp_path / "nothing.png", world / "words.npz")


def test_windows_and_edges_are_where_the_picture_has_them() -> None:
    """A grating of edges at 90 + 30 t degrees, counter-clockwise, in one window alone, is turn t there."""
    row, column = np.mgrid[:128, :128]
    for turn in range(6):
        angle = np.deg2rad(90 + 30 * turn)
        # Rows run downwards: along the edges one goes (cos, -sin), and across them (sin, cos).
        across = np.sin(angle) * column + np.cos(angle) * row
        image = np.full((128, 128), 128, np.uint8)
        wave = (128 + 100 * np.sin(across * 2 * np.pi / 8)).astype(np.uint8)
        image[32:64, 64:96] = wave[32:64, 64:96]
        found = energies(gist(image))
        assert found.shape == (4, 6, 4, 4)
        assert np.argwhere(found == found.max())[0, 1:].tolist() == [turn, 1, 2]


def test_scales_go_from_fine_to_coarse() -> None:
    column = np.mgrid[:128, :128][1]
    found = []
    for period in (4, 6, 11, 21):
        wave = (128 + 100 * np.sin(column * 2 * np.pi / period)).astype(np.uint8)
        found.append(int(energies(gist(cv2.GaussianBlur(wave, (0, 0), 0.5))).max(axis=(1, 2, 3)).argmax()))
    assert found == [0, 1, 2, 3]


def test_the_view_names_the_file_without_its_folder(world: Path) -> None:
    view: FrameView = show_frame(first_image(world), world / "words.npz")
    assert format_frame(view).startswith(f"{first_image(world).name}: {view.words[view.unit]}, at a distance of ")
