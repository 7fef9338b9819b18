"""The n-gram lines of an ARPA file as arrays, where they are as programs write them: the short way of the reader.

What is out of the ordinary (a word that is not listed, a number that calls for a message, a line that is no n-gram) is
not handled here: `parse_block` gives None, and the reader goes the long way, line by line.
"""

import re
from dataclasses import dataclass

import numpy as np

from placerec.lm.backoff import Singles
from placerec.lm.draft import Floats, Mask
from placerec.lm.trie import Ints
from placerec.srilm.fields import LONGEST_NAME, PADDING, Fields, NameTable, split_lines, unusual

LOG_ZERO = -99.0
_NUMBER = re.compile(rb"-?\d+(\.\d*)?([eE][-+]?\d+)?")


@dataclass(frozen=True)
class Block:
    """N-grams of one order: line numbers (m,), words as SRILM's numbers (m, n), log10 p (m,), weights (m,).

    `weighted` bool (m,): the line has a weight.
    """

    lines: Ints
    words: Ints
    log10_p: Singles
    weighted: Mask
    backoff: Singles


def parse_block(data: bytes, n: int, first_line: int, names: NameTable, *, weights: str) -> Block | None:
    """The n-grams of order n in whole lines; None if there is anything unusual about them.

    `weights`: `read` them; `ignore` them; or, at the file's highest order, let only `zero` pass.
    """
    if unusual(data):
        return None
    fields, count = split_lines(data + PADDING, len(data))
    lines = np.flatnonzero(count)
    count = count[lines]
    if not ((count == n + 1) | (count == n + 2)).all():
        return None
    begin = np.cumsum(count) - count
    weighted = count == n + 2
    log10_p = _numbers(fields, begin, least=-np.inf, most=0.0)
    backoff = _weights(fields, begin[weighted] + n + 1, weights)
    if log10_p is None or backoff is None:
        return None
    words = np.stack([names.find(fields, begin + k) for k in range(1, n + 1)], axis=1)
    if (words < 0).any():
        return None
    every = np.zeros(len(lines), np.float32)
    every[weighted] = backoff
    return Block(lines + first_line, words, log10_p, weighted, every)


def _weights(fields: Fields, at: Ints, what: str) -> Singles | None:
    if what == "read":
        return _numbers(fields, at, least=-np.inf, most=np.inf)
    first = np.frombuffer(fields.data, np.uint8)[fields.starts[at]]
    return None if what == "zero" and (first != ord("0")).any() else np.zeros(len(at), np.float32)


def _numbers(fields: Fields, at: Ints, *, least: float, most: float) -> Singles | None:
    """The numbers in the fields `at`, -inf for -99, or None if one is unusual or beyond the limits."""
    value, plain = _decimals(fields, at)
    for i in np.flatnonzero(~plain).tolist():
        text = fields.text(int(at[i]))
        if not _NUMBER.fullmatch(text):
            return None
        value[i] = float(text)
    if not ((value >= least) & (value <= most) & np.isfinite(value)).all():
        return None
    single = value.astype(np.float32)
    return np.where(single == LOG_ZERO, np.float32(-np.inf), single)


def _decimals(fields: Fields, at: Ints) -> tuple[Floats, Mask]:
    """Plain decimal numbers of up to 15 digits, correctly rounded, and which of the fields are that."""
    low, high = fields.packed(at)
    length = fields.lengths[at]
    digits = np.zeros(len(at), np.int64)
    behind = np.zeros(len(at), np.int64)
    points = np.zeros(len(at), np.int64)
    negative = (low & np.uint64(255)) == ord("-")
    plain = (length > 1) & (length <= LONGEST_NAME)
    for j in range(min(LONGEST_NAME, int(length.max(initial=0)))):
        byte = ((low if j < 8 else high) >> np.uint64(8 * (j % 8)) & np.uint64(255)).astype(np.int64)
        point = byte == ord(".")
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


_TENS = 10.0 ** np.arange(LONGEST_NAME + 1)
