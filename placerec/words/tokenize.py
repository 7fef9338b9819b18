"""From images to token streams: the word of every frame."""

import json
import logging
from collections.abc import Callable, Iterable
from pathlib import Path

from placerec.files import whole_folder, write_text
from placerec.frames import Reading, find_sequences
from placerec.version import __version__
from placerec.vision import Descriptors, Dictionary, describe
from placerec.words.stream import WordStream, write_stream, write_vocabulary

OWNED = ("*.tsv", "vocab.txt", "tokens.json")
log = logging.getLogger(__name__)


def tokenize(
    sources: Iterable[Path | str],
    words: Path | str,
    out: Path | str,
    *,
    matrix: Path | str | None = None,
    reading: Reading = Reading(),
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """`placerec tokenize`: write the tokens folder `out` (one .tsv per sequence, vocab.txt) of image sources.

    `words`: the words.npz to use. `matrix`: the frames' descriptors, for a dictionary of descriptors that were computed
    elsewhere (`describe`). tokens.json names its fingerprint, so that models know what they were trained on.
    """
    dictionary = Dictionary.load(Path(words))
    # The folder comes first: that it cannot be written must not be found out after an hour of images.
    with whole_folder(Path(out), OWNED) as folder:
        streams = streams_of(sources, dictionary, matrix=matrix, reading=reading, progress=progress)
        _write(streams, dictionary, folder)
    seen = len({word for stream in streams for word in stream.words})
    log.info("%s: %d sequences, %d of %d words seen", out, len(streams), seen, len(dictionary.vocabulary))


def streams_of(
    sources: Iterable[Path | str],
    dictionary: Dictionary,
    *,
    matrix: Path | str | None = None,
    reading: Reading = Reading(),
    progress: Callable[[int, int], None] | None = None,
) -> list[WordStream]:
    """The token streams of image sources: each frame's best-matching unit in `dictionary`.

    `matrix`: as for `tokenize`. Raises VisionError for a dictionary that needs one if there is none.
    """
    sequences = find_sequences(sources, reading=reading)
    streams = tokens_of(describe(sequences, dictionary.spec, matrix=matrix, progress=progress), dictionary)
    for name in sorted({sequence.name for sequence in sequences} - {stream.name for stream in streams}):
        log.warning("%s: none of its images can be read; the sequence is left out", name)
    return streams


def tokens_of(descriptors: Descriptors, dictionary: Dictionary) -> list[WordStream]:
    """The token streams of described frames, one per sequence."""
    units, distances = dictionary.words(descriptors)
    vocabulary = dictionary.vocabulary
    streams = []
    for name, rows in descriptors.rows_by_sequence().items():
        streams.append(
            WordStream(
                name,
                tuple(descriptors.frames[row] for row in rows),
                descriptors.times[rows],
                tuple(descriptors.places[row] for row in rows),
                tuple(vocabulary[unit] for unit in units[rows].tolist()),
                distances[rows].astype(float),
            )
        )
    return streams


def write_tokens(streams: Iterable[WordStream], dictionary: Dictionary, out: Path) -> None:
    """Write the tokens folder `out`, whole or not at all."""
    with whole_folder(out, OWNED) as folder:
        _write(streams, dictionary, folder)


def _write(streams: Iterable[WordStream], dictionary: Dictionary, folder: Path) -> None:
    for stream in streams:
        write_stream(stream, folder / f"{stream.name}.tsv")
    write_vocabulary(dictionary.vocabulary, folder / "vocab.txt")
    description = {"format": "placerec tokens 1", "version": __version__, "dictionary": dictionary.fingerprint}
    write_text(folder / "tokens.json", json.dumps(description, indent=2) + "\n")
