"""Words and language models -> belief over places: the Bayesian filter of eq. 1."""

from placerec.hohmm.beliefs import Beliefs, format_beliefs, format_header, read_beliefs, write_beliefs
from placerec.hohmm.calibration import Calibration, fit_calibration
from placerec.hohmm.decoder import Belief, SequenceDecoder
from placerec.hohmm.evidence import Emissions, SeparateEmissions
from placerec.hohmm.filter import filter_stream
from placerec.hohmm.recognizer import Recognizer
from placerec.hohmm.transitions import PER, Transition, fixed_transition, learned_transition, read_transitions

__all__ = [
    "PER",
    "Belief",
    "Beliefs",
    "Calibration",
    "Emissions",
    "Recognizer",
    "SeparateEmissions",
    "SequenceDecoder",
    "Transition",
    "filter_stream",
    "fit_calibration",
    "fixed_transition",
    "format_beliefs",
    "format_header",
    "learned_transition",
    "read_beliefs",
    "read_transitions",
    "write_beliefs",
]
