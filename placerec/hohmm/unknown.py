"""Somewhere new: the probability that the place is none of those that were trained.

A chain of two states, known and unknown, runs beside the filter and is fed by what the filter predicts; the beliefs in
the places stay what they are without it. What speaks for `unknown`, as the natural logarithm of a likelihood ratio:

- the word: the places' mean probability of it and the flat 1/V, mixed as if the flat one were one more place, against
  the probability that the filter predicted for it (readings 5.3.3);
- the distance from the descriptor to its word: normal in log2, with the mean and variance of the training distances,
  against the same an octave further out.

Both depend on training frames that the map was fitted to, one next to the other, and are corrected for that. If n
independent samples train k units, they lie closer to them than new ones by sqrt((n - k) / (n + k)), which is how far
a k-means of n samples flatters itself; and neighbouring frames of one word say the same thing twice. The number of
independent samples is taken to be that of runs of equal words.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import groupby

import numpy as np

from placerec.arrays import Floats, Ints
from placerec.hohmm.transitions import fixed_transition
from placerec.lm.logs import LN10

# Unknown and known are kept with the paper's p_e, in the steps of the places' transitions.
CHAIN = fixed_transition(2, 0.99)
# How much further out than a known place a new one lies, in octaves: 0.6 to 1 for GIST in rooms.
OUTLYING = 1.0
# Neighbouring units of a map are not free of each other, so that k of them fit less than k would.
_FREEDOM = 0.9
# What the correction leaves open, in octaves.
_SHIFT_ERROR = 0.3
BINS_PER_OCTAVE = 8
# Distances of the frames of a place to their words: ascending bin -> how many, none of them 0. These are integers, so
# that adding and taking away is exact. A distance d is in bin b if 2**(b/8) <= d < 2**((b+1)/8).
Histogram = dict[int, int]


def distance_bins(distances: Floats) -> Ints:
    """int64 (k,): floor(8 log2 d) of those of `distances` (n,) that are above 0; the others, and nan, are left out."""
    known = distances[np.isfinite(distances) & (distances > 0)]
    bins: Ints = np.floor(BINS_PER_OCTAVE * np.log2(known)).astype(np.int64)
    return bins


def distance_histogram(distances: Floats) -> Histogram:
    """How many of `distances` (n,) are in each bin."""
    bins, counts = np.unique(distance_bins(distances), return_counts=True)
    return dict(zip(bins.tolist(), counts.tolist(), strict=True))


def add_histograms(first: Histogram, second: Histogram, sign: int = 1) -> Histogram:
    """`first` plus `sign` (1 or -1) times `second`; a difference may be negative, an empty bin is left out."""
    total = {b: first.get(b, 0) + sign * second.get(b, 0) for b in sorted(first.keys() | second.keys())}
    return {b: count for b, count in total.items() if count}


@dataclass(frozen=True)
class WordRuns:
    """Of the training words: how many, in how many runs of equal ones, and how many different ones."""

    frames: int
    runs: int
    words: int


@dataclass(frozen=True)
class DistanceModel:
    """log2 of the distances that new frames of C known places have: mean (C,) and one variance."""

    mean: Floats = field(repr=False)
    variance: float


@dataclass(frozen=True)
class UnknownModel:
    """What evidence for a new place is weighed with.

    `vocabulary`: the number of words V. `news`: the share of frames that are not repetitions, from 0 to 1. `distance`
    is None where the training streams had no distances.
    """

    vocabulary: int
    news: float
    distance: DistanceModel | None


def word_runs(sentences: Iterable[Sequence[Sequence[str]]]) -> WordRuns:
    """Count runs of equal words in the sentences of all places; a visit's end ends a run."""
    frames, runs = 0, 0
    words: set[str] = set()
    for sentence in (sentence for place in sentences for sentence in place):
        frames += len(sentence)
        runs += sum(1 for _ in groupby(sentence))
        words.update(sentence)
    return WordRuns(frames, runs, len(words))


def unknown_model(
    vocabulary: int,
    runs: WordRuns,
    histograms: Sequence[Histogram] | None = None,
    *,
    measured: tuple[float, float] | None = None,
) -> UnknownModel:
    """The model of a new place beside C known ones.

    `histograms`: per place in order, bin floor(8 log2 distance) -> training frames; None, or all empty, where there
    are no distances. `measured`: shift and variance of log2 distance from `measure_distances` on held-out sequences,
    which replace what is derived from `runs`.
    """
    news = runs.runs / runs.frames if runs.frames else 1.0
    if not any(histograms or ()):
        return UnknownModel(vocabulary, news, None)
    means, variance = _training_distances(histograms or ())
    shift, spread = measured or (_optimism(runs), variance)
    return UnknownModel(vocabulary, news, DistanceModel(means + shift, spread + _SHIFT_ERROR**2))


