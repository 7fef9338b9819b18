"""Learning and forgetting: the same bytes as training on what is left, and what is refused."""

import json
import logging
import re
import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from helpers.small_world import PLACES, VOCABULARY, run_through, write_images, write_tokens, write_world
from hypothesis import assume, given, settings, strategies as st

from placerec.errors import LanguageModelError, ModelError, OutputError, PlacerecError, SourceError, StreamError
from placerec.files import held_folder
from placerec.lm import SMOOTHINGS
from placerec.model import ModelOptions, train_lm, update
from placerec.words import WordStream, parse_selection, write_stream, write_vocabulary

# Kneser-Ney cannot be fitted to few words.
SAFE = [name for name in SMOOTHINGS if "kneser-ney" not in name]
FRAMES = st.tuples(
    st.sampled_from(["", "K", "L", "L", "M"]),
    st.sampled_from("aaabcd"),
    st.sampled_from([0.2, 0.2, 0.2, 9.0]),
    st.sampled_from([np.nan, 0.0, 0.5, 0.6, 3.0]),
)
OPTIONS = st.builds(
    ModelOptions,
    order=st.integers(1, 4),
    smoothing=st.sampled_from(SAFE),
    min_count=st.sampled_from([(1,), (1, 1, 2)]),
    markers=st.booleans(),
    select=st.sampled_from(["none", "unique", "subsample:2", "compress:2"]).map(parse_selection),
)


def contents(folder: Path) -> dict[str, str]:
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}


def write_run(path: Path, frames: Sequence[tuple[str, str, float, float]]) -> Path:
    places, words, steps, distances = zip(*frames, strict=True)
    write_stream(WordStream.of(path.stem, words, places, times=np.cumsum(steps), distances=distances), path)
    return path


def trained(runs: Sequence[Path], out: Path, options: ModelOptions) -> dict[str, str]:
    train_lm(runs, out, options=options, vocabulary=runs[0].parent / "vocab.txt", as_in_paper=True)
    return contents(out)


@settings(max_examples=25)
@given(
    st.lists(st.tuples(st.lists(FRAMES, min_size=1, max_size=25), st.booleans()), min_size=2, max_size=4),
    OPTIONS,
)
def test_learning_and_forgetting_equal_training_on_what_is_left(
    parts: list[tuple[list[tuple[str, str, float, float]], bool]], options: ModelOptions
) -> None:
    """With every order, smoothing, selection and marker, and for any sequences among the others."""
    assume(all(any(frame[0] for run, later in parts if later is which for frame in run) for which in (False, True)))
    # Hundreds of small files: in memory where there is such a folder.
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as name:
        folder = Path(name)
        write_vocabulary([*"abcd"], folder / "vocab.txt")
        runs = [write_run(folder / f"run{i}.tsv", frames) for i, (frames, _) in enumerate(parts)]
        kept = [run for run, (_, later) in zip(runs, parts, strict=True) if not later]
        more = [run for run, (_, later) in zip(runs, parts, strict=True) if later]
        before = trained(kept, folder / "model", options)
        after = trained([*kept, *more], folder / "both", options)
        trained(runs, folder / "mixed", options)
        update(folder / "model", more)
        assert contents(folder / "model") == after
        for learned in ("model", "mixed"):
            update(folder / learned, more, forget=True)
            assert contents(folder / learned) == before


def write_long_runs(folder: Path) -> list[Path]:
    """Three runs with enough rare words for Kneser-Ney, which needs words that occur once, twice and so on."""
    runs = []
    for seed in range(3):
        words = np.minimum(np.random.default_rng(seed).zipf(1.4, 3000), 400) - 1
        frames = [("hall" if i < 1500 else "kitchen", f"w{word:03d}", 0.5, 1.0) for i, word in enumerate(words)]
        runs.append(write_run(folder / f"run{seed}.tsv", frames))
    write_vocabulary([f"w{i:03d}" for i in range(400)], folder / "vocab.txt")
    return runs


