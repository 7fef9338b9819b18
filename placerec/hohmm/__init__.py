"""Words and language models -> belief over places: the Bayesian filter of eq. 1."""

from placerec.hohmm.beliefs import (
    BeliefRow,
    Beliefs,
    format_beliefs,
    format_header,
    format_json_row,
    format_row,
    read_beliefs,
    write_beliefs,
)
from placerec.hohmm.calibration import Calibration, fit_calibration
from placerec.hohmm.decoder import Belief, Posterior, SequenceDecoder, TakeIn
from placerec.hohmm.evidence import Emissions, SeparateEmissions
from placerec.hohmm.filter import filter_stream
from placerec.hohmm.recognizer import Recognizer
from placerec.hohmm.transitions import PER, Transition, fixed_transition, learned_transition, read_transitions

__all__ = [
    "PER",
    "Belief",
    "BeliefRow",
    "Beliefs",
    "Calibration",
    "Emissions",
    "Posterior",
    "Recognizer",
    "SeparateEmissions",
    "SequenceDecoder",
    "TakeIn",
    "Transition",
    "filter_stream",
    "fit_calibration",
    "fixed_transition",
    "format_beliefs",
    "format_header",
    "format_json_row",
    "format_row",
    "learned_transition",
    "read_beliefs",
    "read_transitions",
    "write_beliefs",
]
