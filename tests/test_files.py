"""Outputs are whole or not there, and nothing that placerec did not write is lost."""

import gzip
import os
import signal
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from placerec import files
from placerec.errors import OutputError, StreamError
from placerec.files import (
    all_lines,
    content_digest,
    content_digest_of_file,
    held_folder,
    number_in,
    read_lines,
    read_text,
    restore_folder,
    sweep_files,
    whole_file,
    whole_folder,
    write_text,
)

if sys.platform != "win32":
    import fcntl

OWNED = ("*.tsv", "sub")


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_appears_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "new" / "a.npz"
    with whole_file(path) as partial:
        partial.write_text("whole")
        assert not path.exists()
        assert partial.suffix == ".npz"
    assert path.read_text() == "whole"
    assert names(path.parent) == ["a.npz"]


def test_a_failure_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    for error in (ValueError, KeyboardInterrupt):
        with pytest.raises(error), whole_file(path) as partial:  # noqa: PT012
            partial.write_text("half")
            raise error
    assert path.read_text() == "old"
    assert names(tmp_path) == ["a.txt"]


def test_what_the_system_refuses_is_an_output_error(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    with pytest.raises(OutputError, match=r"a\.txt: cannot be written: No space left on device"), whole_file(path):
        raise OSError(28, "No space left on device")
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"b\.txt: cannot be written: "):
        write_text(tmp_path / "file" / "b.txt", "")


def test_a_folder_or_a_device_is_not_replaced_by_a_file(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="is a folder, and a file is to be written; name another"):
        write_text(tmp_path, "text")
    with pytest.raises(OutputError, match="/dev/null: is no regular file"):
        write_text(Path("/dev/null"), "text")
    assert Path("/dev/null").is_char_device()


def test_links_are_written_through(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "folder").symlink_to("real")
    (tmp_path / "link.txt").symlink_to("real.txt")
    write_text(tmp_path / "link.txt", "text")
    with whole_folder(tmp_path / "folder", OWNED) as partial:
        (partial / "a.tsv").write_text("a")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "folder").is_symlink()
    assert (tmp_path / "real.txt").read_text() == "text"
    assert names(tmp_path / "real") == ["a.tsv"]


def test_outputs_have_the_usual_permissions(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        write_text(tmp_path / "a.txt", "")
        with whole_folder(tmp_path / "folder", OWNED):
            pass
    finally:
        os.umask(before)
    assert (tmp_path / "a.txt").stat().st_mode & 0o777 == 0o640
    assert (tmp_path / "folder").stat().st_mode & 0o777 == 0o750


def test_a_folder_takes_the_place_of_the_old_one(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    (folder / "sub").mkdir(parents=True)
    (folder / "stale.tsv").write_text("old")
    with whole_folder(folder, OWNED) as partial:
        write_text(partial / "new.tsv", "new")
        assert names(folder) == ["stale.tsv", "sub"]
    assert names(folder) == ["new.tsv"]
    assert names(tmp_path) == ["out"]


def test_a_failure_leaves_the_old_folder(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "old.tsv").write_text("old")
    with pytest.raises(KeyboardInterrupt), whole_folder(folder, OWNED) as partial:  # noqa: PT012
        (partial / "new.tsv").write_text("half")
        raise KeyboardInterrupt
    assert names(folder) == ["old.tsv"]
    assert names(tmp_path) == ["out"]


def no_swap(first: Path, second: Path) -> bool:
    """A system that cannot exchange two folders in one step."""
    return False


@pytest.mark.skipif(sys.platform not in ("linux", "darwin"), reason="no such step there")
def test_folders_change_places_in_one_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / f"{name}.tsv").write_text(name)
    assert not files._swap(tmp_path / "a", tmp_path / "c")
    assert files._swap(tmp_path / "a", tmp_path / "b")
    assert (names(tmp_path / "a"), names(tmp_path / "b")) == (["b.tsv"], ["a.tsv"])
    # And this is how a folder is replaced: nothing is moved away first.
    monkeypatch.setattr(files, "_move_in", no_swap)
    with whole_folder(tmp_path / "a", OWNED) as partial:
        (partial / "new.tsv").write_text("new")
    assert names(tmp_path / "a") == ["new.tsv"]
    assert names(tmp_path) == ["a", "b"]


def test_a_folder_takes_the_place_of_the_old_one_in_two_steps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "_swap", no_swap)
    test_a_folder_takes_the_place_of_the_old_one(tmp_path)


def test_a_folder_that_was_moved_away_by_a_killed_run_comes_back(tmp_path: Path) -> None:
    """Unless another run has written one since."""
    folder = tmp_path / "out"
    for there, kept in ((False, "old.tsv"), (True, "new.tsv")):
        (tmp_path / ".out.replaced-x/old").mkdir(parents=True)
        (tmp_path / ".out.replaced-x/old/old.tsv").write_text("old")
        (tmp_path / ".out.partial-x").mkdir()
        if there:
            (folder / "old.tsv").rename(folder / "new.tsv")
        restore_folder(folder)
        assert names(tmp_path) == ["out"]
        assert names(folder) == [kept]
    restore_folder(tmp_path / "nowhere/out")
    assert names(tmp_path) == ["out"]


