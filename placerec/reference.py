"""The readable specification: counts, smoothing, back-off and filter in plain dictionaries and loops.

Slow, and without the roundings of SRILM's files; the fast rooms `lm` and `hohmm` are tested against it. It imports
nothing of placerec. An n-gram is a tuple of words; a model is (probability, weight): {n-gram: p}, {context: weight}.
"""

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence

Ngram = tuple[str, ...]
Model = tuple[Mapping[Ngram, float], Mapping[Ngram, float]]


def count(sentences: Iterable[Sequence[str]], order: int) -> Counter[Ngram]:
    """How often every n-gram of length 1..order occurs; none spans two sentences."""
    counts: Counter[Ngram] = Counter()
    for sentence in sentences:
        for start in range(len(sentence)):
            for end in range(start + 1, min(start + order, len(sentence)) + 1):
                counts[tuple(sentence[start:end])] += 1
    return counts


def smoothed(counts: Mapping[Ngram, int], vocabulary: Sequence[str], order: int, name: str, delta: float) -> Model:
    """p of every seen n-gram and the backoff weight of every seen context, by the formulas of readings 1.2.

    N: occurrences of the context h, T: distinct words after it, V: words in the vocabulary.
    """
    V = len(vocabulary)
    after: defaultdict[Ngram, dict[str, int]] = defaultdict(dict)
    for ngram, c in counts.items():
        after[ngram[:-1]][ngram[-1]] = c
    p: dict[Ngram, float] = {(word,): 1 / V for word in vocabulary}
    weight: dict[Ngram, float] = {}
    for h in sorted(after, key=len):
        N, T = sum(after[h].values()), len(after[h])
        lower = {word: backed_off((p, weight), word, h[1:]) if h else 1 / V for word in after[h]}
        # What the shorter context's words share, the whole that all is a part of, and what is taken off each count.
        shared, whole, off = {
            "witten-bell": (T, N + T, 0.0),
            "lidstone": (delta * V, N + delta * V, -delta),
            "absolute": (delta * T, N, delta),
            "jelinek-mercer": (N, 2 * N, 0.0),
        }[name.removesuffix("-backoff")]
        if name.endswith("-backoff"):
            seen = {word: (c - off) / whole for word, c in after[h].items()}
        else:
            own = {word: (c - max(off, 0)) / whole for word, c in after[h].items()}
            seen = {word: p_own + shared * lower[word] / whole for word, p_own in own.items()}
            if T < V and sum(seen.values()) > 1 - 3e-6:  # Words unseen here would be left with nothing.
                seen = own
        left = 1 - sum(seen.values())
        left_below = 1 - sum(lower.values())
        if not h:
            unseen = set(vocabulary) - set(seen)
            for word in unseen or seen:
                seen[word] = seen.get(word, 0) + left / len(unseen or seen)
        elif left_below > 3e-6:
            weight[h] = left / left_below
        else:  # Every word was seen here: nothing is left to back off to.
            seen = {word: value / (1 - left) for word, value in seen.items()}
        p.update({(*h, word): value for word, value in seen.items()})
    return p, weight


def backed_off(model: Model, word: str, history: Sequence[str]) -> float:
    """p(word | history): the longest listed n-gram, times the weights of the contexts that were too long."""
    p, weight = model
    h = tuple(history)
    if (*h, word) in p:
        return p[(*h, word)]
    return weight.get(h, 1.0) * backed_off(model, word, h[1:]) if h else 0.0


def belief(words: Sequence[str], models: Sequence[Model], order: int, stay: float) -> list[list[float]]:
    """The belief over places after every word: eq. 1 with fixed transitions."""
    C = len(models)
    leave = (1 - stay) / (C - 1) if C > 1 else 0.0
    matrix = [[stay if i == c else leave for c in range(C)] for i in range(C)]
    histories = [words[max(0, t - order + 1) : t] for t in range(len(words))]
    known = zip(words, histories, strict=True)
    loglik = [[_log(backed_off(model, word, history)) for model in models] for word, history in known]
    return filtered(loglik, [matrix] * len(words))[0]


def filtered(
    loglik: Sequence[Sequence[float]], matrices: Sequence[Sequence[Sequence[float]]]
) -> tuple[list[list[float]], list[bool]]:
    """The belief after every word, uniform at the start, and whether the word has a probability above 0 in any place.

    `loglik`: of each word in each place. `matrices`: the transitions before each word, rows the place before; the first
    is not used.
    """
    beliefs: list[list[float]] = []
    possible: list[bool] = []
    for t, row in enumerate(loglik):
        C = len(row)
        if t == 0:
            log_b = [-math.log(C)] * C
        else:
            log_b = [_log_sum([b + _log(matrices[t][i][c]) for i, b in enumerate(log_b)]) for c in range(C)]
        joint = [b + value for b, value in zip(log_b, row, strict=True)]
        total = _log_sum(joint)
        possible.append(total > -math.inf)
        if possible[-1]:
            log_b = [value - total for value in joint]
        beliefs.append([math.exp(value) for value in log_b])
    return beliefs, possible


def _log(x: float) -> float:
    return math.log(x) if x > 0 else -math.inf


def _log_sum(logs: Sequence[float]) -> float:
    top = max(logs)
    return top + math.log(sum(math.exp(x - top) for x in logs)) if top > -math.inf else top
