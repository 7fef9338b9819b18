"""Back-off models: a log10 probability for each listed n-gram, a backoff weight for each listed context."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from placerec.arrays import Floats, Ints, Singles
from placerec.errors import LanguageModelError, refuse_string
from placerec.lm.score import Contexts, Ngrams, ScoreTables, build_tables
from placerec.lm.trie import Trie, united_trie
from placerec.lm.vocabulary import SENTENCE_END, SENTENCE_START, UNKNOWN, Vocabulary

if TYPE_CHECKING:
    from placerec.lm.perplexity import Totals


@dataclass(frozen=True)
class BackoffModel:
    """An n-gram model as an ARPA file holds it.

    `log10_probs[n-1]` float32 (m_n,) beside the rows of `trie` (-inf for probability zero); `backoffs[n-1]` float32
    (m_n,) log10 weights, nan where the n-gram is not listed as a context.
    """

    trie: Trie
    log10_probs: tuple[Singles, ...] = field(repr=False)
    backoffs: tuple[Singles, ...] = field(repr=False)

    def __repr__(self) -> str:
        return f"BackoffModel({self.trie.sizes})"

    @property
    def order(self) -> int:
        return self.trie.order

    @property
    def listed_order(self) -> int:
        """The highest order of which there are n-grams, at least 1; a header may promise none of higher ones."""
        return max([n for n, keys in enumerate(self.trie.keys, start=1) if len(keys)], default=1)

    @property
    def words(self) -> tuple[str, ...]:
        """All listed words, `<s>`, `</s>` and `<unk>` among them."""
        return self.trie.vocabulary.words

    def __contains__(self, word: str) -> bool:
        return word in self.trie.vocabulary.index

    def log10_p(self, word: str, history: Sequence[str] = ()) -> float:
        """log10 p(word | history); only the last order-1 words of the history matter.

        A word that the model does not list is looked up as `<unk>`; without `<unk>` it has -inf.
        """
        refuse_string(history, LanguageModelError)
        recent = list(history)[-(self.order - 1) :] if self.order > 1 else []
        return float(self.score([*recent, word])[-1])

    def score(self, words: Sequence[str]) -> Floats:
        """log10 p float64 (T,) of each of T words after those before it: empty first context, no markers.

        The sum over a sequence is its log10 probability.
        """
        refuse_string(words, LanguageModelError)
        return self.tables.score(self.ids(words))

    def next_words(self, history: Sequence[str] = (), k: int = 10) -> list[tuple[str, float]]:
        """The k words that are most probable after `history`, and their log10 p, the most probable first.

        Equals stand in the order of their code points; `<s>` and words of probability 0 are left out. Words of the
        history are looked up as `log10_p` does. Raises LanguageModelError if k is negative.
        """
        refuse_string(history, LanguageModelError)
        if k < 0:
            raise LanguageModelError(f"k={k}: a number of words is needed, 0 or more")
        recent = list(history)[-(self.order - 1) :] if self.order > 1 else []
        digits = self.tables.digits(np.append(self.ids(recent), 0))
        log10_p = self.tables.distribution(Contexts(self.tables, digits, 0), len(recent))
        log10_p[self.trie.vocabulary.mask([SENTENCE_START])] = -np.inf
        best = np.argsort(-log10_p, kind="stable")[:k]
        return [(self.words[number], float(log10_p[number])) for number in best.tolist() if log10_p[number] > -np.inf]

    def perplexity(self, sentences: Iterable[Sequence[str]]) -> "Totals":
        """What the model makes of sentences of words: `sentences, words, oovs, zeroprobs, log10_p, ppl, ppl1`.

        Counted as `ngram -ppl` does: each sentence between `<s>` and `</s>`, no context spans two; words without
        probability are counted (`oovs`: unknown, `zeroprobs`: known), and neither in `log10_p` nor in `ppl`, which
        counts words and sentence ends (`ppl1`: words alone; None where there are none).
        """
        from placerec.lm.perplexity import Totals, tally_sentences

        refuse_string(sentences, LanguageModelError)
        marked = []
        for sentence in sentences:
            refuse_string(sentence, LanguageModelError)
            marked.append([SENTENCE_START, *sentence, SENTENCE_END])
        lengths = np.array([len(words) for words in marked], np.int64)
        starts = np.cumsum(lengths) - lengths
        ids = self.ids([word for words in marked for word in words])
        digits = self.tables.digits(ids)
        log10_p, _ = self.tables.find(Contexts(self.tables, digits, starts), digits)
        scored = np.ones(len(ids), bool)
        scored[starts] = False
        unknown = ids == self.trie.vocabulary.index.get(UNKNOWN, -1)
        rows = tally_sentences(log10_p.astype(np.float32), unknown, scored, lengths, np.ones(len(lengths), bool))
        ends, words, oovs, zeroprobs, total = rows.sum(axis=0).tolist()
        return Totals(int(ends), int(words), int(oovs), int(zeroprobs), total)

    def ids(self, words: Sequence[str]) -> Ints:
        """Word numbers int64 (T,); `<unk>`'s, or -1 if it is not listed, for words that are not listed."""
        ids = self.trie.vocabulary.ids(words)
        ids[ids < 0] = self.trie.vocabulary.index.get(UNKNOWN, -1)
        return ids

    @cached_property
    def tables(self) -> ScoreTables:
        """The tables that give words their probability."""
        columns = zip(self.log10_probs, map(float_weights, self.backoffs), self.backoffs, strict=True)
        orders = [
            [Ngrams(self.trie.matrix(n), log10_p.astype(np.float64), weight, ~np.isnan(backoff))]
            for n, (log10_p, weight, backoff) in enumerate(columns, start=1)
        ]
        return build_tables(len(self.words), orders)


