r"""ARPA files of others: what SRILM's `ngram` reads though KenLM refuses it (section 8 of our SRILM specification).

Whatever stands before `\data\` and behind `\end\` is passed over, blank lines and lines that start with ## are too;
fields may be separated by any blanks and tabs; sections may come in any order and hold more or fewer n-grams than the
header promises; a weight of the highest order does not count; words need not be among the 1-grams (p is 0 then); an
n-gram whose context is not listed is left out; log10 p may be above 0. Unlike `ngram`, this reader refuses numbers with
something behind them, and those that are nan or beyond all bounds: no model can be made of them.
"""

import logging
import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from placerec.errors import LanguageModelError, at
from placerec.files import all_lines
from placerec.lm.arpa import log10_number, log_zero, rows_of, with_order
from placerec.lm.backoff import BackoffModel
from placerec.lm.trie import Trie
from placerec.lm.vocabulary import Vocabulary

log = logging.getLogger(__name__)
_COUNT = re.compile(r"ngram\s*(\d{1,18})\s*=\s*\d{1,18}", re.ASCII)
_SECTION = re.compile(r"\\(\d{1,18})-grams", re.ASCII)
_SPACES, _BLANKS = " \t\n\v\f\r", re.compile(r"[ \t\r]+")
_MOST_ORDERS = 100


class _Section(NamedTuple):
    """N-grams of one order: words, log10 p and weights (nan: none), line by line."""

    words: list[list[str]]
    log10_p: list[float]
    backoff: list[float]


def read_tolerantly(path: Path | str) -> BackoffModel:
    """Read an ARPA file as `ngram` does. LanguageModelError, naming the line, for what no model can be made of."""
    sections = _sections(path)
    vocabulary = Vocabulary.of(word for section in sections for words in section.words for word in words)
    model = BackoffModel(Trie(vocabulary, ()), (), ())
    for n, section in enumerate(sections, start=1):
        numbers = np.array([vocabulary.ids(words) for words in section.words], np.int64).reshape(-1, n)
        log10_p, backoff = np.array(section.log10_p, np.float32), np.array(section.backoff, np.float32)
        if n == 1:
            # A word that only longer n-grams list has p 0; of several values the first counts, as below.
            rest = np.setdiff1d(np.arange(len(vocabulary)), numbers[:, 0])
            nothing = np.full(len(rest), np.nan, np.float32)
            key = np.concatenate([numbers[:, 0], rest])
            log10_p = np.concatenate([log10_p, np.full(len(rest), -np.inf, np.float32)])
            model = with_order(model, key, log10_p, np.concatenate([backoff, nothing]))
            continue
        row = rows_of(model.trie, numbers[:, :-1])
        listed = row >= 0
        if not listed.all():
            lost = len(listed) - int(listed.sum())
            log.warning("%s: %d of the %d-grams are left out: the contexts are not listed", path, lost, n)
        key = row[listed] * len(vocabulary) + numbers[listed, -1]
        model = with_order(model, key, log10_p[listed], backoff[listed])
    return model


def _sections(path: Path | str) -> list[_Section]:
    """The n-grams of orders 1, 2, ... up to the highest that the header names."""
    sections: dict[int, _Section] = {}
    section, n, i = None, 0, 1
    begun = False
    for i, line in enumerate(all_lines(path, LanguageModelError), start=1):

        def error(message: str, i: int = i) -> LanguageModelError:
            return LanguageModelError(at(path, i, message))

        if not begun:
            begun = line.startswith("\\data\\")
        elif not line.strip(_SPACES) or line.startswith("##"):
            continue
        elif line.startswith("\\end\\") and section is not None:
            return [sections.get(k, _Section([], [], [])) for k in range(1, max(sections) + 1)]
        elif match := _SECTION.match(line):
            n = int(match[1])
            if not 1 <= n <= max(sections, default=0):
                raise error(f"{line[:40]!r} found, and the header names no order {n}")
            section = sections.setdefault(n, _Section([], [], []))
        elif section is not None:
            _add(section, n, line, top=n == max(sections), error=error)
        elif (match := _COUNT.match(line)) and 1 <= int(match[1]) <= _MOST_ORDERS:
            sections[int(match[1])] = _Section([], [], [])
        else:
            raise error(f"{line[:40]!r} found, 'ngram N=COUNT' expected")
    if not begun:
        raise LanguageModelError(at(path, 1, "no line starts with \\data\\; is this an ARPA file?"))
    raise LanguageModelError(at(path, i, "the file ends where \\end\\ is expected; is it truncated?"))


def _add(section: _Section, n: int, line: str, *, top: bool, error: Callable[[str], LanguageModelError]) -> None:
    fields = [field for field in _BLANKS.split(line) if field]
    if len(fields) not in (n + 1, n + 2):
        expected = f"a number, {n} word{'s' * (n > 1)} and perhaps a weight"
        raise error(f"{line[:60]!r} found, {expected} expected")
    weighted = len(fields) == n + 2 and not top
    log10_p = _number("log10 probability", fields[0], error)
    backoff = _number("backoff weight", fields[-1], error) if weighted else np.nan
    # KenLM takes both spellings for the unknown word.
    section.words.append(["<unk>" if word == "<UNK>" else word for word in fields[1 : n + 1]])
    section.log10_p.append(log10_p)
    section.backoff.append(backoff)


def _number(what: str, text: str, error: Callable[[str], LanguageModelError]) -> float:
    value = log10_number(text)
    if not value < np.inf:
        raise error(f"{what} {text[:60]!r} is not a number")
    return log_zero(value)
