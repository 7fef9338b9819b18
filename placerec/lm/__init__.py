"""Text -> n-gram model -> probability: a language-model toolkit that knows nothing of images or places.

The names below are loaded when they are first used, so that a tool that only scores does not load what estimates.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

_ROOMS = {
    "placerec.lm.arpa": ("format_arpa", "read_arpa", "with_unigrams", "write_arpa"),
    "placerec.lm.backoff": ("BackoffModel",),
    "placerec.lm.counts": ("NgramCounts", "count_ngrams", "format_counts"),
    "placerec.lm.estimation": ("estimate",),
    "placerec.lm.smoothings": ("SMOOTHINGS", "Smoothing", "smoothing"),
}
_HOME = {name: room for room, names in _ROOMS.items() for name in names}

if TYPE_CHECKING:
    from placerec.lm.arpa import (
        format_arpa as format_arpa,
        read_arpa as read_arpa,
        with_unigrams as with_unigrams,
        write_arpa as write_arpa,
    )
    from placerec.lm.backoff import BackoffModel as BackoffModel
    from placerec.lm.counts import (
        NgramCounts as NgramCounts,
        count_ngrams as count_ngrams,
        format_counts as format_counts,
    )
    from placerec.lm.estimation import estimate as estimate
    from placerec.lm.smoothings import SMOOTHINGS as SMOOTHINGS, Smoothing as Smoothing, smoothing as smoothing


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)