@pytest.mark.parametrize("smoothing", [name for name in SMOOTHINGS if name not in SAFE])
def test_smoothings_that_are_fitted_are_fitted_to_all_counts(tmp_path: Path, smoothing: str) -> None:
    runs, options = write_long_runs(tmp_path / "tokens"), ModelOptions(2, smoothing)
    before, after = trained(runs[:2], tmp_path / "model", options), trained(runs, tmp_path / "all", options)
    update(tmp_path / "model", runs[2:])
    assert contents(tmp_path / "model") == after
    update(tmp_path / "model", runs[2:], forget=True)
    assert contents(tmp_path / "model") == before


def test_what_cannot_be_estimated_leaves_the_model(tmp_path: Path) -> None:
    before = trained(write_long_runs(tmp_path / "tokens"), tmp_path / "model", ModelOptions(2, "kneser-ney"))
    with pytest.raises(LanguageModelError, match="place attic: Kneser-Ney fails"):
        update(tmp_path / "model", [write_run(tmp_path / "poor.tsv", [("attic", "w000", 1, 1)])])
    assert contents(tmp_path / "model") == before


@pytest.fixture
def world(tmp_path: Path) -> Path:
    """Token streams of three runs, and a model of the first two."""
    return write_world(tmp_path)


def refused(
    world: Path, message: str, *tokens: Path, forget: bool = False, error: type[Exception] = ModelError
) -> None:
    before = contents(world / "model")
    with pytest.raises(error, match=re.escape(message)):
        update(world / "model", tokens, forget=forget)
    assert contents(world / "model") == before
    assert not [path for path in world.iterdir() if path.name.startswith(".")]


