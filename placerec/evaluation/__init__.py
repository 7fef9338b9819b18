"""Beliefs into knowledge: numbers, pictures and pages."""

from placerec.evaluation.curves import coverage_panel, reliability_panel, roc_panel
from placerec.evaluation.decision import decision_page, format_decision, inspect_decision
from placerec.evaluation.metrics import Evaluation, PlaceScore, SequenceScore, evaluate
from placerec.evaluation.panels import belief_strip, confusion_panel, figure_file, legend_panel
from placerec.evaluation.plots import plot_evaluation
from placerec.evaluation.report import heading, html_page, paragraph, picture, preformatted, table
from placerec.evaluation.sources import evaluate_files
from placerec.evaluation.summary import format_evaluation

__all__ = [
    "Evaluation",
    "PlaceScore",
    "SequenceScore",
    "belief_strip",
    "confusion_panel",
    "coverage_panel",
    "decision_page",
    "evaluate",
    "evaluate_files",
    "figure_file",
    "format_decision",
    "format_evaluation",
    "heading",
    "html_page",
    "inspect_decision",
    "legend_panel",
    "paragraph",
    "picture",
    "plot_evaluation",
    "preformatted",
    "reliability_panel",
    "roc_panel",
    "table",
]
