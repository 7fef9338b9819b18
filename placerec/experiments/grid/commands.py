"""A cell of an experiment as the commands that a user would type."""

import shlex
from collections.abc import Iterable
from os.path import relpath
from pathlib import Path

from placerec.experiments.grid.config import Config
from placerec.experiments.grid.results import Way
from placerec.experiments.grid.units import Unit


def commands_of(plan: Config, way: Way, unit: Unit) -> str:
    """The commands that make a way's result on the fold of `unit`, run in the folder of the config."""
    lines = []
    tokens = "tokens"
    if unit.images is not None:
        sources = [[_from(plan, one.sequence.source) for one in part] for part in (unit.images.train, unit.images.test)]
        words = f"-o words.npz --size {way.size} --seed {unit.seed} --units {plan.units}"
        lines += [
            f"placerec train-words {_listed(sources[0])} {words}",
            f"placerec tokenize {_listed(sources[0] + sources[1])} -w words.npz -o {tokens}/",
        ]
    else:
        tokens = _from(plan, unit.job.train[0].parent)
    train, test = (_listed(f"{tokens}/{path.name}" for path in paths) for paths in (unit.job.train, unit.job.test))
    model = f"--order {way.order} --smoothing {way.smoothing} --select {way.select}"
    learned = way.transition == "learned"
    steps = "--transition learned" if learned else f"--stay {plan.stay:g} --per {plan.per}"
    lines += [
        f"placerec train-lm {train} -o model/ {model}",
        f"placerec decode {test} -m model/ -o beliefs/ {steps}",
        "placerec evaluate beliefs/",
    ]
    return "\n".join(lines)


def _from(plan: Config, path: Path) -> str:
    """The path as seen from the config's folder, if it is below it."""
    found = relpath(path, plan.folder)
    return str(path) if found.startswith("..") else found


def _listed(paths: Iterable[str]) -> str:
    return " ".join(map(shlex.quote, paths))
