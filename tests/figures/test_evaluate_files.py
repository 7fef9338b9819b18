"""Files and folders of beliefs, and standard input, as one evaluation."""

import io
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from placerec.errors import EvaluationError
from placerec.figures.evaluation import evaluate_files

HEADER = "frame\ttime\tplace\tword\tselected\tbest\thall\tlab\n"
RIGHT = HEADER + "0\t0\thall\tw1\t1\thall\t0.9\t0.1\n"
WRONG = HEADER + "0\t0\thall\tw1\t1\tlab\t0.1\t0.9\n"


def put(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def test_files_and_folders_are_judged_together(tmp_path: Path) -> None:
    put(tmp_path / "beliefs" / "seq1.tsv", RIGHT)
    put(tmp_path / "beliefs" / "seq2.tsv", WRONG)
    put(tmp_path / "beliefs" / "seq2.explain.jsonl", "{}")
    single = put(tmp_path / "seq3.tsv", RIGHT)
    result = evaluate_files([tmp_path / "beliefs", str(single)])
    assert list(result.sequences) == ["seq1", "seq2", "seq3"]
    assert result.accuracy == pytest.approx(2 / 3)


def test_files_of_one_name_are_called_by_their_folders(tmp_path: Path) -> None:
    paths = [put(tmp_path / "a" / "seq1.tsv", RIGHT), put(tmp_path / "b" / "seq1.tsv", WRONG)]
    result = evaluate_files(paths)
    assert [(name, score.accuracy) for name, score in result.sequences.items()] == [("a-seq1", 1), ("b-seq1", 0)]


def test_names_that_stay_equal_are_an_error_that_names_both(tmp_path: Path) -> None:
    paths = [put(tmp_path / "a" / "x" / "seq1.tsv", RIGHT), put(tmp_path / "b" / "x" / "seq1.tsv", WRONG)]
    with pytest.raises(EvaluationError) as raised:
        evaluate_files(paths)
    assert str(paths[0]) in str(raised.value)
    assert str(paths[1]) in str(raised.value)


def test_a_file_given_twice_is_refused(tmp_path: Path) -> None:
    path = put(tmp_path / "a" / "seq1.tsv", RIGHT)
    with pytest.raises(EvaluationError) as raised:
        evaluate_files([path.parent, path])
    assert str(raised.value) == f"{path}: is given twice; its frames would count twice"


def test_a_folder_without_beliefs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(EvaluationError) as raised:
        evaluate_files([tmp_path])
    assert str(raised.value) == f"{tmp_path}: holds no beliefs file (.tsv); write them with `placerec decode -o`"


def test_standard_input_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(RIGHT.encode())))
    assert list(evaluate_files(["-"]).sequences) == ["stdin"]
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(b"\xff")))
    with pytest.raises(EvaluationError, match=r"^<stdin>: byte 0xff is not UTF-8$"):
        evaluate_files(["-"])


def test_the_picture_is_drawn_where_it_is_wanted(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    evaluate_files([put(tmp_path / "seq1.tsv", RIGHT)], plot=tmp_path / "out" / "a.png")
    assert (tmp_path / "out" / "a.png").read_bytes().startswith(b"\x89PNG")


def test_what_flatters_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    one_place = put(tmp_path / "seq1.tsv", RIGHT)
    evaluate_files([one_place])
    assert "every test sequence holds one place throughout" in caplog.text
    caplog.clear()
    moving = put(tmp_path / "seq2.tsv", RIGHT + "1\t1\tlap\tw1\t1\thall\t0.9\t0.1\n")
    evaluate_files([one_place, moving])
    (record,) = caplog.records
    assert record.getMessage() == "1 test frames are of 'lap', which the models do not know; the nearest name is 'lab'"


def test_frames_that_are_said_to_be_unknown_are_no_strange_label(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    evaluate_files([put(tmp_path / "seq1.tsv", RIGHT + "1\t1\tunknown\tw1\t1\thall\t0.9\t0.1\n")])
    assert not caplog.records
