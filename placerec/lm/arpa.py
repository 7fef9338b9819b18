r"""ARPA files: the text form of a back-off model that SRILM, KenLM and most decoders read.

Grammar (one blank between words, tabs elsewhere; numbers are log10, `%.7g`)::

    file     = { "#" text NL } NL "\data\" NL { "ngram " n "=" count NL } section { section } NL "\end\" NL
    section  = NL "\" n "-grams:" NL { log10-p TAB word { " " word } [ TAB log10-backoff ] NL }

The writer's layout and order of lines are SRILM's (section 7 of our specification). The reader is as strict as
KenLM's, so that a file that passes here passes there; orders that KenLM does not do are read as well. What is refused
here is read by `arpa_tolerant` if SRILM reads it. -99 stands for log 0.
"""

import logging
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Ints, Mask, Singles
from placerec.errors import LanguageModelError, at, refuse_string
from placerec.files import read_lines, read_text, write_text
from placerec.lm.arpa_text import first_lines
from placerec.lm.backoff import BackoffModel
from placerec.lm.logs import LOG_ZERO
from placerec.lm.trie import Trie, changes
from placerec.lm.vocabulary import Vocabulary

log = logging.getLogger(__name__)
# Rows whose numbers are looked up at once.
_PART = 1 << 17
# No file has 10^18 n-grams; of more digits Python may not make a number.
_COUNT = re.compile(r"ngram\s+(\d{1,18})\s*=\s*(\d{1,18})\s*", re.ASCII)
_NUMBER = re.compile(r"[-+.0-9A-Za-z]+")


def format_arpa(model: BackoffModel, comment: str = "") -> str:
    """The ARPA text of `model`, with a first line `# comment` if one is given."""
    return b"".join(arpa_blocks(model, comment)).decode()


def arpa_blocks(model: BackoffModel, comment: str = "", *, encoding: str = "utf-8") -> Iterator[bytes]:
    """The ARPA text of `model` in blocks of encoded lines, so that it need not be held whole."""
    weighted = [~np.isnan(backoff) for backoff in model.backoffs]
    return row_blocks(model.trie, model.log10_probs, model.backoffs, weighted, comment=comment, encoding=encoding)


def row_blocks(
    trie: Trie,
    log10_probs: Sequence[Singles],
    backoffs: Sequence[Singles],
    weighted: Sequence[Mask],
    *,
    stored: Sequence[Mask] | None = None,
    comment: str = "",
    encoding: str = "utf-8",
) -> Iterator[bytes]:
    """The text of n-grams in the rows of a trie: those that are `stored`, with a weight where `weighted`, (m_n,) each.

    The prefixes of what is stored need not be.
    """
    start = f"# {comment}\n\n\\data\\\n" if comment else "\n\\data\\\n"
    numbers = map(len, trie.keys) if stored is None else (int(mask.sum()) for mask in stored)
    sizes = (f"ngram {n}={size}\n" for n, size in enumerate(numbers, start=1))
    yield (start + "".join(sizes)).encode(encoding)
    words = trie.vocabulary.words
    contexts = _contexts(trie, stored)
    lines, rank = first_lines(words, encoding), np.zeros(1, np.int64)
    for n in range(1, trie.order + 1):
        yield f"\n\\{n}-grams:".encode()
        rows = _wanted(trie, n, stored, contexts[n - 1])
        before = np.zeros(len(rows), np.int64)
        if n > 1:
            # SRILM sorts by the context, read from its last word to its first, then by the word.
            at, before = _regrouped(np.cumsum(changes(trie.prefix(n)[rows])) - 1, rank)
            rows = rows[at]
        word = _narrow(trie.word(n), len(words))[rows]
        for first in range(0, len(rows), _PART):
            part = slice(first, first + _PART)
            row, context, last = rows[part], before[part], word[part]
            if stored is not None and not (shown := stored[n - 1][row]).all():
                row, context, last = row[shown], context[shown], last[shown]
            yield from lines.blocks(log10_probs[n - 1][row], backoffs[n - 1][row], weighted[n - 1][row], context, last)
        if n < trie.order:
            place = np.full(len(trie.keys[n - 1]), -1)
            place[contexts[n - 1]] = 0
            at = np.flatnonzero(place[rows] == 0)
            at = at[np.argsort(word[at], kind="stable")]
            lines = lines.longer(before[at], word[at])
            place[rows[at]] = np.arange(len(at))
            rank = place[contexts[n - 1]]
        yield b"\n"
    yield b"\n\\end\\\n"


