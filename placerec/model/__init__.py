"""The MODEL/ folder: train, load."""

from placerec.model.calibrate import calibrate
from placerec.model.corpus import Corpus, read_corpus
from placerec.model.decoding import Decoding, load_recognizer, make_recognizer, transition_of
from placerec.model.folder import PlaceModels, load_model
from placerec.model.options import ModelOptions, parse_min_count
from placerec.model.train import estimate_place, train_lm, train_model
from placerec.model.update import update

__all__ = [
    "Corpus",
    "Decoding",
    "ModelOptions",
    "PlaceModels",
    "calibrate",
    "estimate_place",
    "load_model",
    "load_recognizer",
    "make_recognizer",
    "parse_min_count",
    "read_corpus",
    "train_lm",
    "train_model",
    "transition_of",
    "update",
]
