"""The paper's experiment, on any recordings: a grid of cells, its figure, its tables and its claims."""

from placerec.experiment.config import Config, read_config
from placerec.experiment.results import Results, Row
from placerec.experiment.run import experiment

__all__ = ["Config", "Results", "Row", "experiment", "read_config"]