def _contexts(trie: Trie, stored: Sequence[Mask] | None) -> list[Ints]:
    """Per order, the rows int64 (c,) of what is a context of an n-gram that is written, or of such a context."""
    contexts = [np.zeros(0, np.int64)]
    for n in range(trie.order, 1, -1):
        prefix = trie.prefix(n)[_wanted(trie, n, stored, contexts[-1])]
        contexts.append(prefix[np.flatnonzero(changes(prefix))])
    return contexts[::-1]


def _wanted(trie: Trie, n: int, stored: Sequence[Mask] | None, contexts: Ints) -> Ints:
    """The rows int64 (m,) of order n that are stored, and those of contexts, ascending."""
    if stored is None:
        return np.arange(len(trie.keys[n - 1]))
    wanted = stored[n - 1]
    if not wanted[contexts].all():
        wanted = wanted.copy()
        wanted[contexts] = True
    return np.flatnonzero(wanted)


def _regrouped(prefix: Ints, rank: Ints) -> tuple[Ints, Ints]:
    """The rows (m,) of ascending prefix rows (m,) so that the prefixes' ranks (p,) ascend, and those ranks (m,)."""
    sizes = np.bincount(prefix, minlength=len(rank))
    moved, shift = np.empty_like(sizes), np.empty_like(sizes)
    moved[rank], shift[rank] = sizes, np.cumsum(sizes) - sizes
    shift -= np.cumsum(moved) - moved
    before = np.repeat(np.arange(len(rank)), moved)
    rows = shift[before]
    rows += np.arange(len(prefix))
    return rows, before


def _narrow(word: Ints, size: int) -> NDArray[np.integer]:
    """Numbers below `size` in a type that numpy sorts fast."""
    return word.astype(np.uint16) if size <= 1 << 16 else word.astype(np.uint32)


def write_arpa(model: BackoffModel, path: Path | str, *, comment: str = "") -> None:
    """Write `model` as an ARPA file (gzipped if the name ends in .gz), whole or not at all."""
    write_text(Path(path), format_arpa(model, comment))


def as_printed(model: BackoffModel) -> BackoffModel:
    """The model as it comes back from an ARPA file, where numbers have seven significant digits."""
    log10_probs, backoffs = (tuple(map(_seven_digits, values)) for values in (model.log10_probs, model.backoffs))
    return BackoffModel(model.trie, log10_probs, backoffs)


def _seven_digits(values: Singles) -> Singles:
    exact = values.astype(np.float64)
    rounded = np.isfinite(exact) & (exact != 0)
    unit = 10.0 ** (6 - np.floor(np.log10(np.abs(exact, where=rounded, out=np.ones_like(exact)))))
    return np.where(rounded, np.rint(exact * unit) / unit, exact).astype(np.float32)


