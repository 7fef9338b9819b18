"""SRILM's option parser: section 2.1 of our SRILM specification. It warns and goes on where others stop."""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from placerec.srilm.streams import SrilmError, Streams
from placerec.version import __version__


class Option(NamedTuple):
    """One option: its kind (flag, int, unsigned, float, string), its default, and what it does in a few words.

    `refused`: named by the specification but not specified, so that it cannot be honoured.
    """

    kind: str
    default: Any = None
    help: str = ""
    refused: bool = False


Options = Mapping[str, Option]


class Parsed:
    """The values by name (without the hyphen), what was given, and the arguments that are no options."""

    def __init__(self, values: dict[str, Any]) -> None:
        self.values = values
        self.given: set[str] = set()
        self.rest: list[str] = []

    def __getitem__(self, name: str) -> Any:
        return self.values[name]


def parse(tool: str, options: Options, arguments: Sequence[str], streams: Streams, *, stops: bool = False) -> Parsed:
    """Parse `arguments`; with `stops`, the first argument that is no option, or `--`, ends the options.

    Raises SrilmError (status 0) after -help and -version, and (status 2) for an option that is refused.
    """
    parsed = Parsed({name: option.default for name, option in options.items()})
    queue = list(arguments)
    while queue:
        argument = queue.pop(0)
        if not argument.startswith("-"):
            parsed.rest.append(argument)
            if stops:
                parsed.rest += queue
                break
            continue
        if stops and argument == "--":
            parsed.rest += queue
            break
        name = argument[1:]
        if name in ("help", "?"):
            raise SrilmError(usage(tool, options), 0)
        if name == "version":
            raise SrilmError(f"placerec {__version__}: {tool} after our specification of SRILM 1.7.3", 0)
        if name not in options:
            streams.say(f'Unknown option "{argument}";  type "{tool} -help" for information')
            continue
        option = options[name]
        if option.refused:
            raise SrilmError(f"{tool}: option {argument} is not supported by placerec: {option.help}", 2)
        if option.kind == "flag":
            parsed.values[name] = True
            parsed.given.add(name)
        elif not queue:
            streams.say(f'Warning: {tool} option "{argument}" needs an argument')
        else:
            _take(parsed, name, option, argument, queue.pop(0), streams)
    return parsed


def _take(parsed: Parsed, name: str, option: Option, argument: str, text: str, streams: Streams) -> None:
    if option.kind == "string":
        parsed.values[name] = text
        parsed.given.add(name)
        return
    if option.kind == "float":
        value = leading_float(text)
        if value is None:
            shown = "%g" % (option.default or 0)
            streams.say(
                f'Warning: option "{argument}" got non-floating-point argument "{text}".  Using default: {shown}.'
            )
            return
    else:
        value = leading_int(text)
        if value is None:
            streams.say(
                f'Warning: option "{argument}" got a non-numeric argument "{text}".  Using default: {option.default}'
            )
            return
        if option.kind == "unsigned" and value < 0:
            streams.say(
                f'Warning: option "{argument}" got a negative argument "{text}".  Using default: {option.default}.'
            )
            return
    parsed.values[name] = value
    parsed.given.add(name)


def leading_int(text: str) -> int | None:
    """The number that C's strtol with base 0 finds at the start of a text: 12, 0x1f, 017; None if there is none."""
    match = re.match(rf"{_SPACE}([-+]?)(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)", text)
    if not match:
        return None
    digits = match[2]
    base = 16 if digits[:2].lower() == "0x" else 8 if digits.startswith("0") and len(digits) > 1 else 10
    value = bounded_int(digits[2:] if base == 16 else digits, base)
    return -value if match[1] == "-" else value


def bounded_int(digits: str, base: int = 10, *, most: int = 2**63 - 1) -> int:
    """The number that digits spell, at most `most`; there may be more digits than Python cares to convert."""
    digits = digits.lstrip("0")
    return min(int(digits or "0", base), most) if len(digits) <= _MOST_DIGITS else most


def leading_float(text: str) -> float | None:
    """The number that C's strtod finds at the start of a text, None if there is none."""
    match = re.match(rf"{_SPACE}([-+]?(?:{_HEXADECIMAL}|{_DECIMAL}|inf(?:inity)?|nan))", text, re.IGNORECASE)
    if not match:
        return None
    if "x" not in match[1].lower():
        return float(match[1])
    try:
        return float.fromhex(match[1])
    except OverflowError:
        return -math.inf if match[1].startswith("-") else math.inf


_MOST_DIGITS = 1000
_SPACE = r"[ \t\n\v\f\r]*"
_HEXADECIMAL = r"0x(?:[0-9a-f]+\.?[0-9a-f]*|\.[0-9a-f]+)(?:p[-+]?[0-9]+)?"
_DECIMAL = r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[-+]?[0-9]+)?"


def usage(tool: str, options: Options) -> str:
    """The option table."""
    lines = [f"Usage of command {tool}:"]
    for name, option in options.items():
        value = "" if option.kind == "flag" else " <arg>"
        default = "" if option.default in (None, False, "") else f" (default {option.default})"
        lines.append(f" -{name + value:24} {option.help}{default}")
    return "\n".join(lines)
