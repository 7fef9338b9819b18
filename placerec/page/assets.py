"""The files of the pages: JavaScript modules and style sheets of the package, served as they are or put into one text.

A module says `import { a, b } from "./other.js";` on a line of its own and begins what it gives to others with
`export`; no two modules call a thing at their top level alike, so that one text can hold them all.
"""

import re
from functools import cache
from importlib.resources import files

from placerec.errors import OutputError

_IMPORT = re.compile(r'^import \{[^}]*\} from "\./(\w+\.js)";\n', re.MULTILINE)
TYPES = {"js": "text/javascript", "css": "text/css", "html": "text/html"}


@cache
def names() -> frozenset[str]:
    """The names of all files of the pages."""
    return frozenset(entry.name for entry in files("placerec.page").joinpath("static").iterdir() if entry.is_file())


@cache
def text(name: str) -> str:
    """The text of one of them; raises OutputError where the installation has lost it."""
    try:
        return files("placerec.page").joinpath("static", name).read_text(encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{name}: a file of the package is missing; install placerec again") from error


def in_one(module: str) -> str:
    """A module and all that it imports as one script, for a page that is one file: no imports, no exports."""
    order: list[str] = []

    def visit(name: str) -> None:
        for other in _IMPORT.findall(text(name)):
            visit(other)
        if name not in order:
            order.append(name)

    visit(module)
    return "\n".join(re.sub(r"^export ", "", _IMPORT.sub("", text(name)), flags=re.MULTILINE) for name in order)
