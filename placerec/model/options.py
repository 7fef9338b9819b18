"""How language models of places are made, and what says so: options, signatures, the equivalent SRILM commands."""

from collections.abc import Sequence
from dataclasses import dataclass

from placerec.errors import ModelError
from placerec.lm import BackoffModel, NgramCounts, estimate, smoothing, with_unigrams
from placerec.lm.smoothings import JELINEK_MERCER, SRILM_OPTIONS, default_delta
from placerec.lm.vocabulary import SENTENCE_END, SENTENCE_START, UNKNOWN
from placerec.version import __version__
from placerec.words import Selection

MAX_ORDER = 9


@dataclass(frozen=True)
class ModelOptions:
    """How language models are made; every name is that of the command line.

    `order`: n-gram order (1: the classical HMM). `delta`: see `placerec.lm.smoothing`; None for its default.
    `min_count`: per order, the last repeats. `markers`: whether `<s>` and `</s>` are counted.
    """

    order: int = 2
    smoothing: str = "witten-bell"
    delta: float | None = None
    min_count: tuple[int, ...] = (1,)
    markers: bool = False
    select: Selection = Selection()

    def check(self) -> None:
        """Raise ModelError or LanguageModelError for an option that no model can be made with."""
        if not 1 <= self.order <= MAX_ORDER:
            raise ModelError(f"order {self.order} is not between 1 and {MAX_ORDER}")
        if not self.min_count or min(self.min_count) < 1:
            raise ModelError(f"minimum counts {self.min_count} are not understood; give numbers above 0, one at least")
        smoothing(self.smoothing, self.delta)

    @property
    def delta_used(self) -> float:
        """`delta`, or the default of the smoothing."""
        return default_delta(self.smoothing) if self.delta is None else self.delta

    @property
    def holds_out(self) -> bool:
        """Whether the smoothing is fitted to sentences that are held out, so that their counts do not do."""
        return self.smoothing == JELINEK_MERCER

    def signature(self, place: str, words: int, dictionary: str = "") -> str:
        """What made the model of a place over `words` words, of a further `dictionary`: the ARPA file's first line."""
        delta = f" delta={self.delta_used:g}" if self.smoothing.startswith(("lidstone", "absolute")) else ""
        return (
            f"placerec {__version__} place={place}{f' dictionary={dictionary}' if dictionary else ''}"
            f" order={self.order} smoothing={self.smoothing}{delta}"
            f" select={self.select} min-count={','.join(map(str, self.min_count))}"
            f" markers={'yes' if self.markers else 'no'} vocab={words}"
        )

    def ngram_count_command(self, place: str) -> str | None:
        """The SRILM command, run in MODEL/, that makes the place's model of its sentences; None where there is none."""
        method = SRILM_OPTIONS[self.smoothing]
        if method is None:
            return None
        minima = [self.min_count[min(n, len(self.min_count)) - 1] for n in range(1, self.order + 1)]
        return " ".join(
            [
                f"ngram-count -text sentences/{place}.txt -vocab vocab.txt",
                *([] if self.markers else ["-nonevents nonevents.txt -no-sos -no-eos"]),
                f"-order {self.order}",
                *(f"-gt{n}min {minimum}" for n, minimum in enumerate(minima, start=1)),
                method.format(delta=self.delta_used),
                f"-lm {place}.arpa",
            ]
        )


def estimate_place(counts: NgramCounts, options: ModelOptions, sentences: Sequence[Sequence[str]] = ()) -> BackoffModel:
    """The language model of one place: V = all words of the counts' vocabulary.

    `sentences`: those that were counted, where `options.holds_out`.
    """
    non_events = () if options.markers else (SENTENCE_END,)
    rule = smoothing(options.smoothing, options.delta, sentences)
    model = estimate(counts, rule, min_count=options.min_count, non_events=non_events)
    return with_unigrams(model, (UNKNOWN, SENTENCE_START, SENTENCE_END))


def parse_min_count(text: str) -> tuple[int, ...]:
    """Minimum counts per order from `N[,N...]` or `srilm` (1,1,2: what ngram-count does); ModelError otherwise."""
    if text == "srilm":
        return (1, 1, 2)
    parts = text.split(",")
    if not all(part.isascii() and part.isdigit() and int(part) > 0 for part in parts):
        raise ModelError(f"minimum count {text!r} is not understood; give numbers above 0 as in 1,1,2, or srilm")
    return tuple(int(part) for part in parts)
