"""What can go wrong for a reason that the user can mend: one class per room, one base for the border to catch."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


class PlacerecError(Exception):
    """Base of all errors that placerec raises on purpose; the message is one line: file, line, value, remedy."""


class SourceError(PlacerecError):
    """A sequence, an image or a label file that cannot be used."""


class VisionError(PlacerecError):
    """A descriptor, a dictionary or a words.npz that cannot be used."""


class StreamError(PlacerecError):
    """A token stream, vocabulary or sentence file that cannot be used."""


class LanguageModelError(PlacerecError):
    """Counts, an estimate or an ARPA file that cannot be used."""


class ModelError(PlacerecError):
    """A MODEL/ folder, a transition or a recognizer that cannot be used."""


class EvaluationError(PlacerecError):
    """Beliefs that cannot be judged or drawn."""


class ExperimentError(PlacerecError):
    """The description of an experiment, or data that do not fit it."""


class PageError(PlacerecError):
    """A page that cannot be served, or cannot show what it is given."""


class OutputError(PlacerecError):
    """An output that cannot be written."""


class MissingExtraError(PlacerecError):
    """An optional package that the request needs is not installed."""

    def __init__(self, package: str, purpose: str, remedy: str) -> None:
        # All three to the base: by them, an error of another process is made again in this one.
        super().__init__(package, purpose, remedy)

    def __str__(self) -> str:
        package, purpose, remedy = self.args
        return f"{purpose} needs the package {package}, which is not installed: {remedy}"


# By the name that it is imported under: what a user calls the package, and what pip is to install, all of an extra.
_BAG = "rosbags mcap mcap-protobuf-support"
_OPTIONAL = {
    "matplotlib": ("matplotlib", "matplotlib"),
    "sklearn": ("scikit-learn", "scikit-learn"),
    "rosbags": ("rosbags", _BAG),
    "av": ("PyAV", "av"),
    "mcap": ("mcap", _BAG),
    "mcap_protobuf": ("mcap-protobuf-support", _BAG),
    "distributed": ("distributed", "distributed"),
    "waitress": ("waitress", "waitress"),
    "rerun": ("rerun-sdk", "rerun-sdk"),
    "onnxruntime": ("onnxruntime", "onnxruntime"),
    # Where kenlm was beside it and is uninstalled, the module goes, and pip takes ufal-kenlm for installed.
    "kenlm": ("kenlm", "--force-reinstall ufal-kenlm"),
}


def check_optional(module: str, purpose: str, instead: str = "") -> None:
    """Raise MissingExtraError if an optional package is not installed; nothing is imported.

    To be called before any work, and not where the package is used at the end of it. `instead`: another remedy.
    """
    # Errors are known to whatever starts, which is to be quick.
    import shlex
    import sys
    from importlib.util import find_spec

    package, wanted = _OPTIONAL[module]
    try:
        found = find_spec(module) is not None
    except ImportError:
        found = False
    if not found:
        # Not the name of the extra: that needs the sources, and to know where they are.
        remedy = f"{shlex.quote(sys.executable)} -m pip install {wanted}"
        raise MissingExtraError(package, purpose, ", or ".join(filter(None, (remedy, instead))))


def refuse_string(words: object, error: type[PlacerecError]) -> None:
    """Raise `error` for a string where a list of words belongs: it would be taken letter by letter."""
    if isinstance(words, str):
        shown = words if len(words) <= 40 else f"{words[:40]}..."
        raise error(f"{shown!r} is a string; a list of words, not a string, is needed here: split it")


def counted(number: float, noun: str) -> str:
    """A number of things as people say it: "1 frame", "2 frames", "1.5 frames"."""
    return f"{number:.15g} {noun}{'' if number == 1 else 's'}"


def at(path: "Path | str", line: int, message: str) -> str:
    """`message` with the position in front, as compilers print it."""
    return f"{path}:{line}: {message}"
