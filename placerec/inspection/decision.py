"""One decision of the recognizer, to be read: what each place's model said, and which words speak for and against."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from placerec.errors import EvaluationError, at
from placerec.figures.pages import heading, html_page, paragraph, table
from placerec.files import all_lines, write_text
from placerec.hohmm.explain import EXPLAINED, WINDOW
from placerec.words.stream import format_seconds

Decision = Mapping[str, Any]
_KEYS = ("frame", "time", "place", "word", "history", "best_before", "best", "rival", "places", "for", "against")
_PLACES = ("place", "p of the word", "answered by", "back-off", "belief before", "after")
_WORDS = ("", "word", "odds", "selected words ago")


def inspect_decision(path: Path | str, frame: str, *, out: Path | str | None = None) -> Decision:
    """The decision at a frame in a file of `decode --explain` (docs/files.md); `out`: an HTML page of it.

    Raises EvaluationError for a file that cannot be read, and for a frame that is not in it.
    """
    decision = read_decision(path, frame)
    if out is not None:
        write_text(Path(out), decision_page(decision, Path(path).name.removesuffix(EXPLAINED)))
    return decision


def read_decision(path: Path | str, frame: str) -> Decision:
    """The line of `frame` (its name, or how that alone begins) in a file of `decode --explain`.

    Raises EvaluationError if there is none, there are several, or it is no such file.
    """
    decisions = [*read_decisions(path)]
    found = [one for one in decisions if one["frame"] == frame] or [
        one for one in decisions if one["frame"].startswith(frame)
    ]
    if len(found) == 1:
        return found[0]
    if found:
        some = f"{len(found)} selected frames begin with {frame!r}, {found[0]['frame']!r} first; give more of the name"
    else:
        some = f"no selected frame {frame!r}; the column `selected` of the beliefs tells which are"
    raise EvaluationError(f"{path}: {some}")


def read_decisions(path: Path | str) -> Iterator[Decision]:
    """All lines of a file of `decode --explain`; raises EvaluationError for one that is no decision."""
    lines = enumerate(all_lines(path, EvaluationError), start=1)
    return (_decision(path, number, line) for number, line in lines if line)


def _decision(path: Path | str, number: int, line: str) -> Decision:
    try:
        decision = json.loads(line)
        missing = [key for key in _KEYS if key not in decision]
        if not missing:
            return dict(decision)
    except (ValueError, TypeError):
        missing = ["all"]
    lacks = f"a decision is expected, and {', '.join(missing)} of it is missing"
    raise EvaluationError(at(path, number, f"{lacks}; write it with `placerec decode --explain`"))


def format_decision(decision: Decision) -> str:
    """A decision as text for people, without a line end at its end."""
    lines = [_title(decision), *_sentences(decision), "", *_columns(*_place_table(decision))]
    rows = [*_word_rows(decision)]
    if rows:
        lines += ["", _words_caption(decision), *_columns(_WORDS, rows)]
    return "\n".join(lines)


def decision_page(decision: Decision, sequence: str) -> str:
    """A decision as a page."""
    rows = [*_word_rows(decision)]
    body = [
        *map(paragraph, (_title(decision), *_sentences(decision))),
        heading("What the places' models say"),
        table(*_place_table(decision), _caption(decision)),
    ]
    if rows:
        against = f"Odds of {decision['best']} against {decision['rival']}"
        body += [heading("What the last words say"), paragraph(_words_caption(decision)), table(_WORDS, rows, against)]
    return html_page(f"{sequence}: {decision['best']}", body)


def _title(decision: Decision) -> str:
    seconds = "" if decision["time"] is None else f" at {format_seconds(decision['time'])} s"
    return f"Frame {decision['frame']}{seconds}: {decision['best']}"


def _sentences(decision: Decision) -> list[str]:
    places, best, former = decision["places"], decision["best"], decision["best_before"]
    if several := decision.get("dictionaries"):
        words = ", ".join(said["word"] for said in several.values() if said["word"])
        seen = f"The words {words} were seen, and each counts to the power of {decision['alpha']:g}. "
    else:
        after = f" after {' '.join(decision['history'])}" if decision["history"] else ", the first word"
        seen = f"The word {decision['word']} was seen{after}. "
    moved = f"from {_number(places[best]['before'])} to {_number(places[best]['after'])}"
    changed = f"; before it, {former} was" if former != best else ", as before"
    label = f" The frame is labelled {decision['place']}." if decision["place"] else ""
    sentences = [f"{seen}The belief in {best} went {moved}, and it is the most probable place{changed}.{label}"]
    if "unknown" in decision:
        news = decision["unknown"]
        odds = _factor(news["log10_ratio"])
        sentences.append(
            f"That the place is none of these went from {_number(news['before'])} to {_number(news['after'])}: "
            f"the frame multiplied the odds by {odds}."
        )
    return sentences


def _place_table(decision: Decision) -> tuple[Sequence[str], list[list[str]]]:
    """Header and rows of what the places' models say."""
    several = decision.get("dictionaries")
    if several is None:
        return _PLACES, [*_place_rows(decision)]
    named = {said["word"]: said["places"] for said in several.values() if said["word"]}
    rows = [
        [
            place,
            *(_factor(own[place]["log10_p"]) for own in named.values()),
            _factor(said["log10_p"]),
            _number(said["before"]),
            _number(said["after"]),
        ]
        for place, said in _by_belief(decision)
    ]
    return ("place", *(f"p of {word}" for word in named), "together, weighed", "belief before", "after"), rows


def _caption(decision: Decision) -> str:
    if "dictionaries" in decision:
        return "The words' probabilities, and the product of them all to the power of alpha."
    return "The n-gram that answered, and the factor paid for each word left out."


def _by_belief(decision: Decision) -> list[tuple[str, Any]]:
    """The places and what is said of them, the most probable first."""
    return sorted(decision["places"].items(), key=lambda item: -(item[1]["after"] or 0))


def _place_rows(decision: Decision) -> Iterator[list[str]]:
    words = [*decision["history"], decision["word"]]
    for place, said in _by_belief(decision):
        paid = " x ".join(_factor(weight) for weight in said["backoffs"]) or "-"
        answer = " ".join(words[len(words) - said["order"] :])
        before, after = _number(said["before"]), _number(said["after"])
        yield [place, _factor(said["log10_p"]), answer, paid, before, after]


def _words_caption(decision: Decision) -> str:
    return (
        f"{decision['best']} against {decision['rival']}: the words of the last {WINDOW} selected frames that moved "
        "the odds most, as far as the filter still remembers them."
    )


def _word_rows(decision: Decision) -> Iterator[list[str]]:
    for side in ("for", "against"):
        for one in decision[side]:
            yield [side, one["word"], f"x {_factor(one['log10_odds'])}", ", ".join(map(str, one["ago"]))]


def _columns(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in (header, *rows)
    ]


def _factor(log10: float | None) -> str:
    """A number whose decimal logarithm is given; None is that of 0."""
    return "0" if log10 is None else _number(10**log10)


def _number(value: float | None) -> str:
    return "0" if value is None else f"{value:.3g}"
