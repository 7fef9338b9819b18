"""A finished model changed by hand: words added, n-grams made more or less probable; every context sums to 1 still."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.errors import LanguageModelError
from placerec.lm.arpa import first_comment, read_arpa, write_arpa
from placerec.lm.backoff import BackoffModel
from placerec.lm.check import SUM_TOLERANCE, context_sums
from placerec.lm.logs import log10, p_of
from placerec.lm.mutable import SILENT, MutableModel, insert_prefixes, weigh_contexts
from placerec.lm.trie import closed_trie
from placerec.lm.vocabulary import SENTENCE_START, Vocabulary

Boosts = Mapping[tuple[str, ...], float]


def adapt_lm(path: Path | str, out: Path | str, add: Mapping[str, float | None], boost: Boosts) -> BackoffModel:
    """`adapt` the model in an ARPA file and write it to `out`, whole or not at all; the comment stays.

    Raises LanguageModelError, naming the file.
    """
    model = read_arpa(path)
    try:
        adapted = adapt(model, add, boost)
    except LanguageModelError as error:
        raise LanguageModelError(f"{path}: {error}") from error
    write_arpa(adapted, out, comment=first_comment(path).removeprefix("#").strip())
    return adapted


def adapt(model: BackoffModel, add: Mapping[str, float | None], boost: Boosts) -> BackoffModel:
    """`model` with words added and n-grams made more probable by factors; what is left of each context is scaled.

    `add`: words that the model does not list, with their probability where nothing else is known; None for that of the
    rarest word. `boost`: n-grams and what the probability of the last word after the others is multiplied by; an n-gram
    that is not listed is, then. Other words keep their proportions in each context, and backoff weights are computed
    anew; a context in which nothing was left for unseen words has nothing for added ones. Raises LanguageModelError for
    a model whose contexts do not sum to 1, a word that is listed or not, and probabilities that do not fit into 1.
    """
    _check_sums(model, "the model")
    mutable, targets = _opened(model, add, boost)
    p_added = _probabilities(model, mutable, add)
    for n in range(1, model.order + 1):
        if n > 1:
            weigh_contexts(mutable, n, SILENT)
            mutable.refresh(n)
        factors = {ngram: factor for ngram, factor in boost.items() if len(ngram) == n}
        if factors or (n == 1 and add):
            _scale(mutable, n, targets[n], np.array(list(factors.values())), factors, p_added if n == 1 else {})
            if n > 1:
                weigh_contexts(mutable, n, SILENT)
        mutable.refresh(n)
    insert_prefixes(mutable, SILENT)
    adapted = mutable.model()
    _check_sums(adapted, "the adapted model")
    return adapted


def _check_sums(model: BackoffModel, what: str) -> None:
    for n, rows, totals in context_sums(model):
        wrong = np.flatnonzero(~(np.abs(totals - 1) <= SUM_TOLERANCE))
        for i in wrong[:1].tolist():
            name = repr(model.trie.texts(n - 1)[int(rows[i])]) if n > 1 else "the empty context"
            remedy = "`ngram -renorm -write-lm` makes a model that sums to 1"
            raise LanguageModelError(f"{what} gives all words after {name} {totals[i]:.7g}, not 1; {remedy}")


def _opened(
    model: BackoffModel, add: Mapping[str, float | None], boost: Boosts
) -> tuple[MutableModel, dict[int, Ints]]:
    """The model as one that changes, with rows for what is boosted: per order, the rows in the order of `boost`."""
    for word in add:
        if word in model or not word or word.split() != [word]:
            reason = "is listed already; boost it instead" if word in model else "is no word"
            raise LanguageModelError(f"{word!r} {reason}")
    for ngram, factor in boost.items():
        missing = [word for word in ngram if word not in model and word not in add]
        if missing or not 1 <= len(ngram) <= model.order or ngram[-1] == SENTENCE_START:
            reason = f"{missing[0]!r} is not in the model" if missing else f"1 to {model.order} words are needed"
            raise LanguageModelError(f"{' '.join(ngram)!r} cannot be boosted: {reason}, and <s> is never predicted")
        if not 0 < factor < np.inf:
            raise LanguageModelError(f"{' '.join(ngram)!r} cannot be boosted by {factor:g}: a number above 0 is needed")
    vocabulary = Vocabulary.of([*model.words, *add])
    numbers = vocabulary.ids(model.words)
    own = [numbers[model.trie.matrix(n)] for n in range(1, model.order + 1)]
    wanted = {n: [vocabulary.ids(ngram) for ngram in boost if len(ngram) == n] for n in range(1, model.order + 1)}
    asked = [np.array(ngrams, np.int64).reshape(-1, n) for n, ngrams in wanted.items()]
    trie, rows = closed_trie(vocabulary, model.order, [*own, *asked])
    mutable = MutableModel(trie, ~vocabulary.mask([SENTENCE_START]))
    for n in range(1, model.order + 1):
        row = rows[n - 1][-1]
        mutable.stored[n - 1][row] = True
        mutable.log10_p[n - 1][row] = model.log10_probs[n - 1]
        weighted = ~np.isnan(model.backoffs[n - 1])
        mutable.backoff[n - 1][row[weighted]] = model.backoffs[n - 1][weighted]
        if n < model.order:
            mutable.add_contexts(n, row[weighted])
        if n > 1:
            mutable.add_contexts(n - 1, np.unique(trie.prefix(n)[row]))
    mutable.refresh_all()
    return mutable, {n: rows[model.order + n - 1][-1] for n in range(1, model.order + 1)}


def _probabilities(model: BackoffModel, mutable: MutableModel, add: Mapping[str, float | None]) -> dict[int, float]:
    """The probability of each added word, by number."""
    p = p_of(model.log10_probs[0])
    rarest = float(p[p > 0].min(initial=1.0))
    found = {}
    for word, given in add.items():
        value = rarest if given is None else given
        if not 0 < value < 1:
            raise LanguageModelError(f"{word!r} cannot get probability {value:g}: a number between 0 and 1 is needed")
        found[mutable.trie.vocabulary.index[word]] = value
    return found


def _scale(
    mutable: MutableModel, n: int, rows: Ints, factors: Floats, names: Boosts, added: Mapping[int, float]
) -> None:
    """Give rows of order n their new probabilities, and scale the others of the same contexts to what is left."""
    context = mutable.trie.prefix(n) if n > 1 else np.zeros(len(mutable.trie.keys[0]), np.int64)
    old = p_of(mutable.backed_off(n)[rows])
    new = old * factors
    sizes = np.zeros(int(context.max(initial=0)) + 1)
    before, after = sizes.copy(), sizes
    np.add.at(before, context[rows], old)
    np.add.at(after, context[rows], new)
    if added:
        rows = np.concatenate([rows, np.array(list(added), np.int64)])
        new = np.concatenate([new, np.array(list(added.values()))])
        after[0] += sum(added.values())
    touched = np.unique(context[rows])
    for place in touched[~(after[touched] < 1)].tolist():
        words = [" ".join(ngram) for ngram in names] + [mutable.trie.vocabulary.words[number] for number in added]
        raise LanguageModelError(
            f"{', '.join(map(repr, words[:3]))}: what is boosted or added in one context comes to {after[place]:.4g}, "
            "and must stay below 1; choose smaller numbers"
        )
    for place in touched[~(before[touched] < 1 - SUM_TOLERANCE)].tolist():
        ngram = next(iter(names))
        raise LanguageModelError(
            f"{' '.join(ngram)!r} cannot be boosted by {names[ngram]:g}: nothing else has probability in the context "
            f"({before[place]:.7g} is boosted); leave it out"
        )
    with np.errstate(divide="ignore"):
        scale = np.log10((1 - after) / np.where(before < 1, 1 - before, 1))
    others = mutable.stored[n - 1] & np.isin(context, touched)
    others[rows] = False
    mutable.log10_p[n - 1][others] += scale[context[others]].astype(np.float32)
    mutable.log10_p[n - 1][rows] = log10(new)
    mutable.stored[n - 1][rows] = True
    if n > 1:
        mutable.add_contexts(n - 1, touched)


def parse_addition(text: str) -> tuple[str, float | None]:
    """The word and the probability that `WORD[=P]` names; LanguageModelError for a P that is no number."""
    word, given, number = text.partition("=") if text.count("=") == 1 else (text, "", "")
    return (word, _number(text, number)) if given else (word, None)


def parse_boost(text: str) -> tuple[tuple[str, ...], float]:
    """The n-gram and the factor that `W1 W2=FACTOR` names; LanguageModelError if there is no factor."""
    ngram, _, number = text.rpartition("=")
    return tuple(ngram.split()), _number(text, number)


def _number(text: str, number: str) -> float:
    try:
        return float(number)
    except ValueError as error:
        raise LanguageModelError(f"{text!r}: {number!r} is not a number; write WORD=0.001 or 'W1 W2=3'") from error
