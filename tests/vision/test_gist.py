"""GIST against the originals' numbers, against a plain float64 program, and at the edges."""

import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from placerec.errors import VisionError
from placerec.vision import gist
from placerec.vision.gist import VARIANTS, prefilter

GOLDEN = {"classic": "v1", "lmgist": "v2"}


def plain_gist(
    image: NDArray[Any], variant: str, orientations: tuple[int, ...] = (6, 6, 6, 6), blocks: int = 4
) -> NDArray[np.float64]:
    """gist/spec.md sections 1 to 4 in float64, step by step, with none of the engine's shortcuts."""
    x = image.astype(np.float64)
    if variant == "lmgist":
        x = 255 * (x - x.min()) / (x.max() - x.min())
    x = np.pad(np.log(x + 1), 5, mode="symmetric")
    rows, columns = x.shape
    n = max(rows, columns)
    n += n % 2
    x = np.pad(x, ((0, n - rows), (0, n - columns)), mode="symmetric")
    f = np.arange(-n // 2, n // 2)
    low = np.fft.ifftshift(np.exp(-(f[:, None] ** 2 + f**2) / (4 / np.sqrt(np.log(2))) ** 2))
    detail = x - np.fft.ifft2(np.fft.fft2(x) * low).real
    contrast = np.sqrt(np.abs(np.fft.ifft2(np.fft.fft2(detail**2) * low)))
    y = (detail / (0.2 + contrast))[5 : rows - 5, 5 : columns - 5]
    border = 32 if variant == "lmgist" else 0
    spectrum = np.fft.fft2(np.pad(y, border, mode="symmetric"))
    height, width = spectrum.shape
    fx, fy = np.meshgrid(np.arange(width) - width / 2, np.arange(height) - height / 2)
    r, t = np.fft.fftshift(np.hypot(fx, fy)), np.fft.fftshift(np.arctan2(fy, fx))
    features = []
    for scale, count in enumerate(orientations):
        for j in range(count):
            tau = t + np.pi * j / count
            tau = np.where(tau > np.pi, tau - 2 * np.pi, tau)
            radial = (r / width / (0.3 / 1.85**scale) - 1) ** 2
            transfer = np.exp(-10 * 0.35 * radial - 2 * np.pi * (16 * count**2 / 32**2) * tau**2)
            a = np.abs(np.fft.ifft2(spectrum * transfer))[border : height - border, border : width - border]
            h, w = a.shape
            for c in range(blocks):
                for b in range(blocks):
                    block = a[b * h // blocks : (b + 1) * h // blocks, c * w // blocks : (c + 1) * w // blocks]
                    features.append(block.mean())
    return np.array(features)


def deviation(got: NDArray[Any], want: NDArray[Any]) -> float:
    """The largest difference, in units of the largest element."""
    return float(np.abs(got - want).max() / np.abs(want).max())


def read(path: Path) -> NDArray[Any]:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert image is not None
    return np.asarray(image)


def textured(height: int, width: int, seed: int = 0) -> NDArray[np.uint8]:
    noise = np.random.default_rng(seed).integers(0, 256, (height, width), dtype=np.uint8)
    return np.asarray(cv2.GaussianBlur(noise, (0, 0), 1.5), np.uint8)


@pytest.mark.parametrize("variant", VARIANTS)
def test_golden_images(shared: Path, variant: str) -> None:
    folder = shared / "gist/golden"
    images = json.loads((folder / "manifest.json").read_text())["images"]
    wanted = np.load(folder / f"matlab_{GOLDEN[variant]}_double_o6666_b4.npy")
    compared = 0
    for image, want in zip(images, wanted, strict=True):
        got = gist(read(folder / image["file"]), variant=variant)
        assert got.dtype == np.float32
        assert got.shape == (384,)
        if np.isfinite(want).all() and want.max() > 1e-9:
            assert deviation(got, want) <= (1e-5 if image["kind"] == "photo" else 2e-4), image["file"]
            compared += 1
        else:
            assert np.isfinite(got).all()
    assert compared > 30


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize(
    ("orientations", "blocks", "name"),
    [((8, 8, 8, 8), 4, "o8888_b4"), ((8, 8, 4), 4, "o884_b4"), ((6,) * 4, 1, "o6666_b1"), ((6,) * 4, 3, "o6666_b3")],
)
def test_golden_orientations_and_blocks(
    shared: Path, variant: str, orientations: tuple[int, ...], blocks: int, name: str
) -> None:
    folder = shared / "gist/golden"
    rows = json.loads((folder / "manifest.json").read_text())["extra_rows"]
    wanted = np.load(folder / f"extra_matlab_{GOLDEN[variant]}_double_{name}.npy")
    assert len(rows) == len(wanted) > 0
    for row, want in zip(rows, wanted, strict=True):
        got = gist(read(folder / row), variant=variant, orientations=orientations, blocks=blocks)
        assert got.shape == (sum(orientations) * blocks**2,)
        assert deviation(got, want) <= 1e-5, row


@pytest.mark.parametrize("name", ["astronaut", "camera"])
def test_golden_prefilter(shared: Path, name: str) -> None:
    folder = shared / "gist/golden"
    image = read(folder / f"img/{name}_128x128.png").astype(np.float32)
    want = np.load(folder / f"stage_{name}_128_prefilt_classic.npy")
    assert deviation(prefilter(image), want) <= 1e-5
    stretched = 255 * (image - image.min()) / (image.max() - image.min())
    want = np.load(folder / f"stage_{name}_128_prefilt_lmgist.npy")
    assert deviation(prefilter(stretched), want) <= 1e-5


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("shape", [(64, 64), (50, 75), (75, 50), (33, 41), (97, 64), (8, 8), (9, 60)])
def test_any_shape_agrees_with_the_plain_program(variant: str, shape: tuple[int, int]) -> None:
    image = textured(*shape, seed=sum(shape))
    assert deviation(gist(image, variant=variant), plain_gist(image, variant)) <= 2e-5


def test_other_filters_and_blocks_agree_with_the_plain_program() -> None:
    image = textured(45, 62)
    got = gist(image, orientations=(5, 3), blocks=7)
    assert deviation(got, plain_gist(image, "lmgist", (5, 3), 7)) <= 2e-5


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("shape", [(64, 64), (128, 128), (75, 50), (33, 41)])
def test_the_engine_without_ipp_agrees(variant: str, shape: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    image = textured(*shape)
    usual = gist(image, variant)
    for ipp in (True, False):
        monkeypatch.setattr(sys.modules["placerec.vision.gist"], "_has_ipp", lambda ipp=ipp: ipp)
        assert deviation(gist(image, variant), usual) <= 2e-6
        assert deviation(gist(image, variant), plain_gist(image, variant)) <= 1e-5


def test_opencv_without_ipp_is_not_used() -> None:
    # OPENCV_IPP is OpenCV's own switch; what is left then is what a wheel for ARM has.
    code = "import sys; from placerec.vision import gist; print(sys.modules['placerec.vision.gist']._has_ipp())"
    run = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"OPENCV_IPP": "disabled"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout == "False\n"


def test_two_threads_give_the_same_bytes() -> None:
    images = [textured(40, 40, seed) for seed in range(40)]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(gist, images))
    np.testing.assert_array_equal(together, [gist(image) for image in images])


def test_a_bank_too_large_to_keep_gives_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    image = textured(40, 40)
    kept = gist(image)
    # The package has a function of the module's name.
    monkeypatch.setattr(sys.modules["placerec.vision.gist"], "_CACHED_PIXELS", 0)
    np.testing.assert_array_equal(gist(image), kept)


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize(("degrees", "best"), [(0, {0}), (30, {5}), (45, {4, 5}), (90, {3}), (150, {1})])
def test_a_grating_answers_in_its_orientation(variant: str, degrees: int, best: set[int]) -> None:
    y, x = np.mgrid[:128, :128]
    angle = np.deg2rad(degrees)
    wave = 127.5 + 100 * np.cos(2 * np.pi * 0.162162 * (x * np.cos(angle) + y * np.sin(angle)))
    energy = gist(wave, variant=variant).reshape(4, 6, 16).mean(axis=2)
    assert int(energy.max(axis=1).argmax()) == 1
    # 45 degrees lies between two filters: both answer alike.
    assert set(np.flatnonzero(energy[1] > 0.95 * energy[1].max()).tolist()) == best


def test_blocks_are_column_by_column() -> None:
    image = np.full((128, 128), 128, np.uint8)
    image[96:, :32] = textured(32, 32)
    energy = gist(image, variant="classic").reshape(24, 16).mean(axis=0)
    assert int(energy.argmax()) == 3


def test_size_squashes_first() -> None:
    image = textured(90, 120)
    squashed = cv2.resize(image, (64, 64), interpolation=cv2.INTER_AREA)
    np.testing.assert_array_equal(gist(image, size=64), gist(np.asarray(squashed)))


def test_lmgist_does_not_see_brightness_and_contrast() -> None:
    image = textured(64, 64).astype(np.float32)
    assert deviation(gist(image * 0.5 + 20), gist(image)) < 1e-5
    assert deviation(gist(image * 0.5 + 20, variant="classic"), gist(image, variant="classic")) > 1e-3


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("value", [0, 0.1, 128, 255])
@pytest.mark.parametrize("size", [None, 48])
def test_a_constant_image_gives_exact_zeros(variant: str, value: float, size: int | None) -> None:
    for image in (np.full((70, 90), value), np.full((70, 90), value, np.uint8)):
        got = gist(image, variant=variant, size=size)
        np.testing.assert_array_equal(got, np.zeros(384, np.float32))


def test_sixteen_bits_keep_what_eight_bits_say() -> None:
    image = textured(64, 64)
    for variant in VARIANTS:
        wide = gist(image.astype(np.uint16) * 257, variant=variant)
        np.testing.assert_array_equal(wide, gist(image, variant=variant))
    twelve = (image.astype(np.uint16) << 4).astype(np.uint16)
    assert deviation(gist(twelve), gist(image)) < 1e-5


def with_value(value: float) -> NDArray[np.float64]:
    image = textured(32, 32).astype(float)
    image[3, 4] = value
    return image


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.zeros((0, 0)), "the image has 0 x 0 pixels; at least 8 x 8 are needed"),
        (textured(7, 30), "the image has 30 x 7 pixels; at least 8 x 8 are needed"),
        (np.zeros((32, 32, 3)), "the image has the shape (32, 32, 3), not (height, width); convert it to grey"),
        (with_value(np.nan), "the image holds NaN or infinite values; repair or remove it"),
        (with_value(np.inf), "the image holds NaN or infinite values; repair or remove it"),
        (with_value(-3), "the image holds the value -3; grey values go from 0 to 255"),
        (np.zeros((32, 32), bool), "the image holds bool values, not numbers of 0..255"),
    ],
)
def test_an_unusable_image_is_refused(image: NDArray[Any], message: str) -> None:
    with pytest.raises(VisionError) as caught:
        gist(image)
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"variant": "gist"}, "no GIST variant is called 'gist'; choose one of lmgist, classic"),
        ({"size": 4}, "an image size of 4 is too small; at least 8 is needed"),
        ({"blocks": 33}, "33 blocks per axis do not fit an image of 32 x 32 pixels"),
        ({"blocks": 0}, "0 blocks per axis do not fit an image of 32 x 32 pixels"),
        ({"orientations": (6, 0)}, "orientations (6, 0): every scale needs at least one"),
        ({"orientations": ()}, "orientations (): every scale needs at least one"),
    ],
)
def test_an_unusable_option_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(VisionError) as caught:
        gist(textured(32, 32), **options)
    assert str(caught.value) == message


def test_the_input_is_left_alone() -> None:
    image = textured(40, 40).astype(np.float32)
    before = image.copy()
    for variant in VARIANTS:
        np.testing.assert_array_equal(gist(image, variant), gist(image, variant))
    np.testing.assert_array_equal(image, before)
