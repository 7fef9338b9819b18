"""The table "Where the place changes" of docs/srilm.md: hidden-ngram cuts unlabelled streams, on held-out sequences.

python docs/make/borders.py DATA/SET... [--test GLOB ...]

Means and standard deviations over three maps of 20 x 20. A border that is found counts as right if there is a true one
within FRAMES frames that no other one has taken; `even`: borders at equal distances, as many as the training has in so
many frames; `words`: wherever the word changes; `decode`: wherever the filter changes its mind, which knows the places.
"""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from single_frame import arguments
from srilm_places import SEEDS, Split, place_models, recognizer, run, splits, spread

HEAD = """\
| set | borders by | found in 100 frames | precision | recall | F1 |
| --- | --- | --- | --- | --- | --- |
"""
FRAMES = 5
CUT = "cut"
ORDERS = (2, 3)


def changes(names: Sequence[str]) -> list[int]:
    """The frames at which another name stands than at the one before."""
    return [i for i in range(1, len(names)) if names[i] != names[i - 1]]


def marked(words: Sequence[str], places: Sequence[str]) -> str:
    """The words of a stream, and CUT where the place changes."""
    borders = set(changes(places))
    return " ".join(f"{CUT} {word}" if i in borders else word for i, word in enumerate(words)) + "\n"


def cut(split: Split, order: int, folder: Path) -> list[list[int]]:
    """The borders that hidden-ngram finds in the tests, with a Witten-Bell model of words and borders."""
    text = "".join(marked(stream.words, stream.places) for stream in split.training)
    files = {"marked.txt": text, "vocab.txt": "\n".join([*split.vocabulary, CUT])}
    estimate = ["-wbdiscount", "-interpolate", "-gt3min", "1", "-vocab", "vocab.txt", "-lm", "events.lm"]
    run(folder, "ngram-count", "-order", str(order), "-text", "marked.txt", *estimate, **files)
    stream_text = "".join(" ".join(stream.words) + "\n" for stream in split.tests)
    events = {"events.txt": f"{CUT}\n", "streams.txt": stream_text}
    command = ["-order", str(order), "-lm", "events.lm", "-text", "streams.txt", "-hidden-vocab", "events.txt"]
    found = []
    for line in run(folder, "hidden-ngram", *command, **events).splitlines():
        borders, frames = [], 0
        for word in line.split():
            if word == CUT:
                borders.append(frames)
            else:
                frames += 1
        # One behind the last word parts nothing.
        found.append([border for border in borders if border < frames])
    return found


def right(found: Sequence[int], true: Sequence[int]) -> int:
    """How many borders have a true one near them, each of its own."""
    left, hits = sorted(true), 0
    for border in sorted(found):
        near = [one for one in left if abs(one - border) <= FRAMES]
        if near:
            left.remove(near[0])
            hits += 1
    return hits


def roads(split: Split) -> Iterator[tuple[str, list[list[int]]]]:
    """Per road the borders in each test stream."""
    frames = sum(len(stream) for stream in split.training)
    every = frames / max(1, sum(len(changes(stream.places)) for stream in split.training))
    yield "even", [[round(k * every) for k in range(1, int(len(stream) / every) + 1)] for stream in split.tests]
    yield "words", [changes(stream.words) for stream in split.tests]
    with TemporaryDirectory() as folder:
        for order in ORDERS:
            yield f"`hidden-ngram -order {order}`", cut(split, order, Path(folder))
    filters = recognizer(split, place_models(split))
    for name, smooth in (("`decode`", False), ("`decode --smooth`", True)):
        yield name, [changes(filters.decode(stream, smooth=smooth).best) for stream in split.tests]


def table(data: Path, test: Sequence[str]) -> str:
    """A set's lines."""
    judged: dict[str, list[list[float]]] = {}
    for seed in SEEDS:
        sums: dict[str, list[int]] = {}
        for split in splits(data, test, seed):
            true = [changes(stream.places) for stream in split.tests]
            frames = sum(len(stream) for stream in split.tests)
            for name, found in roads(split):
                hits = sum(map(right, found, true))
                numbers = hits, sum(map(len, found)), sum(map(len, true)), frames
                sums[name] = [a + b for a, b in zip(sums.get(name, [0] * len(numbers)), numbers, strict=True)]
        for name, (hits, all_found, all_true, frames) in sums.items():
            precision, recall = hits / max(1, all_found), hits / max(1, all_true)
            score = 2 * hits / max(1, all_found + all_true)
            judged.setdefault(name, []).append([100 * all_found / frames, precision, recall, score])
    truth = f"| {data.name} | (true ones) | {100 * all_true / frames:.1f} | | | |\n"
    return truth + "".join(f"| {data.name} {line}\n" for line in spread(judged, (1, 2, 2, 2)))


if __name__ == "__main__":
    options = arguments(__doc__)
    sys.stdout.write(HEAD)
    for data in options.data:
        sys.stdout.write(table(data, options.test))
        sys.stdout.flush()
