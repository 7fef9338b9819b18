"""What a cluster costs and gains: bytes moved, processor time at the client, one worker against two; and 10^9 frames.

    PYTHONPATH=tests python tests/benchmarks/cluster.py SOURCE... [--rounds 3] [--rows 131072] [--price 0.04]

Scheduler, workers and client are processes of this machine, on 127.0.0.1; each worker has one thread. What goes
between the client and the scheduler is counted by a relay between them. `describe` and `tokenize` do the frames of the
sources; for the others these are too few: `PCA` and `epoch` of the map do synthetic descriptors (each of 300 spots,
plus noise; for the map four times over), `train-lm` counts words that were drawn at random, eight times as many. Runs
without a cluster, with one and with two workers take turns, and the median of the rounds counts. A unit is a frame (of
`epoch`: in one epoch). The tables are Markdown.
"""

import argparse
import asyncio
import importlib
import logging
import pickle
import statistics
import subprocess
import sys
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from helpers.local_dask import LocalDask, local_dask

from placerec.cluster import cluster
from placerec.frames import find_sequences
from placerec.jobs import RemoteExecutor
from placerec.model import train_lm
from placerec.vision import DescriptorSpec, Dictionary, DictionaryOptions, describe_sources
from placerec.vision.chunks import spooled
from placerec.vision.pca import fit_pca, moments, project
from placerec.vision.som import train_som
from placerec.words import WordStream, write_stream, write_vocabulary
from placerec.words.tokenize import tokenize

SIDE, EPOCHS = 20, 10
Job = Callable[[RemoteExecutor | None], object]


@dataclass
class Run:
    """What one run took: wall time and the client's processor time in seconds, bytes to and from the scheduler."""

    seconds: float
    client: float
    sent: int
    received: int


