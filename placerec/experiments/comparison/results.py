"""What came of a comparison of methods: a score each, every pair over the same draws, as tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from placerec.errors import counted
from placerec.evaluation.bootstrap import Pair, compare_pairs, count_blocks, draw, interval
from placerec.evaluation.metrics import evaluate
from placerec.experiments.comparison.benchmark import MethodRun
from placerec.experiments.cost import FrontEndCost


@dataclass(frozen=True)
class MethodScore:
    """A line of methods.csv; shares from 0 to 1, nats; `consulted`: the share of frames that asked a second cue."""

    method: str
    accuracy: float
    accuracy_low: float
    accuracy_high: float
    balanced_accuracy: float
    change_latency_frames: float | None
    ece: float
    microseconds_per_frame: float
    log_loss: float
    consulted: float | None = None


@dataclass(frozen=True)
class Comparison:
    """What `compare` found; `drawn`: the intervals are over so many `sequences`, or `visits` of one sequence.

    `cost`: what comes before every method; `majority`: the share of the most frequent place among the test frames.
    """

    scores: tuple[MethodScore, ...]
    pairs: tuple[Pair, ...]
    frames: int
    majority: float
    majority_place: str
    drawn: tuple[int, str]
    cost: FrontEndCost

    def to_dict(self) -> dict[str, list[object]]:
        """A table with a row for each method: `pandas.DataFrame(comparison.to_dict())`, and so for polars."""
        return {one.name: [getattr(score, one.name) for score in self.scores] for one in fields(MethodScore)}

    def best_first(self) -> list[MethodScore]:
        """All methods by accuracy, the best first; of equals the first by name."""
        return sorted(self.scores, key=lambda score: (-score.accuracy, score.method))

    def not_told_from_best(self) -> set[str]:
        """The best method, and all whose difference to it does not hold."""
        best = self.best_first()[0].method
        differ = {frozenset((pair.first, pair.second)) for pair in self.pairs if pair.holds}
        return {score.method for score in self.scores if {best, score.method} not in differ}


def judge(runs: Mapping[str, MethodRun], cost: FrontEndCost, seed: int) -> Comparison:
    """The scores of all methods with intervals over the same draws, and every pair."""
    evaluations = {name: evaluate(run.beliefs) for name, run in runs.items()}
    counted = {name: count_blocks(run.beliefs) for name, run in runs.items()}
    frames, _, what = next(iter(counted.values()))
    right = {name: one for name, (_, one, _) in counted.items()}
    drawn = draw(len(frames), seed)
    scores = tuple(
        MethodScore(
            name,
            evaluation.accuracy,
            *interval(drawn, right[name], frames),
            evaluation.balanced_accuracy,
            evaluation.change_latency_frames,
            evaluation.ece,
            runs[name].microseconds,
            evaluation.log_loss,
            runs[name].consulted,
        )
        for name, evaluation in evaluations.items()
    )
    one = next(iter(evaluations.values()))
    return Comparison(
        scores,
        tuple(compare_pairs(right, frames, drawn)),
        one.frames,
        one.majority_accuracy,
        one.majority_place,
        (len(frames), what),
        cost,
    )


def format_methods(scores: Sequence[MethodScore]) -> str:
    """The text of methods.csv."""
    names = [name for name in MethodScore.__annotations__ if name != "consulted"]
    rows = ([_cell(name, getattr(score, name)) for name in names] for score in scores)
    return "".join(f"{','.join(row)}\n" for row in (names, *rows))


def format_pairs(pairs: Sequence[Pair]) -> str:
    """The text of pairs.csv: `holds` or `cannot tell`, see `Pair.holds`."""
    lines = ["first,second,difference,difference_low,difference_high,verdict"]
    for pair in pairs:
        verdict = "holds" if pair.holds else "cannot tell"
        lines.append(f"{pair.first},{pair.second},{pair.difference:.6f},{pair.low:.6f},{pair.high:.6f},{verdict}")
    return "\n".join(lines) + "\n"


def format_comparison(found: Comparison) -> str:
    """A table for a terminal, best first, without a line end at its end."""
    width = max(16, *(len(score.method) + 1 for score in found.scores))
    lines = [
        f"{'method':<{width}}{'accuracy':>9}  {'95 % interval':>15}{'balanced':>10}{'latency':>9}{'ECE':>7}"
        f"{'log loss':>10}{'us/frame':>10}"
    ]
    for s in found.best_first():
        latency = "-" if s.change_latency_frames is None else f"{s.change_latency_frames:g}"
        lines.append(
            f"{s.method:<{width}}{100 * s.accuracy:>7.1f} %"
            f"  {100 * s.accuracy_low:>6.1f} - {100 * s.accuracy_high:>4.1f} %{100 * s.balanced_accuracy:>8.1f} %"
            f"{latency:>9}{s.ece:>7.3f}{s.log_loss:>10.3f}{s.microseconds_per_frame:>10.1f}"
        )
    lines.append(f"{counted(found.frames, 'frame')}; always {found.majority_place!r}: {100 * found.majority:.1f} %")
    return "\n".join(lines)


def _cell(name: str, value: Any) -> str:
    if value is None or isinstance(value, str):
        return value or ""
    return f"{value:g}" if name == "change_latency_frames" else f"{value:.{2 if name.startswith('micro') else 6}f}"