def with_unigrams(model: BackoffModel, words: Sequence[str]) -> BackoffModel:
    """`model` with those of `words` that it does not list added with probability zero and no backoff weight.

    KenLM refuses files without <s> and </s> and complains of files without <unk>.
    """
    refuse_string(words, LanguageModelError)
    old = model.trie.vocabulary
    vocabulary = Vocabulary.of((*old.words, *words))
    new_word = vocabulary.ids(old.words)
    new_row, keys = new_word, [np.arange(len(vocabulary))]
    for n in range(2, model.order + 1):
        # Numbers grow in the same order as before, so rows stay sorted.
        keys.append(new_row[model.trie.prefix(n)] * len(vocabulary) + new_word[model.trie.word(n)])
        new_row = np.arange(len(keys[-1]))
    log10_p = np.full(len(vocabulary), -np.inf, np.float32)
    backoff = np.full(len(vocabulary), np.nan, np.float32)
    log10_p[new_word], backoff[new_word] = model.log10_probs[0], model.backoffs[0]
    return replace(
        model,
        trie=Trie(vocabulary, tuple(keys)),
        log10_probs=(log10_p, *model.log10_probs[1:]),
        backoffs=(backoff, *model.backoffs[1:]),
    )


def arpa_files(path: Path | str) -> list[Path]:
    """The ARPA files that a path names: itself; of a folder those in it, and then those in the folders in it.

    So a MODEL/ gives the models of all dictionaries. Raises LanguageModelError for a folder without any.
    """
    path = Path(path)
    if not path.is_dir():
        return [path]
    found = [file for pattern in ("*.arpa", "*/*.arpa") for file in sorted(path.glob(pattern))]
    if not found:
        raise LanguageModelError(f"{path}: holds no ARPA file (*.arpa); name one, or the folder of train-lm")
    return found


def read_arpa(path: Path | str, *, tolerant: bool = True) -> BackoffModel:
    """Read an ARPA file (gzipped if the name ends in .gz).

    What SRILM's `ngram` reads though KenLM refuses it (blanks for tabs, text around the model, other counts than
    promised) is read with a warning that says what KenLM refuses; unless `tolerant`, it raises. LanguageModelError
    names the file, the line, the value and what is expected.
    """
    model, complaint = read_with_complaint(path)
    if complaint:
        if not tolerant:
            raise LanguageModelError(complaint)
        log.warning("%s (KenLM would refuse the file)", complaint)
    return model


def first_comment(path: Path | str) -> str:
    """The first line of an ARPA file if it is a comment, which starts with #; else an empty text."""
    line = next(read_lines(Path(path), LanguageModelError), "")
    return line if line.startswith("#") else ""


def read_with_complaint(path: Path | str) -> tuple[BackoffModel, str]:
    """The model in an ARPA file, and the first thing in it that KenLM would refuse, with the place; empty if nothing.

    Raises LanguageModelError for what `ngram` refuses, too.
    """
    try:
        return _Reader(path).model(), ""
    except LanguageModelError as strict:
        # Rarely needed.
        from placerec.lm.arpa_tolerant import read_tolerantly

        try:
            return read_tolerantly(path), str(strict)
        except LanguageModelError as error:
            # One line that both refuse is refused in the strict words.
            same = str(error).split(": ")[0] == str(strict).split(": ")[0]
            raise (strict if same else error) from None


