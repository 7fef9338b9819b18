"""From a text to a model in one call."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from placerec.errors import LanguageModelError
from placerec.files import read_lines
from placerec.lm.backoff import BackoffModel
from placerec.lm.counts import count_ngrams
from placerec.lm.estimation import estimate
from placerec.lm.smoothings import JELINEK_MERCER, smoothing as smoothing_named
from placerec.lm.vocabulary import SENTENCE_END


def train_ngrams(
    text: Path | str | Iterable[Sequence[str]],
    order: int = 3,
    *,
    smoothing: str = "witten-bell",
    delta: float | None = None,
    min_count: Sequence[int] = (1,),
    vocabulary: Iterable[str] | None = None,
    markers: bool = True,
) -> BackoffModel:
    """The n-gram model of a text: the path of a file, a sentence a line (gzipped if it ends in .gz), or lists of words.

    `smoothing`, `delta`: see `placerec.smoothing`. `min_count`: see `placerec.estimate`. `vocabulary`: all words that
    there are; others are `<unk>`, of which nothing is estimated. Without `markers` there is no `<s>`, and `</s>` is
    never predicted. The model is that of `ngram-count -text` with the options of the smoothing. Raises
    LanguageModelError for a text that cannot be read, and for values that cannot be used.
    """
    if isinstance(text, Path | str):
        if not Path(text).exists():
            raise LanguageModelError(f"{text}: no such file; name a text, or give lists of words")
        text = (line.split() for line in read_lines(Path(text), LanguageModelError))
    held_out: Sequence[Sequence[str]] = ()
    if smoothing == JELINEK_MERCER:
        text = held_out = [*text]
    rule = smoothing_named(smoothing, delta, held_out)
    counts = count_ngrams(text, order, vocabulary=vocabulary, markers=markers)
    return estimate(counts, rule, min_count=min_count, non_events=() if markers else (SENTENCE_END,))
