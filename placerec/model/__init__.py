"""The MODEL/ folder: train, load."""

from placerec.model.calibrate import calibrate as calibrate
from placerec.model.corpus import Corpus as Corpus, read_corpus as read_corpus
from placerec.model.decoding import (
    Decoding as Decoding,
    load_recognizer as load_recognizer,
    make_recognizer as make_recognizer,
    transition_of as transition_of,
)
from placerec.model.folder import PlaceModels as PlaceModels, load_model as load_model
from placerec.model.options import (
    ModelOptions as ModelOptions,
    estimate_place as estimate_place,
    parse_min_count as parse_min_count,
)
from placerec.model.train import train_lm as train_lm, train_model as train_model
from placerec.model.update import update as update
