"""Matrix products that give the same bits with every BLAS, its kernels and its threads.

A BLAS adds in whatever order its threads and its processor suggest, and training amplifies the last bits into other
words. The order is of no matter where no addition is rounded: the factors are split into whole multiples of a power
of two that are small enough for float64 to hold every partial sum (the idea of Ozaki's scheme).
"""

import numpy as np

from placerec.arrays import Floats

BITS = 20
TERMS = 1 << 12  # products that may be added: 2**(20 + 20 + 12) is below 2**53


def split(x: Floats, *, axis: int | None = None) -> tuple[Floats, Floats]:
    """(coarse, fine) with coarse + fine = x up to 2**-41 of the largest magnitude along `axis` (None: of all).

    Both are multiples of a power of two, at most 2**20 of them.
    """
    largest = np.abs(x).max(axis=axis, keepdims=True)
    exponent = np.frexp(largest)[1]
    unit = np.ldexp(1.0, exponent - BITS)
    coarse = np.rint(x / unit) * unit
    unit = np.ldexp(1.0, exponent - 2 * BITS)
    return coarse, np.rint((x - coarse) / unit) * unit


def on_grid(x: Floats) -> Floats:
    """Values within -1..1, rounded to whole multiples of 2**-20."""
    grid: Floats = np.ldexp(np.rint(np.ldexp(x, BITS)), -BITS)
    return grid


def gram(x: Floats) -> Floats:
    """x' x of (n, d) with n <= TERMS: (d, d)."""
    coarse, fine = split(x)
    mixed = coarse.T @ fine
    product: Floats = coarse.T @ coarse + (mixed + mixed.T) + fine.T @ fine
    return product


def product(x: Floats, grid: Floats) -> Floats:
    """x @ grid of (n, d) with d <= TERMS and (d, k) from `on_grid`; a row's result is the same in any batch."""
    coarse, fine = split(x, axis=1)
    result: Floats = coarse @ grid + fine @ grid
    return result
