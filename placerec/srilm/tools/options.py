"""SRILM's option parser: section 2.1 of our SRILM specification. It warns and goes on where others stop."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from placerec.srilm.text.numbers import leading_float, leading_int
from placerec.srilm.text.streams import SrilmError, Streams
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
    value: Any = text if option.kind == "string" else (leading_float if option.kind == "float" else leading_int)(text)
    current = parsed[name] or 0
    if value is None and option.kind == "float":
        wrong = f'non-floating-point argument "{text}".  Using default: {current:g}.'
    elif value is None:
        wrong = f'a non-numeric argument "{text}".  Using default: {current}'
    elif option.kind == "unsigned" and value < 0:
        wrong = f'a negative argument "{text}".  Using default: {current}.'
    else:
        parsed.values[name] = value
        parsed.given.add(name)
        return
    streams.say(f'Warning: option "{argument}" got {wrong}')


def usage(tool: str, options: Options) -> str:
    """The option table."""
    lines = [f"Usage of command {tool}:"]
    for name, option in options.items():
        value = "" if option.kind == "flag" else " <arg>"
        default = "" if option.default in (None, False, "") else f" (default {option.default})"
        lines.append(f" -{name + value:24} {option.help}{default}")
    return "\n".join(lines)
