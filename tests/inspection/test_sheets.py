"""The pictures of words: written whole, the same bytes each time, with every place, number and cross that they need."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.pictures import drawn_texts
from helpers.small_world import write_images

from placerec.errors import MissingExtraError, OutputError, VisionError
from placerec.frames import read_gray
from placerec.frames.sequence import Gray
from placerec.frames.table import FrameTable
from placerec.inspection import word_stability, words
from placerec.inspection.frame import show_frame
from placerec.inspection.word_sheet import draw_word_sheet, show_words
from placerec.inspection.word_stability import ChangeResult, Stability, format_stability, plot_stability, stability
from placerec.inspection.words import WordTable
from placerec.vision import DescriptorSpec, DictionaryOptions, train_dictionary

pytest.importorskip("matplotlib")

RESULTS = (
    ChangeResult("JPEG", "quality 90", 200, 3, 2, 200),
    ChangeResult("JPEG", "quality 30", 200, 90, 10, 200),
    ChangeResult("blur", "x", 200, 0, 0, 200),
)
STEP = ChangeResult("the next frame, for comparison", "", 198, 50, 49, 198)
FOUND = Stability(200, 200, RESULTS, STEP)


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("world")
    for seed, name in enumerate(("seq1", "seq2")):
        write_images(root / name, seed)
    train_dictionary(
        [root / "seq1"], root / "words.npz", spec=DescriptorSpec(image_size=16), options=DictionaryOptions(size=4)
    )
    return root


def table(size: int, places: tuple[str, ...], seed: int = 0) -> WordTable:
    rng = np.random.default_rng(seed)
    count = size * size
    votes = rng.integers(0, 9, (count, len(places)))
    votes[::3] = 0
    frames = votes.sum(axis=1) + (not places)
    return WordTable(
        words=tuple(f"w{unit}" for unit in range(count)),
        size=size,
        units="live",
        hits=rng.integers(0, 3, count) * 7,
        frames=frames,
        places=places,
        votes=votes,
        typical=np.where(frames > 0, 0, -1),
        distances=np.where(frames > 0, 0.5, np.nan).astype(np.float32),
        u_matrix=rng.random(count),
        to_dead=3,
        is_training=False,
        looked_at=FrameTable.of("run", ["f.png"] * int(frames.sum())),
    )


def typical(world: Path, words: WordTable) -> dict[int, Gray]:
    image = read_gray(min((world / "seq1/std_cam").iterdir()))
    return {unit: image for unit, frame in enumerate(words.typical) if frame >= 0}


def draw(world: Path, words: WordTable, path: Path) -> list[str]:
    draw_word_sheet(words, typical(world, words), path, title="Words")
    return drawn_texts(path)


def test_every_command_draws_the_same_bytes_each_time(world: Path, tmp_path: Path) -> None:
    image, words = min((world / "seq1/std_cam").iterdir()), world / "words.npz"
    for name in ("a", "b"):
        show_words(words, [world / "seq2"], tmp_path / f"{name}.png")
        show_frame(image, words, [world / "seq2"], tmp_path / f"{name}.svg")
        stability([world / "seq1"], words, tmp_path / f"{name}.pdf")
    for suffix, magic in (("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")):
        first, second = ((tmp_path / f"{name}.{suffix}").read_bytes() for name in ("a", "b"))
        assert first == second
        assert first.startswith(magic)
    assert len(list(tmp_path.iterdir())) == 6


def test_the_sheet_holds_every_place_and_every_number(world: Path, tmp_path: Path) -> None:
    places = ("a$b$", "hall", "kitchen")
    words = table(5, places)
    text = draw(world, words, tmp_path / "a.svg")
    for number, place in enumerate(places, start=1):
        assert place in text
        mine = int((words.place == number - 1).sum())
        assert str(mine) in text
        # In the legend, and on each of its tiles.
        assert text.count(str(number)) >= 1 + mine
    assert text.count("7") + text.count("14") >= (words.hits > 0).sum()
    assert [f"+{column}" in text for column in range(6)] == [True] * 5 + [False]
    assert {"w0", "w5", "w10", "w15", "w20"} <= set(text)
    assert "(no label)" not in text


def test_one_tile_is_explained(world: Path, tmp_path: Path) -> None:
    text = draw(world, table(5, ("CR-B", "hall")), tmp_path / "a.svg")
    assert any(one.startswith("How to read a tile: w") for one in text)
    for note in ("training frames that hit the unit", "the frame nearest to the unit", "its frames by place"):
        assert note in text
    # COLD's codes are spelled out.
    assert "CR-B corridor" in text
    bare = replace(table(3, ("hall",)), hits=np.zeros(9, np.int64))
    assert not any("How to read" in one for one in draw(world, bare, tmp_path / "b.svg"))


def test_without_labels_the_sheet_says_so(world: Path, tmp_path: Path) -> None:
    text = draw(world, table(3, ()), tmp_path / "a.svg")
    assert "(no label)" in text
    assert "No frame has a label: it is not known which place a word belongs to." in text


@pytest.mark.parametrize("size", [2, 8])
def test_long_names_of_many_places_are_shortened_and_nothing_leaves_the_sheet(
    world: Path, tmp_path: Path, size: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    from matplotlib.figure import Figure
    from matplotlib.text import Text

    inside: dict[str, bool] = {}

    def look_over(figure: Figure, *args: object, **options: object) -> None:
        figure.draw_without_rendering()
        for text in figure.findobj(Text):
            if text.get_text():
                box = text.get_window_extent()
                whole = figure.bbox
                inside[text.get_text()] = min(box.x0, box.y0, whole.x1 - box.x1, whole.y1 - box.y1) >= 0

    monkeypatch.setattr(Figure, "savefig", look_over)
    places = tuple(f"the_long_corridor_of_the_building_on_floor_{i:02d}" for i in range(30))
    words = table(size, places)
    words = replace(words, words=tuple(f"placenormalised20.w{unit:03d}" for unit in range(size**2)))
    draw_word_sheet(words, typical(world, words), tmp_path / "a.png", title=f"The words of {'x' * 300}.npz")
    # The title, the places, and the one of the explained tile.
    assert sum("…" in text for text in inside) == 32
    assert [text for text, within in inside.items() if not within] == []


def test_what_is_not_gist_has_bars_and_no_roses(world: Path, tmp_path: Path) -> None:
    spec = DescriptorSpec(kind="centrist", image_size=16)
    train_dictionary([world / "seq1"], tmp_path / "centrist.npz", spec=spec, options=DictionaryOptions(size=3))
    image = min((world / "seq1/std_cam").iterdir())
    show_frame(image, world / "words.npz", out=tmp_path / "roses.svg")
    show_frame(image, tmp_path / "centrist.npz", out=tmp_path / "bars.svg")
    roses, bars = (drawn_texts(tmp_path / f"{name}.svg") for name in ("roses", "bars"))
    assert f"The {spec.length} values of the descriptor" in bars
    for name in ("finest", "fine", "coarse", "coarsest"):
        assert f"Edges of the {name} scale" in roses
        assert f"Edges of the {name} scale" not in bars
    assert any(text.startswith("A rose") for text in roses)
    assert not any(text.startswith("A rose") for text in bars)
    # No box stays empty: the nearest units are rows where there is no picture of them.
    assert "How far the nearest units are; a SOURCE would show what they look like" in roses
    assert "the word of no frame here" not in roses


def test_words_of_a_matrix_are_shown_and_cannot_be_made_from_images(world: Path, tmp_path: Path) -> None:
    matrix, words = tmp_path / "rows.npy", tmp_path / "words.npz"
    np.save(matrix, np.random.default_rng(0).random((12, 20)).astype(np.float32))
    train_dictionary([world / "seq1"], words, options=DictionaryOptions(size=3), matrix=matrix)
    found = show_words(words, [world / "seq1"], tmp_path / "a.png", matrix=matrix)
    assert found.is_training
    assert (tmp_path / "a.png").stat().st_size > 5_000
    image = min((world / "seq1/std_cam").iterdir())
    for command in (lambda: show_frame(image, words), lambda: stability([world / "seq1"], words)):
        with pytest.raises(VisionError, match="were computed elsewhere, and images cannot be described so here"):
            command()


def test_the_table_of_stability() -> None:
    assert format_stability(FOUND).splitlines() == [
        "Of 200 frames",
        "                                 other word  a neighbour  farther",
        "JPEG quality 90                       1.5 %        1.0 %    0.5 %",
        "JPEG quality 30                      45.0 %        5.0 %   40.0 %",
        "blur x                                0.0 %        0.0 %    0.0 %",
        "the next frame, for comparison       25.3 %       24.7 %    0.5 %",
    ]
    assert "next frame" not in format_stability(replace(FOUND, step=replace(STEP, frames=0)))


def test_the_table_of_a_sample_has_intervals() -> None:
    drawn = replace(FOUND, of=1000, results=tuple(replace(one, of=1000) for one in RESULTS))
    lines = format_stability(replace(drawn, step=replace(STEP, of=990))).splitlines()
    assert lines[:4] == [
        "Of 200 frames, drawn from 1000",
        f"{'':<32} other word    95 % interval  a neighbour  farther",
        f"{'JPEG quality 90':<32}      1.5 %     0.6 to 3.9 %        1.0 %    0.5 %",
        f"{'JPEG quality 30':<32}     45.0 %   39.0 to 51.2 %        5.0 %   40.0 %",
    ]
    assert {len(line) for line in lines[1:]} == {82}


def test_the_picture_of_stability_names_every_change(tmp_path: Path) -> None:
    plot_stability(FOUND, tmp_path / "a.svg")
    text = drawn_texts(tmp_path / "a.svg")
    assert {"JPEG quality 90", "JPEG quality 30", "blur x", "45.0", "25.3", "0.0"} <= set(text)


def test_what_cannot_be_drawn_is_found_out_before_the_work(
    world: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def work(*args: object, **options: object) -> None:
        raise AssertionError("the images were read first")

    monkeypatch.setattr(words, "describe", work)
    monkeypatch.setattr(word_stability, "word_changes", work)
    dictionary = world / "words.npz"
    commands = (
        lambda out: show_words(dictionary, [world / "seq1"], out),
        lambda out: show_frame(min((world / "seq1/std_cam").iterdir()), dictionary, [world / "seq1"], out),
        lambda out: stability([world / "seq1"], dictionary, out),
    )
    (tmp_path / "file").write_text("")
    for command in commands:
        with pytest.raises(OutputError, match=r"a\.bmp: no kind of picture"):
            command(tmp_path / "a.bmp")
        with pytest.raises(OutputError, match=r"a\.png: cannot be written"):
            command(tmp_path / "file/a.png")
        with monkeypatch.context() as context:
            context.setitem(sys.modules, "matplotlib", None)
            with pytest.raises(MissingExtraError):
                command(tmp_path / "a.png")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
