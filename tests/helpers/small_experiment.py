"""A small experiment on token streams, for tests."""

from pathlib import Path

from helpers.small_world import write_tokens

CONFIG = """
[data]
tokens = "tokens"
test = ["run3"]
[grid]
order = [1, 3]
smoothing = ["witten-bell", "lidstone-backoff"]
select = ["none", "compress:3", "unique"]
size = [4]
transition = ["fixed", "learned"]
seeds = 1
"""


def write_grid(folder: Path, config: str = CONFIG, name: str = "grid.toml") -> Path:
    """The config, beside the token streams that it names."""
    if not (folder / "tokens").exists():
        write_tokens(folder / "tokens")
    (folder / name).write_text(config, encoding="utf-8")
    return folder / name
