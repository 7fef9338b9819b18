"""What checks of readers share: runs of tools in this process, and how they say that results contradict themselves."""

from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from random import Random

from placerec.srilm.text.streams import Streams

MODEL = (
    b"\\data\\\nngram 1=5\nngram 2=3\n\n\\1-grams:\n-1\t</s>\n-99\t<s>\t-0.25\n-0.5\ta\t-0.5\n-1\tb\t-0.125\n-1\tc\n\n"
    b"\\2-grams:\n-0.5\t<s> a\n-0.25\ta b\n-1\tb </s>\n\n\\end\\\n"
)


class FindingError(AssertionError):
    """A result that contradicts itself."""


@dataclass(frozen=True)
class Reader:
    """Makes valid inputs, and checks what becomes of any: `check(path, variant)`."""

    valid: Callable[[Random], bytes]
    check: Callable[[Path, Random], None]


def run(tool: Callable[..., int], *arguments: str | Path, stdin: bytes = b"") -> tuple[int, bytes, bytes]:
    """One run of a tool in this process: status, standard output and error."""
    out, err = BytesIO(), BytesIO()
    named = [str(argument) for argument in arguments]
    status = tool(named, Streams(BytesIO(stdin), out, err))
    return status, out.getvalue(), err.getvalue()


def same(what: str, one: object, other: object) -> None:
    """Raise FindingError if two results differ."""
    if one != other:
        raise FindingError(f"{what}: {one!r:.300} and {other!r:.300}")


def fixed_model(path: Path) -> str:
    """A small valid model beside a file."""
    lm = path.with_name("model.arpa")
    lm.write_bytes(MODEL)
    return str(lm)
