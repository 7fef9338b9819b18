"""Work on a Dask cluster: a scheduler and workers in processes of their own, some of which are killed on the way."""

import logging
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest
from helpers.local_dask import ENVIRONMENT, LocalDask, local_dask
from helpers.small_world import write_images, write_tokens
from helpers.typed_commands import done, placerec
from helpers.waiting import wait_until

from placerec import cluster as room
from placerec.cluster import check_address, cluster
from placerec.errors import MissingExtraError, StreamError
from placerec.jobs import JobError, Numbered, RemoteExecutor, ScatteredMap, scatter
from placerec.model import ModelOptions, train_lm
from placerec.vision import (
    DescriptorSpec,
    Dictionary,
    DictionaryOptions,
    DictionarySetOptions,
    describe_sources,
    train_dictionary,
)
from placerec.words.tokenize import tokenize

pytest.importorskip("distributed", reason="needs the extra: pip install '.[cluster]'")

SPEC = DescriptorSpec(image_size=16)
T = TypeVar("T")
R = TypeVar("R")
log = logging.getLogger("placerec.test")


@pytest.fixture(scope="module")
def machines(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LocalDask]:
    with local_dask(tmp_path_factory.mktemp("machines")) as made:
        yield made


class Dying:
    """A cluster that loses a worker when `after` results have come, counted over all maps."""

    def __init__(self, work: RemoteExecutor, machines: LocalDask, after: int) -> None:
        self._work, self._machines, self._left = work, machines, after

    def __call__(self, function: Callable[[T], R], items: Iterable[T], /) -> Iterator[R]:
        return self._counted(self._work(function, items))

    def keep(self, items: Numbered[T], /) -> ScatteredMap[T]:
        each = self._work.keep(items)
        return lambda function: self._counted(each(function))

    def _counted(self, results: Iterator[R]) -> Iterator[R]:
        for result in results:
            self._left -= 1
            if self._left == 0:
                self._machines.kill()
            yield result

    @property
    def died(self) -> bool:
        return self._left <= 0


@contextmanager
def dying(machines: LocalDask, after: int) -> Iterator[Dying]:
    """A cluster of two workers, one of which is killed; that it was is asserted."""
    with cluster(machines.have(2)) as work:
        lossy = Dying(work, machines, after)
        yield lossy
    assert lossy.died


