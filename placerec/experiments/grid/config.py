"""What an experiment is: a TOML file with the tables [data], [grid] and [options], read strictly.

[data]
sequences = ["recordings/*"]     # folders of images, relative to this file; or
tokens = "tokens/{size}-{seed}"  # token streams made before
test = ["run3*"]                 # names of the test sequences; or
split = "leave-one-out"          # leave-one-illumination-out, cold-saarbruecken-b

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
"""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from string import Formatter
from typing import Any

from placerec.errors import ExperimentError, PlacerecError
from placerec.experiments.grid.splits import SPLITS
from placerec.files import read_text
from placerec.hohmm import PER
from placerec.lm import SMOOTHINGS
from placerec.model.decoding import NAMED, STAY
from placerec.model.options import MAX_ORDER
from placerec.vision.dictionary import UNITS
from placerec.words import parse_selection

_TABLES = {
    "data": ("sequences", "tokens", "test", "split"),
    "grid": ("order", "smoothing", "select", "size", "transition", "seeds"),
    "options": ("stay", "per", "units"),
}
_PLACEHOLDERS = ("size", "seed")


@dataclass(frozen=True)
class Config:
    """An experiment; every name is that of the file. `sequences` or `tokens` is given, and `test` or `split`."""

    folder: Path  # what relative paths start from
    sequences: tuple[str, ...]
    tokens: str | None
    test: tuple[str, ...]
    split: str | None
    order: tuple[int, ...]
    smoothing: tuple[str, ...]
    select: tuple[str, ...]
    size: tuple[int, ...]
    transition: tuple[str, ...]
    seeds: int
    stay: float
    per: str
    units: str

    def tokens_folder(self, size: int, seed: int) -> Path:
        """Where the token streams are that were made before for this size and seed."""
        return self.folder / (self.tokens or "").format(size=size, seed=seed)


def read_config(path: Path | str) -> Config:
    """Read an experiment's file; ExperimentError names the file, the key, its value and the remedy."""
    path = Path(path)
    try:
        content = tomllib.loads(read_text(path, ExperimentError))
    except tomllib.TOMLDecodeError as error:
        raise ExperimentError(f"{path}: is not TOML: {error}; mend that line") from error
    return _Reader(path, content).config()


@dataclass(frozen=True)
class _Reader:
    path: Path
    content: Mapping[str, Any]

    def config(self) -> Config:
        self._check_keys()
        data = self.content["data"]
        self._one_of(data, "sequences", "tokens")
        self._one_of(data, "test", "split")
        size = self._list("grid", "size", _size)
        seeds = self._value("grid", "seeds", _count, 5)
        return Config(
            folder=self.path.parent,
            sequences=self._list("data", "sequences", _text) if "sequences" in data else (),
            tokens=self._tokens(len(size), seeds) if "tokens" in data else None,
            test=self._list("data", "test", _text) if "test" in data else (),
            split=self._value("data", "split", _choice(*SPLITS), None) if "split" in data else None,
            order=self._list("grid", "order", _order),
            smoothing=self._list("grid", "smoothing", _choice(*SMOOTHINGS)),
            select=self._list("grid", "select", _selection),
            size=size,
            transition=self._list("grid", "transition", _choice(*NAMED), ["fixed"]),
            seeds=seeds,
            stay=self._value("options", "stay", _share, STAY),
            per=self._value("options", "per", _choice(*PER), "update"),
            units=self._value("options", "units", _choice(*UNITS), "live"),
        )

    def _check_keys(self) -> None:
        for table, content in self.content.items():
            if table not in _TABLES:
                raise self._error(f"unknown table [{table}]", f"there are [{'], ['.join(_TABLES)}]")
            if not isinstance(content, dict):
                raise self._error(f"{table} = {content!r} is no table", f"write [{table}] on a line of its own")
            for key in content:
                if key not in _TABLES[table]:
                    raise self._error(f"unknown key {key!r} in [{table}]", f"there are {', '.join(_TABLES[table])}")
        for table in ("data", "grid"):
            if table not in self.content:
                raise self._error(f"the table [{table}] is missing", f"it holds {', '.join(_TABLES[table])}")

    def _one_of(self, data: Mapping[str, Any], first: str, second: str) -> None:
        if first in data and second in data:
            raise self._error(f"[data] has {first!r} and {second!r}, which exclude each other", "leave one out")
        if first not in data and second not in data:
            raise self._error(f"[data] has neither {first!r} nor {second!r}", "give one")

    def _value(self, table: str, key: str, check: Callable[[Any], str], default: Any) -> Any:
        value = self.content.get(table, {}).get(key, default)
        if value is None:
            raise self._error(f"[{table}] has no {key!r}", "add it")
        return self._checked(f"[{table}] {key}", value, check)

    def _list(self, table: str, key: str, check: Callable[[Any], str], default: Any = None) -> tuple[Any, ...]:
        value = self._value(table, key, lambda value: "", default)
        name = f"[{table}] {key}"
        if not isinstance(value, list) or not value:
            raise self._error(f"{name} = {value!r} is no list with something in it", f"write {key} = [...]")
        for i, item in enumerate(value):
            self._checked(name, item, check)
            if item in value[:i]:
                raise self._error(f"{name} lists {item!r} twice", "once is enough")
        return tuple(value)

    def _checked(self, name: str, value: Any, check: Callable[[Any], str]) -> Any:
        remedy = check(value)
        if remedy:
            raise self._error(f"{name} = {value!r} cannot be used", remedy)
        return value

    def _tokens(self, sizes: int, seeds: int) -> str:
        tokens: str = self._value("data", "tokens", _text, None)
        remedy = "write the folder as in tokens/{size}-{seed}"
        try:
            found = [field for _, field, _, _ in Formatter().parse(tokens) if field is not None]
        except ValueError as error:
            raise self._error(f"[data] tokens = {tokens!r}: {error}", remedy) from error
        for field in found:
            if field not in _PLACEHOLDERS:
                raise self._error(f"[data] tokens = {tokens!r} holds {{{field}}}", remedy)
        for field, number in zip(_PLACEHOLDERS, (sizes, seeds), strict=True):
            if number > 1 and field not in found:
                raise self._error(f"[data] tokens = {tokens!r} is the same for every {field}", remedy)
        return tokens

    def _error(self, what: str, remedy: str) -> ExperimentError:
        return ExperimentError(f"{self.path}: {what}; {remedy}")


def _choice(*names: str) -> Callable[[Any], str]:
    return lambda value: "" if isinstance(value, str) and value in names else f"choose {', '.join(names)}"


def _whole(least: int, most: int, remedy: str) -> Callable[[Any], str]:
    # Not isinstance: true and false are whole numbers, too.
    return lambda value: "" if type(value) is int and least <= value <= most else remedy


_order = _whole(1, MAX_ORDER, f"give a whole number from 1 to {MAX_ORDER}")
_size = _whole(2, 200, "give a whole number from 2 to 200, the side of the map")
_count = _whole(1, 1000, "give how many there are, a whole number from 1; they are 0, 1, 2...")


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
