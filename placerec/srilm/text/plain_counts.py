"""Lines of sorted counts files, many at once and without numpy: loading that takes longer than adding small files."""

from itertools import islice
from operator import lt

from placerec.srilm.text.counts_file import MOST_TOKENS

# Integer counts are added modulo this (section 12 of our SRILM specification).
MODULUS = 2**32
# All bytes of words. The others separate them, or have a meaning of their own.
_OF_WORDS = bytes(range(ord(" ") + 1, 256))
_AS_BLANKS = bytes.maketrans(b"\t\n", b"  ")
# Counts of so many digits are below MODULUS, and below 2^64.
_SMALL, _LARGEST = 9, 19


def plain_counts(block: bytes, fractional: bool) -> tuple[list[str], list[str]] | None:
    """The n-grams of whole lines, and their counts, as texts; None if a line is not as `ngram-count -sort` writes it.

    It writes words with one blank between them, a tab, and the count: digits, or if `fractional` digits and a point.
    Each n-gram is greater than the one before it. Integer counts are below MODULUS and have no zeros in front.
    """
    block = block if block.endswith(b"\n") else block + b"\n"
    gaps = block.translate(None, _OF_WORDS)
    edges = b"\n" + block
    if (
        gaps.translate(None, b" ") != b"\t\n" * block.count(b"\n")
        or b" " * (MOST_TOKENS - 1) in gaps
        or b"  " in edges.translate(_AS_BLANKS)
        or b"\n##" in edges
    ):
        return None
    fields = block.decode("latin-1").replace("\n", "\t").split("\t")
    ngrams, counts = fields[:-1:2], _real(fields[1::2]) if fractional else _whole(fields[1::2])
    return (ngrams, counts) if counts and all(map(lt, ngrams, islice(ngrams, 1, None))) else None


def _whole(counts: list[str]) -> list[str] | None:
    longest = max(map(len, counts))
    if not "".join(counts).isdecimal() or longest > _LARGEST:
        return None
    if longest > _SMALL or any(count.startswith("0") for count in {*counts}):
        return [str(int(count) % MODULUS) for count in counts]
    return counts


def _real(counts: list[str]) -> list[str] | None:
    if not "".join(counts).replace(".", "").isdecimal():
        return None
    try:
        [*map(float, counts)]
    except ValueError:
        return None
    return counts
