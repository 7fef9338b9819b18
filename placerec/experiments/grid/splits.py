"""Which sequences train and which test: the folds of an experiment, by the names of its sequences."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase

from placerec.errors import ExperimentError
from placerec.vision.light import LIGHTS

# As find_sequences names them: the folder's name, perhaps behind its parent's.
_COLD = re.compile(r"(?:.*[-_])?seq([1-4])_(cloudy|night|sunny)([0-9]+)")
_ILLUMINATION = re.compile(r".*(cloudy|night|sunny)[0-9]*")
ILLUMINATIONS = ("cloudy", "night", "sunny")

# The paths of Saarbruecken's part B, and the runs that the paper uses: the last one tests.
_PART_B = ("3", "4")
_RUNS = ("1", "2", "3")


@dataclass(frozen=True)
class Fold:
    """One way to divide the sequences, whose names are given in their order.

    `light`: the simulated light in which those of `test` are, one of `vision.light.LIGHTS`; "" as they are.
    """

    name: str
    train: tuple[str, ...]
    test: tuple[str, ...]
    light: str = ""


def named_tests(names: Sequence[str], globs: Sequence[str]) -> list[Fold]:
    """One fold: the sequences that one of `globs` matches test, all others train."""
    for glob in globs:
        if not any(fnmatchcase(name, glob) for name in names):
            raise ExperimentError(f"[data] test: {glob!r} is the name of no sequence; they are {_some(names)}")
    test = [name for name in names if any(fnmatchcase(name, glob) for glob in globs)]
    return [_fold("test", names, test)]


def leave_one_out(names: Sequence[str]) -> list[Fold]:
    """A fold per sequence, which it is named after."""
    return [_fold(name, names, [name]) for name in names]


def leave_one_illumination_out(names: Sequence[str]) -> list[Fold]:
    """A fold per illumination: cloudy, night, sunny, which the names of COLD's sequences end in, before a number."""
    light = {name: match[1] for name in names if (match := _ILLUMINATION.fullmatch(name))}
    for name in names:
        if name not in light:
            raise ExperimentError(
                f"[data] split: leave-one-illumination-out needs names that end in cloudy, night or sunny and a "
                f"number, and {name!r} does not; leave that sequence out, or name the tests"
            )
    found = [one for one in ILLUMINATIONS if one in light.values()]
    return [_fold(one, names, [name for name in names if light[name] == one]) for one in found]


def cold_saarbruecken_b(names: Sequence[str]) -> list[Fold]:
    """The paper's: of part B (seq3, seq4) of COLD's Saarbruecken, runs 1 and 2 train and run 3 tests (readings 0.3).

    Sequences of part A, and further runs of part B, are left out. Raises ExperimentError unless the 18 sequences are
    there, once each.
    """
    parts = {name: match for name in names if (match := _COLD.fullmatch(name))}
    for name in names:
        if name not in parts:
            raise ExperimentError(
                f"[data] split: cold-saarbruecken-b needs COLD's names (seq3_cloudy1), and {name!r} is none; "
                "leave that sequence out, or name the tests"
            )
    used = [name for name in names if parts[name][1] in _PART_B]
    found = [f"seq{m[1]}_{m[2]}{m[3]}" for m in map(parts.__getitem__, used)]
    for wanted in (f"seq{path}_{light}{run}" for path in _PART_B for light in ILLUMINATIONS for run in _RUNS):
        if found.count(wanted) != 1:
            times = found.count(wanted) or "not"
            raise ExperimentError(
                f"[data] split: cold-saarbruecken-b needs each sequence of part B once, and {wanted} is there {times}"
                f"{' times' * (times != 'not')}; complete them, or name the tests"
            )
    runs = [name for name in used if parts[name][3] in _RUNS]
    return [_fold("test", runs, [name for name in runs if parts[name][3] == _RUNS[-1]])]


def in_simulated_light(folds: Sequence[Fold]) -> list[Fold]:
    """Each fold once for every light of `vision.light.LIGHTS`, in which its tests are."""
    return [replace(fold, name=f"{fold.name}-simulated-{light}", light=light) for fold in folds for light in LIGHTS]


# What `[data] split` calls `in_simulated_light`; SPLITS have the frames as they are.
LIGHT = "light"
SPLITS: dict[str, Callable[[Sequence[str]], list[Fold]]] = {
    "leave-one-out": leave_one_out,
    "leave-one-illumination-out": leave_one_illumination_out,
    "cold-saarbruecken-b": cold_saarbruecken_b,
}


def _fold(name: str, names: Sequence[str], test: Sequence[str]) -> Fold:
    train = tuple(one for one in names if one not in test)
    if not train:
        raise ExperimentError(f"[data]: all sequences test ({_some(names)}), and none is left to train; add others")
    return Fold(name, train, tuple(test))


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
