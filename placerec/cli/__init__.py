"""The command line: one file per command, which parses, calls one library function and shows what it gave."""

import os
import sys

import click

from placerec.cli.check import check
from placerec.cli.decode import decode
from placerec.cli.demo import demo
from placerec.cli.describe import describe
from placerec.cli.evaluate import evaluate
from placerec.cli.inspect import inspect
from placerec.cli.lab import lab
from placerec.cli.tokenize import tokenize
from placerec.cli.train_lm import train_lm
from placerec.cli.train_words import train_words
from placerec.errors import PlacerecError
from placerec.version import __version__

EPILOG = """\b
Your own images, in five commands:
  placerec train-words RUNS/ -o words.npz
  placerec tokenize RUNS/ -w words.npz -o tokens/
  placerec train-lm tokens/run1.tsv tokens/run2.tsv -o model/
  placerec decode tokens/run3.tsv -m model/ -o beliefs/
  placerec evaluate beliefs/run3.tsv --plot run3.png
"""


@click.group(epilog=EPILOG, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="placerec")
def commands() -> None:
    """Which place is the camera in? Images become words, places become language models."""


for command in (describe, train_words, tokenize, train_lm, decode, evaluate, inspect, check, lab, demo):
    commands.add_command(command)


def main() -> None:
    """Run the command line; the one place where an error becomes a line on stderr and an exit code."""
    try:
        commands.main(prog_name="placerec", standalone_mode=False)
    except click.UsageError as error:
        error.show()
        sys.exit(2)
    except click.ClickException as error:
        error.show()
        sys.exit(1)
    except PlacerecError as error:
        click.echo(f"placerec: {error}", err=True)
        sys.exit(1)
    except (KeyboardInterrupt, click.Abort):
        click.echo("placerec: interrupted", err=True)
        sys.exit(1)
    except BrokenPipeError:
        # The reader (`| head`) has enough. Without this, Python complains when it closes stdout.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
