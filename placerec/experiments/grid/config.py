"""What an experiment is: a TOML file with the tables [data], [grid] and [options], read strictly.

[data]
sequences = ["recordings/*"]     # folders of images, relative to this file; or
tokens = "tokens/{size}-{seed}"  # token streams made before
test = ["run3*"]                 # names of the test sequences; or
split = "leave-one-out"          # leave-one-illumination-out, cold-saarbruecken-b, light (perhaps with test)

[grid]
order = [1, 2, 3, 4, 5, 6]
smoothing = ["witten-bell", "lidstone-backoff"]
select = ["none", "subsample:3", "subsample:5", "compress:3", "unique"]
size = [10, 20]
transition = ["fixed", "learned"]  # without this: fixed
seeds = 5

[options]                        # all of it may be left out
stay = 0.99
per = "update"
units = "live"
as_in_paper = false              # true: the grid alone, without the system of `placerec learn` beside it
"""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from string import Formatter
from typing import Any

from placerec.errors import ExperimentError, PlacerecError
from placerec.experiments.grid.splits import LIGHT, SPLITS
from placerec.files import read_text
from placerec.hohmm import PER
from placerec.hohmm.transitions import Per
from placerec.lm import SMOOTHINGS
from placerec.model.decoding import NAMED, STAY
from placerec.model.options import MAX_ORDER
from placerec.vision.options import UNITS, Units
from placerec.words import parse_selection


@dataclass(frozen=True)
class Config:
    """An experiment; every name is that of the file. Either `sequences` or `tokens` is empty, and `test` or `split`.

    But both are given where the split is LIGHT and not every sequence is to be tested.
    """

    folder: Path  # what relative paths start from
    sequences: tuple[str, ...]
    tokens: str
    test: tuple[str, ...]
    split: str
    order: tuple[int, ...]
    smoothing: tuple[str, ...]
    select: tuple[str, ...]
    size: tuple[int, ...]
    transition: tuple[str, ...]
    seeds: int
    stay: float
    per: Per
    units: Units
    as_in_paper: bool

    def tokens_folder(self, size: int, seed: int) -> Path:
        """Where the token streams are that were made before for this size and seed."""
        return self.folder / self.tokens.format(size=size, seed=seed)


def _choice(*names: str) -> Callable[[Any], str]:
    return lambda value: "" if isinstance(value, str) and value in names else f"choose {', '.join(names)}"


def _whole(least: int, most: int, remedy: str) -> Callable[[Any], str]:
    # Not isinstance: true and false are whole numbers, too.
    return lambda value: "" if type(value) is int and least <= value <= most else remedy


def _share(value: Any) -> str:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return "" if number and 0 <= value <= 1 else "give a probability, from 0 to 1"


def _text(value: Any) -> str:
    return "" if isinstance(value, str) and value else "give a text that is not empty"


def _selection(value: Any) -> str:
    try:
        parse_selection(value if isinstance(value, str) else repr(value))
    except PlacerecError as error:
        return str(error).partition("; ")[2]
    return "" if isinstance(value, str) else "give a text"


@dataclass(frozen=True)
class _Key:
    """A key of a table: `check` gives the remedy for a value, or for one of a list, that cannot be used.

    `default`: None where the key must be given.
    """

    check: Callable[[Any], str]
    default: Any = None
    many: bool = True


_TABLES = {
    "data": {
        "sequences": _Key(_text, ()),
        "tokens": _Key(_text, "", many=False),
        "test": _Key(_text, ()),
        "split": _Key(_choice(*SPLITS, LIGHT), "", many=False),
    },
    "grid": {
        "order": _Key(_whole(1, MAX_ORDER, f"give a whole number from 1 to {MAX_ORDER}")),
        "smoothing": _Key(_choice(*SMOOTHINGS)),
        "select": _Key(_selection),
        "size": _Key(_whole(2, 200, "give a whole number from 2 to 200, the side of the map")),
        "transition": _Key(_choice(*NAMED), ("fixed",)),
        "seeds": _Key(
            _whole(1, 1000, "give how many there are, a whole number from 1; they are 0, 1, 2..."), 5, many=False
        ),
    },
    "options": {
        "stay": _Key(_share, STAY, many=False),
        "per": _Key(_choice(*PER), "update", many=False),
        "units": _Key(_choice(*UNITS), "live", many=False),
        "as_in_paper": _Key(lambda value: "" if isinstance(value, bool) else "write true or false", False, many=False),
    },
}


