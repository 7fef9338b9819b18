"""Sentences: the selected words of one visit to a place, one visit a line (readings A7, A22).

Grammar of `PLACE.txt`, plain SRILM text: `file = { word { " " word } NL }`.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from placerec.arrays import Floats, Ints, Mask
from placerec.errors import StreamError, refuse_string
from placerec.files import read_lines
from placerec.words.selection import Selection, select
from placerec.words.stream import WordStream, check_word

# A pause this many times longer than the usual time between two frames ends a visit: the recorder was off.
GAP_FACTOR = 10.0

Sentences = list[list[str]]


def time_gaps(times: Floats) -> Mask:
    """bool (n,): whether a frame follows a pause of more than GAP_FACTOR times the median time between frames."""
    steps = np.diff(times)
    known = steps[np.isfinite(steps) & (steps > 0)]
    gaps = np.zeros(len(times), bool)
    if len(known):
        gaps[1:] = np.nan_to_num(steps, nan=0.0) > GAP_FACTOR * np.median(known)
    return gaps


def continues(stream: WordStream) -> Mask:
    """bool (n,): whether a frame and the one before it are both labelled, with no gap in time between them."""
    labelled = stream.table.labelled
    continued = labelled & ~time_gaps(stream.times)
    continued[1:] &= labelled[:-1]
    continued[:1] = False
    return continued


def visits(stream: WordStream, selection: Selection) -> list[tuple[str, list[str]]]:
    """The labelled visits of a stream in order: place, and the selected words of the visit (perhaps none).

    Selection runs over the whole sequence, as at test; then a visit ends where the label changes, at an unlabelled
    frame and at a gap in time.
    """
    kept = select(stream.words, selection)
    continued = continues(stream)
    found: list[tuple[str, list[str]]] = []
    for i, (before, place) in enumerate(pairwise(["", *stream.places])):
        if place and not (continued[i] and place == before):
            found.append((place, []))
        if place and kept[i]:
            found[-1][1].append(stream.words[i])
    return found


def place_steps(stream: WordStream, places: Sequence[str]) -> Ints:
    """int64 (C, C): how often a frame at places[i] is followed by one at places[j].

    Counted between the frames that `continues` connects; `places` must hold every label of the stream.
    """
    at = stream.table.places.codes(places)
    after = np.flatnonzero(continues(stream))
    steps = np.bincount(at[after - 1] * len(places) + at[after], minlength=len(places) ** 2)
    return steps.reshape(len(places), len(places))


def place_triples(stream: WordStream, places: Sequence[str]) -> Ints:
    """int64 (C, C, C): how often a visit to places[j] came from one to places[i] and led to one to places[k].

    The frames from one to the next are those that `continues` connects; `places` must hold every label of the stream.
    """
    index = {place: i for i, place in enumerate(places)}
    triples = np.zeros((len(places),) * 3, np.int64)
    route: list[int] = []
    for place, continued in zip(stream.places, continues(stream).tolist(), strict=True):
        if not continued:
            route = []
        if place and route[-1:] != [index[place]]:
            route = [*route[-2:], index[place]]
            if len(route) == 3:
                triples[tuple(route)] += 1
    return triples


def sentences_per_place(streams: Iterable[WordStream], selection: Selection) -> dict[str, Sentences]:
    """The sentences of every place in the streams, places in alphabetical order.

    A place whose visits hold no selected word is there, with no sentence.
    """
    sentences: dict[str, Sentences] = {}
    for stream in streams:
        for place, words in visits(stream, selection):
            sentences.setdefault(place, []).extend([words] if words else [])
    return dict(sorted(sentences.items()))


def format_sentences(sentences: Sequence[Sequence[str]]) -> str:
    """The text of a sentence file; StreamError for a string in place of a sentence or of all of them."""
    for words in (sentences, *sentences):
        refuse_string(words, StreamError)
    return "".join(" ".join(words) + "\n" for words in sentences)


def read_sentences(path: Path | str) -> Sentences:
    """The sentences of a text file, one a line; blank lines and comment lines (##) are none, as in SRILM."""
    return list(each_sentence(path))


def each_sentence(path: Path | str) -> Iterator[list[str]]:
    """`read_sentences`, one at a time."""
    for i, line in enumerate(read_lines(Path(path), StreamError), start=1):
        if line.strip() and not line.startswith("##"):
            yield [check_word(path, i, word) for word in line.split()]
