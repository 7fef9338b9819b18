"""The table "Places as hidden words" of docs/srilm.md: disambig beside the filter, on held-out sequences.

python docs/make/hidden_places.py DATA/SET... [--test GLOB ...]

Means and standard deviations over three maps of 20 x 20. `disambig` has a language model of the places' names, frame by
frame, and as its map the unigrams of the places' models; the filter has the same words with learned transitions.
"""

import sys
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from single_frame import arguments
from srilm_places import SEEDS, Split, accuracy_of, place_models, recognizer, run, splits, spread

from placerec.evaluation.metrics import evaluate
from placerec.hohmm import Beliefs
from placerec.lm import BackoffModel
from placerec.words import WordStream

HEAD = """\
| set | road | accuracy | balanced | latency |
| --- | --- | --- | --- | --- |
"""
DECODED = {
    "`decode`, n = 1": (1, {}),
    "`decode --viterbi`, n = 1": (1, {"viterbi": True}),
    "`decode --smooth`, n = 1": (1, {"smooth": True}),
    "`decode --viterbi`, n = 2": (2, {"viterbi": True}),
}
DISAMBIG = {
    "`disambig`": ["-order", "2"],
    "`disambig -fb`": ["-order", "2", "-fb"],
    "`disambig -order 3`": ["-order", "3"],
    "`disambig -mapw 0.25`": ["-order", "2", "-mapw", "0.25"],
}


def place_text(streams: Sequence[WordStream]) -> str:
    """The places of labelled frames that follow each other, a line for each stretch of them."""
    lines = []
    for stream in streams:
        for labelled, places in groupby(stream.places, bool):
            if labelled:
                lines.append(" ".join(places))
    return "".join(f"{line}\n" for line in lines)


def word_map(models: Mapping[str, BackoffModel], vocabulary: Sequence[str]) -> str:
    """What each word may stand for: p(word | place) for every place."""
    lines = []
    for word in vocabulary:
        p = [f"{place} {10 ** model.log10_p(word, ()):.7g}" for place, model in models.items()]
        lines.append(f"{word} {' '.join(p)}\n")
    return "".join(lines)


def disambiguated(split: Split, models: Mapping[str, BackoffModel], folder: Path) -> dict[str, list[Beliefs]]:
    """The places that disambig finds behind the words of the tests, by its options."""
    estimate = ["-order", "3", "-wbdiscount", "-interpolate", "-gt3min", "1", "-lm", "places.lm"]
    run(folder, "ngram-count", "-text", "places.txt", *estimate, **{"places.txt": place_text(split.training)})
    (folder / "words.map").write_text(word_map(models, split.vocabulary))
    (folder / "words.txt").write_text("".join(" ".join(stream.words) + "\n" for stream in split.tests))
    number = {place: i for i, place in enumerate(models)}
    found = {}
    for name, options in DISAMBIG.items():
        command = ["-map", "words.map", "-text", "words.txt", "-lm", "places.lm", "-no-eos", *options]
        lines = run(folder, "disambig", *command).splitlines()
        beliefs = []
        for stream, line in zip(split.tests, lines, strict=True):
            best = np.array([number[place] for place in line.split()[1:]])
            beliefs.append(Beliefs.of(stream, tuple(models), np.eye(len(number))[best]))
        found[name] = beliefs
    return found


def table(data: Path, test: Sequence[str]) -> str:
    """A set's lines."""
    judged: dict[str, list[list[float]]] = {}
    for seed in SEEDS:
        found: dict[str, list[Beliefs]] = {}
        for split in splits(data, test, seed):
            models = {order: place_models(split, order) for order in (1, 2)}
            filters = {order: recognizer(split, its) for order, its in models.items()}
            for name, (order, ahead) in DECODED.items():
                decoded = [filters[order].decode(stream, **ahead) for stream in split.tests]
                found.setdefault(name, []).extend(decoded)
            with TemporaryDirectory() as folder:
                for name, beliefs in disambiguated(split, models[1], Path(folder)).items():
                    found.setdefault(name, []).extend(beliefs)
        for name, beliefs in found.items():
            judged.setdefault(name, []).append(accuracy_of(evaluation := evaluate(beliefs)))
    always = f"| {data.name} | always {evaluation.majority_place} | {evaluation.majority_accuracy:.3f} | | |\n"
    return always + "".join(f"| {data.name} {line}\n" for line in spread(judged, (3, 3, 1)))


if __name__ == "__main__":
    options = arguments(__doc__)
    sys.stdout.write(HEAD)
    for data in options.data:
        sys.stdout.write(table(data, options.test))
        sys.stdout.flush()
