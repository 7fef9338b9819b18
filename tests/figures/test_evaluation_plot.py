"""Pictures: written whole, the same bytes for the same numbers, and honest about what they leave out."""

import logging
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.pictures import drawn_texts
from helpers.small_world import beliefs_of

import placerec
from placerec.errors import MissingExtraError, OutputError
from placerec.evaluation.metrics import evaluate
from placerec.figures.canvas import figure_file, place_colours
from placerec.figures.evaluation import chosen, confusion_panel, plot_evaluation
from placerec.figures.strip import axis_of, belief_strip
from placerec.hohmm.beliefs import Beliefs, format_beliefs

matplotlib = pytest.importorskip("matplotlib")

PLACES = ("corridor", "kitchen", "a$b$c")


def recording(name: str, frames: int = 60, wrong: int = 5, places: tuple[str, ...] = PLACES) -> Beliefs:
    truth = np.arange(frames) * 6 // max(frames, 1) % len(places)
    best = truth.copy()
    best[:wrong] = 1
    belief = np.full((frames, len(places)), 0.1 / (len(places) - 1))
    belief[np.arange(frames), best] = 0.9
    labels = [places[place] for place in truth]
    labels[frames // 2 : frames // 2 + 4] = [""] * min(4, frames)
    decided = [places[place] for place in best]
    return beliefs_of(name, places, labels[:frames], decided, belief, np.arange(frames) / 5)


MAGIC = {"png": b"\x89PNG\r\n\x1a\n", "svg": b"<?xml", "pdf": b"%PDF"}


@pytest.mark.parametrize(("suffix", "magic"), MAGIC.items())
def test_the_same_numbers_give_the_same_bytes(tmp_path: Path, suffix: str, magic: bytes) -> None:
    beliefs = [recording("seq1"), recording("seq2", 40)]
    for name in ("a", "b"):
        plot_evaluation(beliefs, evaluate(beliefs), tmp_path / f"{name}.{suffix}")
    first = (tmp_path / f"a.{suffix}").read_bytes()
    assert first.startswith(magic)
    assert first == (tmp_path / f"b.{suffix}").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"a.{suffix}", f"b.{suffix}"]
    assert matplotlib.__version__.encode() not in first


def test_the_users_matplotlib_settings_change_nothing_and_stay(tmp_path: Path) -> None:
    beliefs = [recording("seq1")]
    plot_evaluation(beliefs, evaluate(beliefs), tmp_path / "a.png")
    with matplotlib.rc_context({"font.size": 25, "text.color": "red", "xtick.color": "red"}):
        plot_evaluation(beliefs, evaluate(beliefs), tmp_path / "b.png")
        assert matplotlib.rcParams["font.size"] == 25
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_the_picture_says_what_it_shows(tmp_path: Path) -> None:
    # 60 frames, 20 of each place; 4 of the corridor have no label, 5 others of it are decided as kitchen.
    beliefs = [recording("seq1")]
    result = evaluate(beliefs)
    plot_evaluation(beliefs, result, tmp_path / "a.svg")
    text = "\n".join(drawn_texts(tmp_path / "a.svg"))
    assert f"Accuracy {100 * 51 / 56:.1f} %   (majority class, always “kitchen”: {100 * 20 / 56:.1f} %)" in text
    for needed in ("seq1   91.1 % right", "a$b$c", "true place", "decided place", "belief", "wrong", "no label"):
        assert needed in text, needed
    assert "4 without a label left out" in text
    assert "sequences:" not in text


def test_what_is_unknown_is_drawn_and_judged(tmp_path: Path) -> None:
    made = recording("seq1")
    # The kitchen is a place without a column, and is noticed; its column goes to another place.
    places = ("corridor", "garage", "a$b$c")
    new = np.array([label == "kitchen" for label in made.truth])
    best = tuple("unknown" if is_new else place for place, is_new in zip(made.best, new, strict=True))
    best = tuple("garage" if place == "kitchen" else place for place in best)
    beliefs = [replace(made, places=places, best=best, unknown=np.where(new, 0.75, 0.0))]
    result = evaluate(beliefs)
    plot_evaluation(beliefs, result, tmp_path / "a.svg")
    text = "\n".join(drawn_texts(tmp_path / "a.svg"))
    for needed in ("New places: AUROC 1.000", "Reliability: ECE", "unknown", "seq1   91.1 % right"):
        assert needed in text, needed
    with figure_file(tmp_path / "a.png", 8, 3) as figure:
        axes = figure.subplots()
        belief_strip(axes, beliefs[0], result)
        belief = np.asarray(axes.images[1].get_array())
        wrong = np.asarray(axes.images[3].get_array())[0]
    # Three quarters of a frame in the kitchen are grey, from above.
    grey = (belief[:, 12] == place_colours(["unknown"])[0]).all(axis=1)
    assert grey.tolist() == [False] * 30 + [True] * 90
    assert (wrong == 0).all(axis=1).nonzero()[0].tolist() == [0, 1, 2, 3, 4]