def test_places_without_new_visits_keep_their_files(world: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Down to a first line that another version of placerec wrote."""
    hall = world / "model/hall.arpa"
    hall.write_text(hall.read_text().replace("# placerec ", "# placerec 0.0."))
    before = contents(world / "model")
    kitchen = [("kitchen", "w03", 0.5, np.nan), ("kitchen", "w04", 0.5, np.nan)]
    with caplog.at_level(logging.INFO, "placerec"):
        update(world / "model", [write_run(world / "new/today.tsv", kitchen)])
    assert f"{world / 'model'}: learned today; estimated again: kitchen" in caplog.messages
    after = contents(world / "model")
    assert {name for name in after if after[name] != before[name]} == {
        "kitchen.arpa", "counts/kitchen.counts", "sentences/kitchen.txt", "model.json",
    }  # fmt: skip
    assert after["sentences/kitchen.txt"] == before["sentences/kitchen.txt"] + "w03 w04\n"


def test_a_place_comes_and_goes_with_its_visits(world: Path, caplog: pytest.LogCaptureFixture) -> None:
    before = contents(world / "model")
    attic = write_run(world / "new/attic.tsv", [("attic", "w00", 0.5, 1.0)])
    update(world / "model", [attic])
    assert json.loads((world / "model/model.json").read_text())["places"] == ["attic", *PLACES]
    assert set(contents(world / "model")) - set(before) == {"attic.arpa", "counts/attic.counts", "sentences/attic.txt"}
    update(world / "model", [attic], forget=True)
    assert contents(world / "model") == before


def test_a_place_with_visits_but_no_selected_word_stays(tmp_path: Path) -> None:
    """`unique` over a whole sequence may leave a visit without a word; its place has a model all the same."""
    write_vocabulary(["a", "b"], tmp_path / "vocab.txt")
    one = write_run(tmp_path / "one.tsv", [("K", "a", 1, 1), ("L", "a", 1, 1)])
    two = write_run(tmp_path / "two.tsv", [("L", "b", 1, 1)])
    options = ModelOptions(select=parse_selection("unique"))
    before = trained([one], tmp_path / "model", options)
    assert before["sentences/L.txt"] == ""
    update(tmp_path / "model", [two])
    update(tmp_path / "model", [two], forget=True)
    assert contents(tmp_path / "model") == before


def test_a_folder_of_sentences_is_learned_and_forgotten_under_its_name(world: Path) -> None:
    train_lm([world / "model/sentences"], world / "text", as_in_paper=True)
    before = contents(world / "text")
    (world / "visits").mkdir()
    (world / "visits/hall.txt").write_text("w01 w02\nw03\n")
    update(world / "text", [world / "visits"])
    described = json.loads((world / "text/model.json").read_text())
    assert [sequence["name"] for sequence in described["sequences"]] == ["sentences", "visits"]
    assert (described["transitions"], described["distances"]) == (None, None)
    assert (world / "text/sentences/hall.txt").read_text() == before["sentences/hall.txt"] + "w01 w02\nw03\n"
    update(world / "text", [world / "visits"], forget=True)
    assert contents(world / "text") == before
    with pytest.raises(StreamError, match=r"run3\.tsv: is not what .*text was trained on; give a folder of sentences"):
        update(world / "text", [world / "tokens/run3.tsv"])
    refused(world, "visits: is not what", world / "visits", error=StreamError)


def test_a_calibration_is_dropped_with_a_warning(world: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = world / "model/model.json"
    path.write_text(path.read_text().replace('"calibration": null', '"calibration": {"temperature": 2}'))
    update(world / "model", [world / "tokens/run3.tsv"])
    assert f"{world / 'model'}: the calibration was of the former model, and is dropped; calibrate again" in caplog.text
    train_lm([world / "tokens"], world / "all", as_in_paper=True)
    assert contents(world / "model") == contents(world / "all")


def test_an_update_that_was_done_is_not_done_again(world: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Whoever was killed cannot know whether it was done."""
    before = contents(world / "model")
    with caplog.at_level(logging.INFO, "placerec"):
        update(world / "model", [world / "tokens/run2.tsv", world / "tokens/run1.tsv"])
    assert caplog.messages == [f"{world / 'model'}: has learned run2, run1 already; nothing is changed"]
    assert contents(world / "model") == before


def test_names_tell_what_was_learned(world: Path) -> None:
    tokens = world / "tokens"
    known = f"run2: {world / 'model'} has learned a sequence of this name; rename"
    refused(world, known, tokens / "run3.tsv", tokens / "run2.tsv")
    # Of this name, as long, with as many visits: one word is another.
    other = (tokens / "run2.tsv").read_text().split("\n")
    fields = other[3].split("\t")
    fields[3] = next(word for word in VOCABULARY if word != fields[3])
    other[3] = "\t".join(fields)
    (world / "new").mkdir()
    (world / "new/run2.tsv").write_text("\n".join(other))
    refused(world, known, world / "new/run2.tsv")
    refused(
        world,
        f"run3: {world / 'model'} never learned a sequence of this name; see its model.json",
        tokens / "run3.tsv",
        forget=True,
    )
    refused(
        world,
        "has learned nothing else, and a model has one place at least",
        tokens / "run1.tsv",
        tokens / "run2.tsv",
        forget=True,
    )


def test_a_sequence_is_not_learned_under_two_names(world: Path) -> None:
    (world / "new").mkdir()
    shutil.copy(world / "tokens/run3.tsv", world / "new/run2.tsv")
    both = world / "new/run2.tsv", world / "tokens/run2.tsv"
    refused(world, f"run2: {world / 'model'} has learned a sequence of this name; rename", *both)
    shutil.copy(world / "tokens/vocab.txt", world / "new/vocab.txt")
    train_lm(both, world / "model", as_in_paper=True)
    refused(world, f"tokens-run2: {world / 'model'} has learned a sequence of this name; rename", both[1])
    update(world / "model", both)


@pytest.mark.parametrize(
    ("column", "value"),
    [("place", "kitchen"), ("place", ""), ("word", "w11"), ("time", "1000"), ("distance", "7.5")],
)
def test_only_what_was_learned_is_forgotten(world: Path, column: str, value: str) -> None:
    """One field of the third frame is not what it was."""
    lines = [line.split("\t") for line in (world / "tokens/run2.tsv").read_text().split("\n")]
    lines[3][lines[0].index(column)] = value
    (world / "edited").mkdir()
    (world / "edited/run2.tsv").write_text("\n".join("\t".join(fields) for fields in lines))
    refused(world, "not those that were learned", world / "edited/run2.tsv", forget=True)


def test_words_and_places_must_be_the_models(world: Path) -> None:
    new = write_run(world / "new/new.tsv", [("hall", "w01", 1, 1), ("hall", "zz", 1, 1)])
    # The vocabulary beside the stream does not count.
    write_vocabulary([*VOCABULARY, "zz"], new.parent / "vocab.txt")
    message = f"new.tsv:3: the word 'zz' is not in the vocabulary; tokenize as {world / 'model'} was"
    refused(world, message, new, error=StreamError)
    twin = write_run(world / "new/twin.tsv", [("Hall", "w01", 1, 1)])
    refused(world, "twin: place 'Hall' differs only in case from 'hall' (run1)", twin, error=SourceError)
    unlabelled = write_run(world / "new/unlabelled.tsv", [("", "w01", 1, 1)])
    refused(world, "no labelled frame found: label the frames", unlabelled)
    refused(world, "nothing.tsv: no such file or folder", world / "nothing.tsv", error=StreamError)


def test_words_of_another_dictionary_are_refused(tmp_path: Path) -> None:
    for name, fingerprint in (("a", "f00"), ("b", "ba4"), ("c", "f00")):
        write_tokens(tmp_path / name, [name])
        (tmp_path / name / "tokens.json").write_text(json.dumps({"dictionary": fingerprint}))
    train_lm([tmp_path / "a"], tmp_path / "model", as_in_paper=True)
    refused(tmp_path, "b: its words are of another dictionary than those", tmp_path / "b", error=StreamError)
    update(tmp_path / "model", [tmp_path / "c"])
    assert json.loads((tmp_path / "model/model.json").read_text())["dictionary"] == "f00"


def edit_json(path: Path, **values: object) -> None:
    path.write_text(json.dumps({**json.loads(path.read_text()), **values}))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"sequences": ["run1", "run2"]}, "model.json: does not say which visits were learned, as an older placerec"),
        ({"sequences": []}, "does not say which visits were learned"),
        ({"sequences": [{"name": "run1", "visits": {"hall": -1}}]}, "does not say which visits were learned"),
        ({"transitions": {"counts": [[1, 2], [3, 4]], "triples": []}}, "model.json: "),
        ({"transitions": {"counts": [[10**30] * 3] * 3, "triples": []}}, "model.json: "),
        ({"transitions": {"counts": 7, "triples": []}}, "model.json: "),
        ({"transitions": {"counts": [[1] * 3] * 3}}, "does not say which visits were learned, as an older placerec"),
        ({"transitions": {"counts": [[1] * 3] * 3, "triples": [[0, 1, 3, 1]]}}, "does not say which visits"),
        ({"transitions": {"counts": [[1] * 3] * 3, "triples": [[0, 0, 1, 1]]}}, "does not say which visits"),
        ({"transitions": {"counts": [[1] * 3] * 3, "triples": [[0, 1, 0, -1]]}}, "does not say which visits"),
        ({"transitions": {"counts": [[1] * 3] * 3, "triples": [[0, 1, 0]]}}, "does not say which visits"),
        ({"distances": {"hall": {}}}, "does not say which visits were learned"),
        ({"distances": None}, "does not say which visits were learned"),
        ({"places": ["kitchen", "hall", "office"]}, "does not say which visits were learned"),
        ({"order": 0}, "order 0 is not between 1 and 9"),
        ({"order": "2"}, "model.json: its options make no model; train the model again"),
        ({"delta": "much"}, "model.json: "),
        ({"min_count": 7}, "model.json: its options make no model; train the model again"),
        ({"format": "placerec model 0"}, "is not of the format 'placerec model 1'"),
    ],
)
def test_a_model_json_that_does_not_serve_is_named(world: Path, values: dict[str, object], message: str) -> None:
    edit_json(world / "model/model.json", **values)
    refused(world, message, world / "tokens/run3.tsv")


