"""What is drawn: the parts of pictures and pages, and the picture of an evaluation."""

from placerec.figures.curves import coverage_panel, reliability_panel, roc_panel
from placerec.figures.evaluation import plot_evaluation
from placerec.figures.pages import heading, html_page, paragraph, picture, preformatted, table
from placerec.figures.panels import belief_strip, confusion_panel, figure_file, legend_panel
from placerec.figures.sources import evaluate_files

__all__ = [
    "belief_strip",
    "confusion_panel",
    "coverage_panel",
    "evaluate_files",
    "figure_file",
    "heading",
    "html_page",
    "legend_panel",
    "paragraph",
    "picture",
    "plot_evaluation",
    "preformatted",
    "reliability_panel",
    "roc_panel",
    "table",
]