def test_without_unknown_the_gain_of_withholding_is_drawn(tmp_path: Path) -> None:
    beliefs = [recording("seq1"), recording("seq2")]
    result = evaluate(beliefs)
    plot_evaluation(beliefs, result, tmp_path / "a.svg")
    assert f"Only the surest answered: area {result.risk_coverage.area:.3f}" in "\n".join(
        drawn_texts(tmp_path / "a.svg")
    )


def test_of_many_sequences_the_best_and_the_worst_are_drawn(tmp_path: Path) -> None:
    beliefs = [recording(f"seq{number}", wrong=(number * 7) % 23 % 10) for number in range(23)]
    beliefs.append(recording("hopeless", wrong=40))
    result = evaluate(beliefs)
    shown = chosen(beliefs, result)
    assert len(shown) == len({item.name for item in shown}) == 20
    assert [item.name for item in shown] == [item.name for item in beliefs if item in shown]
    accuracies = [result.sequences[item.name].accuracy or 0 for item in beliefs]
    drawn = [result.sequences[item.name].accuracy or 0 for item in shown]
    assert (min(drawn), max(drawn)) == (min(accuracies), max(accuracies))
    plot_evaluation(beliefs, result, tmp_path / "a.svg")
    assert "20 of 24 sequences: the best, the worst and evenly many between by accuracy." in "\n".join(
        drawn_texts(tmp_path / "a.svg")
    )


def test_sequences_without_a_label_give_way_to_others() -> None:
    beliefs = [recording(f"seq{number}") for number in range(22)]
    beliefs[3] = beliefs_of("seq3", PLACES, [""] * 60, beliefs[3].best)
    result = evaluate(beliefs)
    assert beliefs[3] not in chosen(beliefs, result)
    assert beliefs[3] in chosen(beliefs[:4], result)


def test_a_long_recording_is_thinned_and_says_so(tmp_path: Path) -> None:
    beliefs = [recording("long", 20_000)]
    plot_evaluation(beliefs, evaluate(beliefs), tmp_path / "a.svg")
    assert "1500 of 20000 frames are drawn" in "\n".join(drawn_texts(tmp_path / "a.svg"))
    assert (tmp_path / "a.svg").stat().st_size < 500_000


def test_odd_recordings_are_drawn(tmp_path: Path) -> None:
    many = tuple(f"place {number}" for number in range(45))
    beliefs = [recording("empty", 0, 0), recording("one", 1, 0), recording("many", 90, 3, many)]
    plot_evaluation(beliefs, evaluate([*beliefs]), tmp_path / "a.svg")
    text = "\n".join(drawn_texts(tmp_path / "a.svg"))
    assert "no frames" in text
    assert "empty   no frame has a label" in text


