"""Matrix products that give the same bits with every BLAS, its kernels and its threads.

A BLAS adds in whatever order its threads and its processor suggest, and training amplifies the last bits into other
words. The order is of no matter where no addition is rounded: the factors are split into whole multiples of a power
of two that are small enough for float64 to hold every partial sum (the idea of Ozaki's scheme).
"""

import math
from functools import partial

import numpy as np

from placerec.arrays import Floats, Ints, Singles

BITS = 20
SWEEPS = 30  # the most of Jacobi's rotations
TERMS = 1 << 12  # products that may be added: 2**(20 + 20 + 12) is below 2**53


def split(x: Floats, *, axis: int | None = None) -> tuple[Floats, Floats]:
    """(coarse, fine) with coarse + fine = x up to 2**-41 of the largest magnitude along `axis` (None: of all).

    Both are multiples of a power of two, at most 2**20 of them.
    """
    unit: float | Floats
    if axis is None:
        unit = math.ldexp(1, math.frexp(np.maximum.reduce(np.abs(x), axis=None))[1] - BITS)
    else:
        unit = np.ldexp(1.0, np.frexp(np.abs(x).max(axis=axis, keepdims=True))[1] - BITS)
    coarse = np.rint(x / unit) * unit
    unit = unit / 2**BITS
    return coarse, np.rint((x - coarse) / unit) * unit


def on_grid(x: Floats) -> Floats:
    """Values within -1..1, rounded to whole multiples of 2**-20."""
    grid: Floats = np.ldexp(np.rint(np.ldexp(x, BITS)), -BITS)
    return grid


def exponents(x: Floats | Singles) -> Ints:
    """Per row of (n, d) the power of two, int64 (n, 1), by which its values must be divided to be within -1..1."""
    powers: Ints = np.frexp(np.abs(x).max(axis=1, keepdims=True))[1].astype(np.int64)
    return powers


def gram(x: Floats) -> Floats:
    """x' x of (n, d) with n <= TERMS: (d, d)."""
    coarse, fine = split(x)
    mixed = coarse.T @ fine
    product: Floats = coarse.T @ coarse + (mixed + mixed.T) + fine.T @ fine
    return product


def product(x: Floats, grid: Floats) -> Floats:
    """x @ grid of (n, d) with d <= TERMS and (d, k) from `on_grid`; a row's result is the same in any batch, or alone.

    x may be one row (d,).
    """
    coarse, fine = split(x, axis=1 if x.ndim > 1 else None)
    result: Floats = coarse @ grid + fine @ grid
    return result


def eigen(symmetric: Floats) -> tuple[Floats, Floats]:
    """The eigenvalues (k,) of a symmetric matrix (k, k), largest first, and its eigenvectors in rows (k, k).

    By Jacobi's rotations, k/2 of different rows at a time: arithmetic without sums, where LAPACK's last bits depend on
    threads and processor.
    """
    k = len(symmetric)
    matrix, vectors = symmetric.copy(), np.eye(k)
    enough = k * np.finfo(np.float64).eps * np.abs(symmetric).max()
    beside, rounds = ~np.eye(k, dtype=np.bool_), _rounds(k)
    # They converge quadratically: some ten sweeps do.
    for _ in range(SWEEPS):
        if np.abs(matrix[beside]).max(initial=0) <= enough:
            break
        for p, q in rounds:
            cosine, sine = _rotations(matrix[p, p], matrix[q, q], matrix[p, q])
            turn = partial(_turn, p, q, cosine, sine)
            turn(matrix)
            # A matrix whose columns are turned in their place takes four times as long.
            matrix = np.ascontiguousarray(matrix.T)
            turn(matrix)
            turn(vectors)
    order = np.argsort(-np.diagonal(matrix), kind="stable")
    return np.diagonal(matrix)[order], vectors[order]


def _turn(p: Ints, q: Ints, cosine: Floats, sine: Floats, rows: Floats) -> None:
    """Turn the rows p and q (m,) of a matrix into each other, in its place."""
    first, second = rows[p], rows[q]
    rows[p], rows[q] = cosine * first - sine * second, sine * first + cosine * second


def _rounds(k: int) -> list[tuple[Ints, Ints]]:
    """All pairs of k rows, as the rounds of a tournament in which each row meets one other at a time."""
    players = [*range(k), *([-1] if k % 2 else [])]
    half, rounds = len(players) // 2, []
    for _ in players[1:]:
        met = [pair for pair in zip(players[:half], players[: half - 1 : -1], strict=True) if -1 not in pair]
        first, second = np.array(met, np.int64).reshape(-1, 2).T
        rounds.append((first, second))
        players[1:] = players[2:] + players[1:2]
    return rounds


def _rotations(first: Floats, second: Floats, between: Floats) -> tuple[Floats, Floats]:
    """Cosines and sines (m, 1) of the rotations after which each `between` is 0."""
    met = between != 0
    slope = (second - first) / (2 * np.where(met, between, 1))
    tangent = np.where(met, np.copysign(1, slope) / (np.abs(slope) + np.sqrt(slope**2 + 1)), 0)[:, None]
    cosine = 1 / np.sqrt(tangent**2 + 1)
    return cosine, cosine * tangent
