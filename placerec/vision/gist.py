"""The GIST descriptor in its two published variants: whitening, Gabor bank, block means.

`lmgist` is the authors' LMgist of 2011, `classic` their toolbox of 2006, which lear_gist follows. The Dubois paper
cites a steerable pyramid of the same shape (4 scales x 6 orientations x 4 x 4 blocks); the Gabor bank is its
authors' own published successor. Both variants are exact: nothing is approximated to save time.
"""

import threading
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any, cast

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from placerec.arrays import Singles
from placerec.errors import VisionError
from placerec.vision.images import check_gray, fit_image

VARIANTS = ("lmgist", "classic")
BORDER = 32  # pixels mirrored around the whitened image by lmgist; classic wraps around instead
_MARGIN = 5  # pixels mirrored around the image while it is whitened
_CYCLES = 4.0  # cut-off of the whitening low-pass, in cycles per image
_CACHED_PIXELS = 1 << 19  # a bank of 24 filters takes 192 bytes a pixel: larger ones are made anew for each image


def gist(
    image: NDArray[Any],
    variant: str = "lmgist",
    size: int | None = None,
    orientations: Sequence[int] = (6, 6, 6, 6),
    blocks: int = 4,
) -> Singles:
    """The GIST of one grey image: mean Gabor magnitude of every filter in every block (our GIST specification).

    image: (h, w), grey of 0..255, uint8, uint16 (taken as 0..65535) or float; any size from 8 x 8 on.
    size: None takes the image as it is, a number first squashes it to size x size.
    orientations: filters per scale, finest scale first. blocks: per axis.
    Returns float32 (sum(orientations) * blocks**2,): filter by filter, blocks column by column. A constant image
    gives exact zeros. Raises VisionError for an image or an option that cannot be used.
    """
    if variant not in VARIANTS:
        raise VisionError(f"no GIST variant is called {variant!r}; choose one of {', '.join(VARIANTS)}")
    gray = check_gray(image)
    if size is not None:
        gray = fit_image(gray, size, "squash")
    height, width = gray.shape
    if not 1 <= blocks <= min(height, width):
        raise VisionError(f"{blocks} blocks per axis do not fit an image of {width} x {height} pixels")
    if not orientations or min(orientations) < 1:
        raise VisionError(f"orientations {tuple(orientations)}: every scale needs at least one")
    low, high = float(gray.min()), float(gray.max())
    if low == high:
        return np.zeros(sum(orientations) * blocks**2, np.float32)
    values = gray.astype(np.float32)
    if variant == "lmgist":
        values = (values - np.float32(low)) * np.float32(255 / (high - low))
    return _filter_means(prefilter(values), BORDER if variant == "lmgist" else 0, tuple(orientations), blocks)


def prefilter(values: Singles) -> Singles:
    """Whitening and local contrast normalisation (section 2 of our GIST specification): (h, w) 0..255 to float32."""
    height, width = values.shape
    padded = _mirror(np.log(values + np.float32(1)), _MARGIN, _MARGIN, _MARGIN, _MARGIN)
    rows, columns = padded.shape
    side = max(rows, columns)
    side += side % 2
    # The low-pass wants a square; the originals mirror at the bottom and the right only.
    padded = _mirror(padded, 0, side - rows, 0, side - columns)
    detail = padded - _lowpass(padded)
    contrast = np.sqrt(np.abs(_lowpass(detail * detail)))
    whitened = detail / (np.float32(0.2) + contrast)
    return cast(Singles, whitened[_MARGIN : _MARGIN + height, _MARGIN : _MARGIN + width])


def _mirror(values: Singles, top: int, bottom: int, left: int, right: int) -> Singles:
    return cast(Singles, cv2.copyMakeBorder(values, top, bottom, left, right, cv2.BORDER_REFLECT))


def _lowpass(square: Singles) -> Singles:
    # An FFT and not two matrix products with the circulant: their bits would depend on the BLAS and its threads.
    spectrum = scipy.fft.rfft2(square)
    spectrum *= _lowpass_transfer(len(square))
    return cast(Singles, scipy.fft.irfft2(spectrum, s=square.shape, overwrite_x=True))


