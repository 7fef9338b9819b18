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


# By the name that it is imported under: what a user calls the package, and what installs it.
_OPTIONAL = {
    "matplotlib": ("matplotlib", "pip install 'placerec[plot]'"),
    "sklearn": ("scikit-learn", "pip install 'placerec[systems]'"),
    "rosbags": ("rosbags", "pip install 'placerec[bag]'"),
    "av": ("PyAV", "pip install 'placerec[video]'"),
    "mcap": ("mcap", "pip install 'placerec[bag]'"),
    "mcap_protobuf": ("mcap-protobuf-support", "pip install 'placerec[bag]'"),
    "distributed": ("distributed", "pip install 'placerec[cluster]'"),
    "kenlm": ("kenlm", "pip install kenlm (it is compiled; not on Windows, nor on Python 3.13)"),
}


def check_optional(module: str, purpose: str, instead: str = "") -> None:
    """Raise MissingExtraError if an optional package is not installed; nothing is imported.

    To be called before any work, and not where the package is used at the end of it. `instead`: another remedy.
    """
    # Errors are known to whatever starts, which is to be quick.
    from importlib.util import find_spec

    package, remedy = _OPTIONAL[module]
    try:
        found = find_spec(module) is not None
    except ImportError:
        found = False
    if not found:
        raise MissingExtraError(package, purpose, ", or ".join(filter(None, (remedy, instead))))


def refuse_string(words: object, error: type[PlacerecError]) -> None:
    """Raise `error` for a string where a list of words belongs: it would be taken letter by letter."""
    if isinstance(words, str):
        shown = words if len(words) <= 40 else f"{words[:40]}..."
        raise error(f"{shown!r} is a string; a list of words, not a string, is needed here: split it")


def at(path: "Path | str", line: int, message: str) -> str:
    """`message` with the position in front, as compilers print it."""
    return f"{path}:{line}: {message}"