@pytest.mark.skipif(sys.platform == "win32", reason="no locks on folders there")
def test_a_folder_is_held_by_one_run_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    refusal = pytest.raises(OutputError, match="out: is being changed by another run; try again when that has ended")
    with held_folder(folder), refusal, held_folder(folder):
        pytest.fail("two runs hold the folder")
    with held_folder(folder), whole_folder(folder, OWNED) as partial:
        (partial / "new.tsv").write_text("new")
    with held_folder(folder):
        pass
    flock = fcntl.flock

    def replaced(handle: int, operation: int) -> None:
        flock(handle, operation)
        folder.rename(tmp_path / "former")
        folder.mkdir()

    # What was opened may be replaced before it is locked.
    monkeypatch.setattr("fcntl.flock", replaced)
    with refusal, held_folder(folder):
        pytest.fail("the folder that is held is not there any more")

    def no_locks(handle: int, operation: int) -> None:
        raise OSError(37, "No locks available")

    monkeypatch.setattr("fcntl.flock", no_locks)
    with held_folder(folder):
        pass


def test_the_old_folder_comes_back_if_the_exchange_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "old.tsv").write_text("old")
    replace = Path.replace

    def refuse(self: Path, target: Path) -> Path:
        if Path(target) == folder and self.name != "old":
            raise OSError(5, "Input/output error")
        return replace(self, target)

    monkeypatch.setattr(files, "_swap", no_swap)
    monkeypatch.setattr(Path, "replace", refuse)
    with pytest.raises(OutputError, match="Input/output error"), whole_folder(folder, OWNED) as partial:
        (partial / "new.tsv").write_text("new")
    assert names(folder) == ["old.tsv"]
    assert names(tmp_path) == ["out"]


def test_foreign_files_are_refused_before_and_after_the_work(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "thesis.doc").write_text("mine")
    refusal = pytest.raises(OutputError, match=r"holds thesis\.doc, which this command does not write; name another")
    with refusal, whole_folder(folder, OWNED):
        pytest.fail("the work was begun")
    (folder / "thesis.doc").unlink()
    with refusal, whole_folder(folder, OWNED):
        (folder / "thesis.doc").write_text("mine")
    assert (folder / "thesis.doc").read_text() == "mine"
    assert names(tmp_path) == ["out"]


def test_a_file_is_not_replaced_by_a_folder(tmp_path: Path) -> None:
    path = tmp_path / "out"
    path.write_text("mine")
    with pytest.raises(OutputError, match="is a file, and a folder is to be written"), whole_folder(path, OWNED):
        pytest.fail("the work was begun")
    assert path.read_text() == "mine"


def test_the_current_folder_is_not_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(OutputError, match="is the current folder"), whole_folder(Path("."), OWNED):
        pytest.fail("the work was begun")


