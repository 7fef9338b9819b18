"""Runs a tool on the process's arguments and streams, with the manners of a Unix command.

bin/srilm starts it; only the standard library is loaded until the tool is known.
"""

import gc
import os
import signal
import sys
from collections.abc import Callable, Sequence

TOOLS = (
    "ngram-count",
    "ngram",
    "ngram-merge",
    "compute-best-mix",
    "change-lm-vocab",
    "add-ppls",
    "disambig",
    "hidden-ngram",
    "ngram-class",
    "replace-words-with-classes",
    "uniform-classes",
    "subtract-ppls",
    "sort-lm",
    "make-sub-lm",
    "get-unigram-probs",
    "get-gt-counts",
    "make-gt-discounts",
    "make-kn-discounts",
    "make-abs-discount",
    "make-big-lm",
    "make-batch-counts",
    "merge-batch-counts",
    "reverse-lm",
    "ppl-from-log",
    "compare-ppls",
    "select-vocab",
)
# Small ones that share a module; each of the others has one of its name.
_TOGETHER = {
    **dict.fromkeys(("sort-lm", "make-sub-lm", "get-unigram-probs", "reverse-lm"), "lm_scripts"),
    **dict.fromkeys(
        ("get-gt-counts", "make-gt-discounts", "make-kn-discounts", "make-abs-discount"), "discount_scripts"
    ),
    **dict.fromkeys(("make-batch-counts", "merge-batch-counts"), "batch_counts"),
    **dict.fromkeys(("ppl-from-log", "compare-ppls"), "token_lines"),
}
_INTERRUPTED = 130


def run(tool: str, arguments: Sequence[str], *, shown: str = "") -> int:
    """Run one of TOOLS on the process's standard streams; `shown` is its name in messages. Returns the exit status."""
    # Whoever reads our output may stop doing so (`| head`): like other commands, we just end.
    if hasattr(signal, "SIGPIPE"):
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    try:
        return _run(tool, arguments, shown or tool)
    except KeyboardInterrupt:
        # Ends as if it had not been caught: a shell's loop around us ends too.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        signal.raise_signal(signal.SIGINT)
        return _INTERRUPTED
    except ModuleNotFoundError as error:
        if error.name != "numpy":
            raise
        print(f"{shown or tool}: needs numpy: run `{sys.executable} -m pip install numpy`", file=sys.stderr)  # noqa: T201
        return 1


def function_of(tool: str) -> Callable[..., int]:
    """The function of one of TOOLS: of arguments, streams, and optionally the name in messages -> the exit status."""
    from importlib import import_module

    name = tool.replace("-", "_")
    found: Callable[..., int] = getattr(import_module(f"placerec.srilm.tools.{_TOGETHER.get(tool, name)}"), name)
    return found


def _run(tool: str, arguments: Sequence[str], shown: str) -> int:
    from placerec.errors import PlacerecError
    from placerec.srilm.text.streams import Streams

    streams = Streams(sys.stdin.buffer, sys.stdout.buffer, sys.stderr.buffer)
    try:
        status = function_of(tool)(_latin(arguments), streams, _latin([shown])[0])
        streams.stdout.flush()
    except PlacerecError as error:
        streams.say(f"{shown}: {error}")
        return 1
    except MemoryError:
        streams.say(f"{shown}: out of memory")
        return 1
    except OSError as error:
        # Files are named where they are opened; what is left is standard output.
        streams.say(f"{shown}: standard output: {error.strerror or error}")
        _forget_output()
        return 1
    return status


def _latin(arguments: Sequence[str]) -> list[str]:
    """The bytes of the arguments as Latin-1, as all text is held."""
    return [os.fsencode(argument).decode("latin-1") for argument in arguments]


def _forget_output() -> None:
    """Keep Python from complaining once more, when it ends, that standard output cannot be written."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def main() -> None:
    """`TOOL PATH ARGUMENTS...`: a tool, the path that it was called by, and its arguments."""
    tool, path, *arguments = sys.argv[1:]
    folder, name = os.path.split(path)
    # A shell that found the tool by its bare name hands on the whole path; messages show what was typed.
    shown = name if folder in os.get_exec_path() else path
    # A short-lived process: looking for reference cycles and taking down the interpreter would only cost time.
    gc.disable()
    status = run(tool, arguments, shown=shown)
    sys.stderr.flush()
    os._exit(status)
