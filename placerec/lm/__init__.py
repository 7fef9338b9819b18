"""Text -> n-gram model -> probability: a language-model toolkit that knows nothing of images or places."""

from placerec.lm.arpa import format_arpa, read_arpa, with_unigrams, write_arpa
from placerec.lm.backoff import BackoffModel
from placerec.lm.counts import NgramCounts, count_ngrams, format_counts
from placerec.lm.estimate import estimate
from placerec.lm.smoothings import SMOOTHINGS, Smoothing, smoothing

__all__ = [
    "SMOOTHINGS",
    "BackoffModel",
    "NgramCounts",
    "Smoothing",
    "count_ngrams",
    "estimate",
    "format_arpa",
    "format_counts",
    "read_arpa",
    "smoothing",
    "with_unigrams",
    "write_arpa",
]
