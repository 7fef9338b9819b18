"""What is written in a picture."""

import re
from pathlib import Path


def drawn_texts(path: Path) -> list[str]:
    """The texts of an SVG: matplotlib leaves each beside its outlines, as a comment."""
    return re.findall(r"<!-- (.*?) -->", path.read_text(encoding="utf-8"))