def test_a_missing_letter_is_logged_not_warned(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    beliefs = [recording("seq1", places=("廊下", "kitchen"))]
    with caplog.at_level(logging.WARNING, "placerec"):
        plot_evaluation(beliefs, evaluate(beliefs), tmp_path / "a.png")
    messages = [record.getMessage() for record in caplog.records]
    assert messages
    assert all("Glyph" in message for message in messages)
    assert len(messages) == len(set(messages))


def test_panels_draw_on_a_figure_of_ones_own(tmp_path: Path) -> None:
    beliefs = recording("seq1")
    with figure_file(tmp_path / "a.png", 8, 3) as figure:
        left, right = figure.subplots(1, 2)
        belief_strip(left, beliefs, evaluate([beliefs]))
        confusion_panel(right, evaluate([beliefs]))
        # True places, beliefs, decided places, and what is wrong.
        assert len(left.images) == 4
        wrong = np.asarray(left.images[3].get_array())[0]
        assert (wrong == 0).all(axis=1).nonzero()[0].tolist() == [0, 1, 2, 3, 4]
        belief = np.asarray(left.images[1].get_array())
        # Frame 30 is believed to be in the corridor with 0.9: nine tenths of the height from below.
        corridor = (belief[:, 30] == place_colours(PLACES)[0]).all(axis=1)
        assert corridor.tolist() == [True] * 108 + [False] * 12
        assert np.asarray(right.images[0].get_array()).sum(axis=1) == pytest.approx(1)
    assert (tmp_path / "a.png").exists()


def test_nothing_is_left_when_drawing_fails(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), figure_file(tmp_path / "a.png", 2, 2):
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_colours_of_36_places_differ() -> None:
    colours = place_colours([str(number) for number in range(36)])
    assert len({tuple(colour) for colour in colours.round(3).tolist()}) == 36
    assert ((colours >= 0) & (colours <= 1)).all()


def test_another_suffix_is_refused(tmp_path: Path) -> None:
    beliefs = [recording("seq1")]
    with pytest.raises(OutputError) as raised:
        plot_evaluation(beliefs, evaluate(beliefs), tmp_path / "a.bmp")
    assert str(raised.value) == f"{tmp_path / 'a.bmp'}: no kind of picture; let its name end in .png, .svg or .pdf"


def test_without_matplotlib_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    beliefs = [recording("seq1")]
    with pytest.raises(MissingExtraError) as raised:
        plot_evaluation(beliefs, evaluate(beliefs), tmp_path / "a.png")
    assert str(raised.value) == (
        f"a picture needs the package matplotlib, which is not installed: {sys.executable} -m pip install matplotlib"
    )
    assert list(tmp_path.iterdir()) == []


def test_a_home_that_cannot_be_written_to_is_nothing_to_complain_of(tmp_path: Path) -> None:
    """matplotlib would, in four lines, where it is imported first: in a process of its own."""
    pytest.importorskip("matplotlib")
    (tmp_path / "home").touch()
    (tmp_path / "beliefs.tsv").write_text(format_beliefs(recording("seq1")), encoding="utf-8")
    command = [sys.executable, "-m", "placerec", "evaluate", "beliefs.tsv", "--plot", "a.png"]
    for name in ("MPLCONFIGDIR", "XDG_CACHE_HOME", "XDG_CONFIG_HOME"):
        if name in os.environ:
            pytest.skip(f"{name} says where matplotlib writes")
    home = {**os.environ, "HOME": str(tmp_path / "home"), "PYTHONPATH": str(Path(placerec.__file__).parents[1])}
    done = subprocess.run(command, cwd=tmp_path, env=home, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "a.png").stat().st_size > 1000


def test_strips_are_drawn_over_time_on_one_scale(tmp_path: Path) -> None:
    beliefs = [recording("seq1"), recording("seq2", 20)]
    axis = axis_of(beliefs)
    assert axis.seconds == 1
    assert axis.end == pytest.approx(12)
    plot_evaluation(beliefs, evaluate(beliefs), tmp_path / "a.svg")
    assert "time from the first frame, s" in drawn_texts(tmp_path / "a.svg")
    with figure_file(tmp_path / "a.png", 8, 3) as figure:
        axes = figure.subplots()
        belief_strip(axes, beliefs[1], evaluate(beliefs), axis)
        assert axes.get_xlim() == (0, axis.end)
        assert [image.get_extent()[1] for image in axes.images] == pytest.approx([4.0] * 4)


def test_a_drive_of_hours_is_told_in_hours_and_frames_without_times_are_counted() -> None:
    made = recording("seq1")
    slow = replace(made, stream=replace(made.stream, table=replace(made.stream.table, times=made.times * 900)))
    assert axis_of([slow]).label == "time from the first frame, h"
    timeless = replace(made, stream=replace(made.stream, table=replace(made.stream.table, times=made.times * np.nan)))
    assert axis_of([made, timeless]) == axis_of([timeless])
    assert (axis_of([timeless]).label, axis_of([timeless]).end) == ("frame", 60)


def test_while_no_frame_comes_nothing_is_drawn(tmp_path: Path) -> None:
    made = recording("seq1")
    times = made.times + 100 * (np.arange(60) >= 30)
    late = replace(made, stream=replace(made.stream, table=replace(made.stream.table, times=times)))
    with figure_file(tmp_path / "a.png", 8, 3) as figure:
        axes = figure.subplots()
        belief_strip(axes, late, evaluate([late]))
        true = np.asarray(axes.images[0].get_array())[0]
    # One column more than frames: it is empty, and lies after frame 29.
    assert len(true) == 61
    assert (true[30] == true.max()).all()
