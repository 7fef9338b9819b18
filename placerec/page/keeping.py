"""Frames that are named while a camera stands in a place, kept as a labelled sequence and its token stream.

FOLDER/NAME/ has the images, `t<seconds>.png`, and places.lst, as any labelled drive; FOLDER/NAME.tsv the tokens, which
`placerec update` takes. Every frame is there as soon as it was answered, so that a run that is killed has kept what it
saw.
"""

from collections.abc import Collection, Sequence
from pathlib import Path

import cv2
import numpy as np

from placerec.errors import OutputError
from placerec.files import writing
from placerec.frames.layouts import COLD_LIST
from placerec.frames.naming import with_parent
from placerec.frames.sequence import Frame, Gray
from placerec.words import WordStream
from placerec.words.stream import WordColumn, format_header, format_rows

# Little smaller with more, and a robot has no time for it.
_COMPRESSION = [cv2.IMWRITE_PNG_COMPRESSION, 1]


class KeptFrames:
    """A sequence in `folder` that grows: `name` is the first of NAME-1, NAME-2... that is free, and not in `taken`.

    `dictionaries`: the names of the dictionaries, the first one's is empty. `count`: labelled frames so far.
    """

    def __init__(self, folder: Path, name: str, dictionaries: Sequence[str], taken: Collection[str]) -> None:
        self.name = next(
            one
            for number in range(1, 1 << 30)
            if not {one := f"{name}-{number}", with_parent(one, folder / one)} & {*taken}
            and not (folder / one).exists()
            and not (folder / f"{one}.tsv").exists()
        )
        self.folder, self.count = folder / self.name, 0
        self.tokens = folder / f"{self.name}.tsv"
        self._dictionaries, self._place = dictionaries, ""

    def add(
        self, frame: Frame, image: Gray, words: Sequence[str], distances: Sequence[float | None], place: str
    ) -> None:
        """Keep a frame that is in `place`; of those in none ("") only one that ends a visit is kept.

        `words`, `distances`: of each dictionary. Raises OutputError for what cannot be written.
        """
        if not place and not self._place:
            return
        name = f"t{frame.time:.6f}.png"
        stream = self._stream(name, frame.time, words, distances, place)
        with writing(self.folder):
            if not self.folder.exists():
                self.folder.mkdir(parents=True)
                _append(self.tokens, format_header(stream))
            done, data = cv2.imencode(".png", image.clip(0, 255).astype(np.uint8), _COMPRESSION)
            if not done:
                raise OutputError(f"{self.folder}: frame {frame.name} cannot be kept as PNG")
            (self.folder / name).write_bytes(data.tobytes())
            _append(self.tokens, format_rows(stream))
            if place:
                _append(self.folder / COLD_LIST, f"{name} {place}\n")
        self._place = place
        self.count += bool(place)

    def _stream(
        self, name: str, time: float, words: Sequence[str], distances: Sequence[float | None], place: str
    ) -> WordStream:
        far = [np.nan if one is None else one for one in distances]
        first = WordStream.of(self.name, [words[0]], [place], frames=[name], times=[time], distances=[far[0]])
        named = zip(self._dictionaries[1:], words[1:], far[1:], strict=True)
        further = {one: WordColumn((word,), np.array([distance])) for one, word, distance in named}
        return WordStream(self.name, first.table, first.words, first.distances, further)


def _append(path: Path, text: str) -> None:
    with path.open("a", encoding="utf-8", newline="") as file:
        file.write(text)