def test_an_older_model_is_refused(world: Path) -> None:
    path = world / "model/model.json"
    description = json.loads(path.read_text())
    for key in ("transitions", "distances", "calibration"):
        del description[key]
    path.write_text(json.dumps({**description, "sequences": ["run1", "run2"]}))
    refused(world, "as an older placerec or an editor leaves it; train the model again", world / "tokens/run3.tsv")


@pytest.mark.parametrize(
    ("name", "edit", "message"),
    [
        ("counts/hall.counts", lambda text: text.replace("w00\t", "w00\t1", 1), "hall.counts: counts "),
        ("counts/hall.counts", lambda text: text + "w00 zz\t1\n", "'w00 zz\\t1' is no n-gram of the vocabulary"),
        ("counts/hall.counts", lambda text: text + "w00 w00 w00\t1\n", "is no n-gram of the vocabulary, of at most 2"),
        ("counts/hall.counts", lambda text: text + "w00 w00\tx\n", "is no n-gram of the vocabulary"),
        ("sentences/hall.txt", lambda text: text + "w00\n", "hall.txt: holds 5 sentences, and model.json names 4, as "),
        ("sentences/hall.txt", lambda text: "w00 " + text, " words, and "),
    ],
)
def test_an_edit_of_counts_or_sentences_is_found(
    world: Path, name: str, edit: Callable[[str], str], message: str
) -> None:
    path = world / "model" / name
    path.write_text(edit(path.read_text()))
    for tokens, forget in (("run3", False), ("run2", True)):
        refused(world, message, world / f"tokens/{tokens}.tsv", forget=forget, error=PlacerecError)


