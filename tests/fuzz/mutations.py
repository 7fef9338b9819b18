"""Valid inputs of the readers, and what can happen to them."""

import gzip
from collections.abc import Callable
from random import Random

WORDS = ("a", "b", "c", "<s>", "</s>", "<unk>", "w" * 8, "w" * 9, "w" * 16, "w" * 17, "é", "b#", "\\c")
ODD_WORDS = (
    "-pau-",
    "##",
    "#",
    "\\end\\",
    "\\data\\",
    "\\2-grams:",
    "<UNK>",
    "\u2028",
    "\x85",
    "\xa0",
    "A",
    "z" * 5000,
)
ODD_NUMBERS = (
    *(
        "nan",
        "-nan",
        "inf",
        "-inf",
        "infinity",
        "1e400",
        "-1e400",
        "1e-400",
        "-1e-05",
        "0",
        "-0",
        "-",
        ".",
        "-.5",
        "5.",
    ),
    *("-99", "-99.00000001", "99999999999999999999", "-99999999999999999999", "18446744073709551616", "1" * 5000),
    *("+5", "0x10", "-0x1p3", "017", "1_000", "-1_0.5", "\u0661", "0.5", "-8.5899346e9", "-3.4e38", "1e", "--1", "1,5"),
)
SEPARATORS = (" ", "\t", "  ", " \t ", "\r", "\v", "\f", "\0", "\n", "\xa0", "")
LINE_ENDS = ("\r\n", "\r", "\n\n", " \n", "\n \n", "\0\n", "\n## x\n", "\n##\0\n", "")
Mutation = Callable[[bytes, Random], bytes]


def text(rng: Random) -> bytes:
    """Sentences."""
    lines = (" ".join(rng.choices(WORDS, k=rng.randrange(8))) for _ in range(rng.randrange(12)))
    return "".join(f"{line}\n" for line in lines).encode()


def counts(rng: Random) -> bytes:
    """N-grams with counts, some of them real numbers, none or large."""
    usual, shown = ("1", "2", "17"), ("0", "1", "2", "17", "0.5", "4294967296", "1e3")
    chosen = shown if rng.random() < 0.2 else usual
    ngrams = (" ".join(rng.choices(WORDS, k=rng.randrange(1, 5))) for _ in range(rng.randrange(15)))
    return "".join(f"{ngram}\t{rng.choice(chosen)}\n" for ngram in ngrams).encode()


def arpa(rng: Random) -> bytes:
    """A model of order 1 to 3 in which every context has its weight."""
    ngrams: list[list[tuple[str, ...]]] = [[(word,) for word in rng.sample(WORDS, k=rng.randrange(1, len(WORDS)))]]
    for _ in range(rng.randrange(3)):
        longer = {(*rng.choice(ngrams[-1]), *rng.choice(ngrams[0])) for _ in range(rng.randrange(1, 8))}
        ngrams.append(sorted(longer))
    lines = ["\\data\\", *(f"ngram {n}={len(its)}" for n, its in enumerate(ngrams, start=1))]
    for n, its in enumerate(ngrams, start=1):
        lines += ["", f"\\{n}-grams:"]
        for ngram in its:
            weight = "" if n == len(ngrams) else f"\t{-rng.random():.7g}"
            lines.append(f"{-4 * rng.random():.7g}\t{' '.join(ngram)}{weight}")
    return "\n".join([*lines, "", "\\end\\", ""]).encode()


def _place(data: bytes, rng: Random) -> int:
    return rng.randrange(len(data) + 1)


def _flip(data: bytes, rng: Random) -> bytes:
    at = _place(data, rng)
    return data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]


def _insert(data: bytes, rng: Random) -> bytes:
    at = _place(data, rng)
    return data[:at] + rng.choice((*ODD_WORDS, *ODD_NUMBERS, *SEPARATORS)).encode() + data[at:]


def _cut(data: bytes, rng: Random) -> bytes:
    first, last = sorted((_place(data, rng), _place(data, rng)))
    return data[:first] + data[last:] if rng.random() < 0.7 else data[:first]


def _lines(data: bytes, rng: Random) -> bytes:
    """A line is removed, doubled or moved, or all are shuffled or repeated."""
    lines = data.splitlines(keepends=True) or [b"\n"]
    at = rng.randrange(len(lines))
    match rng.randrange(5):
        case 0:
            del lines[at]
        case 1:
            lines.insert(at, lines[at])
        case 2:
            lines.insert(rng.randrange(len(lines)), lines.pop(at))
        case 3:
            rng.shuffle(lines)
        case 4:
            lines *= rng.choice((2, 30))
    return b"".join(lines)


def _field(data: bytes, rng: Random) -> bytes:
    """A word or number becomes another."""
    fields = data.split(b" ") if rng.random() < 0.5 else data.split(b"\t")
    at = rng.randrange(len(fields))
    head, end, tail = fields[at].partition(b"\n")
    fields[at] = rng.choice((*WORDS, *ODD_WORDS, *ODD_NUMBERS)).encode() + end + tail if rng.random() < 0.5 else head
    return (b" " if rng.random() < 0.9 else b"\t").join(fields)


def _separate(data: bytes, rng: Random) -> bytes:
    if rng.random() < 0.5:
        return data.replace(b"\n", rng.choice(LINE_ENDS).encode(), rng.choice((1, -1)))
    return data.replace(rng.choice((b" ", b"\t")), rng.choice(SEPARATORS).encode(), rng.choice((1, 3, -1)))


def _recode(data: bytes, rng: Random) -> bytes:
    decoded = data.decode("utf-8", "replace")
    return decoded.encode(rng.choice(("utf-8-sig", "utf-16", "utf-16-le", "latin-1")), "replace")


def _lengthen(data: bytes, rng: Random) -> bytes:
    """A word or a line becomes very long."""
    at = _place(data, rng)
    return data[:at] + rng.choice((b"x" * 70000, b"a " * 50001, b"a\n" * 3000)) + data[at:]


MUTATIONS: tuple[tuple[Mutation, int], ...] = (
    (_flip, 8),
    (_insert, 8),
    (_cut, 4),
    (_lines, 5),
    (_field, 8),
    (_separate, 4),
    (_recode, 1),
    (_lengthen, 1),
)


def mutated(data: bytes, rng: Random) -> bytes:
    """`data` after none to five mutations."""
    mutations, weights = zip(*MUTATIONS, strict=True)
    for mutation in rng.choices(mutations, weights, k=rng.choice((0, 1, 1, 1, 2, 3, 5))):
        data = mutation(data, rng)
    return data


def packed(data: bytes, rng: Random) -> bytes:
    """`data` gzipped, in half of the cases with damage."""
    whole = gzip.compress(data, mtime=0)
    return rng.choice((_flip, _cut, _insert))(whole, rng) if rng.random() < 0.5 else whole
