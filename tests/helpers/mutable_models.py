"""Finished models as ones that can be changed."""

from collections.abc import Sequence

import numpy as np

from placerec.lm import BackoffModel
from placerec.lm.mutable import MutableModel, unite
from placerec.lm.vocabulary import Vocabulary


def mutable_models(
    models: Sequence[BackoffModel], non_events: Sequence[str], words: Sequence[str] = ()
) -> list[MutableModel]:
    """Mutable forms of models over one trie, that of all their n-grams; `words` are added to the vocabulary."""
    vocabulary = Vocabulary.of([word for model in models for word in model.words] + list(words))
    return unite([_mutable_model(model) for model in models], vocabulary, ~vocabulary.mask(non_events))


def _mutable_model(model: BackoffModel) -> MutableModel:
    trie = model.trie.with_endings()
    mutable = MutableModel(trie, np.ones(len(trie.vocabulary), bool))
    rows = np.arange(len(trie.vocabulary))
    for n in range(1, model.order + 1):
        rows = trie.find(n, rows[model.trie.prefix(n)], model.trie.word(n)) if n > 1 else rows
        mutable.stored[n - 1][rows] = True
        mutable.log10_p[n - 1][rows] = model.log10_probs[n - 1]
        backoff = model.backoffs[n - 1]
        is_context = ~np.isnan(backoff)
        mutable.backoff[n - 1][rows[is_context]] = backoff[is_context]
        mutable.add_contexts(n, rows[is_context])
    mutable.refresh_all()
    return mutable
