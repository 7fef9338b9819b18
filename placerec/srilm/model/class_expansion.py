"""A model over classes as one over words: `-expand-classes`, section T4.3 of our specification of SRILM's tools."""

import math
from collections import defaultdict
from collections.abc import Callable, Iterator
from itertools import product

import numpy as np

from placerec.arrays import Ints, Singles
from placerec.lm.mutable import MutableModel, Trace, reweigh
from placerec.lm.score import TokenSequence
from placerec.lm.trie import closed_trie
from placerec.lm.vocabulary import SENTENCE_END, SENTENCE_START
from placerec.srilm.model.class_scorers import ClassModel, Ngram, States, add_logs, single
from placerec.srilm.text.streams import SrilmError
from placerec.srilm.text.vocabulary import WordList

_MOST = 5_000_000
# Of all n-grams together: those of an expansion of a thousand words have a hundred million.
_MOST_WORDS = 20_000_000
_BLOCK = 1 << 18


def expanded(
    mutable: MutableModel,
    model: ClassModel,
    words: WordList,
    *,
    longest: int,
    exact: int,
    messages: Callable[[MutableModel], Trace],
) -> MutableModel:
    """The model of what the classes in the n-grams of `mutable` stand for, of at most `longest` words (0: any).

    `model`: that model with its classes. `exact`: n-grams of so many words or more get the exact probabilities of
    `model` (0: none). Raises SrilmError if there are too many n-grams.
    """
    masses = _masses(mutable, model, words, longest)
    total = -math.inf
    for ngram, mass in masses.items():
        total = add_logs(total, mass) if len(ngram) == 1 else total
    start = words.index.get(SENTENCE_START, -1)
    masses[()], masses[(start,)] = total, float(_each(model, np.array([[start]]), start)[0, 0])
    order = max(len(ngram) for ngram in masses)
    vocabulary, sorted_number = words.sorted()
    ngrams = [[ngram for ngram in masses if len(ngram) == n] for n in range(1, order + 1)]
    groups = [np.array(its, np.int64).reshape(len(its), n) for n, its in enumerate(ngrams, start=1)]
    trie, rows = closed_trie(vocabulary, order, [sorted_number[group] for group in groups])
    names = np.array(words.names(vocabulary), np.int64)
    changed = MutableModel(trie, ~vocabulary.mask(words.non_events), names)
    for n, (its, row) in enumerate(zip(ngrams, rows, strict=True), start=1):
        values = [_exact(model, ngram, start) if exact and n >= exact else _share(masses, ngram) for ngram in its]
        changed.stored[n - 1][row[-1]] = True
        changed.log10_p[n - 1][row[-1]] = values
        if n > 1:
            changed.add_contexts(n - 1, np.unique(row[-2]))
    changed.log10_p[0][vocabulary.ids([SENTENCE_START])] = -np.inf
    changed.refresh_all()
    reweigh(changed, messages(changed))
    return changed


def _share(masses: dict[Ngram, float], ngram: Ngram) -> float:
    mass, whole = masses[ngram], masses.get(ngram[:-1], -math.inf)
    return mass - whole if mass > -math.inf and whole > -math.inf else -math.inf


def _exact(model: ClassModel, ngram: Ngram, start: int) -> float:
    """log10 p of the last word given those before it."""
    opened = len(ngram) > 1 and ngram[0] == start
    states = model.start(start) if opened else States({((), ()): 0.0}, 0.0)
    log10_p = 0.0
    for word in ngram[opened:]:
        states, log10_p, _ = model.score(states, word)
    return log10_p


def _masses(mutable: MutableModel, model: ClassModel, words: WordList, longest: int) -> dict[Ngram, float]:
    """log10 p of each word n-gram that n-grams over words and classes stand for: by classes and by itself."""
    by_class: defaultdict[Ngram, float] = defaultdict(lambda: -math.inf)
    numbers = words.numbers(mutable.trie.vocabulary)
    start = words.index.get(SENTENCE_START, -1)
    ways = held = 0
    for n in range(1, min(mutable.order, longest or mutable.order) + 1):
        rows = np.flatnonzero(mutable.stored[n - 1])
        for begin in range(0, len(rows), _BLOCK):
            matrix = numbers[mutable.trie.matrix(n)[rows[begin : begin + _BLOCK]]]
            for tokens, each in zip(map(tuple, matrix.tolist()), _each(model, matrix, start), strict=True):
                ways += math.prod(len(model.definitions.of.get(token, (token,))) for token in tokens)
                if ways > _MOST:
                    raise SrilmError(
                        f"-expand-classes {longest}: classes stand for words in more than {_MOST} ways; "
                        "ask for shorter n-grams, or prune the model first"
                    )
                classed = any(token in model.definitions.of for token in tokens)
                for ngram, log10_p in _stood_for(tokens, each, model, longest):
                    held += len(ngram)
                    if held > _MOST_WORDS:
                        raise SrilmError(
                            f"-expand-classes {longest}: classes stand for n-grams that have more than {_MOST_WORDS} "
                            "words together; ask for shorter n-grams"
                        )
                    by_class[ngram] = add_logs(by_class[ngram], log10_p if classed else -math.inf)
    by_class.pop((start,), None)
    masses = dict(by_class)
    for n in {len(ngram) for ngram in masses}:
        its = [ngram for ngram in masses if len(ngram) == n]
        for begin in range(0, len(its), _BLOCK):
            part = its[begin : begin + _BLOCK]
            each = _each(model, np.array(part, np.int64), start)
            for ngram, log10_p in zip(part, np.cumsum(each, axis=1, dtype=np.float32)[:, -1].tolist(), strict=True):
                masses[ngram] = add_logs(masses[ngram], log10_p)
    return masses


def _each(model: ClassModel, matrix: Ints, start: int) -> Singles:
    """log10 p of each token of n-grams, a matrix (m, n), given those before it, float32 (m, n).

    <s> in front counts as </s>, as where contexts are weighed for pruning.
    """
    log10_p = model.model(TokenSequence.of_rows(matrix)).score().log10_p.reshape(matrix.shape)
    end = model.words.index[SENTENCE_END]
    model.prepare([((), end)])
    log10_p[matrix[:, 0] == start, 0] = model.steps[(), end].log10_p
    return log10_p


def _stood_for(tokens: Ngram, each: Singles, model: ClassModel, longest: int) -> Iterator[tuple[Ngram, float]]:
    """The word n-grams that end in the last of some tokens and begin in the first, and their log10 p.

    `each` (n,): log10 p of each token given those before it. Those of more than `longest` words are left out (0: none).
    """
    choices = [list(model.definitions.of.get(token, {(token,): 0.0}).items()) for token in tokens]
    joint = float(np.cumsum(each, dtype=np.float32)[-1])
    for chosen in product(*choices):
        log10_p = 0.0
        for _, share in chosen:
            log10_p = single(log10_p + single(share))
        log10_p = single(log10_p + joint)
        words = tuple(word for expansion, _ in chosen for word in expansion)
        first, last = len(chosen[0][0]), len(words) - len(chosen[-1][0])
        for begin in range(first):
            stop = min(len(words), begin + longest) if longest else len(words)
            for end in range(max(last, begin) + 1, stop + 1):
                yield words[begin:end], log10_p