def measure_distances(distances: Floats, places: Ints, histograms: Sequence[Histogram]) -> tuple[float, float] | None:
    """Shift and variance of log2 distance against the training means, over frames (n,) of known places.

    `places`: (n,) int64, the true place's index in `histograms`. Frames without a distance are left out; None if fewer
    than two are left. From sequences that trained neither words nor models.
    """
    means, _ = _training_distances(histograms)
    usable = np.isfinite(distances) & (distances > 0)
    if usable.sum() < 2 or not np.isfinite(means).all():
        return None
    outlying = np.log2(distances[usable]) - means[places[usable]]
    return float(outlying.mean()), float(outlying.var())


def evidence_of_all(
    models: Sequence[UnknownModel], log10_likelihoods: Floats, predicted: Floats, distances: Floats
) -> Floats:
    """The mean of `evidence` over dictionaries, float64 (T,): words of one frame say much the same of a new place.

    models: of D dictionaries; log10_likelihoods: (D, T, C) of their words in each place, nan where a dictionary says
    nothing; predicted: (T, C) the filter's belief before each frame; distances: (D, T), nan where unknown.
    """
    if len(models) == 1:
        return evidence(models[0], log10_likelihoods[0], predicted, distances[0])
    ratio, heard = np.zeros(len(predicted)), np.zeros(len(predicted))
    for model, likelihoods, far in zip(models, log10_likelihoods, distances, strict=True):
        said = ~np.isnan(likelihoods).any(axis=1)
        ratio[said] += evidence(model, likelihoods[said], predicted[said], far[said])
        heard += said
    return ratio / np.maximum(heard, 1)


def evidence(model: UnknownModel, log10_likelihoods: Floats, predicted: Floats, distances: Floats) -> Floats:
    """log of p(frame | unknown) / p(frame | known), natural, (T,) for T selected frames, by one dictionary.

    log10_likelihoods: (T, C) of each word in each place; predicted: (T, C) the filter's belief before each word
    (uniform before the first); distances: (T,), nan where unknown. A frame's evidence depends on its own row alone.
    """
    ratio = _word_evidence(model.vocabulary, log10_likelihoods, predicted)
    if model.distance is not None:
        ratio = ratio + _distance_evidence(model.distance, predicted, distances)
    return model.news * ratio


def prior(places: int) -> tuple[float, float]:
    """The probabilities of `unknown` and of known before anything is seen: it is one place beside the C known ones."""
    return 1 / (places + 1), places / (places + 1)


def chain_evidence(ratios: Floats, places: int) -> Floats:
    """log10 p float64 (T, 2) of T frames in the states of the chain, unknown and known; `ratios` (T,): of `evidence`.

    A filter that begins with even beliefs begins with `prior` by them: that is put into the first frame.
    """
    found = np.zeros((len(ratios), 2))
    found[:, 0] = ratios / LN10
    found[:1, 0] -= math.log10(places)
    return found


def _word_evidence(vocabulary: int, log10_likelihoods: Floats, predicted: Floats) -> Floats:
    # A likelihood ratio does not change if all likelihoods are divided by the largest.
    top = log10_likelihoods.max(axis=1, initial=-np.inf)
    scale = np.where(np.isfinite(top), top, 0.0)
    likelihood = 10.0 ** (log10_likelihoods - scale[:, None])
    flat = 10.0**-scale / vocabulary
    anywhere = (likelihood.sum(axis=1) + flat) / (log10_likelihoods.shape[1] + 1)
    known = (predicted * likelihood).sum(axis=1)
    with np.errstate(divide="ignore"):
        ratio: Floats = np.log(anywhere) - np.log(known)
    # A word that no likely place explains would otherwise decide alone.
    return np.minimum(ratio, math.log(max(vocabulary, 2)), out=ratio)


def _distance_evidence(model: DistanceModel, predicted: Floats, distances: Floats) -> Floats:
    usable = np.isfinite(distances) & (distances > 0)
    outlying = np.log2(np.where(usable, distances, 1.0)) - (predicted * model.mean).sum(axis=1)
    # Two normal distributions of one variance; beyond half an octave outside their means nothing more is learnt.
    centred = np.clip(outlying - OUTLYING / 2, -OUTLYING, OUTLYING)
    return np.where(usable, centred * OUTLYING / model.variance, 0.0)


def _training_distances(histograms: Sequence[Histogram]) -> tuple[Floats, float]:
    """Of log2 distance in training: the mean (C,) per place, that of all where it has none, and the variance within."""
    counts = [np.array(list(histogram.values()), np.float64) for histogram in histograms]
    values = [(np.array(list(histogram), np.float64) + 0.5) / BINS_PER_OCTAVE for histogram in histograms]
    sums = [float(count @ value) for count, value in zip(counts, values, strict=True)]
    total = sum(float(count.sum()) for count in counts)
    overall = sum(sums) / total if total else math.nan
    means = np.array([s / count.sum() if count.sum() else overall for s, count in zip(sums, counts, strict=True)])
    within = sum(float(count @ (value - mean) ** 2) for count, value, mean in zip(counts, values, means, strict=True))
    return means, within / total if total else math.nan


def _optimism(runs: WordRuns) -> float:
    """By how many octaves new frames lie further from their words than training frames."""
    fitted = _FREEDOM * runs.words
    return 0.5 * math.log2((runs.runs + fitted) / (runs.runs - fitted)) if fitted else 0.0
