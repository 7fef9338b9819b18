"""The table "Jelinek-Mercer" of docs/recognizer.md: what `placerec learn` makes, by smoothing, on held-out sequences.

python docs/make/learned_smoothings.py DATA/SET --fold 'GLOB ...' [--fold 'GLOB ...' ...]

A fold is the globs of the sequences that test; all others train. Means over the folds with their frames as weights;
four dictionaries of seed 0, weights learned.
"""

import argparse
import logging
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from held_out import part
from single_frame import described, fold_names

from placerec.evaluation.metrics import evaluate
from placerec.model import ModelOptions, load_model
from placerec.model.decoding import make_recognizer
from placerec.model.folder import ModelFolder
from placerec.model.learn import learn_folder
from placerec.vision import Descriptors, DictionarySet, DictionarySetOptions
from placerec.words.tokenize import streams_of_rows

HEAD = """\
| set | smoothing | accuracy | log loss | ECE |
| --- | --- | --- | --- | --- |
"""
SMOOTHINGS = ("witten-bell", "jelinek-mercer")


def judged(frames: Descriptors, tested: list[str], smoothing: str) -> tuple[list[float], int]:
    """Accuracy, log loss and calibration error in sequences that trained nothing, and the number of their frames."""
    training = part(frames, [name for name in dict.fromkeys(frames.sequences) if name not in tested])
    tests = part(frames, tested)
    with TemporaryDirectory() as path:
        folder = ModelFolder(Path(path))
        options = ModelOptions(smoothing=smoothing)
        learn_folder(folder, training.values, training.table, training.spec, DictionarySetOptions(), options)
        recognizer = make_recognizer(load_model(path))
        streams = streams_of_rows(tests.values, tests.table, DictionarySet.load(folder.words), tests.spec)
        found = evaluate([recognizer.decode(stream) for stream in streams])
    return [found.accuracy, found.log_loss, found.ece], found.frames


def rows(data: Path, folds: list[str]) -> str:
    """A set's lines."""
    frames, lines = described(data), []
    tests = [fold_names(frames, globs.split())[0] for globs in folds]
    for smoothing in SMOOTHINGS:
        numbers, weights = zip(*(judged(frames, tested, smoothing) for tested in tests), strict=True)
        accuracy, loss, error = np.average(numbers, axis=0, weights=weights)
        lines.append(f"| {data.name} | {smoothing} | {accuracy:.3f} | {loss:.3f} | {error:.3f} |\n")
    return "".join(lines)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="a folder of sequences with labels")
    parser.add_argument(
        "--fold", action="append", required=True, help="globs of sequences that test, with blanks between"
    )
    logging.getLogger("placerec").setLevel(logging.ERROR)
    options = parser.parse_args()
    sys.stdout.write(HEAD + rows(options.data, options.fold))
