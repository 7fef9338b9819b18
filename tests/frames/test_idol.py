"""KTH-IDOL2's layout: png/ in a folder that names the sequence, rooms in the names of the images."""

from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from placerec.errors import SourceError
from placerec.frames import SourceOptions, find_sequences
from placerec.frames.layouts import room_in, seconds_in

# As the files are called; the third has an exponent and an integer, as %g writes them.
NAMES = (
    "t1117456789.250000_rPA_x-0.25_y3.125_a1.5708.png",
    "t1117456789.050000_rCR_x0_y3.1_a-0.5.png",
    "t1117456789.450000_rEO_x1e-05_y-12_a3.png",
)


def make(folder: Path, names: tuple[str, ...] = NAMES) -> Path:
    folder.mkdir(parents=True)
    for name in names:
        (folder / name).touch()
    return folder


def test_names() -> None:
    assert (seconds_in(NAMES[0]), room_in(NAMES[0])) == (1117456789.25, "PA")
    assert (seconds_in(NAMES[2]), room_in(NAMES[2])) == (1117456789.45, "EO")
    for name in ("t1.5_x1_y2_a3.png", "t1.5.png", "t1.5_rpa_x1_y2_a3.png", "t1.5_r_x1_y2_a3.png", "frame1.png"):
        assert room_in(name) is None


numbers = st.floats(-1e4, 1e4, allow_nan=False)


@given(numbers, numbers, numbers, st.sampled_from(["BO", "CR", "EO", "KT", "PA"]))
def test_names_as_they_are_written(x: float, y: float, angle: float, room: str) -> None:
    name = f"t{1117456789.25:.6f}_r{room}_x{x:g}_y{y:g}_a{angle:g}.png"
    assert (seconds_in(name), room_in(name)) == (1117456789.25, room)


@pytest.mark.parametrize("where", ["", "dum_cloudy1", "dum_cloudy1/png"])
def test_a_sequence_is_called_after_the_folder_that_holds_png(tmp_path: Path, where: str) -> None:
    make(tmp_path / "dum_cloudy1/png")
    (sequence,) = find_sequences([tmp_path / where])
    assert sequence.name == "dum_cloudy1"
    assert sequence.source == tmp_path / "dum_cloudy1"
    assert [(frame.place, frame.time) for frame in sequence.frames] == [
        ("CR", 1117456789.05),
        ("PA", 1117456789.25),
        ("EO", 1117456789.45),
    ]
    assert sequence.frames[0].path == tmp_path / "dum_cloudy1/png" / NAMES[1]


def test_the_whole_data_set(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for robot in ("dum", "min"):
        for light in ("cloudy", "night", "sunny"):
            make(tmp_path / f"KTH-IDOL2/{robot}_{light}1/png")
    names = [sequence.name for sequence in find_sequences([tmp_path / "KTH-IDOL2"])]
    assert names == ["dum_cloudy1", "dum_night1", "dum_sunny1", "min_cloudy1", "min_night1", "min_sunny1"]
    monkeypatch.chdir(tmp_path / "KTH-IDOL2/min_night1/png")
    assert [sequence.name for sequence in find_sequences(["."])] == ["min_night1"]
    with pytest.raises(SourceError, match="given twice"):
        find_sequences([".", "../../min_night1"])


def test_images_beside_each_other_and_labels_of_their_own(tmp_path: Path) -> None:
    run = make(tmp_path / "min_sunny2")
    (sequence,) = find_sequences([run], options=SourceOptions(every=2))
    assert (sequence.name, [frame.place for frame in sequence.frames]) == ("min_sunny2", ["CR", "EO"])
    (run / "places.lst").write_text(f"{NAMES[0]} printer\n")
    (sequence,) = find_sequences([run])
    assert [frame.place for frame in sequence.frames] == ["", "printer", ""]


def test_png_is_a_name_like_any_other_elsewhere(tmp_path: Path) -> None:
    make(tmp_path / "run/png", ("t1.500000.png", "t2.500000.png"))
    (sequence,) = find_sequences([tmp_path])
    assert sequence.name == "png"