def float_weights(backoff: Singles) -> Floats:
    """log10 weights float64 (m,) of a model's `backoffs`: 0 for what is no context."""
    return np.where(np.isnan(backoff), 0.0, backoff.astype(np.float64))


@dataclass(frozen=True)
class ModelUnion:
    """C models over the n-grams of all of them; make one with `unite_models`. `index`: the numbers of their words.

    The numbers are those of `BackoffModel.score`, to the last bit: the same float64 sums in the same order.
    """

    index: Mapping[str, int] = field(repr=False)
    tables: ScoreTables = field(repr=False)

    def __repr__(self) -> str:
        models = self.tables.log10_p.shape[1]
        return f"ModelUnion({models} models, {len(self.index)} words, {len(self.tables.log10_p) - 1} n-grams)"

    def score(self, words: Sequence[str]) -> Floats:
        """log10 p float64 (T, C) of each of T words after those before it: empty first context, no markers.

        Raises KeyError for a word that is not listed.
        """
        refuse_string(words, LanguageModelError)
        return self.tables.score(np.fromiter(map(self.index.__getitem__, words), np.int64, len(words)))

    def follow(self) -> Callable[[str], list[float]]:
        """A function to be asked for each word of a text in turn: the C log10 p that `score` gives it, or KeyError.

        Constant memory: it remembers where the last N-1 words stand.
        """
        return self.tables.follow(self.index)


def unite_models(models: Sequence[BackoffModel]) -> ModelUnion:
    """C models as one: a look-up answers for all of them; a word that a model does not list has -inf under it."""
    tries = [model.trie.with_endings() for model in models]
    trie = united_trie(Vocabulary.of(word for trie in tries for word in trie.vocabulary.words), tries)[0]
    log10_p, weights = _columns(trie, models)
    for n in range(2, trie.order + 1):
        # By back-off where a model does not list an n-gram.
        lower = log10_p[n - 2][trie.suffixes[n - 1]] + weights[n - 2][trie.prefix(n)]
        log10_p[n - 1] = np.where(np.isnan(log10_p[n - 1]), lower, log10_p[n - 1])
    orders = [
        [Ngrams(trie.matrix(n), p, weight, np.ones(len(p), bool))]
        for n, (p, weight) in enumerate(zip(log10_p, weights, strict=True), start=1)
    ]
    return ModelUnion(trie.vocabulary.index, build_tables(len(trie.vocabulary), orders))


def _columns(trie: Trie, models: Sequence[BackoffModel]) -> tuple[list[Floats], list[Floats]]:
    """Per order (m_n, C): the log10 p that models list, nan where they do not (-inf for words); backoff weights."""
    log10_p = [np.full((len(keys), len(models)), np.nan) for keys in trie.keys]
    weights = [np.zeros((len(keys), len(models))) for keys in trie.keys]
    log10_p[0][:] = -np.inf
    for c, model in enumerate(models):
        word = row = trie.vocabulary.ids(model.words)
        for n in range(1, model.order + 1):
            if n > 1:
                row = trie.find(n, row[model.trie.prefix(n)], word[model.trie.word(n)])
            log10_p[n - 1][row, c] = model.log10_probs[n - 1]
            weights[n - 1][row, c] = float_weights(model.backoffs[n - 1])
    return log10_p, weights
