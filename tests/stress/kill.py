"""Commands that are killed at random moments and run again: the same bytes as undisturbed, and nothing else is left.

    python tests/stress/kill.py [--kills 20] [--seed 0] [--jobs 2] [--small] [COMMAND...]

Each time the process and its workers are killed together (SIGKILL to the group); then the command is run to its end.
Processes are forked from this one, which has imported everything: no moment is spent on the start of Python.
"""

import argparse
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from helpers.small_world import run_through, write_images

from placerec.cli import commands
from placerec.words import write_stream, write_vocabulary

Contents = dict[str, bytes]
COLUMNS = ("command", "seconds", "kills", "at work", "with a journal", "done", "same bytes", "left over")
ROW = "{:<12}" + "{:>15}" * (len(COLUMNS) - 1)


class DisturbedError(Exception):
    """Something came out otherwise than undisturbed."""


@dataclass
class FrameCounts:
    """What the kills met: something written and not all of it, results in a journal, an end that came before them."""

    seconds: float = 0.0
    kills: int = 0
    at_work: int = 0
    journals: int = 0
    ended: int = 0
    same: int = 0
    litter: list[str] = field(default_factory=list)

    def row(self, name: str) -> str:
        """A line of the table."""
        found = (self.kills, self.at_work, self.journals, self.ended, self.same, len(self.litter))
        return ROW.format(name, f"{self.seconds:.2f}", *found)


def main() -> None:
    """Print the table; DisturbedError if a line of it is not as it should be."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commands", nargs="*", choices=[[], *COMMANDS], metavar="COMMAND", default=[])
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", default="2")
    parser.add_argument("--small", action="store_true", help="fewer frames and cells")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        world = Path(folder).resolve()
        os.environ["TMPDIR"] = str(world / "tmp")
        chosen = given.commands or list(COMMANDS)
        make_world(world, chosen, small=given.small)
        say(ROW.format(*COLUMNS))
        for name in chosen:
            tally = disturb(name, given.jobs, world, given.kills, random.Random(f"{given.seed} {name}"))
            say(tally.row(name))
            if tally.same != tally.kills or tally.litter:
                raise DisturbedError(f"{name}: {tally}")


def say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def make_world(world: Path, chosen: Sequence[str], *, small: bool) -> None:
    """What the commands read: images, a dictionary of them, token streams, a model, an experiment's grid."""
    (world / "tmp").mkdir()
    for seed in range(1 if small else 3):
        write_images(world / "runs" / f"run{seed}", seed, frames=320 if small else 128)
    for seed in range(3):
        write_images(world / "few" / f"run{seed}", seed, frames=6 if small else 24)
    for number in range(20 if small else 60):
        write_stream(run_through(f"run{number:02d}", number, 600), world / "tokens" / f"run{number:02d}.tsv")
    write_stream(run_through("today", 99, 3000), world / "today.tsv")
    write_vocabulary([f"w{i:02d}" for i in range(12)], world / "tokens" / "vocab.txt")
    grid = '[data]\nsequences = ["few/*"]\ntest = ["run2"]\n[grid]\norder = [1, 2]\nsmoothing = ["witten-bell"]\n'
    sizes = "size = [2]\nseeds = 1\n" if small else "size = [2, 3]\nseeds = 2\n"
    (world / "grid.toml").write_text(grid + 'select = ["none", "unique"]\n' + sizes)
    if "tokenize" in chosen:
        started(typed("train-words", "runs", "--size", "4", "--image-size", "32", "-o", "words.npz"), world)()
    if "update" in chosen:
        started(typed(*TRAIN, "-o", "model"), world)()
    modules = ("placerec.words.tokenize", "placerec.experiments", "matplotlib.pyplot")
    for module in modules if "experiment" in chosen else modules[:1]:
        import_module(module)


def typed(*args: str) -> Callable[[], None]:
    return lambda: commands.main([*args, "-q"], prog_name="placerec", standalone_mode=True)


