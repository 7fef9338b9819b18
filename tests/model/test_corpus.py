"""What TOKENS may be: streams, folders of them, a folder of sentences; and what is wrong with them, and where."""

import json
import re
from pathlib import Path

import pytest
from helpers.small_world import PLACES, VOCABULARY, write_tokens

from placerec.errors import SourceError, StreamError
from placerec.model import ModelOptions, read_corpus, train_lm
from placerec.words import Selection, parse_selection


def write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def refused(message: str, *sources: Path, error: type[Exception] = StreamError, vocabulary: Path | None = None) -> None:
    with pytest.raises(error, match=re.escape(message)):
        read_corpus(sources, selection=Selection(), vocabulary=vocabulary)


def test_a_folder_of_streams_is_read_with_the_vocabulary_beside_them(tmp_path: Path) -> None:
    folder = write_tokens(tmp_path / "tokens")
    corpus = read_corpus([folder], selection=Selection())
    assert list(corpus.sentences) == list(PLACES)
    assert corpus.vocabulary == VOCABULARY
    assert corpus.record.names == ["run1", "run2", "run3"]
    assert corpus.record.dictionary is None
    assert sum(len(visit) for text in corpus.sentences.values() for visit in text) == 180


def test_steps_and_distances_of_all_frames_are_recorded(tmp_path: Path) -> None:
    """Selection leaves words out of the sentences, but no frame out of the steps and distances."""
    head = "place\tword\tdistance\n"
    write(tmp_path / "one.tsv", head + "hall\ta\t1\nhall\ta\t\nkitchen\ta\t2\n\ta\t9\nhall\tb\t0.5\n")
    write(tmp_path / "two.tsv", head + "kitchen\ta\t2.1\nhall\tb\t0\n\tb\t9\n")
    write(tmp_path / "vocab.txt", "a\nb\n")
    corpus = read_corpus([tmp_path / "two.tsv", tmp_path / "one.tsv"], selection=parse_selection("unique"))
    assert corpus.sentences == {"hall": [["b"], ["a"], ["b"]], "kitchen": [["a"]]}
    assert corpus.record.transitions is not None
    assert corpus.record.transitions.tolist() == [[1, 1], [1, 0]]
    assert corpus.record.distances == {"hall": {-8: 1, 0: 1}, "kitchen": {8: 2}}
    learned = [("two", {"hall": 1, "kitchen": 1}), ("one", {"hall": 2, "kitchen": 0})]
    assert [(sequence.name, sequence.visits) for sequence in corpus.record.sequences] == learned


def test_a_folder_of_sentences_has_no_steps(tmp_path: Path) -> None:
    write(tmp_path / "text/hall.txt", "a b\nb\n")
    write(tmp_path / "text/hall-2.txt", "b\n")
    record = read_corpus([tmp_path / "text"], selection=Selection(), vocabulary=write(tmp_path / "v", "a\nb\n")).record
    assert [(sequence.name, sequence.visits) for sequence in record.sequences] == [("text", {"hall": 2, "hall-2": 1})]
    assert (record.transitions, record.distances, record.dictionary) == (None, None, None)


def test_selection_is_applied(tmp_path: Path) -> None:
    text = "place\tword\n" + "".join(f"hall\t{word}\n" for word in "aaabbcaa")
    write(tmp_path / "run.tsv", text)
    write(tmp_path / "vocab.txt", "a\nb\nc\n")
    expected = {"none": "aaabbcaa", "unique": "abca", "subsample:3": "aba", "compress:2": "aabca"}
    for rule, words in expected.items():
        corpus = read_corpus([tmp_path / "run.tsv"], selection=parse_selection(rule))
        assert corpus.sentences == {"hall": [list(words)]}


def test_a_folder_of_sentences_trains_the_same_models(tmp_path: Path) -> None:
    train_lm([write_tokens(tmp_path / "tokens")], tmp_path / "model")
    train_lm([tmp_path / "model/sentences"], tmp_path / "again", vocabulary=tmp_path / "model/vocab.txt")
    # MODEL/vocab.txt stands beside MODEL/sentences.
    train_lm([tmp_path / "model/sentences"], tmp_path / "beside")
    for place in PLACES:
        for name in (f"{place}.arpa", f"counts/{place}.counts", f"sentences/{place}.txt"):
            first = (tmp_path / "model" / name).read_bytes()
            assert first == (tmp_path / "again" / name).read_bytes() == (tmp_path / "beside" / name).read_bytes()


def test_the_dictionary_of_the_tokens_is_recorded(tmp_path: Path) -> None:
    for name, fingerprint in (("a", "f00"), ("b", "f00"), ("c", "ba4")):
        write_tokens(tmp_path / name, [name])
        write(tmp_path / name / "tokens.json", json.dumps({"dictionary": fingerprint}))
    train_lm([tmp_path / "a", tmp_path / "b"], tmp_path / "model")
    assert json.loads((tmp_path / "model/model.json").read_text())["dictionary"] == "f00"
    refused("c: its words are of another dictionary than those of ", tmp_path / "a", tmp_path / "c")
    for broken in ("{", "[]", "{}", "7"):
        write(tmp_path / "a/tokens.json", broken)
        refused("a/tokens.json: is no description of tokens; tokenize again", tmp_path / "a")


