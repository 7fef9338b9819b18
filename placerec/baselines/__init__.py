"""The systems that the paper names, each as one short module, on the same words."""

from placerec.baselines.decode import check_method, decode, load_decoder, make_decoder
from placerec.baselines.follower import Follower
from placerec.baselines.lesson import Follow, Lesson, Step, make_lesson, read_lesson
from placerec.baselines.methods import HOHMM, METHODS, NEED_DESCRIPTORS, Method

__all__ = [
    "HOHMM",
    "METHODS",
    "NEED_DESCRIPTORS",
    "Follow",
    "Follower",
    "Lesson",
    "Method",
    "Step",
    "check_method",
    "decode",
    "load_decoder",
    "make_decoder",
    "make_lesson",
    "read_lesson",
]
