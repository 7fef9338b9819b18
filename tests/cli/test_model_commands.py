"""Models on the command line: train-lm, update, check, inspect and calibrate."""

import json
import re
import shutil
from pathlib import Path

import pytest
from helpers.several_dictionaries import FURTHER, write_several
from helpers.small_world import PLACES, write_tokens
from helpers.typed_commands import done, fails, make_world, misused, placerec


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `make_world` makes, for all tests here."""
    return make_world(tmp_path_factory.mktemp("world"))


def test_training_refuses_words_and_vocabularies_it_cannot_use(world: Path, tmp_path: Path) -> None:
    write_tokens(tmp_path, ["run"])
    path = tmp_path / "run.tsv"
    path.write_text(path.read_text().replace("w04", "w99", 1))
    line = 1 + next(i for i, text in enumerate(path.read_text().splitlines()) if "w99" in text)
    fails(rf"run\.tsv:{line}: the word 'w99' is not in the vocabulary", "train-lm", path, "-o", tmp_path / "model")
    fails(r"none\.txt: no such file", "train-lm", path, "-o", tmp_path / "model", "--vocab", tmp_path / "none.txt")
    (tmp_path / "vocab.txt").unlink()
    fails(
        r"vocab\.txt: no such file; the vocabulary .* is named with --vocab FILE",
        "train-lm",
        path,
        "-o",
        tmp_path / "model",
    )
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.tsv"]
    result = done("decode", path, "-m", world / "model")
    assert "warning: run: words that the models do not list: 1 skipped, 'w99' first\n" in result.stderr


def test_training_options_reach_the_model(world: Path, tmp_path: Path) -> None:
    done(
        "train-lm", world / "tokens", "-o", tmp_path / "model", "--order", 3, "--smoothing", "lidstone",
        "--delta", 0.25, "--select", "compress:2", "--min-count", "1,2", "--markers",
    )  # fmt: skip
    described = json.loads((tmp_path / "model/model.json").read_text())
    found = {name: described[name] for name in ("order", "smoothing", "delta", "select", "min_count", "markers")}
    assert found == {
        "order": 3,
        "smoothing": "lidstone",
        "delta": 0.25,
        "select": "compress:2",
        "min_count": [1, 2],
        "markers": True,
    }


def test_visits_are_learned_and_forgotten(world: Path, tmp_path: Path) -> None:
    first, second = world / "tokens/run1.tsv", world / "tokens/run2.tsv"
    done("train-lm", first, "-o", tmp_path / "model")
    before = (tmp_path / "model/hall.arpa").read_bytes()
    learned = done("update", tmp_path / "model", second)
    assert learned.stdout == ""
    stays = f"{tmp_path / 'model'}: the weight of words stays as it was learned; train again to learn it anew\n"
    assert learned.stderr == f"{tmp_path / 'model'}: learned run2; estimated again: hall, kitchen, office\n{stays}"
    assert (tmp_path / "model/hall.arpa").read_bytes() == (world / "model/hall.arpa").read_bytes() != before
    again = done("update", tmp_path / "model", second).stderr
    assert again == f"{tmp_path / 'model'}: has learned run2 already; nothing is changed\n"
    forgotten = done("update", tmp_path / "model", second, "--forget").stderr
    assert forgotten == f"{tmp_path / 'model'}: forgotten run2; estimated again: hall, kitchen, office\n{stays}"
    assert (tmp_path / "model/hall.arpa").read_bytes() == before
    assert done("update", tmp_path / "model", second, "-q").stderr == ""
    misused("Missing argument 'TOKENS...'", "update", tmp_path / "model")


def test_check_and_inspect_name_what_they_cannot_read(world: Path, tmp_path: Path) -> None:
    (tmp_path / "empty.arpa").write_text("")
    for command in ("check", "inspect"):
        fails(r"none\.arpa: no such file", command, tmp_path / "none.arpa")
        fails(r"empty\.arpa:1: the file ends where", command, tmp_path / "empty.arpa")
        (tmp_path / "none").mkdir(exist_ok=True)
        fails("none: holds no ARPA file", command, tmp_path / "none")
    fails("the word 'zz' is not in the model", "inspect", world / "model/hall.arpa", "w01 zz")


def test_check_is_content_with_our_models_and_not_with_others(world: Path, tmp_path: Path) -> None:
    pytest.importorskip("kenlm")
    models = sorted((world / "model").glob("*.arpa"))
    assert [path.stem for path in models] == list(PLACES)
    assert [line.endswith(": ok") for line in done("check", *models).stdout.splitlines()] == [True] * 3
    assert [one["ok"] for one in json.loads(done("check", *models, "--json").stdout)] == [True] * 3
    bad = tmp_path / "bad.arpa"
    bad.write_text(re.sub(r"^-\S+(?=\tw03)", "-0.1", models[0].read_text(), count=1, flags=re.MULTILINE))
    result = placerec("check", bad)
    assert result.exit_code == 1
    assert "FAIL (worst context" in result.stdout
    assert result.stderr == "placerec: a model is not as it should be; see above\n"


def test_check_and_inspect_do_all_files_of_a_folder(tmp_path: Path) -> None:
    pytest.importorskip("kenlm")
    write_several(tmp_path / "tokens")
    model = tmp_path / "model"
    done("train-lm", tmp_path / "tokens", "-o", model, "-q")
    folders = [model, *(model / name for name in FURTHER)]
    files = [str(folder / f"{place}.arpa") for folder in folders for place in PLACES]
    lines = done("check", model).stdout.splitlines()
    assert [line.partition(":")[0] for line in lines] == files
    assert [one["path"] for one in json.loads(done("check", model, "--json").stdout)] == files
    text = done("inspect", model, "w01 w02", "pn10.w1", "--top", 1).stdout
    assert [line for line in text.splitlines() if ": order " in line] == [f"{file}: order 2" for file in files]
    shown = json.loads(done("inspect", model, "w01 w02", "pn10.w1", "--json").stdout)
    assert [one["path"] for one in shown] == files
    explained = [[entry["word"] for entry in one["explained"]] for one in shown]
    assert explained == [["w02"]] * 3 + [[]] * 3 + [["pn10.w1"]] * 3
    fails("model: no model there has all words of 'w01 pn10.w1'", "inspect", model, "w02", "w01 pn10.w1")
    (model / "pn10/office.arpa").write_text("")
    # What was checked before is told.
    result = placerec("check", model)
    assert result.exit_code == 1
    assert len(result.stdout.splitlines()) == 8
    assert result.stderr.startswith(f"placerec: {model}/pn10/office.arpa:1: ")


def test_inspect_shows_ngrams(world: Path) -> None:
    text = done("inspect", world / "model/hall.arpa", "w01 w02", "--top", 1).stdout
    assert "order 2" in text
    assert "w01 w02" in text
    assert json.loads(done("inspect", world / "model/hall.arpa", "w01 w02", "--json").stdout)


def test_calibrate_tells_what_it_found_and_refuses_training(world: Path, tmp_path: Path) -> None:
    shutil.copytree(world / "model", tmp_path / "model")
    text = done("calibrate", tmp_path / "model", world / "tokens/run3.tsv", "--stay", "0.9", "-q").stdout
    assert re.fullmatch(r"temperature  \d.*\nlog loss     \d.* -> \d.*60 frames.*\n", text)
    assert json.loads((tmp_path / "model/model.json").read_text())["calibration"]["options"]["stay"] == 0.9
    fails("run1: trained .*, which is surer of it", "calibrate", tmp_path / "model", world / "tokens/run1.tsv")
