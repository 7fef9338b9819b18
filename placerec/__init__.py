"""Place recognition as language modelling: images -> visual words -> n-gram models -> belief over places.

The names below are loaded when they are first used: importing placerec loads neither OpenCV nor scipy.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from placerec.version import __version__

_ROOMS = {
    "placerec.errors": ("PlacerecError",),
    "placerec.frames": ("Frame", "SourceOptions", "Sequence", "find_sequences", "read_gray"),
    "placerec.vision": (
        "DescriptorSpec",
        "Dictionary",
        "DictionaryOptions",
        "DictionarySet",
        "DictionarySetOptions",
        "describe",
        "gist",
        "train_dictionary",
    ),
    "placerec.words": ("Selection", "WordStream", "parse_selection", "read_stream", "select", "write_stream"),
    "placerec.words.tokenize": ("tokenize",),
    "placerec.lm": ("BackoffModel", "count_ngrams", "estimate", "read_arpa", "smoothing", "write_arpa"),
    "placerec.lm.adapt": ("adapt_lm",),
    "placerec.lm.check": ("check_model",),
    "placerec.lm.inspect": ("inspect_model",),
    "placerec.lm.text": ("train_ngrams",),
    "placerec.hohmm": (
        "Belief",
        "Beliefs",
        "Recognizer",
        "Transition",
        "filter_stream",
        "fixed_transition",
        "learned_transition",
        "read_beliefs",
        "read_transitions",
    ),
    "placerec.learning": ("learn",),
    "placerec.model": ("Decoding", "ModelOptions", "calibrate", "load_recognizer", "train_lm", "update"),
    "placerec.methods": ("decode", "follow_live", "load_decoder"),
    "placerec.evaluation.metrics": ("evaluate",),
    "placerec.experiments.comparison.run": ("compare",),
    "placerec.experiments.grid.run": ("experiment",),
    "placerec.figures.evaluation": ("evaluate_files",),
    "placerec.inspection.decision": ("inspect_decision",),
    "placerec.inspection.frame": ("show_frame",),
    "placerec.inspection.word_sheet": ("show_words",),
    "placerec.inspection.word_stability": ("stability",),
    "placerec.page.label": ("label_pages",),
    "placerec.vision.light": ("relight",),
    "placerec.page.report": ("report",),
    "placerec.lab.layout": ("render_lab",),
}
_HOME = {name: room for room, names in _ROOMS.items() for name in names}

if TYPE_CHECKING:
    from placerec.errors import PlacerecError
    from placerec.evaluation.metrics import evaluate
    from placerec.experiments.comparison.run import compare
    from placerec.experiments.grid.run import experiment
    from placerec.figures.evaluation import evaluate_files
    from placerec.frames import Frame, Sequence, SourceOptions, find_sequences, read_gray
    from placerec.hohmm import (
        Belief,
        Beliefs,
        Recognizer,
        Transition,
        filter_stream,
        fixed_transition,
        learned_transition,
        read_beliefs,
        read_transitions,
    )
    from placerec.inspection.decision import inspect_decision
    from placerec.inspection.frame import show_frame
    from placerec.inspection.word_sheet import show_words
    from placerec.inspection.word_stability import stability
    from placerec.lab.layout import render_lab
    from placerec.learning import learn
    from placerec.lm import BackoffModel, count_ngrams, estimate, read_arpa, smoothing, write_arpa
    from placerec.lm.adapt import adapt_lm
    from placerec.lm.check import check_model
    from placerec.lm.inspect import inspect_model
    from placerec.lm.text import train_ngrams
    from placerec.methods import decode, follow_live, load_decoder
    from placerec.model import Decoding, ModelOptions, calibrate, load_recognizer, train_lm, update
    from placerec.page.label import label_pages
    from placerec.page.report import report
    from placerec.vision import (
        DescriptorSpec,
        Dictionary,
        DictionaryOptions,
        DictionarySet,
        DictionarySetOptions,
        describe,
        gist,
        train_dictionary,
    )
    from placerec.vision.light import relight
    from placerec.words import Selection, WordStream, parse_selection, read_stream, select, write_stream
    from placerec.words.tokenize import tokenize

__all__ = [
    "BackoffModel",
    "Belief",
    "Beliefs",
    "Decoding",
    "DescriptorSpec",
    "Dictionary",
    "DictionaryOptions",
    "DictionarySet",
    "DictionarySetOptions",
    "Frame",
    "ModelOptions",
    "PlacerecError",
    "Recognizer",
    "Selection",
    "Sequence",
    "SourceOptions",
    "Transition",
    "WordStream",
    "__version__",
    "adapt_lm",
    "calibrate",
    "check_model",
    "compare",
    "count_ngrams",
    "decode",
    "describe",
    "estimate",
    "evaluate",
    "evaluate_files",
    "experiment",
    "filter_stream",
    "find_sequences",
    "fixed_transition",
    "follow_live",
    "gist",
    "inspect_decision",
    "inspect_model",
    "label_pages",
    "learn",
    "learned_transition",
    "load_decoder",
    "load_recognizer",
    "parse_selection",
    "read_arpa",
    "read_beliefs",
    "read_gray",
    "read_stream",
    "read_transitions",
    "relight",
    "render_lab",
    "report",
    "select",
    "show_frame",
    "show_words",
    "smoothing",
    "stability",
    "tokenize",
    "train_dictionary",
    "train_lm",
    "train_ngrams",
    "update",
    "write_arpa",
    "write_stream",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'placerec' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return __all__
