"""The whole run: the same bytes for any number of processes and after a kill, and nothing done twice."""

import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from helpers.small_experiment import CONFIG, write_grid
from helpers.small_world import write_images, write_tokens

from placerec.errors import ExperimentError, OutputError, StreamError
from placerec.experiments import store
from placerec.experiments.grid import cells
from placerec.experiments.grid.config import read_config
from placerec.experiments.grid.run import experiment, run_grid
from placerec.files import held_folder
from placerec.vision import Dictionary

IMAGES = """
[data]
sequences = ["runs/*"]
split = "leave-one-out"
[grid]
order = [1, 2]
smoothing = ["witten-bell"]
select = ["none", "unique"]
size = [2, 3]
seeds = 1
"""


@pytest.fixture
def work(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How much is done of what can be kept: sequences described, dictionaries learned, cells."""
    done: Counter[str] = Counter()

    def counted(module: Any, name: str, amount: Callable[..., int]) -> None:
        real = getattr(module, name)

        def work(*args: Any, **options: Any) -> Any:
            done[name] += amount(*args)
            return real(*args, **options)

        monkeypatch.setattr(module, name, work)

    counted(store, "_describe", lambda some, *args: len(some))
    counted(Dictionary, "fit", lambda *args: 1)
    counted(cells, "_computed", lambda job, missing: len(missing))
    return done


def outputs(out: Path) -> list[bytes]:
    return [(out / name).read_bytes() for name in ("results.csv", "sequences.csv")]


def test_the_columns_of_results_are_those_of_their_file(tmp_path: Path) -> None:
    for seed, name in enumerate("ab"):
        write_images(tmp_path / "runs" / name, seed)
    out = tmp_path / "out"
    _, results = run_grid(read_config(write_grid(tmp_path, IMAGES)), out)
    columns = results.to_dict()
    header, *rows = [line.split(",") for line in (out / "results.csv").read_text().splitlines()]
    assert list(columns) == header
    assert [len(column) for column in columns.values()] == [len(rows)] * len(header)
    assert [str(value) for value in columns["select"]] == [row[header.index("select")] for row in rows]
    assert columns["accuracy"] == pytest.approx([float(row[header.index("accuracy")]) for row in rows], abs=1e-6)


def test_a_second_run_does_only_what_changed(tmp_path: Path, work: Counter[str]) -> None:
    for seed, name in enumerate("ab"):
        write_images(tmp_path / "runs" / name, seed)
    path, out = write_grid(tmp_path, IMAGES), tmp_path / "out"

    def done(text: str = "", new: str = "") -> dict[str, int]:
        work.clear()
        path.write_text(path.read_text().replace(text, new))
        run_grid(read_config(path), out)
        return dict(work)

    assert done() == {"_describe": 2, "fit": 4, "_computed": 4 * 4}
    first = outputs(out)
    assert done() == {}
    assert done("order = [1, 2]", "order = [1, 2, 3]") == {"_computed": 4 * 2}
    assert done('["none", "unique"]', '["none", "compress:2"]') == {"_computed": 4 * 3}
    assert done("size = [2, 3]", "size = [2, 3, 4]") == {"fit": 2, "_computed": 2 * 6}
    assert done("[grid]", '[grid]\ntransition = ["learned"]') == {"_computed": 6 * 6}
    path.write_text(IMAGES)
    assert done() == {}
    assert outputs(out) == first
    # What was removed by hand is made again, and nothing else.
    for folder, pattern in (("words", "*.npz"), ("tokens", "*/a.tsv"), ("descriptors", "*.npz")):
        next((out / "cache" / folder).glob(pattern)).unlink()
    assert done()["_describe"] == 1
    assert outputs(out) == first
    # One image more: its sequence is described, and everything that it trains or tests, done anew.
    write_images(tmp_path / "more", 9, frames=1)
    (image,) = (tmp_path / "more" / "std_cam").iterdir()
    image.rename(tmp_path / "runs" / "a" / "std_cam" / "t2000.000000_x0_y0_a0.png")
    assert done() == {"_describe": 1, "fit": 2, "_computed": 4 * 4}
    # Another label makes other token streams, and no other words.
    labels = tmp_path / "runs" / "b" / "localization" / "places.lst"
    labels.write_text(labels.read_text().replace("hall", "kitchen", 1))
    assert done() == {"_computed": 4 * 4}


def test_what_cannot_be_read_again_is_done_again(tmp_path: Path, work: Counter[str]) -> None:
    plan, out = read_config(write_grid(tmp_path)), tmp_path / "out"
    run_grid(plan, out)
    first = outputs(out)
    kept = sorted((out / "cache" / "cells").iterdir())
    assert len(kept) == 3
    for path, text in zip(kept, ("", "[1]", "{"), strict=True):
        path.write_text(text)
    work.clear()
    run_grid(plan, out)
    assert work["_computed"] == 3 * 8
    assert outputs(out) == first


@pytest.mark.skipif(sys.platform == "win32", reason="other signals there")
def test_a_killed_run_goes_on_and_two_processes_give_the_same_bytes(tmp_path: Path) -> None:
    path = write_grid(tmp_path)
    run_grid(read_config(path), tmp_path / "whole")
    # It says when it is half-way, between a partial file and the whole one.
    code = (
        "import time\nfrom pathlib import Path\nimport placerec.files as files\n"
        "from placerec.experiments.grid.run import experiment\n"
        "real, written = Path.replace, []\n"
        "def slow(self, target):\n"
        "    written.append(target)\n"
        "    if len(written) == 2:\n        print('ready', flush=True)\n        time.sleep(60)\n"
        "    return real(self, target)\n"
        f"Path.replace = slow\nexperiment({str(path)!r}, {str(tmp_path / 'out')!r})\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(signal.SIGKILL)
    cells_kept = list((tmp_path / "out" / "cache" / "cells").iterdir())
    assert sorted(path.name.startswith(".") for path in cells_kept) == [False, True]
    assert not (tmp_path / "out" / "results.csv").exists()
    # The folder's lock ended with the process, and what is half-done there is cleared away.
    experiment(path, tmp_path / "out", jobs=2)
    assert outputs(tmp_path / "out") == outputs(tmp_path / "whole")
    assert not [path for path in (tmp_path / "out" / "cache" / "cells").iterdir() if path.name.startswith(".")]


def test_two_runs_do_not_write_to_one_folder(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with held_folder(tmp_path / "out"), pytest.raises(OutputError, match="is being changed by another run"):
        experiment(write_grid(tmp_path), tmp_path / "out")


@pytest.mark.parametrize(
    ("old", "new", "error", "told"),
    [
        ('"tokens"', '"nowhere"', StreamError, "nowhere: no such file or folder"),
        ('["run3"]', '["run4"]', ExperimentError, "'run4' is the name of no sequence; they are run1, run2, run3"),
        ('test = ["run3"]', 'split = "cold-saarbruecken-b"', ExperimentError, "'run1' is none; leave that sequence"),
    ],
)
def test_data_that_do_not_fit_are_told(tmp_path: Path, old: str, new: str, error: type[Exception], told: str) -> None:
    path = write_grid(tmp_path, CONFIG.replace(old, new, 1))
    with pytest.raises(error, match=told):
        run_grid(read_config(path), tmp_path / "out")


def test_token_streams_need_their_vocabulary(tmp_path: Path) -> None:
    write_tokens(tmp_path / "tokens")
    (tmp_path / "tokens" / "vocab.txt").unlink()
    with pytest.raises(ExperimentError, match=r"vocab.txt: no such file; put the vocabulary"):
        run_grid(read_config(write_grid(tmp_path)), tmp_path / "out")
