"""Where images come from: folders are found, labelled and put in order; images are decoded one at a time."""

from placerec.frames.find import find_sequences
from placerec.frames.image import read_gray
from placerec.frames.reading import Reading
from placerec.frames.sequence import Frame, Sequence

__all__ = ["Frame", "Reading", "Sequence", "find_sequences", "read_gray"]
