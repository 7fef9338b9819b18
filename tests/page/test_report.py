"""The report as a file: what is in it, how drives and systems are found, and that no name becomes HTML."""

import base64
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.decoded_images import write_decoded_images
from helpers.small_world import PLACES, beliefs_of, write_images, write_world
from helpers.typed_commands import done, misused

from placerec.errors import EvaluationError, SourceError
from placerec.hohmm import Beliefs, read_beliefs, write_beliefs
from placerec.page.drives import group_files, json_in_page, pack_drive, shares
from placerec.page.pictures import chosen_frames
from placerec.page.report import report, report_page

NASTY = "<script>alert(1)</script>"


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_decoded_images(tmp_path_factory.mktemp("world"))


def data_in(page: Path | str) -> dict[str, Any]:
    text = page if isinstance(page, str) else page.read_text(encoding="utf-8")
    found: dict[str, Any] = json.loads(re.findall(r'<script type="application/json" id="data">(.*?)</script>', text)[0])
    return found


def spread(runs: list[int]) -> list[int]:
    return [value for value, count in zip(runs[::2], runs[1::2], strict=True) for _ in range(count)]


def test_everything_is_in_the_file(world: Path, tmp_path: Path) -> None:
    out = tmp_path / "report.html"
    done(
        "report",
        world / "beliefs",
        "--frames",
        world / "runs/run1",
        world / "runs/run2",
        "-w",
        world / "words.npz",
        "-o",
        out,
    )
    data = data_in(out)
    assert [drive["name"] for drive in data["drives"]] == ["run1", "run2"]
    beliefs = read_beliefs(world / "beliefs/run1.tsv")
    drive = data["drives"][0]
    (system,) = drive["systems"]
    assert drive["frames"] == [*beliefs.frames]
    assert np.frombuffer(base64.b64decode(drive["times"]), "<f8").tolist() == beliefs.times.tolist()
    for column, names in ((drive["truth"], beliefs.truth), (system["best"], beliefs.best)):
        assert [data["places"][place] for place in spread(column)] == [*names]
    assert [system["vocabulary"][word] for word in spread(system["words"])] == [*beliefs.words]
    packed = np.frombuffer(base64.b64decode(system["belief"]), "<u2").reshape(len(beliefs), -1) / 65535
    assert packed == pytest.approx(beliefs.belief, abs=1e-4)
    at, pictures = drive["pictures"]
    assert at == [*range(12)]
    assert all(one.startswith("data:image/webp;base64,") for one in pictures)
    # Of every frame what decided, with the words of all dictionaries; and what each word looks like.
    assert [*system["reasons"]] == [str(frame) for frame in range(12)]
    first = system["reasons"]["3"]
    assert len(first["said"]) >= 1
    assert all(word in data["tiles"] for word, *_ in first["said"])
    assert len(first["before"]) == len(system["columns"]) == 2


def test_it_asks_nothing_of_the_network_and_runs_its_own_script_alone(world: Path, tmp_path: Path) -> None:
    report([world / "beliefs"], tmp_path / "r.html", frames=[world / "runs"])
    text = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert not re.search(r"https?://", text.replace("http://www.w3.org/", ""))
    policy = re.findall(r'Content-Security-Policy" content="([^"]*)"', text)[0]
    assert policy.startswith("default-src 'none'; img-src data:;")
    assert re.search(r"script-src 'sha256-[A-Za-z0-9+/=]{44}'$", policy)
    assert text.count("<script") == 2
    for word in ("fetch(", "XMLHttpRequest", "innerHTML", "import "):
        assert word not in text
    assert "@media print" in text
    assert "prefers-color-scheme" in text


def test_the_same_beliefs_give_the_same_bytes(world: Path, tmp_path: Path) -> None:
    for name in "ab":
        report([world / "beliefs"], tmp_path / f"{name}.html", frames=[world / "runs"], words=world / "words.npz")
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_names_are_text(tmp_path: Path) -> None:
    places = (NASTY, "b&quot;'\"", "</script><img src=x>")
    beliefs = beliefs_of("x", places, [places[0]] * 3, [places[1]] * 3)
    named = [(tmp_path / f"{NASTY[:8]}.tsv", replace(beliefs, stream=beliefs.stream.renamed("</script><b>")))]
    page = report_page("t<i>", group_files(named, {}))
    assert not re.search(r"<script>alert|<img src=x|<b>|<i>", page)
    assert data_in(page)["places"] == [*places]
    assert data_in(page)["drives"][0]["name"] == "</script><b>"


def test_no_json_ends_the_element_that_it_is_in() -> None:
    value = ["</script>", "<!--", "&amp;", "\u2028", "ü"]
    text = json_in_page(value)
    assert not re.search("[<>&\u2028]", text)
    assert json.loads(text) == value


def test_beliefs_of_the_same_frames_stand_beside_each_other(world: Path, tmp_path: Path) -> None:
    drives = report([world / "beliefs", world / "others"], tmp_path / "r.html")
    assert [(drive.name, [*drive.beliefs]) for drive in drives] == [
        (name, ["beliefs", "others"]) for name in ("run1", "run2")
    ]
    text = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert data_in(text)["systems"] == ["beliefs", "others"]
    assert "All beliefs of this page." in text
    assert re.search(r"labelled frames right by beliefs; always (hall|kitchen) would be 50.0 %", text)


