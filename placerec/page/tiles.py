"""The typical frame of each word: of the frames of some drives the nearest to the word's unit."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from placerec.frames import Sequence as FrameSequence
from placerec.jobs import Progress
from placerec.page.drives import Drive
from placerec.vision import Descriptors, DictionarySet, describe


def tiles_of(
    drives: Sequence[Drive],
    sequences: Mapping[str, FrameSequence],
    words: Path | str,
    progress: Progress | None = None,
    cache: Path | str | None = None,
    network: Path | str | None = None,
) -> dict[str, tuple[str, int]]:
    """Word -> drive and number of the frame that is typical of it, for the words that a frame of the drives has.

    `sequences`: the images of each drive by the drive's name. `cache`: see `placerec.vision.describe`. `network`: the
    file of the image network, for words of one. Raises VisionError for a words.npz that cannot be read.
    """
    dictionaries = DictionarySet.load(words, network=network)
    named = [FrameSequence(name, one.frames, one.source, one.recording) for name, one in sequences.items()]
    found = describe(named, dictionaries.spec, cache=cache, progress=progress)
    return typical_frames(drives, found, dictionaries)


def typical_frames(
    drives: Sequence[Drive], descriptors: Descriptors, dictionaries: DictionarySet
) -> dict[str, tuple[str, int]]:
    """What `tiles_of` gives, from the descriptors of the drives' frames, whose sequences are called as the drives."""
    number = {(drive.name, frame): index for drive in drives for index, frame in enumerate(drive.frames)}
    found: dict[str, tuple[str, int]] = {}
    frames = list(zip(descriptors.sequences, descriptors.frames, strict=True))
    for one, (units, distances) in zip(dictionaries.dictionaries, dictionaries.words(descriptors), strict=True):
        # From the farthest to the nearest, so that the nearest stays.
        for row in np.argsort(-distances, kind="stable").tolist():
            if frames[row] in number:
                found[one.vocabulary[int(units[row])]] = (frames[row][0], number[frames[row]])
    return found
