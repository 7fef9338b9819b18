"""The table "Fewer words" of docs/srilm.md: ngram-class merges the words of a map, on held-out sequences.

python docs/make/merged_words.py DATA/SET... [--test GLOB ...]

Means and standard deviations over three maps. Words of a 20 x 20 map as they are; merged by what stands beside them in
the training sequences; and words of smaller maps with as many units. Witten-Bell bigrams, learned transitions, filter.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from single_frame import SIZE, arguments
from srilm_places import SEEDS, Split, accuracy_of, place_models, recognizer, run, splits, spread

from placerec.evaluation.metrics import evaluate
from placerec.hohmm import Beliefs
from placerec.words import WordStream

HEAD = """\
| set | words | accuracy | balanced | latency | log loss |
| --- | --- | --- | --- | --- | --- |
"""
SMALLER = (10, 5)


def merged(split: Split, classes: int, folder: Path) -> Split:
    """The streams with classes of words for words."""
    text = "".join(" ".join(stream.words) + "\n" for stream in split.training)
    command = ["-text", "text.txt", "-numclasses", str(classes), "-classes", "words.classes"]
    run(folder, "ngram-class", *command, **{"text.txt": text})
    lines = [line.split() for line in (folder / "words.classes").read_text().splitlines()]
    class_of = {word: name for name, _, word in lines}
    # Words that the training never has stay by themselves.
    names = sorted({class_of.get(word, word) for word in split.vocabulary})

    def renamed(stream: WordStream) -> WordStream:
        return replace(stream, words=tuple(class_of.get(word, word) for word in stream.words))

    return Split([*map(renamed, split.training)], [*map(renamed, split.tests)], names)


def decoded(split: Split) -> list[Beliefs]:
    """What the filter believes of the tests."""
    filters = recognizer(split, place_models(split))
    return [filters.decode(stream) for stream in split.tests]


def table(data: Path, test: Sequence[str]) -> str:
    """A set's lines."""
    judged: dict[str, list[list[float]]] = {}
    for seed in SEEDS:
        found: dict[str, list[Beliefs]] = {}
        for split in splits(data, test, seed):
            found.setdefault(f"map of {SIZE} x {SIZE}", []).extend(decoded(split))
            with TemporaryDirectory() as folder:
                for size in SMALLER:
                    name = f"of {SIZE} x {SIZE}, merged to {size**2}"
                    found.setdefault(name, []).extend(decoded(merged(split, size**2, Path(folder))))
        for size in SMALLER:
            for split in splits(data, test, seed, size):
                found.setdefault(f"map of {size} x {size}", []).extend(decoded(split))
        for name, beliefs in found.items():
            judged.setdefault(name, []).append([*accuracy_of(evaluation := evaluate(beliefs)), evaluation.log_loss])
    always = f"| {data.name} | always {evaluation.majority_place} | {evaluation.majority_accuracy:.3f} | | | |\n"
    return always + "".join(f"| {data.name} {line}\n" for line in spread(judged, (3, 3, 1, 2)))


if __name__ == "__main__":
    options = arguments(__doc__)
    sys.stdout.write(HEAD)
    for data in options.data:
        sys.stdout.write(table(data, options.test))
        sys.stdout.flush()
