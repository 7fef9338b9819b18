"""Words and language models -> belief over places: the Bayesian filter of eq. 1."""

from placerec.hohmm.beliefs import (
    Beliefs as Beliefs,
    format_beliefs as format_beliefs,
    format_header as format_header,
    read_beliefs as read_beliefs,
    write_beliefs as write_beliefs,
)
from placerec.hohmm.calibration import Calibration as Calibration, fit_calibration as fit_calibration
from placerec.hohmm.decoder import Belief as Belief, SequenceDecoder as SequenceDecoder
from placerec.hohmm.evidence import Emissions as Emissions, SeparateEmissions as SeparateEmissions
from placerec.hohmm.filter import filter_stream as filter_stream
from placerec.hohmm.recognizer import Recognizer as Recognizer
from placerec.hohmm.transitions import (
    PER as PER,
    Transition as Transition,
    fixed_transition as fixed_transition,
    learned_transition as learned_transition,
    read_transitions as read_transitions,
)
