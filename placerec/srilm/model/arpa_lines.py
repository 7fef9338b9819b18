"""The n-gram lines of an ARPA file as arrays, where they are as programs write them: the short way of the reader.

What is out of the ordinary (a word that is not listed, a number that calls for a message, a line that is no n-gram) is
not handled here: `parse_block` gives None, and the reader goes the long way, line by line.
"""

import re
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from placerec.arrays import Floats, Ints, Mask, Numbers, Singles
from placerec.lm.logs import LOG_ZERO
from placerec.srilm.text.fields import FILLED, Fields, eight_digits, split_lines, with_odd_bytes

# So many numbers are sooner converted one by one.
_FEW = 200
# Bytes of numbers that are taken apart many at a time.
_LONGEST = 16
_NUMBER = re.compile(rb"-?\d+(\.\d*)?([eE][-+]?\d+)?")


class Block(NamedTuple):
    """N-grams of one order: line numbers (m,) from 1, SRILM's numbers of words (m, n), log10 p (m,), weights (m,).

    `weighted` bool (m,): the line has a weight. `size`: how many lines there are, empty ones too.
    """

    lines: Ints
    words: Numbers
    log10_p: Singles
    weighted: Mask
    backoff: Singles
    size: int = 0


def parse_block(data: bytes, n: int, numbered: Callable[[Fields, Ints], Ints], *, weights: str) -> Block | None:
    """The n-grams of order n in whole lines; None if there is anything unusual about them.

    `numbered`: gives the numbers of fields that are words, -1 for a word that is not listed. `weights`: `read` them;
    `ignore` them; or, at the file's highest order, let only `zero` pass.
    """
    if with_odd_bytes(data):
        return None
    fields, physical = split_lines(data)
    lines = np.flatnonzero(physical)
    count = physical[lines]
    weighted = count == n + 2
    if not (weighted | (count == n + 1)).all():
        return None
    begin = np.cumsum(count) - count
    log10_p = _numbers(fields, begin, most=0.0)
    backoff = _weights(fields, begin[weighted] + n + 1, weights)
    if log10_p is None or backoff is None:
        return None
    # Column by column: that makes few long loops of many short ones.
    words = numbered(fields, (begin + np.arange(1, n + 1)[:, None]).ravel())
    if (words < 0).any():
        return None
    every = np.zeros(len(lines), np.float32)
    every[weighted] = backoff
    return Block(lines + 1, words.reshape(n, -1).T, log10_p, weighted, every, len(physical))


def _weights(fields: Fields, at: Ints, what: str) -> Singles | None:
    if what == "read":
        return _numbers(fields, at, most=np.inf)
    first = np.frombuffer(fields.data, np.uint8)[fields.starts[at]]
    return None if what == "zero" and (first != ord("0")).any() else np.zeros(len(at), np.float32)


def _numbers(fields: Fields, at: Ints, *, most: float) -> Singles | None:
    """The numbers in the fields `at`, -inf for -99, or None if one is unusual, infinite, or above the limit."""
    value, plain = _short_decimals(fields, at)
    if not plain.all():
        longer = np.flatnonzero(~plain)
        if len(longer) > _FEW:
            value[longer], plain = _decimals(fields, at[longer])
            longer = longer[~plain]
        for i in longer.tolist():
            text = fields.text(int(at[i]))
            if not _NUMBER.fullmatch(text):
                return None
            value[i] = float(text)
    if not (np.isfinite(value) & (value <= most)).all():
        return None
    single = value.astype(np.float32)
    single[single == LOG_ZERO] = -np.inf
    return single


_SIGN, _POINT, _BYTE = ord("-"), ord("."), np.uint64(255)
_ZERO_POINT, _TWO_BYTES = np.uint64(int.from_bytes(b"0.", "little")), np.uint64(0xFFFF)


def _short_decimals(fields: Fields, at: Ints) -> tuple[Floats, Mask]:
    """Numbers of one digit, a point and up to eight digits, correctly rounded; and which of the fields are that."""
    start = fields.starts[at]
    text = fields.eights.take(start)
    negative = text & _BYTE == _SIGN
    size = fields.lengths[at]
    size -= 2
    if negative.all():
        text >>= np.uint64(8)
        start += 3
        size -= 1
    else:
        text >>= np.uint64(8) * negative
        start += 2
        start += negative
        size -= negative
    # Nothing is left of the first two bytes but the digit, if they are a digit and a point.
    whole = (text ^ _ZERO_POINT) & _TWO_BYTES
    digits, plain = eight_digits(fields.eights.take(start), FILLED.take(size, mode="clip"))
    plain &= whole <= 9
    plain &= size.view(np.uint64) <= 8
    # Both are exact, so that the quotient is the float64 nearest to the decimal number.
    whole *= np.uint64(10**8)
    whole += digits
    value = whole / 1e8
    return np.where(negative, -value, value), plain


def _decimals(fields: Fields, at: Ints) -> tuple[Floats, Mask]:
    """Plain decimal numbers of up to 15 digits, correctly rounded, and which of the fields are that."""
    low, high = fields.packed(at, 2)
    length = fields.lengths[at]
    digits = np.zeros(len(at), np.int64)
    behind = np.zeros(len(at), np.int64)
    points = np.zeros(len(at), np.int64)
    negative = (low & np.uint64(255)) == _SIGN
    plain = length <= _LONGEST
    for j in range(min(_LONGEST, int(length.max(initial=0)))):
        byte = ((low if j < 8 else high) >> np.uint64(8 * (j % 8)) & np.uint64(255)).astype(np.int64)
        point = byte == _POINT
        digit = byte - ord("0")
        numeral = (digit >= 0) & (digit <= 9)
        digits = np.where(numeral, digits * 10 + digit, digits)
        behind += numeral & (points > 0)
        points += point
        plain &= numeral | point | (j >= length) | (negative if j == 0 else False)
    plain &= (points <= 1) & (length - points - negative > 0)
    # Both are exact, so that the quotient is the float64 nearest to the decimal number.
    value = digits / _TENS[behind]
    return np.where(negative, -value, value), plain


_TENS = 10.0 ** np.arange(_LONGEST + 1)
