"""The rules of section 2.2, one by one."""

import bz2
import gzip
import io
import os
import stat
import threading
from pathlib import Path

import pytest

from placerec.srilm.text.streams import Lines, SrilmError, Streams, exit_status, tokens


def streams(data: bytes = b"") -> tuple[Streams, io.BytesIO, io.BytesIO]:
    ours = Streams(io.BytesIO(data), out := io.BytesIO(), err := io.BytesIO())
    return ours, out, err


def lines_of(data: bytes) -> list[tuple[int, str]]:
    lines = Lines("x", io.BytesIO(data), streams()[0])
    found = [(lines.number, line) for line in lines]
    parts = Lines("x", io.BytesIO(data), streams()[0])
    blocks = list(parts.blocks(3))
    assert b"".join(blocks) == data.removeprefix(b"\xef\xbb\xbf")
    assert [(parts.number, line) for line in parts.of(line for block in blocks for line in io.BytesIO(block))] == found
    return found


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"a\nb", [(1, "a"), (2, "b")]),
        (b"a\n\n \t\v\f\r\nb\n", [(1, "a"), (4, "b")]),
        (b"##c\na\n#b\n ##d\n", [(2, "a"), (3, "#b"), (4, " ##d")]),
        (b"\xef\xbb\xbfa\n\xef\xbb\xbfb\n", [(1, "a"), (2, "\xef\xbb\xbfb")]),
        (b"\xef\xbb\xbf##c\na\n", [(2, "a")]),
        (b"a b\0c\ne f\n", [(1, "a be f")]),
        (b"a\0b\nc\0d\ne\0", [(1, "ace")]),
        (b"a\0b\nc\nd\n", [(1, "ac"), (2, "d")]),
        (b"a\r\nb\rc\n", [(1, "a\r"), (2, "b\rc")]),
        (b"\xff\xe9\n", [(1, "\xff\xe9")]),
        (b"", []),
    ],
)
def test_lines(data: bytes, expected: list[tuple[int, str]]) -> None:
    assert lines_of(data) == expected


def test_positions_count_every_line() -> None:
    lines = Lines("x.txt", io.BytesIO(b"\n##\na\n\n"), streams()[0])
    assert list(lines) == ["a"]
    assert lines.position == "x.txt: line 4: "


def test_tokens_are_separated_by_blank_tab_cr_and_lf_only() -> None:
    assert tokens(" a\tb\r c\vd\fe  \n") == ["a", "b", "c\vd\fe"]


@pytest.mark.parametrize(("mark", "encoding"), [(b"\xff\xfe", "UTF-16LE"), (b"\xfe\xff", "UTF-16BE")])
def test_utf_16_is_an_empty_file_with_a_message(mark: bytes, encoding: str) -> None:
    ours, _, err = streams(mark + b"a\0\n\0")
    assert list(ours.lines("-")) == []
    assert err.getvalue() == f"-: line 0: conversion from {encoding} not supported\n".encode()


def test_the_same_words_packed_and_plain(tmp_path: Path) -> None:
    ours, _, _ = streams()
    (tmp_path / "a.gz").write_bytes(gzip.compress(b"a\n") + gzip.compress(b"b\n"))
    (tmp_path / "plain.gz").write_bytes(b"a\nb\n")
    (tmp_path / "a.bz2").write_bytes(bz2.compress(b"a\nb\n"))
    for path in tmp_path.iterdir():
        assert list(ours.lines(str(path))) == ["a", "b"]


@pytest.mark.parametrize(("name", "magic"), [("x.gz", b"\x1f\x8b"), ("x.bz2", b"BZh"), (".gz", b"a\n"), ("x", b"a\n")])
def test_names_say_how_output_is_packed(
    name: str, magic: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ours, _, _ = streams()
    ours.write(name, "a\n")
    first = (tmp_path / name).read_bytes()
    assert first.startswith(magic)
    assert list(ours.lines(name)) == ["a"]
    ours.write(name, "a\n")
    assert (tmp_path / name).read_bytes() == first


@pytest.mark.parametrize("suffix", [".Z", ".7z", ".xz"])
def test_other_packers_are_refused(suffix: str) -> None:
    with pytest.raises(SrilmError, match=f"x{suffix}: placerec does not read or write {suffix} files") as caught:
        streams()[0].open(f"x{suffix}")
    assert caught.value.status == 2


@pytest.mark.parametrize("cut", [5, 15, -4])
def test_damaged_gzip_is_an_error_with_the_name(cut: int, tmp_path: Path) -> None:
    path = tmp_path / "a.gz"
    path.write_bytes(gzip.compress(b"a b c\n" * 100)[:cut])
    with pytest.raises(SrilmError, match=r"a\.gz: "):
        list(streams()[0].lines(str(path)))


def test_a_missing_file_and_folder(tmp_path: Path) -> None:
    missing = str(tmp_path / "none" / "x")
    for act in (lambda: streams()[0].open(missing), lambda: streams()[0].write(missing, "")):
        with pytest.raises(SrilmError, match=f"^{missing}: No such file or directory$") as caught:
            act()
        assert caught.value.status == 1


def test_hyphen_twice_is_warned_of_once() -> None:
    ours, out, err = streams(b"a\n")
    for _ in range(3):
        ours.write("-", "b\n")
    assert [list(ours.lines("-")) for _ in range(3)] == [["a"], [], []]
    assert out.getvalue() == b"b\nb\nb\n"
    assert err.getvalue().decode().splitlines() == [
        "warning: '-' used multiple times for output",
        "warning: '-' used multiple times for input",
    ]


def test_bytes_of_names_and_text_are_kept(tmp_path: Path) -> None:
    ours, _, _ = streams()
    name = os.fsencode(tmp_path / "é").decode("latin-1")
    ours.write(name, "\xe9\n")
    assert (tmp_path / "é").read_bytes() == b"\xe9\n"


def test_failed_output_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "x"
    path.write_text("old")
    ours, _, _ = streams()

    def fail() -> None:
        with ours.output(str(path)) as file:
            file.write(b"new")
            raise ValueError("broken")

    with pytest.raises(ValueError, match="broken"):
        fail()
    assert [entry.read_text() for entry in tmp_path.iterdir()] == ["old"]


def test_output_goes_through_links_and_into_pipes(tmp_path: Path) -> None:
    (tmp_path / "target").write_text("old")
    (tmp_path / "link").symlink_to("target")
    os.mkfifo(tmp_path / "pipe")
    ours, _, _ = streams()
    ours.write(str(tmp_path / "link"), "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_text() == "new"
    received: list[str] = []
    reader = threading.Thread(target=lambda: received.append((tmp_path / "pipe").read_text()))
    reader.start()
    ours.write(str(tmp_path / "pipe"), "piped")
    reader.join()
    assert received == ["piped"]
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)
    ours.write("/dev/null", "gone")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)


def test_exit_status_says_the_message() -> None:
    @exit_status
    def tool(arguments: object, ours: Streams) -> int:
        raise SrilmError("no such thing", 2)

    ours, _, err = streams()
    assert tool([], ours) == 2
    assert err.getvalue() == b"no such thing\n"
