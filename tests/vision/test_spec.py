"""Specifications: what each kind has, what it has not, and the way into files and back."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from placerec.cli.shared import descriptors
from placerec.errors import VisionError
from placerec.vision import KINDS, DescriptorSpec, descriptor
from placerec.vision.network import Network

SPECS = [
    DescriptorSpec(),
    DescriptorSpec("classic", 64, "crop"),
    DescriptorSpec(kind="centrist", image_size=96),
    DescriptorSpec(kind="npy", columns=768),
    DescriptorSpec(kind="colour"),
    DescriptorSpec(kind="centrist+onnx", image_size=96, network=Network("ab" * 32, 48, "seen", fit="crop")),
]


@pytest.mark.parametrize("spec", SPECS, ids=str)
def test_into_a_file_and_back(spec: DescriptorSpec) -> None:
    assert DescriptorSpec(**spec.as_dict()) == spec


def test_a_file_tells_what_the_kind_has_and_no_more() -> None:
    assert [spec.as_dict() for spec in SPECS[1:5]] == [
        {"kind": "gist", "variant": "classic", "image_size": 64, "fit": "crop"},
        {"kind": "centrist", "image_size": 96, "fit": "squash"},
        {"kind": "npy", "columns": 768},
        {"kind": "colour"},
    ]
    told = SPECS[5].as_dict()
    assert [*told] == ["kind", "image_size", "fit", "network"]
    assert told["network"] == {
        **{"digest": "ab" * 32, "length": 48, "layer": "seen", "height": 224, "width": 224, "fit": "crop"},
        **{"white": 1.0, "mean": (0.485, 0.456, 0.406), "deviation": (0.229, 0.224, 0.225)},
        **{"channels": "rgb", "layout": "nchw", "tokens": "first"},
    }
    assert [spec.length for spec in SPECS] == [384, 384, 1016, 768, 72, 1064]
    assert [spec.colours for spec in SPECS] == [False] * 4 + [True] * 2


def test_before_there_were_kinds_all_was_gist() -> None:
    old: dict[str, Any] = {"variant": "classic", "image_size": 64, "fit": "crop"}
    assert DescriptorSpec(**old) == SPECS[1]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"kind": "sift"},
            "no descriptor is called 'sift'; choose one of gist, lbp, ranks, centrist, colour, onnx",
        ),
        ({"kind": []}, "no descriptor is called []"),
        ({"variant": "new"}, "no GIST variant is called 'new'; choose one of lmgist, classic"),
        ({"fit": "stretch"}, "no fit is called 'stretch'; choose one of squash, crop"),
        ({"image_size": 7}, "an image size of 7 cannot be used; give a number of 8 or more"),
        ({"kind": "centrist", "image_size": 7}, "an image size of 7 cannot be used"),
        ({"kind": "centrist", "variant": "classic"}, "centrist descriptors have no variant; leave it out"),
        ({"kind": "npy", "columns": 5, "image_size": 64}, "npy descriptors have no image_size; leave it out"),
        ({"columns": 5}, "gist descriptors have no columns; leave it out"),
        ({"kind": "colour", "image_size": 64}, "colour descriptors have no image_size; leave it out"),
        ({"kind": "gist+onnx"}, "onnx descriptors are made by the network in a file; name it, as in onnx:net.onnx"),
        ({"network": SPECS[-1].network}, "gist descriptors have no network"),
        ({"kind": "npy"}, "descriptors of 0 values cannot be used; they may have 1 to 4096"),
        ({"kind": "npy", "columns": 4097}, "descriptors of 4097 values cannot be used"),
        ({"kind": "npy", "columns": "5"}, "descriptors of 5 values cannot be used"),
    ],
)
def test_what_does_not_exist_is_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(VisionError, match=re.escape(message)):
        DescriptorSpec(**settings)


def test_images_are_not_described_by_a_matrix() -> None:
    with pytest.raises(VisionError, match=r"\(768 values\) were computed elsewhere.*; tokenize with --descriptor npy:"):
        descriptor(np.zeros((20, 20), np.uint8), SPECS[3])


def test_the_commands_and_the_page_have_every_kind() -> None:
    assert tuple(kind for kind in KINDS if kind not in ("onnx", "npy")) == descriptors.KINDS
    page = (Path(__file__).parents[2] / "docs/vision.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `(\w+)[^|]*` \|[^|]*\|[^|]*\|[^|]*\|$", page, re.MULTILINE) == [*KINDS]
