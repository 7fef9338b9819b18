"""An evaluation as text for a terminal of 100 columns."""

import textwrap

import numpy as np

from placerec.errors import counted
from placerec.evaluation.confidence import COVERAGES, ECE_BINS
from placerec.evaluation.metrics import Evaluation

_WIDTH = 100
_NAME_WIDTH = 32
_LEAST_NAME_WIDTH = 8
_MOST_CONFUSIONS = 10


def format_evaluation(evaluation: Evaluation) -> str:
    """A short table of everything in `evaluation`, at most 100 columns wide, without a line end at its end."""
    blocks = [_overall(evaluation), _per_place(evaluation), _confusion(evaluation)]
    return "\n\n".join("\n".join(line.rstrip() for line in block) for block in blocks if block)


def shorten(name: str, width: int) -> str:
    """`name`, its middle replaced by an ellipsis if it is longer than `width`: endings tell places apart too."""
    if len(name) <= width:
        return name
    tail = (width - 1) // 2
    return name[: width - 1 - tail] + "…" + name[len(name) - tail :]


def percent(share: float | None) -> str:
    """A share as a percentage with one digit after the point, a dash where it is undefined."""
    return "–" if share is None else f"{100 * share:.1f} %"


def _overall(evaluation: Evaluation) -> list[str]:
    latency = evaluation.change_latency_frames
    changes = f"{counted(evaluation.changes, 'change')} of place"
    delay = f"– ({changes})" if latency is None else f"{counted(latency, 'frame')}, median of {changes}"
    left_out = f", {evaluation.unlabelled} without a label left out" if evaluation.unlabelled else ""
    majority = f"always {shorten(evaluation.majority_place, _NAME_WIDTH)!r}: {percent(evaluation.majority_accuracy)}"
    half = percent(float(evaluation.risk_coverage.accuracy[COVERAGES.index(0.5)]))
    lines = [
        f"frames             {evaluation.frames} judged{left_out}",
        f"accuracy           {percent(evaluation.accuracy)}   (majority class, {majority})",
        f"balanced accuracy  {percent(evaluation.balanced_accuracy)}   (mean recall of the places)",
        f"change latency     {delay}",
        f"calibration error  {evaluation.ece:.3f}   (ECE: belief beside share right, {ECE_BINS} bins; 0 is calibrated)",
        f"log loss           {evaluation.log_loss:.3f}   (nats per frame; 0 is best)",
        f"risk-coverage      {evaluation.risk_coverage.area:.3f}   (area; of the surest half {half} are right)",
    ]
    made_by = [line for made in evaluation.made_by for line in _wrapped(f"{'model':<19}", made)]
    return [*lines, *_new_places(evaluation), *_sequences(evaluation), *made_by]


def _wrapped(title: str, text: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent=title, subsequent_indent=" " * len(title))


def _new_places(evaluation: Evaluation) -> list[str]:
    found = evaluation.new_places
    if found is None:
        return []
    area = "–" if found.auroc is None else f"{found.auroc:.3f}"
    new = counted(found.new, "frame")
    return [f"unknown AUROC      {area}   ({new} of places without a column, {found.known} of others)"]


def _sequences(evaluation: Evaluation) -> list[str]:
    judged = [(score.accuracy, name) for name, score in evaluation.sequences.items() if score.accuracy is not None]
    if len(judged) < 2:
        return []
    worst, best = min(judged, key=lambda pair: pair[0]), max(judged, key=lambda pair: pair[0])
    ends = " to ".join(f"{percent(accuracy)} ({shorten(name, 26)})" for accuracy, name in (worst, best))
    return [f"sequences          {len(judged)}: {ends}"]


def _per_place(evaluation: Evaluation) -> list[str]:
    names = [shorten(name, _NAME_WIDTH) for name in evaluation.places]
    width = max(5, *map(len, names))
    lines = [f"  #  {'place':<{width}}  {'frames':>8}  {'precision':>9}  {'recall':>9}"]
    for number, (name, score) in enumerate(zip(names, evaluation.per_place.values(), strict=True), start=1):
        shares = f"{percent(score.precision):>9}  {percent(score.recall):>9}"
        lines.append(f"{number:>3}  {name:<{width}}  {score.frames:>8}  {shares}")
    return lines


def _confusion(evaluation: Evaluation) -> list[str]:
    counts = evaluation.confusion
    cell = max(4, len(str(counts.max())) + 2)
    room = _WIDTH - 5 - cell * len(counts)
    if room < _LEAST_NAME_WIDTH:
        return _largest_confusions(evaluation)
    names = [shorten(name, min(room, _NAME_WIDTH)) for name in evaluation.places]
    width = max(map(len, names))
    lines = ["frames by true place (rows) and decided place (columns, by number)"]
    lines.append(" " * (5 + width) + "".join(f"{number:>{cell}}" for number in range(1, len(names) + 1)))
    for number, (name, row) in enumerate(zip(names, counts.tolist(), strict=True), start=1):
        # A dot for nothing lets the eye find what went wrong.
        lines.append(f"{number:>3}  {name:<{width}}" + "".join(f"{count or '·':>{cell}}" for count in row))
    return lines


def _largest_confusions(evaluation: Evaluation) -> list[str]:
    wrong = evaluation.confusion.copy()
    np.fill_diagonal(wrong, 0)
    order = np.argsort(-wrong, axis=None, kind="stable")[:_MOST_CONFUSIONS]
    lines = ["most frequent confusions (too many places for a matrix of this width)"]
    for true, decided in (divmod(int(cell), len(wrong)) for cell in order):
        if wrong[true, decided]:
            names = [shorten(evaluation.places[place], 36) for place in (true, decided)]
            lines.append(f"{wrong[true, decided]:>8}  {names[0]} taken for {names[1]}")
    return lines
