"""Completion, asked for as the shells ask: by the environment, in a process of its own."""

import os
import re
import subprocess
import sys
from pathlib import Path

import click
import pytest

from placerec.cli import commands

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/install.md").read_text(encoding="utf-8")
HEAVY = ("numpy", "cv2", "scipy", "matplotlib", "kenlm", "sklearn")


def ask(shell: str, line: str) -> tuple[list[str], str]:
    """The lines that answer the shell when the cursor is at the end of `line`, and what was imported for them."""
    words = line.split(" ")
    # bash and zsh say which word the cursor is in, fish what that word is.
    asked = {"COMP_WORDS": line, "COMP_CWORD": words[-1] if shell == "fish" else str(len(words) - 1)}
    done = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "placerec"],
        env={**os.environ, "PYTHONPATH": str(ROOT), "_PLACEREC_COMPLETE": f"{shell}_complete", **asked},
        capture_output=True,
        text=True,
        check=True,
    )
    assert "click.shell_completion" in done.stderr
    return done.stdout.splitlines(), done.stderr


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("placerec tr", ["plain,train-lm", "plain,train-words"]),
        ("placerec train-lm --sm", ["plain,--smoothing"]),
        ("placerec train-lm --smoothing wit", ["plain,witten-bell", "plain,witten-bell-backoff"]),
        ("placerec decode --tr", ["plain,--transition"]),
        ("placerec decode tokens/run3.tsv -m mod", ["file,mod"]),
        ("placerec evaluate bel", ["file,bel"]),
        ("placerec evaluate beliefs/run3.tsv --plot ", ["file,"]),
        # Whatever follows one of SRILM's names may be a file.
        ("placerec ngram-count -text tr", ["file,tr"]),
    ],
)
def test_commands_options_values_and_files_are_completed_at_no_cost(line: str, expected: list[str]) -> None:
    answer, imported = ask("bash", line)
    assert answer == expected
    assert not [name for name in HEAVY if re.search(rf"\| +{name}$", imported, re.M)]


def test_zsh_and_fish_are_told_what_a_command_is_for() -> None:
    assert ask("zsh", "placerec calib")[0] == ["plain", "calibrate", "Learn how far the beliefs of a model can..."]
    assert ask("zsh", "placerec check mod")[0] == ["file", "mod", "_"]
    assert ask("fish", "placerec calib")[0] == ["plain,calibrate\tLearn how far the beliefs of a model can..."]
    assert ask("fish", "placerec check mod")[0] == ["file,mod"]


def test_every_command_is_completed() -> None:
    assert [line.removeprefix("plain,") for line in ask("bash", "placerec ")[0]] == sorted(commands.commands)
    assert len(commands.commands) > 20


@pytest.mark.skipif(not Path("/bin/bash").exists(), reason="needs bash")
def test_bash_completes_with_the_line_of_the_docs(tmp_path: Path) -> None:
    (line,) = re.findall(r"^    (eval .*bash_source.*)$", PAGE, re.M)
    placerec = tmp_path / "placerec"
    placerec.write_text(f'#!/bin/sh\nPYTHONPATH="{ROOT}" exec "{sys.executable}" -m placerec "$@"\n')
    placerec.chmod(0o755)
    # `compopt` works only while a user waits for an answer.
    script = f"""{line}
        compopt() {{ printf '%s %s %s\\n' compopt "$@"; }}
        complete -p placerec
        COMP_WORDS=(placerec train-); COMP_CWORD=1; _placerec_completion placerec; echo "${{COMPREPLY[*]}}"
        COMPREPLY=(); COMP_WORDS=(placerec check model/); COMP_CWORD=2; _placerec_completion placerec"""
    environment = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"}
    done = subprocess.run(["/bin/bash", "-c", script], env=environment, capture_output=True, text=True)
    assert done.stderr == ""
    assert done.stdout.splitlines() == [
        "complete -o nosort -F _placerec_completion placerec",
        "train-lm train-words",
        "compopt -o default",
    ]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_docs_lines_ask_for_what_there_is(shell: str) -> None:
    assert re.findall(rf"_PLACEREC_COMPLETE={shell}_source placerec", PAGE)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "_PLACEREC_COMPLETE": f"{shell}_source"}
    done = subprocess.run([sys.executable, "-m", "placerec"], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert f"_PLACEREC_COMPLETE={shell}_complete" in done.stdout


def test_paths_are_completed_wherever_a_command_wants_one() -> None:
    """A parameter that says it is a file or a folder is one for the shell, too."""
    context = click.Context(commands)
    wanted = [
        (name, parameter)
        for name, command in commands.commands.items()
        for parameter in command.params
        if re.search(r"/|FILE|SOURCE|TOKENS|BELIEFS|\.(tsv|npz|arpa|toml|png)", parameter.make_metavar(context))
        and not re.search(r"npy:FILE|fixed\|", parameter.make_metavar(context))
    ]
    assert len(wanted) > 25
    for name, parameter in wanted:
        items = parameter.shell_complete(context, "x")
        assert [item.type in ("file", "dir") for item in items] == [True], f"{name}: {parameter.name}"