async def relay(port: int) -> None:
    """Pass on what goes to `port` and back; print a port for that, and for every line of input the bytes so far."""
    passed = [0, 0]

    async def pump(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, way: int) -> None:
        while data := await reader.read(1 << 18):
            passed[way] += len(data)
            writer.write(data)
            await writer.drain()
        writer.close()

    async def connected(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        back, forth = await asyncio.open_connection("127.0.0.1", port)
        await asyncio.gather(pump(reader, forth, 0), pump(back, writer, 1), return_exceptions=True)

    server = await asyncio.start_server(connected, "127.0.0.1", 0)
    print(server.sockets[0].getsockname()[1], flush=True)
    while await asyncio.to_thread(sys.stdin.readline):
        print(*passed, flush=True)


class Meter:
    """A relay in a process of its own."""

    def __init__(self, port: str) -> None:
        command = [sys.executable, __file__, "--relay", port]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.address = f"tcp://127.0.0.1:{self._line()}"

    def _line(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline().strip()

    def passed(self) -> tuple[int, int]:
        """Bytes to the scheduler and from it."""
        assert self._process.stdin is not None
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        sent, received = map(int, self._line().split())
        return sent, received

    def close(self) -> None:
        self._process.communicate()


def measured(job: Job, work: RemoteExecutor, meter: Meter) -> Run:
    """A run of the job, without the way to the cluster and back."""
    before, start, processor = meter.passed(), time.perf_counter(), time.process_time()
    job(work)
    seconds, client = time.perf_counter() - start, time.process_time() - processor
    sent, received = (now - then for now, then in zip(meter.passed(), before, strict=True))
    return Run(seconds, client, sent, received)


@dataclass
class Row:
    """Medians per unit: milliseconds here, with one worker and with two, bytes each way, milliseconds of the client."""

    here: float
    one: float
    two: float
    sent: float
    received: float
    client: float


def row(units: int, runs: dict[int, list[Run]]) -> Row:
    """The medians of the runs."""
    here, one, two = (1e3 * statistics.median(run.seconds for run in runs[workers]) / units for workers in (0, 1, 2))
    sent, received, client = (
        statistics.median(getattr(run, name) for run in runs[2]) / units for name in ("sent", "received", "client")
    )
    return Row(here, one, two, sent, received, 1e3 * client)


def arithmetic(rows: dict[str, Row], price: float, streams: float, listed: float) -> None:
    """What 10^9 frames take, if nothing but their number changes."""
    print(f"\n| for 10^9 frames | core-hours | on 100 cores | at {price} a core-hour | moved | cores a client feeds |")
    print("| --- | --- | --- | --- | --- | --- |")
    for title, name, times in (
        ("describe", "describe", 1),
        ("PCA", "PCA", 1),
        ("map, 50 epochs", "epoch", 50),
        ("tokenize", "tokenize", 1),
        ("train-lm", "train-lm", 1),
    ):
        got = rows[name]
        hours, client = (1e9 * times * each / 3.6e6 for each in (got.one, got.client))
        moved = times * (got.sent + got.received)
        cells = f"{hours:.0f} | {max(hours / 100, client):.2g} h | {price * hours:.0f} | {moved / 1e3:.2f} TB"
        print(f"| {title} | {cells} | {got.one / got.client:.0f} |")
    print(
        f"\ntoken streams: {streams:.0f} bytes a frame; the list of frames in the client's memory: {listed:.0f} a frame"
    )


def jobs(sources: list[Path], rows: int, folder: Path) -> list[tuple[str, int, Job]]:
    """Name, number of units, and what to do."""
    frames = sum(len(sequence.frames) for sequence in find_sequences(sources))
    rng = np.random.default_rng(0)
    spec = DescriptorSpec()
    spots = rng.normal(size=(300, spec.length))
    values = (spots[np.sort(rng.integers(300, size=rows))] + 0.3 * rng.normal(size=(rows, spec.length))).astype("f4")
    codes = np.tile(project(values, fit_pca(moments(values[:4096]))), (4, 1))
    Dictionary.fit(values[:4096], spec=spec, options=DictionaryOptions(size=SIDE, epochs=2)).save(folder / "words.npz")
    words = Dictionary.load(folder / "words.npz")
    print(f"tokenize sends once, and counts among what it sends: {len(pickle.dumps(words))} bytes")
    (folder / "tokens").mkdir()
    for place in ("hall", "kitchen"):
        named = [words.vocabulary[unit] for unit in rng.integers(SIDE**2, size=4 * rows).tolist()]
        write_stream(WordStream.of(place, named, [place] * len(named)), folder / f"tokens/{place}.tsv")
    write_vocabulary(words.vocabulary, folder / "tokens/vocab.txt")

    def epochs(work: RemoteExecutor | None) -> None:
        with spooled(codes, work) as kept:
            train_som(kept, SIDE, rng=np.random.default_rng(0), epochs=EPOCHS)

    return [
        ("describe", frames, lambda work: describe_sources(sources, folder / "d.npz", work=work)),
        ("tokenize", frames, lambda work: tokenize(sources, folder / "words.npz", folder / "t", work=work)),
        ("train-lm", 8 * rows, lambda work: train_lm([folder / "tokens"], folder / "m", work=work)),
        ("PCA", rows, lambda work: moments(values, work)),
        ("epoch", 4 * rows * EPOCHS, epochs),
    ]


def timed(job: Job, workers: int, machines: LocalDask, meter: Meter) -> Run:
    """A run with so many workers; none: without a cluster."""
    if not workers:
        start = time.perf_counter()
        job(None)
        return Run(time.perf_counter() - start, 0, 0, 0)
    machines.have(workers)
    with cluster(meter.address) as work:
        list(work(abs, range(20 * workers)))  # imports are not what is measured
        return measured(job, work, meter)


def main(sources: list[Path], rounds: int, rows: int, price: float) -> None:
    """Print the tables."""
    logging.getLogger("placerec").setLevel(logging.ERROR)
    tracemalloc.start()
    listing = [frame.path.stat().st_size for sequence in find_sequences(sources) for frame in sequence.frames]
    kept = find_sequences(sources)
    listed = sum(trace.size for trace in tracemalloc.take_snapshot().traces) / max(1, len(listing))
    tracemalloc.stop()
    print(f"{len(listing)} images in {len(kept)} sequences, {statistics.mean(listing):.0f} bytes each")
    with tempfile.TemporaryDirectory() as name, local_dask(Path(name)) as machines:
        meter = Meter(machines.address.rpartition(":")[2])
        todo = jobs(sources, rows, Path(name))
        print(f"map of {SIDE} x {SIDE}; {rounds} rounds\n")
        print("| work | units | ms a unit, no cluster | 1 worker | 2 workers | gain | sent | received | client, ms |")
        print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
        found = {}
        for title, units, job in todo:
            runs: dict[int, list[Run]] = {0: [], 1: [], 2: []}
            for workers in (0, 1, 2) * rounds:
                runs[workers].append(timed(job, workers, machines, meter))
            got = found[title] = row(units, runs)
            cells = f"{units} | {got.here:.3g} | {got.one:.3g} | {got.two:.3g} | {got.one / got.two:.2f}"
            print(f"| {title} | {cells} | {got.sent:.0f} | {got.received:.0f} | {got.client:.3g} |", flush=True)
        meter.close()
        streams = sum(path.stat().st_size for path in Path(name, "t").glob("*.tsv")) / len(listing)
        arithmetic(found, price, streams, listed)
        idle(machines)


def idle(machines: LocalDask) -> None:
    """What the scheduler, a worker and this process hold in memory, if psutil tells."""
    psutil = importlib.import_module("psutil")
    for title, process in (("scheduler", machines.scheduler), ("worker", machines.workers[0])):
        print(f"{title}: {psutil.Process(process.pid).memory_info().rss / 1e6:.0f} MB")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sources", nargs="*", type=Path)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--rows", type=int, default=1 << 17)
    parser.add_argument("--price", type=float, default=0.04, help="of an hour of a core")
    parser.add_argument("--relay", type=int)
    asked = parser.parse_args()
    if asked.relay:
        asyncio.run(relay(asked.relay))
    else:
        main(asked.sources, asked.rounds, asked.rows, asked.price)