@lru_cache(maxsize=4)
def _lowpass_transfer(side: int) -> Singles:
    """(side, side // 2 + 1): exp(-(fx² + fy²) ln 2 / cycles²), half a plane as rfft2 has it; read-only."""
    falloff = np.exp(-(np.fft.fftfreq(side, 1 / side) ** 2) * np.log(2) / _CYCLES**2)
    transfer = np.outer(falloff, falloff[: side // 2 + 1]).astype(np.float32)
    transfer.flags.writeable = False
    return transfer


def _filter_means(whitened: Singles, border: int, orientations: tuple[int, ...], blocks: int) -> Singles:
    extended = _mirror(whitened, border, border, border, border)
    rows, columns = extended.shape
    spectrum = _spectrum(extended)
    # A scale at a time where the bank is kept: fewer calls, and fewer waits of threads for the interpreter's lock.
    groups: Iterable[Singles]
    if rows * columns <= _CACHED_PIXELS:
        groups = _bank(rows, columns, orientations)
    else:
        groups = (transfer[None] for transfer in _filters(rows, columns, orientations))
    height, width = rows - 2 * border, columns - 2 * border
    bands = []
    for transfers in groups:
        n = len(transfers)
        memory = _memory(n * (2 * rows * columns + height * width))
        product = memory[: n * 2 * rows * columns].reshape(n, rows, columns, 2)
        magnitudes = memory[n * 2 * rows * columns :].reshape(n, height, width)
        np.multiply(spectrum, transfers, out=product)
        np.abs(_responses(product)[:, border : rows - border, border : columns - border], out=magnitudes)
        bands.append(_band_sums(magnitudes, blocks))
    return _block_means(np.concatenate(bands), height, blocks)


_kept = threading.local()


def _memory(count: int) -> Singles:
    """Memory for `count` numbers that the thread uses again: fresh pages would cost as much as the transforms."""
    memory: Singles = getattr(_kept, "memory", np.empty(0, np.float32))
    if len(memory) < count:
        memory = _kept.memory = np.empty(count, np.float32)
    return memory[:count]


@lru_cache(maxsize=1)
def _has_ipp() -> bool:
    """Whether OpenCV has Intel's transforms (its wheels for x86 do); its own are slower than scipy's."""
    return bool(cv2.ipp.useIPP())


def _spectrum(image: Singles) -> Singles:
    """The DFT divided by the number of pixels: (h, w, 2), real and imaginary parts."""
    if not _has_ipp():
        spectrum = scipy.fft.fft2(image, norm="forward")
        return cast(Singles, spectrum.view(np.float32).reshape(*image.shape, 2))
    # OpenCV transforms complex arrays four times faster than real ones, and the factor of the inverse transforms is
    # cheaper paid here once.
    plane = np.zeros((*image.shape, 2), np.float32)
    plane[..., 0] = image
    return cast(Singles, cv2.dft(plane, dst=plane, flags=cv2.DFT_SCALE))


def _responses(spectra: Singles) -> NDArray[np.complex64]:
    """The inverse DFTs without a factor, complex (n, h, w), of (n, h, w, 2), whose memory is used up."""
    numbers = spectra.view(np.complex64)[..., 0]
    if not _has_ipp():
        return cast(NDArray[np.complex64], scipy.fft.ifft2(numbers, norm="forward", overwrite_x=True))
    for spectrum in spectra:
        cv2.dft(spectrum, dst=spectrum, flags=cv2.DFT_INVERSE)
    return numbers


def _edges(length: int, blocks: int) -> list[int]:
    return [k * length // blocks for k in range(blocks + 1)]


def _band_sums(magnitudes: Singles, blocks: int) -> Singles:
    """(n, blocks, w): the sums of (n, h, w) over the rows of each row of blocks."""
    n, height, width = magnitudes.shape
    if height % blocks == 0:
        sums: Singles = magnitudes.reshape(n, blocks, -1, width).sum(axis=2)
        return sums
    return np.stack([magnitudes[:, a:b].sum(axis=1) for a, b in pairwise(_edges(height, blocks))], axis=1)


def _block_means(bands: Singles, height: int, blocks: int) -> Singles:
    """(filters * blocks²,) means from the (filters, blocks, w) sums of bands, block columns outermost."""
    tops, lefts = _edges(height, blocks), _edges(bands.shape[2], blocks)
    sums = np.add.reduceat(bands.astype(np.float64), lefts[:-1], axis=2)
    means: Singles = (sums / np.outer(np.diff(tops), np.diff(lefts))).astype(np.float32)
    return means.transpose(0, 2, 1).ravel()


@lru_cache(maxsize=4)
def _bank(rows: int, columns: int, orientations: tuple[int, ...]) -> tuple[Singles, ...]:
    """The transfer functions of each scale, (orientations, rows, columns, 2), read-only."""
    filters = _filters(rows, columns, orientations)
    scales = tuple(np.stack([next(filters) for _ in range(count)]) for count in orientations)
    for transfers in scales:
        transfers.flags.writeable = False
    return scales


def _filters(rows: int, columns: int, orientations: tuple[int, ...]) -> Iterator[Singles]:
    """The Gabor transfer functions (section 3 of our GIST specification), each (rows, columns, 2), finest scale first.

    They are real; every value is there twice, for the real and the imaginary part that it multiplies.
    """
    # Odd sizes sit on a half-integer grid, as in the originals.
    fx = np.fft.fftshift(np.arange(columns) - columns / 2)
    fy = np.fft.fftshift(np.arange(rows) - rows / 2)[:, None]
    # The originals divide by the columns for both axes, whatever the aspect ratio.
    radius, angle = np.hypot(fx, fy) / columns, np.arctan2(fy, fx)
    for scale, count in enumerate(orientations):
        radial = -3.5 * (radius / (0.3 / 1.85**scale) - 1) ** 2
        sharpness = 2 * np.pi * 16 * count**2 / 32**2
        for turn in range(count):
            tau = angle + np.pi * turn / count
            tau[tau > np.pi] -= 2 * np.pi
            yield np.repeat(np.exp(radial - sharpness * tau**2).astype(np.float32)[..., None], 2, axis=2)
