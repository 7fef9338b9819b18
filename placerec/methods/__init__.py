"""The systems that the paper names, each as one short module, on the same words."""

from placerec.methods.decode import check_method, decode, load_decoder, make_decoder
from placerec.methods.follower import Follower
from placerec.methods.methods import HOHMM, METHODS, NEED_DESCRIPTORS, Method
from placerec.methods.training_set import MakeStepper, StepFunction, TrainingSet, make_training_set, read_training_set

__all__ = [
    "HOHMM",
    "METHODS",
    "NEED_DESCRIPTORS",
    "Follower",
    "MakeStepper",
    "Method",
    "StepFunction",
    "TrainingSet",
    "check_method",
    "decode",
    "load_decoder",
    "make_decoder",
    "make_training_set",
    "read_training_set",
]
