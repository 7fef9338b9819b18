"""docs/srilm.md lists exactly the options that the tools have; run this file to write its tables anew."""

import re
from importlib import import_module
from pathlib import Path

import pytest

from placerec.srilm.tools.options import Options

PAGE = Path(__file__).resolve().parents[2] / "docs/srilm.md"
TABLED = ("ngram-count", "ngram", "ngram-merge", "disambig", "hidden-ngram", "ngram-class")


def options_of(tool: str) -> Options:
    options: Options = pytest.importorskip(f"placerec.srilm.tools.{tool.replace('-', '_')}").OPTIONS
    assert len(options) >= 2
    return options


def rows(options: Options) -> list[str]:
    """One row for each option; those that differ only in a digit share one, `gtNmin` stands for gt1min to gt9min."""
    families: dict[tuple[str, str], list[str]] = {}
    for name, option in options.items():
        digit = re.sub(r"\D", "", name)
        text = option.help.replace(digit, "N") if digit else option.help
        families.setdefault((re.sub(r"\d", "N", name), text), []).append(name)
    lines = []
    for (family, text), names in sorted(families.items(), key=lambda item: (item[0][0], item[1])):
        digits = [re.sub(r"\D", "", name) for name in names]
        option = options[names[0]]
        value = {"flag": "", "string": " TEXT", "float": " REAL"}.get(option.kind, " NUMBER")
        which = f" (N = {digits[0]} .. {digits[-1]})" if len(names) > 1 else ""
        name = family if len(names) > 1 else names[0]
        text = re.sub(r"</?\w+>", r"`\g<0>`", text if len(names) > 1 else option.help)
        lines.append(f"| `-{name}{value}`{which} | {'refused' if option.refused else 'works'} | {text} |")
    return lines


def table(page: str, tool: str) -> list[str]:
    """The rows under a tool's heading."""
    section = re.search(rf"^### {tool}\n(.*?)(?=^#|\Z)", page, re.MULTILINE | re.DOTALL)
    assert section is not None
    return [line for line in section[1].splitlines() if line.startswith("| `")]


@pytest.mark.parametrize("tool", TABLED)
def test_the_page_lists_exactly_the_options_of_the_tool(tool: str) -> None:
    assert table(PAGE.read_text(), tool) == rows(options_of(tool))


def test_every_option_that_the_specification_names_is_known(shared: Path) -> None:
    text = (shared / "srilm/spec.md").read_text()
    spans = " ".join(re.findall(r"`([^`\n]+)`", text))
    named = set(re.findall(r"(?<![\w<-])-([a-z][a-zA-Z0-9-]*)", spans))
    assert len(named) > 90
    known = {name for tool in TABLED for name in options_of(tool)} | {"help", "version"}
    # Placeholders, words that are no options (a token, a number), and options of tools that we do not have.
    others = {"foo", "pau-", "interpolateI", "writeK", "writeN", "inf", "nan", "subset"}
    assert sorted(name for name in named - known - others if f"write{name}" not in known) == []


def _rewrite() -> None:
    page = PAGE.read_text()
    for tool in TABLED:
        old = table(page, tool)
        lines = rows(import_module(f"placerec.srilm.tools.{tool.replace('-', '_')}").OPTIONS)
        head = "| option | | what it does, or why it is refused |\n|---|---|---|\n"
        body = "".join(f"{line}\n" for line in old)
        page = page.replace(f"### {tool}\n\n{head}{body}", f"### {tool}\n\n{head}" + "".join(f"{x}\n" for x in lines))
    PAGE.write_text(page)


if __name__ == "__main__":
    _rewrite()