def test_a_negative_count_names_its_ngram(world: Path) -> None:
    path = world / "model/counts/hall.counts"
    pair, count = next(line.split("\t") for line in path.read_text().splitlines() if " " in line)
    path.write_text(path.read_text().replace(f"{pair}\t{count}\n", f"{pair}\t0\n"))
    message = f"hall.counts: '{pair}' would be left with the count -"
    first = (world / "model/sentences/hall.txt").read_text().splitlines()[:2]
    holder = "run1" if any(pair in visit for visit in first) else "run2"
    refused(world, message, world / f"tokens/{holder}.tsv", forget=True)


def test_missing_files_and_folders_are_named(world: Path) -> None:
    with pytest.raises(ModelError, match="nowhere/model: no such model folder; `placerec train-lm TOKENS"):
        update(world / "nowhere/model", [world / "tokens/run3.tsv"])
    assert not (world / "nowhere").exists()
    with pytest.raises(ModelError, match=r"tokens/model\.json: missing, so .*tokens is no model of train-lm"):
        update(world / "tokens", [world / "tokens/run3.tsv"])
    write_images(world / "images")
    for text in ("", "what lies beside images\n"):
        (world / "images/README.txt").write_text(text)
        makes = re.escape(f"`placerec tokenize {world / 'images'} -w words.npz -o tokens/` makes token streams of that")
        with pytest.raises(StreamError, match=rf"images: holds no token stream \(\.tsv\), but images; {makes}"):
            update(world / "model", [world / "images"])
    (world / "model/counts/office.counts").unlink()
    refused(world, "office.counts: missing, though model.json names visits to its place", world / "tokens/run3.tsv")


def test_two_updates_at_one_time_do_not_undo_each_other(world: Path) -> None:
    with held_folder(world / "model"):
        refused(
            world, "model: is being changed by another run; try again", world / "tokens/run3.tsv", error=OutputError
        )
    update(world / "model", [world / "tokens/run3.tsv"])


def test_progress_counts_the_places_that_are_estimated(world: Path) -> None:
    seen: list[tuple[int, int]] = []
    stream = run_through("run4", 4)
    write_stream(stream, world / "run4.tsv")
    update(world / "model", [world / "run4.tsv"], progress=lambda done, total: seen.append((done, total)))
    assert seen == [(1, 3), (2, 3), (3, 3)]
