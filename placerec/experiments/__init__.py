"""The paper's experiment, on any recordings: a grid of cells, its figure, its tables and its claims."""

from placerec.experiments.config import Config, read_config
from placerec.experiments.results import Results, Row
from placerec.experiments.run import experiment

__all__ = ["Config", "Results", "Row", "experiment", "read_config"]
