"""Beliefs files to an evaluation, and a picture of it."""

import os
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from placerec.errors import EvaluationError
from placerec.evaluation.metrics import Evaluation, evaluate
from placerec.figures.evaluation import plot_evaluation
from placerec.figures.panels import check_figure
from placerec.frames.naming import unique_names
from placerec.hohmm.beliefs import Beliefs, parse_beliefs, read_beliefs

_SUFFIXES = (".tsv", ".tsv.gz")


def evaluate_files(sources: Iterable[Path | str], *, plot: Path | str | None = None) -> Evaluation:
    """Judge beliefs files, folders of them, or standard input (`-`) by their true places; `plot` gets the picture.

    Files of one name are called by their folders too. Raises EvaluationError for what cannot be read or judged, and
    what `plot_evaluation` raises.
    """
    if plot is not None:
        check_figure(plot)
    paths = _files([Path(source) for source in sources])
    beliefs = [_read(path) for path in paths]
    names = unique_names([(one.name, path) for one, path in zip(beliefs, paths, strict=True)], EvaluationError)
    beliefs = [replace(one, stream=one.stream.renamed(name)) for one, name in zip(beliefs, names, strict=True)]
    evaluation = evaluate(beliefs)
    if plot is not None:
        plot_evaluation(beliefs, evaluation, plot)
    return evaluation


def _files(sources: list[Path]) -> list[Path]:
    files: dict[str, Path] = {}
    for source in sources:
        found = (
            sorted(path for path in source.iterdir() if path.name.endswith(_SUFFIXES)) if source.is_dir() else [source]
        )
        if not found:
            raise EvaluationError(f"{source}: holds no beliefs file (.tsv); write them with `placerec decode -o`")
        for path in found:
            if files.setdefault(os.path.abspath(path), path) is not path:
                raise EvaluationError(f"{path}: is given twice; its frames would count twice")
    return list(files.values())


def _read(path: Path) -> Beliefs:
    if str(path) != "-":
        return read_beliefs(path)
    try:
        return parse_beliefs(sys.stdin.buffer.read().decode(), name="stdin", source="<stdin>")
    except UnicodeDecodeError as error:
        raise EvaluationError(f"<stdin>: byte 0x{error.object[error.start]:02x} is not UTF-8") from error