def test_runs_at_one_time_do_not_disturb_each_other(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    with whole_folder(folder, OWNED) as first:
        (first / "first.tsv").write_text("1")
        with whole_folder(folder, OWNED) as second:
            (second / "second.tsv").write_text("2")
        assert names(folder) == ["second.tsv"]
        assert first.exists()
    assert names(folder) == ["first.tsv"]
    assert names(tmp_path) == ["out"]


def test_a_folder_put_there_during_the_exchange_goes_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "out"
    replace = Path.replace
    calls: list[Path] = []

    def race(self: Path, target: Path) -> Path:
        if Path(target) == folder and not calls:
            calls.append(Path(target))
            folder.mkdir()
            (folder / "other.tsv").write_text("other run")
        return replace(self, target)

    monkeypatch.setattr(files, "_swap", no_swap)
    monkeypatch.setattr(Path, "replace", race)
    with whole_folder(folder, OWNED) as partial:
        (partial / "mine.tsv").write_text("mine")
    assert calls
    assert names(folder) == ["mine.tsv"]
    assert names(tmp_path) == ["out"]


@pytest.mark.skipif(sys.platform == "win32", reason="no locks on folders there")
def test_what_a_killed_run_left_is_removed(tmp_path: Path) -> None:
    script = (
        "import sys, time; from pathlib import Path; from placerec.files import whole_folder\n"
        "with whole_folder(Path(sys.argv[1]), ('*.tsv',)) as partial:\n"
        "    (partial / 'half.tsv').write_text('half'); print('ready', flush=True); time.sleep(60)\n"
    )
    folder = tmp_path / "out"
    with subprocess.Popen([sys.executable, "-c", script, str(folder)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        with whole_folder(folder, OWNED):
            assert len(names(tmp_path)) == 2, "a run that goes on keeps its folder"
        process.send_signal(signal.SIGKILL)
    assert names(tmp_path) != ["out"]
    with whole_folder(folder, OWNED) as partial:
        (partial / "whole.tsv").write_text("whole")
    assert names(tmp_path) == ["out"]
    assert names(folder) == ["whole.tsv"]


@pytest.mark.skipif(sys.platform == "win32", reason="needs locks on files")
def test_partial_files_of_killed_runs_go_and_those_being_written_stay(tmp_path: Path) -> None:
    left = [".a.npz.partial-abcd_123.npz", ".b.partial-00000000"]
    kept = [".a.npz.partial-journal", ".c.partial-toolong123", "a.npz"]
    for name in (*left, *kept):
        (tmp_path / name).write_text("")
    (tmp_path / ".d.partial-abcdefgh").mkdir()
    with whole_file(tmp_path / "a.npz") as partial:
        sweep_files(tmp_path, "a.npz")
        assert names(tmp_path) == sorted([left[1], *kept, ".d.partial-abcdefgh", partial.name])
        sweep_files(tmp_path)
        assert names(tmp_path) == sorted([*kept, ".d.partial-abcdefgh", partial.name])


def test_text_is_utf8_with_line_feeds_and_gzip_without_a_date(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_text(tmp_path / "a.txt", "Küche\n")
    assert (tmp_path / "a.txt").read_bytes() == b"K\xc3\xbcche\n"
    write_text(tmp_path / "a.gz", "Küche\n")
    monkeypatch.setattr("time.time", lambda: 1e9)
    write_text(tmp_path / "b.gz", "Küche\n")
    assert (tmp_path / "a.gz").read_bytes() == (tmp_path / "b.gz").read_bytes()
    assert read_text(tmp_path / "a.gz", StreamError) == "Küche\n"


def test_a_name_that_is_not_utf8_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"a\.tsv: a name in 'frame \\udcff\.png' is not UTF-8"):
        write_text(tmp_path / "a.tsv", "frame \udcff.png")
    assert names(tmp_path) == []


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.txt", b"one\ntwo \xff\n", r"a.txt:2: byte 0xff is not UTF-8; save the file as UTF-8"),
        ("a.gz", b"no gzip", r"a.gz: cannot be read: Not a gzipped file"),
        ("a.gz", gzip.compress(b"text", mtime=0)[:-6], r"a.gz: cannot be read: Compressed file ended"),
        ("a.gz", gzip.compress(b"text", mtime=0)[:10] + b"\xff" * 30, r"a.gz: cannot be read: Error -3"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path: Path, name: str, data: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(StreamError, match=message):
        read_text(tmp_path / name, StreamError)


def test_missing_files_and_folders_are_named(tmp_path: Path) -> None:
    with pytest.raises(StreamError, match="nothing: no such file"):
        read_text(tmp_path / "nothing", StreamError)
    with pytest.raises(StreamError, match="is a folder, and a file is expected"):
        read_text(tmp_path, StreamError)


def test_the_umask_is_left_as_it_was() -> None:
    before = os.umask(0o022)
    os.umask(before)
    assert files._umask() == before
    assert os.umask(before) == before


def test_a_digest_is_of_types_shapes_values_and_limits() -> None:
    array = np.arange(6, dtype=np.float32)
    different = [
        (array,),
        (array.reshape(2, 3),),
        (array.reshape(2, 3).T,),
        (array.view(np.int32),),
        (array[:3], array[3:]),
        (b"ab", b"c"),
        (b"a", b"bc"),
        ("ab", "c"),
        (["ab", "c"],),
        ({"ab": "c"},),
        (None,),
        (),
    ]
    assert len({content_digest(*parts) for parts in different}) == len(different)
    assert content_digest(array[::2], {"a": 1, "b": 2}) == content_digest(array[::2].copy(), {"b": 2, "a": 1})


def test_a_digest_of_a_file_is_that_of_its_bytes(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"abc")
    assert content_digest_of_file(path, StreamError) == sha256(b"abc").hexdigest()
    with pytest.raises(StreamError, match=r"b: cannot be read: No such file"):
        content_digest_of_file(tmp_path / "b", StreamError)


def test_lines_of_every_editor(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    for data in (b"a\nb\xc2\x85c\n", b"\xef\xbb\xbfa\r\nb\xc2\x85c\r\n", b"a\nb\xc2\x85c"):
        path.write_bytes(data)
        assert all_lines(path, StreamError) == list(read_lines(path, StreamError)) == ["a", "b\x85c"]


def test_a_number_or_what_is_asked_for_instead() -> None:
    assert number_in(" 1e-3 ") == 0.001
    assert np.isnan(number_in("1,5"))
    assert number_in("", 2.0) == 2.0
