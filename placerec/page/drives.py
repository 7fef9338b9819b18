"""Drives and what several systems believed of them, for a page: grouped, and packed into plain values.

Beliefs of the same frames are one drive, seen by several systems: `a/run3.tsv` and `b/run3.tsv` are the drive `run3`,
and the systems are called `a` and `b`.
"""

import base64
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Floats
from placerec.errors import EvaluationError
from placerec.evaluation.metrics import right_frames
from placerec.figures.strip import timed
from placerec.frames.naming import unique_names
from placerec.frames.table import Labels
from placerec.hohmm.beliefs import UNKNOWN_PLACE, Beliefs
from placerec.inspection.decision import Decision

_WRONG, _RIGHT, _NO_LABEL = 0, 1, -1
_DIGITS = 4


@dataclass(frozen=True)
class Drive:
    """One sequence: what each system believed of its frames, by the system's name, and what decided them, if known."""

    name: str
    beliefs: Mapping[str, Beliefs]
    decisions: Mapping[str, Sequence[Decision]] = field(default_factory=dict)

    @property
    def frames(self) -> tuple[str, ...]:
        """The names of the frames."""
        return self._any.frames

    @property
    def truth(self) -> tuple[str, ...]:
        """The true places, "" where a frame has no label."""
        return self._any.truth

    @property
    def times(self) -> Floats:
        """Seconds, float64 (n,), nan where unknown."""
        return self._any.times

    @property
    def _any(self) -> Beliefs:
        return next(iter(self.beliefs.values()))


def drives_of(systems: Mapping[str, Sequence[Beliefs]]) -> list[Drive]:
    """The drives that some systems decoded, by the names of the sequences; all of a name have the same frames."""
    found: dict[str, dict[str, Beliefs]] = {}
    for system, beliefs in systems.items():
        for one in beliefs:
            found.setdefault(one.name, {})[system] = one
    return [Drive(name, of) for name, of in found.items()]


def group_files(named: Sequence[tuple[Path, Beliefs]], decisions: Mapping[Path, Sequence[Decision]]) -> list[Drive]:
    """Beliefs files as drives: those of one name and the same frames are one drive, seen by several systems.

    Files of one name and other frames are several drives, called by their folders too. Raises EvaluationError where
    two stay equal.
    """
    of_name: dict[str, list[tuple[Path, Beliefs]]] = {}
    for path, beliefs in named:
        of_name.setdefault(beliefs.name, []).append((path, beliefs))
    paired = {name for name, group in of_name.items() if len({one.frames for _, one in group}) == 1}
    several = [path.parent for name in paired if len(group := of_name[name]) > 1 for path, _ in group]
    folders = list(dict.fromkeys(folder.resolve() for folder in several))
    titles = dict(zip(folders, unique_names([(one.name, one) for one in folders], EvaluationError), strict=True))
    rest = [(path, one) for name, group in of_name.items() if name not in paired for path, one in group]
    alone = dict(
        zip([path for path, _ in rest], unique_names([(b.name, p) for p, b in rest], EvaluationError), strict=True)
    )
    drives: dict[str, Drive] = {}
    for path, beliefs in named:
        name = alone.get(path, beliefs.name)
        known = drives.setdefault(name, Drive(name, {}, {}))
        system = titles.get(path.parent.resolve(), "") if name in paired else ""
        if system in known.beliefs:
            raise EvaluationError(f"{path}: the same frames as another file of its folder; leave one of them out")
        drives[name] = Drive(
            name,
            {**known.beliefs, system: replace(beliefs, stream=beliefs.stream.renamed(name))},
            {**known.decisions, **({system: decisions[path]} if path in decisions else {})},
        )
    return list(drives.values())


def pack_drive(drive: Drive, places: Sequence[str], systems: Sequence[str]) -> dict[str, Any]:
    """A drive as plain values; `places`: all of the page, by whose numbers places are called, -1 for none."""
    return {
        "name": drive.name,
        "frames": list(drive.frames),
        "times": _numbers(drive.times, "<f8") if drive.frames and timed(drive.times) else None,
        "truth": _runs(Labels(drive.truth).codes(places).tolist()),
        "systems": [
            _pack_beliefs(drive.beliefs[name], places) | _pack_reasons(drive, name) if name in drive.beliefs else None
            for name in systems
        ],
    }


