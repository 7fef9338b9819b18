"""docs/commands.md, from the commands themselves.

python docs/make/commands.py > docs/commands.md
"""

import inspect
import re
import sys
from collections.abc import Iterator

import click

import placerec
from placerec.cli import GROUPS, commands
from placerec.cli.shared.groups import grouped
from placerec.cli.srilm import EXAMPLES, SRILM_COMMANDS, Tool

HEAD = """\
# Commands

Made by `python docs/make/commands.py` from the commands themselves; `placerec COMMAND --help` says the same.

- Data goes to standard output, talk to standard error. `-` is standard input or output where a command says so.
- Exit status: 0 done; 1 an error, one line that names file, line, value and remedy; 2 wrong usage.
- An output that exists is replaced whole, and nothing is written elsewhere, but for \
[descriptors that are kept](long_work.md#described-once) for other commands.
- All commands have `-q`, `--quiet` (say nothing but errors), `-v`, `--verbose` (say more) and `-h`, `--help`.
- `python -m placerec` is the same as `placerec`.
"""
SRILM_HEAD = """\
## SRILM's commands

`placerec ngram-count` and `bin/ngram-count` are the same, and so are the others. Their options are SRILM's: \
[tables](srilm.md#options).

| command | what it does | example |
| --- | --- | --- |
"""
# The one call of the library that a command makes, where it has another name or there are two.
PYTHON = {
    "check": "check_model",
    "evaluate": "evaluate_files",
    "inspect": "inspect_model inspect_decision",
    "lab": "render_lab",
    "label": "label_pages",
    "train-words": "train_dictionary",
    "demo": "",
}
# Those with a table of options on docs/srilm.md.
TABLED = ("ngram-count", "ngram", "ngram-merge", "disambig", "hidden-ngram", "ngram-class")
COMMON = {"quiet", "verbose", "help"}


def page() -> str:
    """The page."""
    parts = [HEAD]
    for title, names in GROUPS.items():
        parts += [f"## {title}\n", *(section(name, commands.commands[name]) for name in names)]
    return "\n".join([*parts, SRILM_HEAD]) + "".join(map(tool_row, SRILM_COMMANDS))


def section(name: str, command: click.Command) -> str:
    """A command: usage, what it does, its options, an example, the call that does the same."""
    usage = " ".join(" ".join(command.collect_usage_pieces(click.Context(command))).split())
    rows: list[str] = []
    for title, options in grouped(command.params).items():
        own = [row(each) for each in options if each.name not in COMMON]
        rows += [f"| **{title}** | | |", *own] if own and rows else own
    examples = re.sub(r"^(Example: |\s+)", "    ", (command.epilog or "").replace("\b\n", ""), flags=re.MULTILINE)
    calls = PYTHON.get(name, name.replace("-", "_")).split()
    parts = [f"### {name}\n", f"    placerec {name} {usage}\n", *prose(command.help or "")]
    if rows:
        parts += ["| option | value | what it is |\n| --- | --- | --- |", *rows, ""]
    parts += [f"Example:\n\n{examples.rstrip()}\n"]
    if calls:
        parts += [f"In Python: {' or '.join(map(reference, calls))}.\n"]
    return "\n".join(parts)


def reference(call: str) -> str:
    """A link to a function in the library's reference, where one is named in full if its module has the same name."""
    home = getattr(placerec, call).__module__
    return f"[`placerec.{call}`](library.md#{home if home.endswith(f'.{call}') else 'placerec'}.{call})"


def prose(text: str) -> Iterator[str]:
    """The paragraphs of a help text; what is not to be wrapped (after a line \\b) as a block."""
    for paragraph in inspect.cleandoc(text).split("\n\n"):
        lines = paragraph.splitlines()
        if lines[0] == "\b":
            yield "\n".join(f"    {line}" for line in lines[1:]) + "\n"
        else:
            yield marked(" ".join(lines)) + "\n"


def row(option: click.Option) -> str:
    """A line of the table: the names, the values, the help, and in brackets the default and what is allowed."""
    text, *told = re.split(r"\s*\[((?:default: .*?)|repeatable)\]$", " ".join((option.help or "").split()))
    notes = ["required" if option.required else "", default(option), *told, limits(option.type)]
    shown = "; ".join(note for note in notes if note)
    names = ", ".join(f"`{name}`" for name in [*option.opts, *option.secondary_opts])
    return f"| {names} | {values(option)} | {marked(text)}{f' ({shown})' if shown else ''} |"


def values(option: click.Option) -> str:
    """What the values of an option can be, none for a flag."""
    if option.is_flag:
        return ""
    if isinstance(option.type, click.Choice) and not option.metavar:
        choices = [str(choice) for choice in option.type.choices]
    else:
        choices = (option.metavar or {"integer range": "N", "float range": "X"}.get(option.type.name, "VALUE")).split(
            "|"
        )
    return ", ".join(f"`{choice}`" for choice in choices)


def default(option: click.Option) -> str:
    """The default, if --help shows it."""
    if not isinstance(option.default, int | float | str) or (option.is_flag and not option.secondary_opts):
        return ""
    if option.is_flag:
        return f"default: `{(option.opts if option.default else option.secondary_opts)[0]}`"
    return f"default: `{option.default}`"


def limits(kind: object) -> str:
    """The range of a number."""
    if not isinstance(kind, click.IntRange | click.FloatRange):
        return ""
    low = "" if kind.min is None else f"{'above' if kind.min_open else 'at least'} {kind.min:g}"
    high = "" if kind.max is None else f"{'below' if kind.max_open else 'at most'} {kind.max:g}"
    return ", ".join(part for part in (low, high) if part)


def marked(text: str) -> str:
    """Text as Markdown: what looks like a tag or ends a table's cell is kept as it is."""
    return re.sub(r"(?<!`)(</?\w+>)", r"`\1`", text).replace("|", "\\|")


def tool_row(tool: Tool) -> str:
    """A line about a command of SRILM's."""
    name = str(tool.name)
    anchor = name if name in TABLED else "the-scripts"
    purpose = str(tool.short_help).rstrip(".")
    return f"| [`{name}`](srilm.md#{anchor}) | {purpose} | `placerec {name} {EXAMPLES[name]}` |\n"


if __name__ == "__main__":
    sys.stdout.write(page())
