"""The experiment in words: the paper's tables and its claims, as Markdown."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from placerec.evaluation.bootstrap import DRAWS, LEAST
from placerec.experiments.grid.claims import HIGH, Claim, Statement
from placerec.experiments.grid.results import FoldData, Results, Row, Setting, by_seed

PAPER_RUNS = {10: "3.15", 20: "2.67"}
Table = tuple[Sequence[str], Sequence[Sequence[str]]]


def images_table(folds: Mapping[str, FoldData]) -> Table:
    """Labelled images per place and split (the paper's Table 2)."""
    places = sorted({place for fold in folds.values() for place in (*fold.train, *fold.test)})
    lines = []
    for name, fold in folds.items():
        for split, images in (("training", fold.train), ("testing", fold.test)):
            counts = [images.get(place, 0) for place in places]
            lines.append((name, split, *map(str, counts), str(sum(counts))))
    return ("fold", "split", *places, "all"), lines


def runs_table(rows: Iterable[Row]) -> Table:
    """Frames in a row with the same word in training, mean over seeds and folds (the paper's Table 1)."""
    runs: dict[int, dict[tuple[int, str], float]] = {}
    for row in rows:
        runs.setdefault(row.size, {})[row.seed, row.fold] = row.same_word_run
    lines = [
        (str(size), f"{np.mean([*values.values()]):.2f}", PAPER_RUNS.get(size, ""))
        for size, values in sorted(runs.items())
    ]
    return ("S", "same-word run", "in the paper, on COLD"), lines


def best_table(results: Results, most: int = 10) -> Table:
    """The best settings, with baselines: percent of the frames, mean and standard deviation over seeds."""
    tables = [
        by_seed(results.rows, share) for share in (lambda o: o.right, lambda o: o.frame_wise, lambda o: o.majority)
    ]
    lines = []
    for setting in ranked(results)[:most]:
        right, alone, majority = (100 * np.array(table[setting]) for table in tables)
        spread = f" ± {right.std(ddof=1):.1f}" if len(right) > 1 else ""
        names = str(setting.size), setting.smoothing, setting.select, str(setting.order), setting.transition
        lines.append((*names, f"{right.mean():.1f}{spread}", f"{alone.mean():.1f}", f"{majority.mean():.1f}"))
    names_ = ("S", "smoothing", "select", "n", "transition")
    return (*names_, "frames right, %", "each frame alone, %", "most frequent place, %"), lines


def ranked(results: Results) -> list[Setting]:
    """All settings, the best first by the mean over seeds; of equals the first in order."""
    accuracy = by_seed(results.rows)
    return sorted(accuracy, key=lambda setting: (-np.mean(accuracy[setting]), setting))


def verdicts_table(claims: Mapping[str, Sequence[Claim]]) -> Table:
    """A line per claim, and its verdict for each kind of transitions."""
    same = zip(*claims.values(), strict=True)
    lines = [(judged[0].name, judged[0].text, *(claim.verdict for claim in judged)) for judged in same]
    return ("claim", "the paper says", *(f"{transition} transitions" for transition in claims)), lines


def claims_table(claims: Sequence[Claim]) -> Table:
    """A line per statement."""
    lines = [
        ("" if number else claim.name, statement.text, *numbers_of(statement), statement.verdict)
        for claim in claims
        for number, statement in enumerate(claim.statements)
    ]
    return ("claim", "measured", "points", "95 %", "wanted", "this number"), lines


def numbers_of(statement: Statement) -> tuple[str, str, str]:
    """The number, its interval or why there is none, and what was wanted."""
    found = statement.interval
    number = "" if statement.values is None else f"{statement.values[0]:+.1f}"
    return number, f"{found[0]:+.1f} to {found[1]:+.1f}" if found else statement.reason, statement.wanted


def reading(sequences: int, seeds: int) -> str:
    """How the verdicts are to be read."""
    return (
        f"Points are percent of the test frames, mean over {seeds} seeds. The interval is the middle 95 % of {DRAWS} "
        f"draws of the {sequences} test sequences with replacement, the same draws on both sides of a difference; it "
        "does not cover what other training sequences would change. A number holds if its whole interval is where it "
        "is wanted, does not hold if the whole interval is elsewhere, and otherwise cannot be told. A claim holds if "
        f"all its numbers hold. Fewer than {LEAST} test sequences tell nothing: by chance all may be on one side. A "
        "best or worst cell is chosen on all sequences, so its number flatters. What several percent (2), little (2), "
        f"among the best (1) and high ({HIGH:g} %) mean was set by placerec, not by the paper."
    )


def markdown(table: Table) -> str:
    """A table as Markdown."""
    header, lines = table
    rows = [header, ["---"] * len(header), *lines]
    return "".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |\n" for row in rows)


def format_tables(results: Results) -> str:
    """The text of tables.md."""
    parts = [
        "# Tables\n",
        "## Labelled images per place and split\n",
        markdown(images_table(results.folds)),
        "## Frames in a row with the same word\n",
        "Training sequences, mean over seeds and folds, cut at the ends of sequences.\n",
        markdown(runs_table(results.rows)),
        "## The best of the grid\n",
        markdown(best_table(results)),
    ]
    return "\n".join(parts)


def format_claims(claims: Mapping[str, Sequence[Claim]], note: str) -> str:
    """The text of claims.md; `claims` by transition."""
    parts = ["# The paper's claims\n", markdown(verdicts_table(claims)), note + "\n"]
    for transition, judged in claims.items():
        parts += [f"## With {transition} transitions\n", markdown(claims_table(judged))]
    return "\n".join(parts)