def test_other_frames_of_the_same_name_are_another_drive(tmp_path: Path) -> None:
    one, other = (beliefs_of("run", PLACES, ["hall"] * n, ["hall"] * n) for n in (3, 4))
    found = group_files([(tmp_path / "a/run.tsv", one), (tmp_path / "b/run.tsv", other)], {})
    assert [(drive.name, [*drive.beliefs]) for drive in found] == [("a-run", [""]), ("b-run", [""])]
    with pytest.raises(EvaluationError, match="leave one of them out"):
        group_files([(tmp_path / "a/run.tsv", one), (tmp_path / "a/run.tsv.gz", one)], {})


def test_a_drive_without_labels_has_no_number(tmp_path: Path) -> None:
    beliefs = beliefs_of("run", PLACES, [""] * 4, ["hall"] * 4)
    page = report_page("r", group_files([(tmp_path / "run.tsv", beliefs)], {}))
    assert "none has a label" in page
    assert spread(data_in(page)["drives"][0]["systems"][0]["judged"]) == [-1] * 4


def test_frames_are_the_axis_where_times_are_none() -> None:
    for times in ([7.0] * 4, [1.0, 2.0, 1.5, 3.0], [1.0, np.nan, 2.0, 3.0]):
        beliefs = beliefs_of("run", PLACES, [""] * 4, ["hall"] * 4, times=np.array(times))
        (drive,) = group_files([(Path("run.tsv"), beliefs)], {})
        assert pack_drive(drive, PLACES, [""])["times"] is None


def test_unknown_is_a_place_of_its_own() -> None:
    made = beliefs_of("run", PLACES, ["hall", "", "attic"], ["hall", "hall", "unknown"])
    beliefs = replace(made, unknown=np.array([0.1, 0.2, 0.9]))
    places = (*PLACES, "attic", "unknown")
    found = shares(beliefs, places)
    assert found.sum(axis=1) == pytest.approx(1)
    assert found[:, 4].tolist() == [0.1, 0.2, 0.9]
    (drive,) = group_files([(Path("run.tsv"), beliefs)], {})
    (system,) = pack_drive(drive, places, [""])["systems"]
    # A frame of a place without a column is right if it is unknown.
    assert spread(system["judged"]) == [1, -1, 1]


def test_images_must_be_those_of_the_beliefs(world: Path, tmp_path: Path) -> None:
    write_images(tmp_path / "run9", 9, frames=4)
    with pytest.raises(SourceError, match=r"run9: has the frames of none of the drives \(run1, run2\)"):
        report([world / "beliefs"], tmp_path / "r.html", frames=[tmp_path / "run9"])
    write_images(tmp_path / "run1", 9, frames=4)
    with pytest.raises(SourceError, match=r"run1: has no frame t1004\.0\S*png, of which run1 has beliefs"):
        report([world / "beliefs"], tmp_path / "r.html", frames=[tmp_path / "run1"])
    assert not (tmp_path / "r.html").exists()


def test_images_of_another_name_are_known_by_their_frames(world: Path, tmp_path: Path) -> None:
    write_images(tmp_path / "renamed", 0)
    write_beliefs(tmp_path / "alone" / "today.tsv", read_beliefs(world / "beliefs/run1.tsv"))
    report([tmp_path / "alone"], tmp_path / "r.html", frames=[tmp_path / "renamed"])
    assert len(data_in(tmp_path / "r.html")["drives"][0]["pictures"][0]) == 12


@pytest.mark.parametrize(("frames", "wanted", "most"), [(5, [2], 9), (100, [3, 50, 99], 10), (100, range(100), 8)])
def test_of_many_frames_the_wanted_and_evenly_many_others_are_shown(frames: int, wanted: Any, most: int) -> None:
    found = chosen_frames(frames, wanted, most)
    assert found == sorted({*found})
    assert len(found) == min(frames, most)
    if len([*wanted]) < most:
        assert {*wanted} <= {*found}


def test_a_long_drive_stays_small(tmp_path: Path) -> None:
    n = 20_000
    truth = [PLACES[i // 500 % 3] for i in range(n)]
    belief = np.random.default_rng(0).dirichlet(np.ones(3), n)
    made: Beliefs = beliefs_of("long", PLACES, truth, truth, belief, np.arange(n) / 10)
    page = report_page("long", group_files([(tmp_path / "long.tsv", made)], {}))
    assert len(page) < 1_500_000


def test_evaluate_writes_the_page_too(world: Path, tmp_path: Path) -> None:
    out = tmp_path / "e.html"
    told = done("evaluate", world / "beliefs", "--html", out).stdout
    assert told.startswith("frames ")
    assert len(data_in(out)["drives"]) == 2
    misused("standard input is gone then", "evaluate", "-", "--html", out)


def test_mistakes_of_usage_are_told(world: Path, tmp_path: Path) -> None:
    beliefs, out = world / "beliefs", tmp_path / "r.html"
    misused("Option '--frames' needs a source behind it", "report", beliefs, "--frames", "-o", out)
    misused("none without --frames", "report", beliefs, "-w", world / "words.npz", "-o", out)


def test_without_matplotlib_only_the_still_picture_is_missing(world: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    (one,) = group_files([(world / "beliefs/run1.tsv", read_beliefs(world / "beliefs/run1.tsv"))], {})
    assert 'class="still"' in report_page("r", [one])
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert 'class="still"' not in report_page("r", [one])


def test_a_world_without_images_has_a_report(tmp_path: Path) -> None:
    root = write_world(tmp_path)
    done("decode", root / "tokens", "-m", root / "model", "-o", root / "beliefs", "--unknown", "--explain", "-q")
    done("report", root / "beliefs", "-o", root / "r.html")
    data = data_in(root / "r.html")
    assert data["places"][-1] == "unknown"
    assert len(data["drives"][0]["systems"][0]["reasons"]["0"]["unknown"]) == 3
