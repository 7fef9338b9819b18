"""The systems that turn words into beliefs: the paper's, and those that it names, each as one short module."""

from placerec.methods.decode import decode, decode_lines
from placerec.methods.decoders import HOHMM, METHODS, check_method, load_decoder, make_decoder
from placerec.methods.live import LiveReport, decode_live, follow_live
from placerec.methods.training_set import MakeStepper, TrainingSet, make_training_set, read_training_set

__all__ = [
    "HOHMM",
    "METHODS",
    "LiveReport",
    "MakeStepper",
    "TrainingSet",
    "check_method",
    "decode",
    "decode_lines",
    "decode_live",
    "follow_live",
    "load_decoder",
    "make_decoder",
    "make_training_set",
    "read_training_set",
]
