"""The systems that turn words into beliefs: the paper's, and those that it names, each as one short module."""

from placerec.methods.decode import decode as decode, decode_lines as decode_lines
from placerec.methods.decoders import (
    HOHMM as HOHMM,
    METHODS as METHODS,
    check_method as check_method,
    load_decoder as load_decoder,
    make_decoder as make_decoder,
)
from placerec.methods.live import LiveReport as LiveReport, decode_live as decode_live, follow_live as follow_live
from placerec.methods.training_set import (
    MakeStepper as MakeStepper,
    TrainingSet as TrainingSet,
    make_training_set as make_training_set,
    read_training_set as read_training_set,
)
