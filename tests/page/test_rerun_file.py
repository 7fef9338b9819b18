"""A recording for the viewer Rerun, read back: what is where, and that nothing else needs rerun-sdk."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from helpers.decoded_images import write_decoded_images
from helpers.typed_commands import done, fails, misused

from placerec.hohmm import read_beliefs


def rows(path: Path) -> dict[str, list[dict[str, Any]]]:
    """The rows of each entity of a recording, in order, their columns by the last part of the name."""
    chunk = pytest.importorskip("rerun.chunk", reason="needs rerun-sdk, and one that reads recordings")
    found: dict[str, list[dict[str, Any]]] = {}
    for one in chunk.RrdReader(path).stream().to_chunks():
        if not one.is_static:
            found.setdefault(one.entity_path, []).extend(one.to_record_batch().to_pylist())
    return {name: sorted(own, key=lambda row: row["frame"]) for name, own in found.items()}


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("rerun", reason="needs rerun-sdk: pip install '.[rerun]'")
    root = write_decoded_images(tmp_path_factory.mktemp("world"))
    with_words = ("-w", root / "words.npz", "-o", root / "b", "-q", "--rerun", root / "a.rrd")
    done("decode", root / "runs", "-m", root / "model", *with_words)
    return root


def test_frames_beliefs_words_and_places_are_series(world: Path) -> None:
    found = rows(world / "a.rrd")
    beliefs = read_beliefs(world / "b/run1.tsv")
    names = {f"/run{k}/{name}" for k in (1, 2) for name in ("frame", "word", "true", "decided")}
    assert names | {f"/run{k}/belief/{place}" for k in (1, 2) for place in beliefs.places} == {*found}
    hall = [row["Scalars:scalars"][0] for row in found["/run1/belief/hall"]]
    assert hall == pytest.approx(beliefs.belief[:, beliefs.places.index("hall")])
    assert [row["TextLog:text"][0] for row in found["/run1/word"]] == [*beliefs.words]
    # Where the place changes.
    assert [(row["frame"], row["TextLog:text"][0]) for row in found["/run1/true"]] == [(0, "hall"), (6, "kitchen")]
    assert [row["time"].total_seconds() for row in found["/run1/true"]] == [0, 6]
    pictures = found["/run1/frame"]
    assert [row["frame"] for row in pictures] == [*range(12)]
    assert all(bytes(row["EncodedImage:blob"][0])[:3] == b"\xff\xd8\xff" for row in pictures)


def test_tokens_have_no_pictures(world: Path, tmp_path: Path) -> None:
    done("decode", world / "tokens", "-m", world / "model", "-o", tmp_path / "b", "-q", "--rerun", tmp_path / "a.rrd")
    found = rows(tmp_path / "a.rrd")
    assert not [name for name in found if name.endswith("/frame")]
    assert len(found["/run2/belief/hall"]) == 12
    assert np.isfinite([row["Scalars:scalars"][0] for row in found["/run2/belief/hall"]]).all()


def test_what_cannot_be_read_twice_is_refused(tmp_path: Path) -> None:
    for tokens in (["-"], ["camera:0"], ["drive.mp4", "--live"]):
        misused("--rerun is for whole recordings", "decode", *tokens, "-m", "model", "--rerun", tmp_path / "a.rrd")


def test_without_rerun_it_is_said_before_any_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    fails("--rerun needs the package rerun-sdk", "decode", "t.tsv", "-m", "model", "--rerun", tmp_path / "a.rrd")
