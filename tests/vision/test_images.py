"""Fitting images to the square, and what becomes of the files that cameras and disks spoil."""

import logging
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.image_files import encode

from placerec.errors import VisionError
from placerec.frames import Frame, Sequence
from placerec.vision import DescriptorSpec, describe, fit_image

TEXTURE = np.random.default_rng(0).integers(0, 256, (30, 40), np.uint8)
TWELVE = np.random.default_rng(0).integers(0, 4096, (30, 40), np.uint16)


CONSTANT = encode(".png", np.full((30, 40), 90, np.uint8))
USABLE = {
    "grey.png": encode(".png", TEXTURE),
    "colour.jpg": encode(".jpg", np.dstack([TEXTURE] * 3)),
    "alpha.png": encode(".png", np.dstack([TEXTURE] * 4)),
    "sixteen.png": encode(".png", TEXTURE.astype(np.uint16) * np.uint16(257)),
    "twelve.png": encode(".png", TWELVE),
    "twelve.tif": encode(".tif", TWELVE),
    "eight-sixteen.png": encode(".png", TEXTURE.astype(np.uint16)),
    "webp.webp": encode(".webp", TEXTURE),
    "smallest.png": encode(".png", TEXTURE[:8, :8]),
    "narrow.png": encode(".png", TEXTURE[:, :8]),
}
UNUSABLE = {
    "no-end.jpg": (encode(".jpg", TEXTURE)[:-2], "JPEG is truncated or damaged (no end marker)"),
    "half.jpg": (encode(".jpg", TEXTURE)[:400], "JPEG is truncated or damaged (no end marker)"),
    "head.jpg": (encode(".jpg", TEXTURE)[:20], "JPEG is truncated or damaged (no end marker)"),
    "half.png": (encode(".png", TEXTURE)[:400], "PNG is truncated (no IEND)"),
    "half.webp": (encode(".webp", TEXTURE)[:200], "is no image that OpenCV can decode"),
    "half.tif": (encode(".tif", TEXTURE)[:600], "is no image that OpenCV can decode"),
    "empty.png": (b"", "is empty"),
    "text.jpg": (b"no picture", "is no image that OpenCV can decode"),
    "tiny.png": (encode(".png", TEXTURE[:1, :1]), "is 1x1 pixels, and 8 a side are needed"),
    "flat.png": (encode(".png", TEXTURE[:7]), "is 40x7 pixels, and 8 a side are needed"),
    "float.tif": (encode(".tif", TEXTURE / np.float32(255)), "has pixels of type float32"),
    "nan.tif": (encode(".tif", np.full((30, 40), np.nan, np.float32)), "has pixels of type float32"),
}


def written(folder: Path, files: dict[str, bytes]) -> list[Sequence]:
    for name, data in files.items():
        (folder / name).write_bytes(data)
    frames = tuple(Frame(name, float("nan"), "", folder / name) for name in files)
    return [Sequence("run", frames, folder)]


@pytest.mark.parametrize("variant", ["lmgist", "classic"])
def test_what_can_be_read_is_described(tmp_path: Path, variant: str, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        described = describe(written(tmp_path, USABLE), DescriptorSpec(variant, 32))
    assert caplog.messages == []
    assert described.frames == tuple(USABLE)
    assert np.isfinite(described.values).all()
    assert (described.values.max(axis=1) > 0.01).all()
    same = described.values[[described.frames.index(name) for name in ("grey.png", "alpha.png", "sixteen.png")]]
    # Eight bits are rounded after the resizing.
    np.testing.assert_allclose(same, same[[0, 0, 0]], rtol=0, atol=3e-3)
    np.testing.assert_array_equal(*described.values[[4, 5]])


def test_what_cannot_be_read_is_named_and_counted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    files = {name: data for name, (data, _) in UNUSABLE.items()} | {"constant.png": CONSTANT}
    with caplog.at_level(logging.INFO):
        described = describe(written(tmp_path, files), DescriptorSpec(image_size=32))
    assert (described.frames, described.skipped, described.constant) == (("constant.png",), len(UNUSABLE), 1)
    np.testing.assert_array_equal(described.values, np.zeros((1, 384), np.float32))
    *told, constant, summary = caplog.messages
    for (name, (_, reason)), message in zip(UNUSABLE.items(), told, strict=True):
        assert message.startswith(f"{tmp_path / name}: {reason}; ")
        assert message.endswith("; the frame is skipped")
    assert constant == f"{tmp_path / 'constant.png'}: of one grey level throughout; its descriptor is zero"
    assert summary == f"1 frame described, {len(UNUSABLE)} skipped, 1 of one grey level throughout"


@pytest.mark.parametrize("fit", ["squash", "crop"])
@pytest.mark.parametrize("shape", [(48, 64), (64, 48), (30, 30), (20, 90), (41, 37)])
def test_the_result_has_the_size_and_type_asked_for(fit: str, shape: tuple[int, int]) -> None:
    image = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
    small, fine = fit_image(image, 32, fit), fit_image(image.astype(np.float32), 32, fit)
    assert small.shape == fine.shape == (32, 32)
    assert small.dtype == np.uint8
    assert fine.dtype == np.float32
    # Two roundings, where one axis shrinks and the other grows.
    np.testing.assert_allclose(small, fine, rtol=0, atol=1.5)


def test_shrinking_averages_over_areas() -> None:
    image = np.random.default_rng(0).integers(0, 256, (64, 128)).astype(np.float32)
    means = image.reshape(16, 4, 16, 8).mean(axis=(1, 3))
    np.testing.assert_allclose(fit_image(image, 16), means, rtol=1e-5)


def test_an_axis_that_shrinks_is_averaged_though_the_other_grows() -> None:
    # Stripes of one pixel: sampling without averaging would show black or white.
    image = np.zeros((12, 96), np.float32)
    image[:, ::2] = 200
    image[0] += 1
    fitted = fit_image(image, 24)
    np.testing.assert_allclose(fitted[4:], 100, atol=1e-3)


def test_crop_keeps_the_aspect_ratio_and_the_centre() -> None:
    image = np.zeros((40, 81), np.uint8)
    cv2.circle(image, (40, 20), 12, 255, -1)
    crop = fit_image(image, 40, "crop")
    np.testing.assert_array_equal(crop, image[:, 20:60])
    squashed = fit_image(image, 40, "squash")
    assert (squashed > 128).sum() < 0.6 * (crop > 128).sum()


def test_an_image_that_fits_is_not_touched() -> None:
    image = np.random.default_rng(0).integers(0, 256, (32, 32)).astype(np.uint8)
    for fit in ("squash", "crop"):
        np.testing.assert_array_equal(fit_image(image, 32, fit), image)


def test_a_constant_image_stays_constant() -> None:
    fitted = fit_image(np.full((37, 53), 0.1, np.float32), 29)
    assert (fitted == np.float32(0.1)).all()


def test_an_unknown_fit_is_refused() -> None:
    with pytest.raises(VisionError, match="no fit is called 'stretch'; choose one of squash, crop"):
        fit_image(np.zeros((9, 9), np.uint8), 8, "stretch")
