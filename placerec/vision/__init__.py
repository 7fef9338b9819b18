"""From image to word: descriptors, their principal components and the self-organising map."""

from placerec.vision.centrist import centrist
from placerec.vision.describe import Descriptors, describe, save_descriptors
from placerec.vision.dictionary import Dictionary, DictionaryOptions
from placerec.vision.gist import gist
from placerec.vision.images import fit_image
from placerec.vision.sources import describe_sources, train_dictionary
from placerec.vision.spec import KINDS, DescriptorSpec, descriptor

__all__ = [
    "KINDS",
    "DescriptorSpec",
    "Descriptors",
    "Dictionary",
    "DictionaryOptions",
    "centrist",
    "describe",
    "describe_sources",
    "descriptor",
    "fit_image",
    "gist",
    "save_descriptors",
    "train_dictionary",
]