TRAIN = ("train-lm", "tokens", "--order", "5")
# What is typed; `out` is the output.
COMMANDS: dict[str, tuple[str, ...]] = {
    "tokenize": ("tokenize", "runs", "-w", "words.npz", "-o", "place/out", "--no-cache"),
    "train-words": ("train-words", "runs", "-o", "place/out.npz", "--image-size", "32", "--size", "4", "--no-cache"),
    "train-lm": (*TRAIN, "-o", "place/out"),
    "update": ("update", "place/model", "today.tsv"),
    "experiment": ("experiment", "grid.toml", "-o", "place/out"),
}

PARALLEL = ("tokenize", "train-words", "experiment")


def disturb(name: str, jobs: str, world: Path, kills: int, generator: random.Random) -> FrameCounts:
    """Run a command undisturbed, and then `kills` times killed and run again."""
    args = (*COMMANDS[name], *(("--jobs", jobs) if name in PARALLEL else ()))
    work, place, tally = typed(*args), world / "place", FrameCounts()
    begin(world, name)
    began = time.monotonic()
    started(work, world)()
    tally.seconds = time.monotonic() - began
    whole = contents(place)
    for _ in range(kills):
        begin(world, name)
        before = contents(place)
        wait = started(work, world)
        moment = generator.uniform(0, tally.seconds)
        time.sleep(moment)
        if not wait(kill=True):
            tally.ended += 1
            # The first run was slower than it need have been.
            tally.seconds = moment
        tally.kills += 1
        found = contents(place)
        tally.at_work += found not in (before, whole)
        tally.journals += any(name.endswith("-journal") and text for name, text in found.items())
        started(work, world)()
        found = contents(place)
        tally.same += {name: found.get(name) for name in whole} == whole
        tally.litter += [*(found.keys() - whole.keys()), *map(str, (world / "tmp").iterdir())]
    return tally


def begin(world: Path, name: str) -> None:
    """An output folder as it is before the command."""
    shutil.rmtree(world / "place", ignore_errors=True)
    (world / "place").mkdir()
    if name == "update":
        shutil.copytree(world / "model", world / "place" / "model")


def contents(folder: Path) -> Contents:
    """Every file and folder in it, hidden ones too."""
    return {str(path.relative_to(folder)): path.read_bytes() if path.is_file() else b"" for path in folder.rglob("*")}


def started(work: Callable[[], None], folder: Path) -> Callable[..., bool]:
    """Begin `work` in a group of processes of its own: a function that waits for its end, or ends it by SIGKILL.

    It gives whether it was killed. DisturbedError if the work failed, or left a process behind.
    """
    child = os.fork()
    if child == 0:
        os.setsid()
        os.chdir(folder)
        try:
            work()
        except SystemExit as end:
            os._exit(int(end.code or 0))
        except BaseException:
            sys.excepthook(*sys.exc_info())
        os._exit(1)

    def wait(kill: bool = False) -> bool:
        if kill:
            # Until it has called setsid there is no such group.
            for end in (os.killpg, os.kill):
                with suppress(ProcessLookupError):
                    end(child, signal.SIGKILL)
        status = os.waitpid(child, 0)[1]
        if not os.WIFSIGNALED(status) and os.WEXITSTATUS(status):
            raise DisturbedError(f"exit code {os.WEXITSTATUS(status)}")
        until = time.monotonic() + 20
        while left := of_session(child):
            if time.monotonic() > until:
                raise DisturbedError(f"processes that go on: {left}")
            time.sleep(0.02)
        return os.WIFSIGNALED(status)

    return wait


def of_session(session: int) -> list[int]:
    """The processes of a session, without those that nobody has waited for yet."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                state, _, _, its = (entry / "stat").read_text().rpartition(") ")[2].split()[:4]
            except (OSError, ValueError):
                continue
            if int(its) == session and state != "Z":
                found.append(int(entry.name))
    return found


if __name__ == "__main__":
    main()
