"""Where images come from: folders, videos and bags are found, labelled and put in order; images are decoded singly."""

from placerec.frames.find import find_sequences
from placerec.frames.image import read_gray
from placerec.frames.images import all_images, files_of, images_at
from placerec.frames.sequence import Frame, Sequence, SourceOptions

__all__ = ["Frame", "Sequence", "SourceOptions", "all_images", "files_of", "find_sequences", "images_at", "read_gray"]
