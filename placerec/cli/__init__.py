"""The command line: each command parses, calls one library function and shows what it returned."""

import io
import os
import re
import signal
import sys
from types import FrameType
from typing import Any

import click
from click.exceptions import NoArgsIsHelpError

from placerec.cli import experiments, images, learning, models, pages, reports
from placerec.cli.srilm import SRILM_COMMANDS
from placerec.errors import PlacerecError
from placerec.version import __version__

EPILOG = """\b
Your own images, in one command:
  placerec learn RUNS/ -o model/ --test RUNS/run3
The same step by step:
  placerec train-words RUNS/run1 RUNS/run2 -o words.npz
  placerec tokenize RUNS/ -w words.npz -o tokens/
  placerec train-lm tokens/run1.tsv tokens/run2.tsv -o model/
  placerec decode tokens/run3.tsv -m model/ -o beliefs/
  placerec evaluate beliefs/run3.tsv --plot run3.png
"""


class Failure(click.ClickException):
    """An error as one line on stderr, and exit code 1."""

    speaker = "placerec"

    def show(self, file: Any = None) -> None:
        line = self.message.replace("\r", "\\r").replace("\n", "\\n")
        click.echo(f"{self.speaker}: {line}", file=file, err=True)


class Misuse(Failure):
    """Wrong usage as one line on stderr: the command, what is wrong, and an example or where to read; exit code 2."""

    exit_code = 2

    def __init__(self, error: click.UsageError, group: click.Context) -> None:
        # Click names no context where an option is the last word and its value is missing.
        context = error.ctx or group
        asked = "" if error.ctx else f" {group.invoked_subcommand or ''}".rstrip()
        self.speaker = f"{context.command_path}{asked}"
        example = re.search("placerec .*", context.command.epilog or "")
        of_argument = isinstance(getattr(error, "param", None), click.Argument)
        if example and (of_argument or isinstance(error, click.MissingParameter)):
            remedy = f"for example: {example[0]}"
        else:
            remedy = f"see `{self.speaker} --help`"
        # Those of click end in a full stop, and have line ends where there are choices.
        super().__init__(f"{' '.join(error.format_message().split()).removesuffix('.')}; {remedy}")


# Commands by what people do; those of SRILM follow.
GROUPS = {
    "Your images": (
        *("label", "learn", "describe", "train-words", "tokenize", "train-lm"),
        *("decode", "evaluate", "calibrate", "update"),
    ),
    "Look": ("report", "show-words", "show-frame", "stability", "relight", "inspect"),
    "Language models": ("check", "adapt-lm"),
    "Experiments": ("demo", "lab", "compare", "experiment"),
}
# Columns for the names of commands in the list of them.
_NAMES = 17


class Commands(click.Group):
    """The one place where what goes wrong becomes a line on stderr and an exit code."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        try:
            return super().parse_args(ctx, args)
        except NoArgsIsHelpError:
            raise
        except click.UsageError as error:
            raise Misuse(error, ctx) from error

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except click.UsageError as error:
            raise Misuse(error, ctx) from error
        except PlacerecError as error:
            raise Failure(str(error)) from error
        except KeyboardInterrupt as error:
            raise Failure("interrupted") from error
        except BrokenPipeError:
            # The reader (`| head`) has enough. Without this, Python complains when it closes stdout.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            ctx.exit(0)
        except UnicodeEncodeError as error:
            wanted = f"{error.object[error.start : error.end]!r} cannot be written as {error.encoding}"
            raise Failure(f"{wanted}; set PYTHONUTF8=1, or rename what holds it") from error
        except OSError as error:
            raise Failure(f"{error.filename or 'standard output'}: {error.strerror or error}") from error
        except MemoryError as error:
            raise Failure(f"not enough memory ({error}); give less at a time") from error

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """All commands, a line each, by what they are for; the few with long names have their line for themselves."""
        for title, names in (GROUPS | {"SRILM's tools": tuple(str(tool.name) for tool in SRILM_COMMANDS)}).items():
            with formatter.section(title):
                lines = [(name, self.commands[name].get_short_help_str(formatter.width)) for name in names]
                formatter.write_dl(lines, col_max=_NAMES)


@click.group(
    cls=Commands, epilog=EPILOG, context_settings={"help_option_names": ["-h", "--help"], "show_default": True}
)
@click.version_option(__version__, prog_name="placerec")
def commands() -> None:
    """Which place is the camera in? Images become words, places become language models."""


for module in (learning, images, models, pages, reports, experiments):
    for command in vars(module).values():
        if isinstance(command, click.Command):
            commands.add_command(command)
for command in SRILM_COMMANDS:
    commands.add_command(command)


def _terminate(number: int, frame: FrameType | None) -> None:
    """SIGTERM is as Ctrl-C is at this moment: nothing half is left, and what a camera recorded is kept."""
    interrupt = signal.getsignal(signal.SIGINT)
    # Ignored as it may be in the background, it must end the program still.
    (interrupt if callable(interrupt) else signal.default_int_handler)(signal.SIGINT, frame)


def main() -> None:
    """Run the command line: UTF-8 in and out whatever the locale, so that files and pipes hold the same bytes."""
    signal.signal(signal.SIGTERM, _terminate)
    for stream, errors in ((sys.stdin, "replace"), (sys.stdout, "surrogateescape"), (sys.stderr, "backslashreplace")):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(encoding="utf-8", errors=errors)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(newline="\n")
    commands.main(prog_name="placerec")
