"""What an experiment keeps under its output: results by the content of what made them, each file whole or not at all.

A key is the SHA-256 of all inputs and options of a step, of the cache's format and of placerec's version: whatever
changes, only what depends on it is done again. The folder may be removed at any time.
"""

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from placerec.errors import ExperimentError, PlacerecError
from placerec.files import read_text, write_text
from placerec.version import __version__

FORMAT = "placerec experiment 2"


def key_of(*parts: Any) -> str:
    """The key of a step with these inputs (plain values): 64 hexadecimal digits."""
    text = json.dumps([FORMAT, __version__, *parts], ensure_ascii=True, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def content_of(path: Path) -> str:
    """The SHA-256 of a file's bytes; ExperimentError if it cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise ExperimentError(f"{path}: cannot be read: {error.strerror}") from error


def load(path: Path) -> dict[str, Any]:
    """What `save` wrote there, empty if there is nothing that can be used."""
    try:
        content = json.loads(read_text(path, PlacerecError))
    except (PlacerecError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def save(path: Path, content: dict[str, Any]) -> None:
    """Keep plain values; numbers come back to the last digit."""
    write_text(path, json.dumps(content, ensure_ascii=True, separators=(",", ":")) + "\n")


def sweep(folders: Iterable[Path]) -> None:
    """Remove what a killed run did not finish; no other run may be at work there."""
    for folder in folders:
        for path in folder.glob(".*.partial-*"):
            if path.is_file():
                path.unlink(missing_ok=True)
