"""What is drawn: the parts of pictures and pages, and the picture of an evaluation."""

from placerec.figures.canvas import figure_file
from placerec.figures.evaluation import evaluate_files, plot_evaluation
from placerec.figures.pages import heading, html_page, paragraph, picture, preformatted, table
from placerec.figures.panels import (
    belief_strip,
    confusion_panel,
    coverage_panel,
    legend_panel,
    reliability_panel,
    roc_panel,
)

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