@pytest.fixture(autouse=True)
def small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nine batches of the images below, nine chunks of their descriptors; some words of a text."""
    monkeypatch.setattr("placerec.frames.images.BATCH", 8)
    monkeypatch.setattr("placerec.vision.chunks.CHUNK", 8)
    monkeypatch.setattr("placerec.lm.counts.BLOCK", 40)


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("images")
    for seed, name in enumerate(("seq1", "seq2", "seq3")):
        write_images(root / name, seed, frames=24)
    return root


def contents(path: Path) -> dict[str, bytes]:
    files = [path] if path.is_file() else [file for file in sorted(path.rglob("*")) if file.is_file()]
    assert files
    return {str(file.relative_to(path)): file.read_bytes() for file in files}


def double(number: int) -> int:
    if number == 7:
        log.warning("seven")
    return 2 * number


def started(item: tuple[str, int]) -> int:
    """Leaves a file that names the item and the process."""
    folder, number = item
    (Path(folder) / f"{number}-{os.getpid()}").touch()
    time.sleep(0.05)
    return number


def refuse(number: int) -> int:
    raise StreamError(f"{number} cannot be used; take another")


def be_late(number: int) -> int:
    raise TimeoutError("the file system is slow today")


def total(rows: Any) -> float:
    return float(rows.sum())


def test_results_and_notes_are_in_order_and_errors_come_through(
    machines: LocalDask, caplog: pytest.LogCaptureFixture
) -> None:
    with cluster(machines.have(2)) as work:
        with caplog.at_level(logging.INFO, "placerec"):
            assert list(work(double, range(40))) == list(range(0, 80, 2))
        assert caplog.messages == ["seven"]
        assert list(work(double, [])) == []
        large = np.zeros(2_000_000)  # Dask would warn
        assert list(work(partial(np.vdot, large), [large])) == [0.0]
        with pytest.raises(StreamError, match="3 cannot be used; take another"):
            list(work(refuse, [3, 4]))
        with pytest.raises(TimeoutError, match="the file system is slow today"):
            list(work(be_late, [3, 4]))
        assert next(work(double, iter(range(10**9)))) == 0


def test_a_lost_worker_costs_only_its_share(machines: LocalDask, tmp_path: Path) -> None:
    with dying(machines, after=10) as work:
        lost = machines.workers[0].pid
        assert list(work(started, [(str(tmp_path), number) for number in range(60)])) == list(range(60))
    runs: dict[int, set[int]] = {}
    for path in tmp_path.iterdir():
        number, process = map(int, path.name.split("-"))
        runs.setdefault(number, set()).add(process)
    assert any(lost in processes for processes in runs.values())
    again = [processes for processes in runs.values() if len(processes) > 1]
    assert all(lost in processes for processes in again)
    assert len(again) <= 2  # what it was at, and what lay ready there


def test_what_is_kept_is_sent_again_when_its_worker_is_lost(machines: LocalDask) -> None:
    items = [np.full((3, 2), number, np.float32) for number in range(20)]
    with dying(machines, after=30) as work:
        each = scatter(items, work)
        for _ in range(4):
            assert list(each(total)) == [6.0 * number for number in range(20)]


def test_describe(machines: LocalDask, images: Path, tmp_path: Path) -> None:
    describe_sources([images], tmp_path / "here.npz", spec=SPEC)
    with dying(machines, after=4) as work:
        describe_sources([images], tmp_path / "there.npz", spec=SPEC, work=work)
    assert contents(tmp_path / "here.npz") == contents(tmp_path / "there.npz")


def test_train_words(machines: LocalDask, images: Path, tmp_path: Path) -> None:
    train_dictionary([images], tmp_path / "here.npz", spec=SPEC, options=DictionaryOptions(size=5, epochs=4))
    for after in (14, 40):  # nine batches are described, nine chunks go to the PCA, then nine to every epoch
        with dying(machines, after) as work:
            train_dictionary(
                [images], tmp_path / "there.npz", spec=SPEC, options=DictionaryOptions(size=5, epochs=4), work=work
            )
        assert contents(tmp_path / "here.npz") == contents(tmp_path / "there.npz")


def test_train_words_of_several_views(machines: LocalDask, images: Path, tmp_path: Path) -> None:
    options = DictionarySetOptions(sizes=(3, 4), epochs=4)
    made = train_dictionary([images], tmp_path / "here.npz", spec=SPEC, options=options)
    assert made.names == ("", "plain4", "pn3", "pn4")
    with dying(machines, after=40) as work:
        train_dictionary([images], tmp_path / "there.npz", spec=SPEC, options=options, work=work)
    assert contents(tmp_path / "here.npz") == contents(tmp_path / "there.npz")


def test_tokenize(machines: LocalDask, images: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = np.random.default_rng(0).normal(size=(60, SPEC.length)).astype(np.float32)
    Dictionary.fit(rows, spec=SPEC, options=DictionaryOptions(size=4)).save(tmp_path / "words.npz")
    tokenize([images], tmp_path / "words.npz", tmp_path / "here")
    with dying(machines, after=4) as work:
        tokenize([images], tmp_path / "words.npz", tmp_path / "there", work=work)
    assert contents(tmp_path / "here") == contents(tmp_path / "there")
    options = ["-w", tmp_path / "words.npz", "-o", tmp_path / "command", "--cluster", machines.have(1)]
    monkeypatch.chdir(images)  # where the workers are not
    result = done("tokenize", "seq1", "seq2", "seq3", "--no-cache", *options)
    assert result.stderr.startswith("72 frames described\n")
    assert contents(tmp_path / "here") == contents(tmp_path / "command")


@pytest.mark.parametrize("options", [ModelOptions(3), ModelOptions(2, "lidstone", markers=True, min_count=(1, 2))])
def test_train_lm(machines: LocalDask, tmp_path: Path, options: ModelOptions) -> None:
    (tmp_path / "tokens").mkdir()
    tokens = write_tokens(tmp_path / "tokens", [f"run{number}" for number in range(12)])
    train_lm([tokens], tmp_path / "here", options=options)
    with dying(machines, after=5) as work:
        train_lm([tokens], tmp_path / "there", options=options, work=work)
    assert contents(tmp_path / "here") == contents(tmp_path / "there")


def test_processes_of_this_machine_leave_nothing_behind_when_interrupted(images: Path, tmp_path: Path) -> None:
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    # A shell that runs tests in the background lets them ignore interrupts.
    start = "import os, signal, sys; signal.signal(signal.SIGINT, signal.SIG_DFL); os.execv(sys.argv[1], sys.argv[1:])"
    command = [sys.executable, "-c", start, sys.executable, "-m", "placerec", "describe", str(images)]
    with subprocess.Popen(
        [*command, "-o", str(tmp_path / "d.npz"), "--cluster", "local:2", "--image-size", "512"],
        env={**ENVIRONMENT, "TMPDIR": str(scratch)},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        # Two workers, and what Python has beside them.
        wait_until(lambda: len(_group(process.pid)) == 4, "the workers never began")
        time.sleep(1)
        os.killpg(process.pid, signal.SIGINT)
        assert process.stderr is not None
        assert process.stderr.read() == "placerec: interrupted\n"
    assert process.returncode == 1
    wait_until(lambda: not _group(process.pid), "a process is left")
    assert not list(scratch.iterdir())
    assert not (tmp_path / "d.npz").exists()


def _group(leader: int) -> list[int]:
    """The processes of a process group."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, group = path.read_text().rpartition(")")[2].split()[:3]
        except OSError:
            continue
        if int(group) == leader and state != "Z":
            found.append(int(path.parent.name))
    return found


