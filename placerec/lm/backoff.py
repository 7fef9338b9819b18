"""The back-off model: a log10 probability for each listed n-gram, a backoff weight for each listed context."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from placerec.arrays import Floats, Ints, Singles
from placerec.lm.trie import Trie


@dataclass(frozen=True)
class BackoffModel:
    """An n-gram model as an ARPA file holds it.

    `log10_ps[n-1]` float32 (m_n,) beside the rows of `trie` (-inf for probability zero); `backoffs[n-1]` float32
    (m_n,) log10 weights, nan where the n-gram is not listed as a context.
    """

    trie: Trie
    log10_ps: tuple[Singles, ...] = field(repr=False)
    backoffs: tuple[Singles, ...] = field(repr=False)

    @property
    def order(self) -> int:
        return self.trie.order

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
        recent = list(history)[-(self.order - 1) :] if self.order > 1 else []
        return float(self.score([*recent, word])[-1])

    def score(self, words: Sequence[str]) -> Floats:
        """log10 p float64 (T,) of each of T words after those before it: empty first context, no markers.

        The sum over a sequence is its log10 probability. Vectorised: one binary search per order for all words.
        """
        return score_ids(self, self.ids(words))[0]

    def ids(self, words: Sequence[str]) -> Ints:
        """Word numbers int64 (T,); `<unk>`'s, or -1 if it is not listed, for words that are not listed."""
        ids = self.trie.vocabulary.ids(words)
        ids[ids < 0] = self.trie.vocabulary.index.get("<unk>", -1)
        return ids


def score_ids(model: BackoffModel, ids: Ints) -> tuple[Floats, Ints]:
    """log10 p float64 (T,) and the order that answered int64 (T,) (0: not even a unigram) for word numbers (T,)."""
    rows = ids
    log10_p = np.where(ids >= 0, model.log10_ps[0].astype(np.float64)[ids], -np.inf) if len(ids) else np.zeros(0)
    answered = (ids >= 0).astype(np.int64)
    for n in range(2, model.order + 1):
        # The (n-1)-gram that ends one word earlier is the context.
        context = np.full(len(rows), -1, np.int64)
        context[1:] = rows[:-1]
        rows = model.trie.find(n, context, ids)
        listed, known = rows >= 0, context >= 0
        backoff = np.zeros(len(rows))
        backoff[known] = np.nan_to_num(model.backoffs[n - 2][context[known]].astype(np.float64), neginf=-np.inf)
        log10_p = log10_p + backoff
        log10_p[listed] = model.log10_ps[n - 1][rows[listed]]
        answered[listed] = n
    return log10_p, answered
