"""Beliefs judged by the true places: numbers, how far to trust them, and their text."""

from placerec.evaluation.metrics import Evaluation, PlaceScore, SequenceScore, evaluate
from placerec.evaluation.summary import format_evaluation

__all__ = ["Evaluation", "PlaceScore", "SequenceScore", "evaluate", "format_evaluation"]
