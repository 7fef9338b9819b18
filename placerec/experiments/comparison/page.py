"""The page of a comparison: the test sequences as every method saw them, and how good each was."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from placerec.evaluation.summary import percent
from placerec.experiments.comparison.benchmark import MethodRun
from placerec.experiments.comparison.results import Comparison
from placerec.figures.pages import heading, picture, table
from placerec.frames import Sequence as FrameSequence
from placerec.jobs import Progress
from placerec.page.drives import drives_of
from placerec.page.report import report_page, shown_of


def comparison_page(
    found: Comparison,
    runs: Mapping[str, MethodRun],
    tests: Sequence[FrameSequence],
    drawn: Path,
    progress: Progress | None = None,
) -> str:
    """HTML of a comparison of `runs` on the sequences `tests`; `drawn`: the picture of it.

    The best method comes first, with all others to be set beside it.
    """
    order = [score.method for score in found.best_first()]
    drives = drives_of({method: runs[method].beliefs for method in order})
    shown = shown_of(drives, {sequence.name: sequence for sequence in tests}, progress)
    more = [
        heading("Accuracy and cost"),
        picture(drawn, "A row per method: accuracy with its interval, and cost", "Methods, the best on top."),
        _table(found),
    ]
    return report_page("placerec compare", drives, shown, more=more)


def _table(found: Comparison) -> str:
    equals = found.not_told_from_best()
    rows = [
        (
            score.method,
            percent(score.accuracy),
            f"{100 * score.accuracy_low:.1f} to {100 * score.accuracy_high:.1f} %",
            "the best, or cannot be told from it" if score.method in equals else "behind the best",
            percent(score.balanced_accuracy),
            None if score.change_latency_frames is None else f"{score.change_latency_frames:g}",
            f"{score.ece:.3f}",
            f"{score.log_loss:.2f}",
            f"{score.microseconds_per_frame:.1f}",
        )
        for score in found.best_first()
    ]
    header = ("method", "frames right", "95 % interval", "", "mean recall", "latency", "ECE", "log loss", "µs a frame")
    number, what = found.drawn
    caption = f"{found.frames} test frames; intervals over {number} {what}; pairs.csv has every two methods."
    return table(header, rows, caption, marks={"the best, or cannot be told from it": "yes", "behind the best": "none"})
