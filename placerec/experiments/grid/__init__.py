"""The paper's experiment, on any recordings: a grid of cells, its figure, its tables and its claims."""

from placerec.experiments.grid.config import Config, read_config
from placerec.experiments.grid.results import Results, Row
from placerec.experiments.grid.run import experiment

__all__ = ["Config", "Results", "Row", "experiment", "read_config"]
