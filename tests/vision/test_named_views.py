"""Views by name: several descriptors of a frame in one row, and dictionaries of some of its columns."""

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from placerec.errors import VisionError
from placerec.frames.table import FrameTable, Labels, Texts
from placerec.vision import (
    DEFAULT_KIND,
    Descriptors,
    DescriptorSpec,
    Dictionary,
    DictionarySet,
    DictionarySetOptions,
    descriptor,
)
from placerec.vision.options import View
from placerec.vision.pca import fit_pca, moments, project
from placerec.vision.views import fit_blocks, half_whitened

SPEC = DescriptorSpec(kind=DEFAULT_KIND, image_size=32)
PLACES = ["hall", "office"] * 30


def rows(spec: DescriptorSpec = SPEC, n: int = 60, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.array([descriptor(rng.integers(0, 256, (32, 32)).astype(np.uint8), spec) for _ in range(n)])


@pytest.fixture(scope="module")
def values() -> np.ndarray:
    return rows()


def fit(values: np.ndarray, *views: str, spec: DescriptorSpec = SPEC) -> DictionarySet:
    options = DictionarySetOptions(views, (2, 3), components=8)
    return DictionarySet.fit(values, spec=spec, places=PLACES, options=options)


def test_every_view_is_told_by_its_name(values: np.ndarray, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, logger="placerec.vision.views"):
        fit(values)
    assert [message.split(":", 2)[:2] for message in caplog.messages if message.startswith("view ")] == [
        ["view gist", "pn"],
        ["view lbp", "pn"],
        ["view ranks", "pn"],
    ]


def test_a_joined_descriptor_is_its_parts_one_behind_the_other(values: np.ndarray) -> None:
    assert SPEC.length == values.shape[1] == 384 + 236 + 144
    assert DescriptorSpec(**SPEC.as_dict()) == SPEC
    for kind in SPEC.kinds:
        part = SPEC.part(kind)
        np.testing.assert_array_equal(values[:, SPEC.columns_of(part)], rows(part))
    turned = SPEC.part("ranks", "gist")
    np.testing.assert_array_equal(values[:, SPEC.columns_of(turned)], rows(turned))
    assert SPEC.columns_of(SPEC) == slice(None)


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("gist+gist", "the descriptor 'gist\\+gist' names gist twice"),
        ("gist+npy", "npy descriptors are computed elsewhere, and cannot be joined"),
        ("gist+", "no descriptor is called ''; choose one of gist, lbp, ranks"),
    ],
)
def test_what_cannot_be_joined(kind: str, message: str) -> None:
    with pytest.raises(VisionError, match=message):
        DescriptorSpec(kind=kind)
    with pytest.raises(VisionError, match="gist descriptors are no part of gist\\+lbp\\+ranks descriptors with these"):
        SPEC.columns_of(DescriptorSpec())


def test_the_default_views_are_gist_as_it_is_and_every_kind_normalised(values: np.ndarray) -> None:
    made = fit(values)
    assert [str(view) for view in View.default(SPEC)] == ["gist", "gist:pn", "lbp:pn", "ranks:pn"]
    assert made.names == ("", "gist3", "gistpn2", "gistpn3", "lbppn2", "lbppn3", "rankspn2", "rankspn3")
    assert made.spec == SPEC
    assert made.options.views == ("gist", "gist:pn", "lbp:pn", "ranks:pn")
    assert made.dictionaries[4].spec == SPEC.part("lbp")


def test_a_dictionary_of_some_columns_is_that_of_its_descriptors_alone(values: np.ndarray) -> None:
    made, gist = fit(values), SPEC.part("gist")
    alone = fit(values[:, SPEC.columns_of(gist)], "gist", "gist:pn", spec=gist)
    assert alone.names == ("", "plain3", "pn2", "pn3")
    assert [one.fingerprint for one in made.dictionaries[:4]] == [one.fingerprint for one in alone.dictionaries]
    for (units, far), (own, distance) in zip(
        made.words(values), alone.words(values[:, SPEC.columns_of(gist)]), strict=False
    ):
        np.testing.assert_array_equal(units, own)
        np.testing.assert_array_equal(far, distance)


