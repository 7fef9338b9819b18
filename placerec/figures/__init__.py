"""What is drawn: the parts of pictures and pages, and the picture of an evaluation."""

from placerec.figures.evaluation import evaluate_files, plot_evaluation

__all__ = ["evaluate_files", "plot_evaluation"]
