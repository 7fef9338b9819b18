"""What commands say of themselves: which there are, how they are listed, and --help of each."""

import re

import click
import pytest
from helpers.typed_commands import done

from placerec.cli import commands
from placerec.cli.shared import SMOOTHING_NAMES, work
from placerec.files import CACHE
from placerec.lm import SMOOTHINGS
from placerec.srilm.tools.run import TOOLS

NAMES = sorted(set(commands.commands) - set(TOOLS))


def test_all_commands_of_the_contract_so_far_are_there() -> None:
    expected = (
        "adapt-lm calibrate check compare decode demo describe evaluate experiment inspect lab label learn relight "
        "report show-frame show-words stability tokenize train-lm train-words update"
    )
    assert " ".join(NAMES) == expected
    assert set(commands.commands) == {*NAMES, *TOOLS}


@pytest.mark.parametrize("tool", TOOLS)
def test_every_tool_of_srilm_helps(tool: str) -> None:
    text = done(tool, "--help").stdout
    assert text == done(tool, "-h").stdout
    assert f"\nExample: placerec {tool} " in text


def test_the_list_of_commands_is_not_cut_off() -> None:
    listed = done("--help").stdout.partition("\nYour images:\n")[2].partition("Your own images")[0]
    assert "..." not in listed
    for name in commands.commands:
        assert len(re.findall(rf"^  {name}(?:\n  )? +[A-Z].*\.$", listed, re.MULTILINE)) == 1, name


def test_commands_are_listed_by_what_people_do() -> None:
    text = done("--help").stdout
    groups = dict(re.findall(r"^(\S.*):\n((?:  .*\n)+)", text.partition("placerec learn")[0], re.MULTILINE))
    assert list(groups)[1:] == ["Your images", "Look", "Language models", "Experiments", "SRILM's tools"]
    assert re.findall(r"^  (\S+)", groups["Your images"], re.MULTILINE)[:3] == ["label", "learn", "describe"]
    assert re.findall(r"^  (\S+)", groups["SRILM's tools"], re.MULTILINE) == list(TOOLS)


@pytest.mark.parametrize(
    ("name", "groups"),
    [
        (
            "decode",
            ["Options", "How sources are read", "How words become beliefs", "What is kept", "The page", "General"],
        ),
        (
            "train-words",
            [
                *("Options", "How sources are read", "How words are learned", "What describes an image"),
                *("What is kept", "Who does the work", "General"),
            ],
        ),
        ("lab", ["Options", "General"]),
    ],
)
def test_options_are_listed_by_what_they_are_for(name: str, groups: list[str]) -> None:
    text = done(name, "--help").stdout
    assert re.findall(r"^(\S.*):$", text, re.MULTILINE) == groups
    assert re.findall(r"^  (-\S+)", text.partition("\nGeneral:\n")[2], re.MULTILINE) == ["-q,", "-v,", "-h,"]
    for option in commands.commands[name].params:
        if isinstance(option, click.Option):
            shown = re.findall(rf"^  (?:-\S+, )*{option.opts[-1]}\b", text, re.MULTILINE)
            assert len(shown) == 1, option.opts


@pytest.mark.parametrize("name", NAMES)
def test_every_command_helps(name: str) -> None:
    text = done(name, "--help").stdout
    assert text == done(name, "-h").stdout
    assert f"Example: placerec {name}" in text
    command = commands.commands[name]
    options = {option for param in command.params for option in param.opts}
    assert {"-q", "--quiet", "-v", "--verbose"} <= options
    for param in command.params:
        if isinstance(param, click.Option):
            assert param.help, f"{param.opts} is not explained"
            shown = re.split(rf"^  (?:-+\w+, )?{param.opts[-1]}\b", text, flags=re.MULTILINE)[1].partition("\n  -")[0]
            told = "default: " in " ".join(shown.split()) or param.required or param.is_flag
            assert told or not isinstance(param.default, int | float | str), f"the default of {param.opts} is not shown"


def test_options_of_one_name_are_one_option() -> None:
    """One spelling across commands: short and long forms always go together, and -o is always the output."""
    forms: dict[str, set[tuple[str, ...]]] = {}
    for command in commands.commands.values():
        for param in command.params:
            if isinstance(param, click.Option):
                forms.setdefault(param.opts[-1], set()).add(tuple(param.opts))
    assert {name for name, spellings in forms.items() if len(spellings) > 1} == set()
    assert forms["--out"] == {("-o", "--out")}


def test_the_names_of_smoothings_are_those_of_the_library() -> None:
    assert tuple(SMOOTHINGS) == SMOOTHING_NAMES


def test_the_folder_of_kept_descriptors_is_that_of_the_library() -> None:
    assert work.CACHE == CACHE


def test_the_version_is_told() -> None:
    assert re.fullmatch(r"placerec, version \d+\.\d+\.\d+\n", done("--version").stdout)
