"""What is known of every word: against plain loops, and in words."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.typing import NDArray

from placerec.errors import SourceError
from placerec.frames import SourceOptions, find_sequences
from placerec.frames.table import FrameTable
from placerec.inspection.words import WordTable, format_words, typical_images, u_matrix, word_table
from placerec.vision import Descriptors, DescriptorSpec, Dictionary, DictionaryOptions
from placerec.vision.options import Units

SPEC = DescriptorSpec(image_size=16)


def sample(n: int, seed: int) -> NDArray[np.float32]:
    rng = np.random.default_rng(seed)
    centres = np.random.default_rng(99).random((6, 384)) * 0.2
    return (centres[rng.integers(6, size=n)] + 0.02 * rng.random((n, 384))).astype(np.float32)


def described(n: int = 60, seed: int = 1, places: tuple[str, ...] = ("b", "a", ""), apart: int = 99) -> Descriptors:
    """Frames of two sequences, `apart` of other names before a name comes again."""
    labels = [places[i * 7 // n % len(places)] for i in range(n)]
    names = [f"f{i % apart}.png" for i in range(n)]
    half = n // 2
    one = FrameTable.of("one", names[:half], places=labels[:half])
    two = FrameTable.of("two", names[half:], places=labels[half:])
    return Descriptors(SPEC, sample(n, seed), FrameTable.concat([one, two]))


def dictionary(units: Units = "live") -> Dictionary:
    return Dictionary.fit(sample(40, 0), spec=SPEC, options=DictionaryOptions(size=7, units=units))


def test_of_joined_descriptors_the_table_is_that_of_the_dictionarys_own() -> None:
    frames = described()
    spec = DescriptorSpec(kind="ranks+gist", image_size=16)
    more = np.random.default_rng(3).random((60, 144), np.float32)
    joined = Descriptors(spec, np.concatenate([more, frames.values], axis=1), frames.table)
    assert word_table(joined, dictionary()).to_json() == word_table(frames, dictionary()).to_json()


@pytest.mark.parametrize("units", ["live", "all"])
def test_the_table_is_that_of_a_plain_loop(units: Units) -> None:
    frames, words = described(), dictionary(units)
    table = word_table(frames, words)
    codes = (frames.values - words.pca.mean) @ words.pca.components.T
    distances = np.linalg.norm(codes[:, None] - words.codebook, axis=2)
    nearest = distances.argmin(axis=1)
    assert table.to_dead == (words.hits[nearest] == 0).sum() > 0
    own = (np.where(words.hits > 0, distances, np.inf) if units == "live" else distances).argmin(axis=1)
    assert table.places == ("a", "b")
    for unit in range(49):
        mine = np.flatnonzero(own == unit)
        assert table.frames[unit] == len(mine)
        assert table.votes[unit].tolist() == [sum(frames.places[i] == place for i in mine) for place in "ab"]
        assert table.typical[unit] == (mine[distances[mine, unit].argmin()] if len(mine) else -1)
        if len(mine):
            assert table.distances[unit] == pytest.approx(distances[mine, unit].min(), rel=1e-4)
        else:
            assert np.isnan(table.distances[unit])
    assert (table.frames[table.hits == 0].sum() == 0) == (units == "live")


@given(st.integers(1, 5), st.integers(1, 4), st.integers(0, 1000))
def test_the_u_matrix_is_the_mean_distance_to_the_neighbours(size: int, width: int, seed: int) -> None:
    codebook = np.random.default_rng(seed).normal(size=(size * size, width)).astype(np.float32)
    found = u_matrix(codebook)
    for row in range(size):
        for column in range(size):
            around = [(row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)]
            inside = [r * size + c for r, c in around if 0 <= r < size and 0 <= c < size]
            lengths = [np.linalg.norm(codebook[row * size + column] - codebook[unit]) for unit in inside]
            assert found[row, column] == pytest.approx(np.mean(lengths) if lengths else 0, rel=1e-5)


def test_json_is_a_row_per_unit_without_nan() -> None:
    table = word_table(described(), dictionary())
    text = json.dumps(table.to_json(), allow_nan=False)
    found: dict[str, Any] = json.loads(text)
    assert [row["word"] for row in found["units"]] == [f"w{unit:02d}" for unit in range(49)]
    assert sum(row["frames"] for row in found["units"]) == found["frames"] == 60
    assert found["labelled"] == sum(place != "" for place in described().places)
    votes = sum(row["share"] * row["frames"] for row in found["units"] if row["place"] and row["frames"] == 1)
    assert votes == sum(1 for row in found["units"] if row["place"] and row["frames"] == 1)
    blank = next(row for row in found["units"] if not row["frames"])
    assert [blank[key] for key in ("place", "share", "typical_frame", "typical_sequence", "distance")] == [None] * 5


def test_the_typical_frames_of_sequences_of_equal_image_names_are_told_apart(tmp_path: Path) -> None:
    frames = described(apart=30)
    for level in range(60):
        path = tmp_path / ("one" if level < 30 else "two") / f"f{level % 30}.png"
        path.parent.mkdir(exist_ok=True)
        cv2.imwrite(str(path), np.full((8, 8), level, np.uint8))
    sequences = find_sequences([tmp_path / "one", tmp_path / "two"], options=SourceOptions("sequences"))
    table = word_table(frames, dictionary())
    levels = {unit: int(image[0, 0]) for unit, image in typical_images(table, sequences).items()}
    assert levels == {unit: frame for unit, frame in enumerate(table.typical.tolist()) if frame >= 0}
    assert {level < 30 for level in levels.values()} == {True, False}
    some = list(levels)[::2]
    assert set(typical_images(table, sequences, some)) == set(some)
    for path in (tmp_path / "one").iterdir():
        path.unlink()
    with pytest.raises(SourceError, match="no such file"):
        typical_images(table, sequences)


def by_hand(**changes: Any) -> WordTable:
    """Four units, the last dead; six labelled frames and one without a label."""
    table = WordTable(
        words=("w0", "w1", "w2", "w3"),
        size=2,
        units="live",
        hits=np.array([3, 2, 1, 0]),
        frames=np.array([4, 3, 0, 0]),
        places=("hall", "kitchen"),
        votes=np.array([[3, 1], [0, 2], [0, 0], [0, 0]]),
        typical=np.array([0, 5, -1, -1]),
        distances=np.array([0.25, 0.5, np.nan, np.nan], np.float32),
        u_matrix=np.array([0.1, 0.2, 0.3, 0.4]),
        to_dead=1,
        is_training=False,
        looked_at=FrameTable.of("run", [f"{i}.png" for i in range(7)]),
    )
    return replace(table, **changes)


def test_the_text_tells_what_matters() -> None:
    assert format_words(by_hand()).splitlines() == [
        "4 units, 3 of them hit in training; 2 are words of 7 frames in 1 sequence.",
        "1 unit that no training frame hit: 14.3 % of the frames are nearest to one, and get the word of the nearest "
        "live unit instead.",
        "83.3 % of the 6 labelled frames have the place that their word mostly belongs to (counted on these very "
        "frames).",
        "",
        "place      frames   words   its frames with these words",
        "hall            3       1                       100.0 %",
        "kitchen         3       1                        66.7 %",
    ]


def test_the_text_of_other_tables() -> None:
    text = format_words(by_hand(units="all"))
    assert "14.3 % of the frames are nearest to one and have it as word, which no language model has seen." in text
    assert "hit: none of these frames is nearest to one.\n" in format_words(by_hand(to_dead=0))
    trained = format_words(by_hand(is_training=True, to_dead=0))
    assert "hit: none of these frames is nearest to one, for they trained the map.\n" in trained
    whole = format_words(by_hand(hits=np.array([1, 1, 1, 1])))
    assert whole.startswith("4 units, all of them hit in training; 2 are words of 7 frames in 1 sequence.\n83.3 %")
    bare = by_hand(places=(), votes=np.zeros((4, 0), np.int64))
    assert format_words(bare).endswith("No frame has a label: it is not known which place a word belongs to.")
    assert bare.place.tolist() == [-1] * 4
    assert np.isnan(bare.share).all()


def test_frames_that_trained_the_map_are_recognised() -> None:
    trained = replace(described(40), values=sample(40, 0))
    table = word_table(trained, dictionary())
    assert table.is_training
    assert table.to_dead == 0
    assert table.frames.tolist() == table.hits.tolist()
    assert not word_table(described(), dictionary()).is_training