class _Reader:
    """The lines of one file, the place in them, and the grammar's productions."""

    def __init__(self, path: Path | str) -> None:
        self.path = path
        self.lines = read_text(Path(path), LanguageModelError).replace("\r\n", "\n").split("\n")
        if self.lines[-1] == "":
            self.lines.pop()
        self.line = 0

    def error(self, message: str, line: int | None = None) -> LanguageModelError:
        return LanguageModelError(at(self.path, self.line + 1 if line is None else line + 1, message))

    def model(self) -> BackoffModel:
        sizes = self.header()
        model = BackoffModel(Trie(Vocabulary((), {}), ()), (), ())
        for n, size in enumerate(sizes, start=1):
            first, words, log10_p, backoff = self.section(n, size, top=n == len(sizes))
            if n == 1:
                vocabulary = Vocabulary.of(word for (word,) in words)
                model = replace(model, trie=Trie(vocabulary, ()))
                key = vocabulary.ids([word for (word,) in words])
            else:
                model, key = self.keys(model, words, first)
            model = with_order(model, key, log10_p, backoff)
            if len(model.trie.keys[-1]) < size:
                twice = size - len(model.trie.keys[-1])
                log.warning("%s: %d of the %d-grams are listed twice; the first of each counts", self.path, twice, n)
        self.end()
        return model

    def header(self) -> list[int]:
        while self.line < len(self.lines) and (not self.lines[self.line].strip() or self.lines[self.line][0] == "#"):
            self.line += 1
        if self.take("an ARPA file, starting with \\data\\").rstrip() != "\\data\\":
            self.line -= 1
            raise self.error(f"{self.lines[self.line][:40]!r} found, \\data\\ expected; is this an ARPA file?")
        sizes: list[int] = []
        while self.line < len(self.lines) and self.lines[self.line].strip():
            match = _COUNT.fullmatch(self.lines[self.line])
            if not match or int(match[1]) != len(sizes) + 1:
                raise self.error(f"{self.lines[self.line][:40]!r} found, 'ngram {len(sizes) + 1}=COUNT' expected")
            sizes.append(int(match[2]))
            self.line += 1
        if not sizes:
            raise self.error("no 'ngram 1=COUNT' line after \\data\\")
        return sizes

    def section(self, n: int, size: int, *, top: bool) -> tuple[int, list[list[str]], Singles, Singles]:
        self.skip_blank()
        if self.take(f"\\{n}-grams:") != f"\\{n}-grams:":
            raise self.error(f"{self.lines[self.line - 1][:40]!r} found, \\{n}-grams: expected", self.line - 1)
        first = self.line
        last = min(first + size, len(self.lines))
        fields = [self.ngram(line, n, top) for line in range(first, last)]
        self.line = last
        if len(fields) < size or (last < len(self.lines) and self.lines[last].strip() and self.lines[last][0] != "\\"):
            raise self.error(
                f"the header promises {size} {n}-grams, and there are {'fewer' if len(fields) < size else 'more'}"
            )
        log10_p = np.array([p for p, _, _ in fields], np.float32)
        backoff = np.array([weight for _, _, weight in fields], np.float32)
        return first, [words for _, words, _ in fields], log10_p, backoff

    def ngram(self, line: int, n: int, top: bool) -> tuple[float, list[str], float]:
        text = self.lines[line]
        parts = text.split("\t") if n == 1 else re.split(r"[ \t]+", text.lstrip(" \t"))
        weighted = len(parts) == n + 2 and text.endswith("\t" + parts[-1])
        if not (weighted or len(parts) == n + 1) or not all(parts):
            expected = f"a number, {n} word{'s' * (n > 1)} and perhaps a tab and a weight"
            raise self.error(f"{text[:60]!r} found, {expected} expected", line)
        log10_p = self.number(parts[0], line, "log10 probability")
        if log10_p > 0:
            raise self.error(f"log10 probability {parts[0]} is above 0", line)
        weight = np.nan
        if weighted:
            weight = self.number(parts[-1], line, "backoff weight")
            if not np.isfinite(weight):
                raise self.error(f"backoff weight {parts[-1]} is not finite", line)
            if top and weight != 0:
                raise self.error(f"backoff weight {parts[-1]} on the highest order, which has none", line)
        # KenLM takes both spellings for the unknown word.
        words = ["<unk>" if word == "<UNK>" else word for word in parts[1 : n + 1]]
        return log_zero(log10_p), words, np.nan if top else log_zero(weight)

    def number(self, text: str, line: int, what: str) -> float:
        value = log10_number(text)
        if np.isnan(value):
            raise self.error(f"{what} {text[:60]!r} is not a number", line)
        return value

    def keys(self, model: BackoffModel, words: list[list[str]], first: int) -> tuple[BackoffModel, Ints]:
        """The trie keys of n-grams one longer than `model`'s, and the model with the contexts they need."""
        vocabulary = model.trie.vocabulary
        n = model.order + 1
        numbers = np.array([[vocabulary.index.get(word, -1) for word in ngram] for ngram in words], np.int64)
        numbers = numbers.reshape(-1, n)
        for i in np.flatnonzero((numbers < 0).any(axis=1))[:1].tolist():
            word = words[i][int(np.argmin(numbers[i]))]
            raise self.error(f"the word {word!r} is not among the 1-grams", first + i)
        row = rows_of(model.trie, numbers[:, :-1])
        lacking = np.flatnonzero(row < 0)
        if len(lacking):
            # KenLM takes a missing context for granted where another n-gram ends in it.
            endings = set(map(tuple, numbers[:, 1:].tolist()))
            for i in lacking.tolist():
                if tuple(numbers[i, :-1].tolist()) not in endings:
                    raise self.error(
                        f"the context {' '.join(words[i][:-1])!r} is not among the {n - 1}-grams", first + i
                    )
            model = self.with_contexts(model, np.unique(numbers[lacking, :-1], axis=0), first + int(lacking[0]))
            row = rows_of(model.trie, numbers[:, :-1])
        return model, row * len(vocabulary) + numbers[:, -1]

    def with_contexts(self, model: BackoffModel, numbers: Ints, line: int) -> BackoffModel:
        """`model` with n-grams (m, N) of the highest order N added, each with the log10 p that back-off gives it."""
        prefix = rows_of(model.trie, numbers[:, :-1])
        if (prefix < 0).any():
            raise self.error("the context of an n-gram is missing at two orders", line)
        trie = model.trie
        log10_p = np.array([model.tables.score(ngram)[-1] for ngram in numbers], np.float32)
        shorter = BackoffModel(Trie(trie.vocabulary, trie.keys[:-1]), model.log10_probs[:-1], model.backoffs[:-1])
        return with_order(
            shorter,
            np.concatenate([trie.keys[-1], prefix * len(trie.vocabulary) + numbers[:, -1]]),
            np.concatenate([model.log10_probs[-1], log10_p]),
            np.concatenate([model.backoffs[-1], np.full(len(log10_p), np.nan, np.float32)]),
        )

    def end(self) -> None:
        self.skip_blank()
        if self.take("\\end\\").rstrip() != "\\end\\":
            raise self.error(f"{self.lines[self.line - 1][:40]!r} found, \\end\\ expected", self.line - 1)
        self.skip_blank()
        if self.line < len(self.lines):
            raise self.error(f"{self.lines[self.line][:40]!r} found after \\end\\")

    def skip_blank(self) -> None:
        while self.line < len(self.lines) and not self.lines[self.line].strip():
            self.line += 1

    def take(self, expected: str) -> str:
        if self.line >= len(self.lines):
            raise self.error(
                f"the file ends where {expected} is expected; is it truncated?", max(0, len(self.lines) - 1)
            )
        self.line += 1
        return self.lines[self.line - 1]


def log10_number(text: str) -> float:
    """The number that a text is, nan for what is none."""
    try:
        # Python also takes 1_0, digits of other scripts, and blanks around them.
        return float(text) if _NUMBER.fullmatch(text) else np.nan
    except ValueError:
        return np.nan


def log_zero(value: float) -> float:
    """A log10 number of a file, -inf for -99 and less."""
    return -np.inf if value <= LOG_ZERO else value


def rows_of(trie: Trie, numbers: Ints) -> Ints:
    """Rows (m,) of the n-grams whose word numbers are the rows of `numbers` (m, n), -1 where not listed."""
    row = numbers[:, 0]
    for n in range(2, numbers.shape[1] + 1):
        row = trie.find(n, row, numbers[:, n - 1])
    return row


def with_order(model: BackoffModel, key: Ints, log10_p: Singles, backoff: Singles) -> BackoffModel:
    """`model` with one order more, given in any order; of duplicates the first counts, as in KenLM."""
    distinct, rows = np.unique(key, return_index=True)
    return BackoffModel(
        Trie(model.trie.vocabulary, (*model.trie.keys, distinct)),
        (*model.log10_probs, log10_p[rows]),
        (*model.backoffs, backoff[rows]),
    )