def _pack_beliefs(beliefs: Beliefs, places: Sequence[str]) -> dict[str, Any]:
    judged = np.where(
        np.array(beliefs.truth, np.str_) == "", _NO_LABEL, np.where(right_frames(beliefs), _RIGHT, _WRONG)
    )
    vocabulary = list(dict.fromkeys(beliefs.words))
    number = {word: index for index, word in enumerate(vocabulary)}
    return {
        "best": _runs(Labels(beliefs.best).codes(places).tolist()),
        "judged": _runs(judged.tolist()),
        "selected": _runs(beliefs.selected.astype(int).tolist()),
        "belief": _numbers(np.rint(shares(beliefs, places) * 65535), "<u2"),
        "vocabulary": vocabulary,
        "words": _runs([number[word] for word in beliefs.words]),
    }


def shares(beliefs: Beliefs, places: Sequence[str]) -> Floats:
    """The probability of each of P places, and of `unknown` if it is one of them, float64 (n, P)."""
    found = np.zeros((len(beliefs), len(places)))
    unknown = np.zeros(len(beliefs)) if beliefs.unknown is None else beliefs.unknown
    found[:, Labels(beliefs.places).codes(places)] = beliefs.belief * (1 - unknown[:, None])
    if beliefs.unknown is not None:
        found[:, places.index(UNKNOWN_PLACE)] = unknown
    return found


def _pack_reasons(drive: Drive, system: str) -> dict[str, Any]:
    """What decided the frames: by the number of each, see `_pack_decision`."""
    decisions = drive.decisions.get(system, ())
    number = {frame: index for index, frame in enumerate(drive.frames)}
    columns = [*drive.beliefs[system].places]
    packed = {number[one["frame"]]: _pack_decision(one, columns) for one in decisions if one["frame"] in number}
    return {"columns": columns, "reasons": packed} if packed else {}


def _pack_decision(decision: Decision, columns: Sequence[str]) -> dict[str, Any]:
    """One line of NAME.explain.jsonl without the names of its places, which are `columns`."""
    places = decision["places"]
    several = decision.get("dictionaries") or {
        "word": {"word": decision["word"], "history": decision["history"], "places": places}
    }
    packed: dict[str, Any] = {
        "rival": decision["rival"],
        "for": [_pack_argument(one) for one in decision["for"]],
        "against": [_pack_argument(one) for one in decision["against"]],
        "weighed": [_short(places[place]["log10_p"]) for place in columns],
        "before": [_short(places[place]["before"]) for place in columns],
        "said": [
            [
                said["word"],
                said["history"],
                [_short(said["places"][place]["log10_p"]) for place in columns],
                [said["places"][place]["order"] for place in columns],
            ]
            for said in several.values()
            if said["word"]
        ],
    }
    if "alpha" in decision:
        packed["alpha"] = decision["alpha"]
    if "unknown" in decision:
        packed["unknown"] = [_short(decision["unknown"][name]) for name in ("log10_ratio", "before", "after")]
    return packed


def _pack_argument(one: Mapping[str, Any]) -> list[Any]:
    return [one["word"], _short(one["log10_odds"]), one["ago"]]


def _short(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.{_DIGITS}g}")


def _runs(values: Iterable[int]) -> list[int]:
    """Runs of equal values: value, how often, value, how often..."""
    return [number for value, run in groupby(values) for number in (value, sum(1 for _ in run))]


def _numbers(values: NDArray[Any], kind: str) -> str:
    """An array in the order of its rows as base64 of little-endian numbers."""
    return base64.b64encode(values.astype(kind).tobytes()).decode("ascii")


def json_in_page(value: Any) -> str:
    """JSON that can stand in a script element: nothing in it ends the element or begins another."""
    text = json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026").replace("\u2028", "\\u2028")
