"""placerec in a Python that lacks some of its optional packages."""

import subprocess
import sys

_PROGRAM = """
import sys


class Finder:
    def __init__(self, finder):
        self.finder = finder

    def find_spec(self, name, path=None, target=None):
        return None if name.partition(".")[0] in {absent!r} else self.finder.find_spec(name, path, target)


sys.meta_path[:] = map(Finder, sys.meta_path)
from placerec.cli import main

sys.argv[0] = "placerec"
main()
"""


def run_without(absent: tuple[str, ...], *args: object) -> subprocess.CompletedProcess[str]:
    """`placerec ARGS` where the packages `absent` cannot be found, in a process of its own."""
    program = [sys.executable, "-c", _PROGRAM.format(absent=absent), *map(str, args)]
    return subprocess.run(program, capture_output=True, text=True)
