"""From image to word: descriptors, their principal components and self-organising maps."""

from placerec.vision.centrist import centrist as centrist
from placerec.vision.describe import (
    Descriptors as Descriptors,
    describe as describe,
    save_descriptors as save_descriptors,
)
from placerec.vision.dictionary import Dictionary as Dictionary
from placerec.vision.dictionary_set import DictionarySet as DictionarySet
from placerec.vision.gist import gist as gist
from placerec.vision.images import fit_image as fit_image
from placerec.vision.options import (
    DEFAULT_KIND as DEFAULT_KIND,
    DictionaryOptions as DictionaryOptions,
    DictionarySetOptions as DictionarySetOptions,
)
from placerec.vision.sources import describe_sources as describe_sources, train_dictionary as train_dictionary
from placerec.vision.spec import KINDS as KINDS, DescriptorSpec as DescriptorSpec, descriptor as descriptor
