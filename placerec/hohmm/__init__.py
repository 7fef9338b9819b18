"""Words and language models -> belief over places: the Bayesian filter of eq. 1."""

from placerec.hohmm.beliefs import (
    Beliefs,
    belief_rows,
    best_places,
    format_header,
    format_row,
    read_beliefs,
    write_beliefs,
)
from placerec.hohmm.calibration import Calibration, fit_calibration
from placerec.hohmm.filter import Filtered, filter_stream
from placerec.hohmm.recognizer import Belief, Recognizer
from placerec.hohmm.transitions import Transition, fixed_transition

__all__ = [
    "Belief",
    "Beliefs",
    "Calibration",
    "Filtered",
    "Recognizer",
    "Transition",
    "belief_rows",
    "best_places",
    "filter_stream",
    "fit_calibration",
    "fixed_transition",
    "format_header",
    "format_row",
    "read_beliefs",
    "write_beliefs",
]
