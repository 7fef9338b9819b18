"""Text drawn from a model.

The random stream is NumPy's PCG64 (`numpy.random.PCG64(seed)`), one `Generator.random()` per word: the word drawn is
the first, in the order of the vocabulary, at which the cumulative probability exceeds that number times the sum. The
same model and seed give the same text everywhere.
"""

from collections.abc import Callable, Sequence

import numpy as np

from placerec.arrays import Floats, Singles
from placerec.lm.logs import p_of

LONGEST = 50000


def draw_word(p: Floats, rng: "np.random.Generator") -> int:
    """The number of a word drawn with probabilities `p` (V,), which need not sum to 1."""
    cumulative = np.cumsum(p)
    return min(int(np.searchsorted(cumulative, rng.random() * cumulative[-1], side="right")), len(p) - 1)


def generate(
    spread: Callable[[Sequence[int]], Singles],
    prefix: Sequence[int],
    end: int,
    rng: "np.random.Generator",
    *,
    order: int,
    longest: int = LONGEST,
) -> list[int]:
    """Word numbers drawn one after the other behind `prefix` until `end` is drawn (it is left out).

    `spread` gives log10 p float32 (V,) of every word after a history of up to `order`-1 words; what cannot be drawn
    has -inf. The sentence ends as well where nothing can be drawn, and after `longest` words.
    """
    words: list[int] = []
    history = list(prefix)
    while len(words) < longest:
        p = p_of(spread(history[max(0, len(history) - order + 1) :]))
        if not p.sum() > 0:
            break
        word = draw_word(p, rng)
        if word == end:
            break
        words.append(word)
        history.append(word)
    return words