@pytest.mark.parametrize("address", ["", "local", "local:0", "127.0.0.1:8786", "tcp://host", "http://host:1"])
def test_what_is_no_address_is_an_error_of_usage(address: str, tmp_path: Path) -> None:
    with pytest.raises(JobError, match="is no cluster; give tcp://HOST:PORT of a scheduler, or local:N"):
        check_address(address)
    result = placerec("describe", "x", "-o", tmp_path / "d.npz", "--cluster", address)
    assert (result.exit_code, "is no cluster; give tcp://" in result.stderr) == (2, True)


def test_either_processes_here_or_a_cluster() -> None:
    result = placerec("describe", "x", "-o", "d.npz", "--jobs", 2, "--cluster", "local:2")
    assert (result.exit_code, "leave one of them out" in result.stderr) == (2, True)


def test_no_scheduler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "CONNECT", 0.5)
    with (
        pytest.raises(JobError, match=r"tcp://127\.0\.0\.1:9: no scheduler answers there"),
        cluster("tcp://127.0.0.1:9"),
    ):
        pass


def test_no_certificates() -> None:
    with pytest.raises(JobError, match="needs certificates; name them"), cluster("tls://127.0.0.1:9"):
        pass


def test_another_version(
    machines: LocalDask, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    address = machines.have(1)
    with monkeypatch.context() as patched, caplog.at_level(logging.WARNING, "placerec"):
        patched.setattr("platform.machine", lambda: "abacus")
        with cluster(address):
            assert len(caplog.messages) == 1
            assert "and here is abacus; the bytes may differ" in caplog.messages[0]
    monkeypatch.setattr(room, "__version__", "99.0")
    with pytest.raises(JobError, match=r"has placerec \d.*, and 99\.0 is wanted"), cluster(address):
        pass
    with pytest.raises(JobError, match=r"a worker has placerec 99\.0, and 1\.0 is wanted"):
        room._call(room._Function(room._Item(double), "1.0"), room._Item([1]), logging.INFO)


def test_without_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match="needs the package distributed"), cluster("local:1"):
        pass


def test_all_workers_and_the_scheduler_are_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "JOIN", 1.0)
    with local_dask(tmp_path) as machines:
        address = machines.have(1)
        with cluster(address) as work:
            items = [(str(tmp_path), number) for number in range(100)]
            results = work(started, items)
            next(results)
            machines.kill()
            with pytest.raises(JobError, match="no worker is left; start more with `dask worker tcp://"):
                list(results)
            with pytest.raises(JobError, match="the scheduler has no workers; start some"), cluster(address):
                pass
            results = work(started, items)
            machines.scheduler.kill()
            with pytest.raises(JobError, match="the scheduler is gone; start it again"):
                list(results)