def read_config(path: Path | str) -> Config:
    """Read an experiment's file; ExperimentError names the file, the key, its value and the remedy."""
    path = Path(path)
    text = read_text(path, ExperimentError)
    try:
        content = tomllib.loads(text)
        _check_keys(content)
        found = [(key, _value(content, table, key)) for table, keys in _TABLES.items() for key in keys]
        config = Config(path.parent, **dict(found))
        _check_tokens(config)
        if config.tokens and config.split == LIGHT:
            raise ExperimentError("[data] split = 'light' looks at images, and tokens are given; give sequences")
    except tomllib.TOMLDecodeError as error:
        raise ExperimentError(f"{path}: is not TOML: {error}; mend that line") from error
    except ExperimentError as error:
        raise ExperimentError(f"{path}: {error}") from error
    return config


def _check_keys(content: Mapping[str, Any]) -> None:
    for table, given in content.items():
        if table not in _TABLES:
            raise ExperimentError(f"unknown table [{table}]; there are [{'], ['.join(_TABLES)}]")
        if not isinstance(given, dict):
            raise ExperimentError(f"{table} = {given!r} is no table; write [{table}] on a line of its own")
        for key in given:
            if key not in _TABLES[table]:
                raise ExperimentError(f"unknown key {key!r} in [{table}]; there are {', '.join(_TABLES[table])}")
    for table in ("data", "grid"):
        if table not in content:
            raise ExperimentError(f"the table [{table}] is missing; it holds {', '.join(_TABLES[table])}")
    for first, second in (("sequences", "tokens"), ("test", "split")):
        if first in content["data"] and second in content["data"] and content["data"][second] != LIGHT:
            raise ExperimentError(f"[data] has {first!r} and {second!r}, which exclude each other; leave one out")
        if first not in content["data"] and second not in content["data"]:
            raise ExperimentError(f"[data] has neither {first!r} nor {second!r}; give one")


def _value(content: Mapping[str, Any], table: str, key: str) -> Any:
    rule, name = _TABLES[table][key], f"[{table}] {key}"
    if key not in content.get(table, {}):
        if rule.default is None:
            raise ExperimentError(f"[{table}] has no {key!r}; add it")
        return rule.default
    value = content[table][key]
    if rule.many and (not isinstance(value, list) or not value):
        raise ExperimentError(f"{name} = {value!r} is no list with something in it; write {key} = [...]")
    items = value if rule.many else [value]
    for i, item in enumerate(items):
        if remedy := rule.check(item):
            raise ExperimentError(f"{name} = {item!r} cannot be used; {remedy}")
        if item in items[:i]:
            raise ExperimentError(f"{name} lists {item!r} twice; once is enough")
    return tuple(value) if rule.many else value


def _check_tokens(config: Config) -> None:
    """Whether the folder of the token streams is another one for every size and seed."""
    name, remedy = f"[data] tokens = {config.tokens!r}", "write the folder as in tokens/{size}-{seed}"
    try:
        found = [field for _, field, _, _ in Formatter().parse(config.tokens) if field is not None]
    except ValueError as error:
        raise ExperimentError(f"{name}: {error}; {remedy}") from error
    numbers = {"size": len(config.size), "seed": config.seeds}
    for field in found:
        if field not in numbers:
            raise ExperimentError(f"{name} holds {{{field}}}; {remedy}")
    for field, number in numbers.items():
        if config.tokens and number > 1 and field not in found:
            raise ExperimentError(f"{name} is the same for every {field}; {remedy}")
