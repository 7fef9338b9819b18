"""A Dask cluster on this machine: a scheduler and workers, each a process that can be killed."""

import importlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import placerec
from helpers.waiting import wait_until

ENVIRONMENT = {
    **os.environ,
    # As `dask worker` has it, which begins without its own supervisor here.
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"),
    "PYTHONPATH": os.pathsep.join([str(Path(placerec.__file__).parent.parent), str(Path(__file__).parents[1])]),
}


class LocalDask:
    """A scheduler and its workers, on this machine."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.workers: list[subprocess.Popen[bytes]] = []
        file = folder / "scheduler.json"
        self.scheduler = self._start("scheduler", "--port", "0", "--scheduler-file", str(file))
        self.address: str = wait_until(lambda: _address(file), "the scheduler never began")

    def _start(self, kind: str, *options: str) -> "subprocess.Popen[bytes]":
        common = ["--host", "127.0.0.1", "--no-dashboard"]
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{kind}", *options, *common],
            env=ENVIRONMENT,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def have(self, count: int) -> str:
        """The address, once there are `count` workers."""
        self.workers = [worker for worker in self.workers if worker.poll() is None]
        self.kill(len(self.workers) - count)
        options = ["--no-nanny", "--nthreads", "1", "--local-directory", str(self._folder)]
        while len(self.workers) < count:
            self.workers.append(self._start("worker", self.address, *options))
        with importlib.import_module("distributed").Client(self.address, set_as_default=False) as client:
            wait_until(lambda: len(client.nthreads()) == count, "the workers never began")
        return self.address

    def kill(self, count: int = 1) -> None:
        """End so many workers, which get no time to say so."""
        for _ in range(count):
            worker = self.workers.pop(0)
            worker.kill()
            worker.wait()

    def close(self) -> None:
        for process in [*self.workers, self.scheduler]:
            process.kill()
            process.wait()


@contextmanager
def local_dask(folder: Path) -> Iterator[LocalDask]:
    machines = LocalDask(folder)
    try:
        yield machines
    finally:
        machines.close()


def _address(file: Path) -> str | None:
    try:
        return str(json.loads(file.read_text())["address"])
    except (OSError, ValueError):
        return None  # not written, or not all of it