def test_one_frame_and_many_get_the_words_of_other_descriptors_in_any_order(values: np.ndarray) -> None:
    made = fit(values, "ranks:pn", "gist", "lbp+gist:pn")
    assert made.names == ("", "rankspn3", "gist2", "gist3", "lbpgistpn2", "lbpgistpn3")
    assert made.spec.kind == "ranks+gist+lbp"
    table = FrameTable(Texts(map(str, range(60))), Labels(["run"] * 60), np.arange(60.0), Labels(PLACES))
    every = made.words(Descriptors(SPEC, values, table))
    turned = made.words(values[:, SPEC.columns_of(made.spec)])
    for (units, far), (other, distance) in zip(every, turned, strict=True):
        np.testing.assert_array_equal(units, other)
        np.testing.assert_array_equal(far, distance)
    for row in range(3):
        alone = made.words(values[row : row + 1, SPEC.columns_of(made.spec)])
        assert [int(units[0]) for units, _ in alone] == [int(units[row]) for units, _ in every]


def test_the_file_keeps_views_and_descriptors(values: np.ndarray, tmp_path: Path) -> None:
    made = fit(values, "gist", "gist+ranks:pn")
    made.save(tmp_path / "words.npz")
    read = DictionarySet.load(tmp_path / "words.npz")
    assert (read.fingerprint, read.options, read.spec) == (made.fingerprint, made.options, made.spec)
    again = fit(values, "gist", "gist+ranks:pn")
    again.save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "words.npz").read_bytes()
    with pytest.raises(VisionError, match=r"words\.npz: holds 4 dictionaries; read it with DictionarySet\.load"):
        Dictionary.load(tmp_path / "words.npz")


def test_blocks_weigh_alike_however_large_their_values(values: np.ndarray) -> None:
    many = np.concatenate([values[:, :40], 1000 * values[:, 400:440]], axis=1)
    found = fit_blocks(moments(many), (40, 40), 6)
    large = fit_blocks(moments(np.concatenate([values[:, :40], values[:, 400:440]], axis=1)), (40, 40), 6)
    np.testing.assert_allclose(found.variances, large.variances, rtol=1e-4)
    assert found.explained == pytest.approx(large.explained, abs=1e-4)


def test_views_that_cannot_be(values: np.ndarray) -> None:
    with pytest.raises(VisionError, match="no view is called 'lda'; choose some of plain, pn, half, gist, lbp, ranks"):
        DictionarySetOptions(("lda",))
    with pytest.raises(VisionError, match="'gist:lda': no projection is called 'lda'; choose one of plain, pn, half"):
        DictionarySetOptions(("gist:lda",))
    with pytest.raises(VisionError, match="there are no centrist descriptors beside those of gist\\+lbp\\+ranks"):
        fit(values, "centrist")
    with pytest.raises(VisionError, match="the view plain of gist descriptors is named twice"):
        fit(values[:, :384], "gist", "plain", spec=SPEC.part("gist"))


def test_without_labels_the_views_are_half_whitened(values: np.ndarray, caplog: pytest.LogCaptureFixture) -> None:
    options = DictionarySetOptions((), (2,), components=8)
    made = DictionarySet.fit(values, spec=SPEC, options=options)
    assert made.names == ("", "gisthalf2", "lbphalf2", "rankshalf2")
    assert made.options.views == ("gist", "gist:half", "lbp:half", "ranks:half")
    assert "no two places are labelled: views are half whitened, not normalised by places" in caplog.text
    named = DictionarySet.fit(values, spec=SPEC, options=replace(options, views=("gist", "lbp:pn")))
    assert named.names == ("",)
    assert "the view lbp:pn is left out: it needs frames of two places" in caplog.text


def test_half_whitened_coordinates_have_the_roots_of_the_variances(values: np.ndarray) -> None:
    gist = values[:, :384]
    plain = fit_pca(moments(gist), 8)
    half = half_whitened(plain)
    codes, halved = project(gist, plain), project(gist, half)
    np.testing.assert_allclose(halved, codes / plain.variances**0.25, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(halved.var(axis=0, ddof=1), half.variances, rtol=1e-3)
