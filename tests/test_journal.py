"""What long work has found so far: taken up again as far as it is sound, and never anything else."""

import errno
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from placerec.errors import OutputError
from placerec.jobs import JobError
from placerec.journal import Journal, open_journal

RECORDS = [(b"first", b"one" * 5), (b"second", b""), (b"", b"three"), (b"fourth", bytes(range(256)))]
NAME = ".out.npz.partial-journal"


def taken_up(out: Path, records: list[tuple[bytes, bytes]]) -> int:
    """Do the work of `records` with a journal: how many came from an earlier run."""
    known = 0
    with open_journal(out) as journal:
        for key, content in records:
            found = journal.next(key) if known >= 0 else None
            if found is None:
                break
            assert found == content
            known += 1
        for key, content in records[known:]:
            journal.add(key, content)
        assert list(journal.contents()) == [content for _, content in records]
    assert list(out.parent.iterdir()) == []
    return known


@contextmanager
def killed(out: Path, records: list[tuple[bytes, bytes]] = RECORDS) -> Iterator[Path]:
    """The journal of a run that did `records` and was interrupted."""
    with suppress(KeyboardInterrupt), open_journal(out) as journal:
        for key, content in records:
            assert journal.next(key) is None
            journal.add(key, content)
        raise KeyboardInterrupt
    path = out.parent / NAME
    assert path.stat().st_mode & 0o777 == 0o600
    yield path


def ends() -> list[int]:
    """Where the records end in the file."""
    sizes = [32 + len(key) + len(content) for key, content in RECORDS]
    return [sum(sizes[:n]) for n in range(len(sizes) + 1)]


def test_a_record_that_is_cut_ends_what_is_taken_from_the_file(tmp_path: Path) -> None:
    out = tmp_path / "out.npz"
    for size in range(ends()[-1] + 1):
        with killed(out) as path:
            assert path.stat().st_size == ends()[-1]
            os.truncate(path, size)
        assert taken_up(out, RECORDS) == sum(end <= size for end in ends()) - 1


def test_a_record_that_is_damaged_ends_it_too(tmp_path: Path) -> None:
    out = tmp_path / "out.npz"
    for at in range(ends()[-1]):
        with killed(out) as path:
            data = bytearray(path.read_bytes())
            data[at] ^= 0x40
            path.write_bytes(data)
        assert taken_up(out, RECORDS) == sum(end <= at for end in ends()) - 1


@pytest.mark.parametrize("changed", range(len(RECORDS)))
def test_what_was_made_from_something_else_is_done_again_and_all_behind_it(tmp_path: Path, changed: int) -> None:
    records = list(RECORDS)
    records[changed] = (b"another", b"result")
    with killed(tmp_path / "out.npz"):
        assert taken_up(tmp_path / "out.npz", records) == changed


def test_fewer_and_more_results_than_before(tmp_path: Path) -> None:
    out = tmp_path / "out.npz"
    with killed(out):
        assert taken_up(out, RECORDS[:2]) == 2
    with killed(out, RECORDS[:2]):
        assert taken_up(out, RECORDS) == 2
    with killed(out, []):
        assert taken_up(out, RECORDS) == 0


@pytest.mark.parametrize("error", [KeyboardInterrupt, JobError, OutputError, ValueError])
def test_only_who_was_interrupted_goes_on(tmp_path: Path, error: type[BaseException]) -> None:
    with pytest.raises(error), open_journal(tmp_path / "out.npz") as journal:  # noqa: PT012
        journal.add(b"key", b"content")
        raise error
    assert [path.name for path in tmp_path.iterdir()] == ([NAME] if error in (KeyboardInterrupt, JobError) else [])


@pytest.mark.skipif(sys.platform == "win32", reason="no such locks there")
def test_two_runs_at_one_time_have_a_journal_each(tmp_path: Path) -> None:
    out = tmp_path / "out.npz"
    with open_journal(out) as first:
        first.add(b"1", b"first")
        with open_journal(out) as second:
            assert second.next(b"1") is None
            second.add(b"1", b"second")
            assert [path.name for path in tmp_path.iterdir()] == [NAME]
            assert list(second.contents()) == [b"second"]
        assert [path.name for path in tmp_path.iterdir()] == [NAME]
        assert list(first.contents()) == [b"first"]
    assert list(tmp_path.iterdir()) == []


def test_what_killed_runs_left_beside_it_is_removed(tmp_path: Path) -> None:
    for name in ("out.npz", "out", "out.partial-x.npz"):
        for left in (f".{name}.partial-abcd_123{Path(name).suffix}", f".{name}.partial-journal"):
            (tmp_path / left).write_text("half")
        (tmp_path / f".{name}.partial-mine.txt").write_text("of another program")
        with open_journal(tmp_path / name):
            pass
        assert [path.name for path in tmp_path.iterdir()] == [f".{name}.partial-mine.txt"]
        (tmp_path / f".{name}.partial-mine.txt").unlink()


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
def test_a_link_in_its_place_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("precious")
    (tmp_path / NAME).symlink_to("mine")
    with pytest.raises(OutputError, match=r"out\.npz: cannot be written: "), open_journal(tmp_path / "out.npz"):
        pytest.fail("it was followed")
    assert (tmp_path / "mine").read_text() == "precious"


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*args: object) -> int:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(OutputError, match="cannot be written: Permission denied"), open_journal(tmp_path / "out.npz"):
        pytest.fail("the work was begun")


def test_another_users_journal_keeps_nobody_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    theirs = tmp_path / NAME
    theirs.write_bytes(b"theirs")
    real = os.open

    def refuse(path: str | Path, *args: int, **more: int) -> int:
        if Path(path) == theirs:
            raise PermissionError(errno.EACCES, "Permission denied")
        return real(path, *args, **more)

    monkeypatch.setattr(os, "open", refuse)
    with open_journal(tmp_path / "out.npz") as journal:
        journal.add(b"key", b"content")
        assert list(journal.contents()) == [b"content"]
    assert theirs.read_bytes() == b"theirs"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_told_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with Path("/dev/full").open("r+b", buffering=0) as full:
        journal = Journal(full, tmp_path / "out.npz")
        with pytest.raises(OutputError, match=r"out\.npz: cannot be written: No space left on device"):
            journal.add(b"key", b"content")
    real = os.open
    monkeypatch.setattr(os, "open", lambda path, *args: real("/dev/full", os.O_RDWR))
    # The file is closed on the way out, and what it still holds does not fit then, either.
    with pytest.raises(OutputError, match="No space left"), open_journal(tmp_path / "out.npz") as journal:
        journal.add(b"key", b"content")


def test_a_journal_that_something_else_wrote_to_is_noticed(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="was changed by something else"), open_journal(tmp_path / "out") as journal:  # noqa: PT012
        journal.add(b"key", b"content")
        (tmp_path / ".out.partial-journal").write_bytes(b"")
        list(journal.contents())