def test_missing_things_are_named(tmp_path: Path) -> None:
    folder = write_tokens(tmp_path / "tokens")
    (tmp_path / "empty").mkdir()
    run = folder / "run1.tsv"
    refused("nothing: no such file or folder; token streams (.tsv) are expected", tmp_path / "nothing")
    refused("empty: holds neither token streams (.tsv) nor sentences (PLACE.txt)", tmp_path / "empty")
    refused("empty: holds no token stream (.tsv); `placerec tokenize` makes", tmp_path / "empty", folder)
    folder_of = "but images; `placerec tokenize {} -w words.npz -o tokens/` makes token streams of that"
    for name in ("runs/run1/std_cam/1.jpeg", "kitti/image_0/000000.png", "phone/clip.mp4", "lab/seq1/std_cam/1.png"):
        write(tmp_path / name, "")
        top = tmp_path / name.partition("/")[0]
        write(top / "times.txt", "0.5\n") if "kitti" in name else None
        write(top / "README.txt", "Images of a laboratory.\n") if "lab" in name else None
        said = folder_of.format(top)
        refused(f"{top}: holds neither token streams (.tsv) nor sentences (PLACE.txt), {said}", top)
        refused(f"{top}: holds no token stream (.tsv), {said}", top, folder)
    image, video = tmp_path / "runs/run1/std_cam/1.jpeg", tmp_path / "phone/clip.mp4"
    said = folder_of.format(image.parent).replace("images", "one image", 1)
    refused(f"{image}: is no token stream (.tsv), {said}", image, image.with_name("2.jpeg"))
    said = folder_of.format(video).replace("images", "a recording", 1)
    refused(f"{video}: is no token stream (.tsv), {said}", video)
    words = "words.npz: is no token stream (.tsv); the words.npz of train-words is what -w names"
    refused(words, write(tmp_path / "words.npz", "PK"))
    refused("other.txt: no such file", run, vocabulary=tmp_path / "other.txt")
    refused("holds no word; one word a line is expected", run, vocabulary=write(tmp_path / "v.txt", "\n"))
    (folder / "vocab.txt").unlink()
    refused("tokens/vocab.txt: no such file; the vocabulary (all words, one a line) is named with --vocab FILE", run)


def test_a_model_is_told_from_sentences(tmp_path: Path) -> None:
    folder = write_tokens(tmp_path / "tokens")
    model = tmp_path / "model"
    train_lm([folder], model)
    no_tokens = "model: is a model of train-lm, and no token streams; name "
    refused(f"{no_tokens}the tokens/ that `placerec tokenize` makes of images", model)
    write_tokens(model / "tokens")
    refused(f"{no_tokens}{model}/tokens/", model)
    # Those of the model are read as any.
    assert list(read_corpus([model / "sentences"], selection=Selection()).sentences) == list(PLACES)


@pytest.mark.parametrize(
    ("name", "text", "position"),
    [
        # The frame is called like the word that is wrong two lines below.
        ("run.tsv", "frame\tplace\tword\nzz\thall\ta\n\n9\thall\tzz\n", "run.tsv:4"),
        ("run.tsv", "word\tplace\r\na\thall\r\nzz\thall\r\n", "run.tsv:3"),
        ("run.tsv", "a b\n\na zz\n", "run.tsv:3"),
        ("hall.txt", "## a comment\na b\nzz\n", "hall.txt:3"),
    ],
)
def test_a_word_outside_the_vocabulary_is_found_by_line(tmp_path: Path, name: str, text: str, position: str) -> None:
    write(tmp_path / "in" / name, text)
    vocabulary = write(tmp_path / "vocab.txt", "a\nb\n")
    message = f"in/{position}: the word 'zz' is not in the vocabulary; add it, or remove the line"
    refused(message, tmp_path / "in", vocabulary=vocabulary)


def test_places_are_checked_by_file_and_line(tmp_path: Path) -> None:
    vocabulary = write(tmp_path / "vocab.txt", "a\n")
    slash = write(tmp_path / "slash.tsv", "place\tword\nhall\ta\na/b\ta\n")
    refused("slash.tsv:3: place 'a/b' holds a /; rename it", slash, vocabulary=vocabulary)
    one = write(tmp_path / "one.tsv", "place\tword\n\ta\nhall\ta\n")
    two = write(tmp_path / "two.tsv", "place\tword\nhall\ta\nHall\ta\n")
    with pytest.raises(SourceError, match=r"two\.tsv:3: place 'Hall' differs only in case from 'hall' \(.*one\.tsv:3"):
        read_corpus([one, two], selection=Selection(), vocabulary=vocabulary)
    write(tmp_path / "in" / "two words.txt", "a\n")
    refused(
        "two words.txt: place 'two words' holds white space; rename the file", tmp_path / "in", vocabulary=vocabulary
    )


def test_names_of_sequences(tmp_path: Path) -> None:
    for folder in ("a", "b", "c/a"):
        write_tokens(tmp_path / folder, ["run"])
    corpus = read_corpus([tmp_path / "a/run.tsv", tmp_path / "b/run.tsv"], selection=Selection())
    assert corpus.record.names == ["a-run", "b-run"]
    refused("is named a-run, as ", tmp_path / "a/run.tsv", tmp_path / "c/a/run.tsv")
    refused("run.tsv: is given twice; name each sequence once", tmp_path / "a", tmp_path / "a/run.tsv")


def test_streams_without_labels_cannot_train(tmp_path: Path) -> None:
    write(tmp_path / "run.tsv", "word\na\n")
    write(tmp_path / "vocab.txt", "a\n")
    with pytest.raises(Exception, match="no labelled frame found: label the frames"):
        train_lm([tmp_path / "run.tsv"], tmp_path / "model", options=ModelOptions())
