"""Every method on the same recordings: `placerec compare`."""

from placerec.experiments.comparison.results import Comparison, MethodScore
from placerec.experiments.comparison.run import compare

__all__ = ["Comparison", "MethodScore", "compare"]
