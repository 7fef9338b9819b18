"""disambig and hidden-ngram: sums over all sequences by hand."""

import itertools
import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from helpers.srilm_runs import call

from placerec.lm import BackoffModel, read_arpa
from placerec.srilm.model.trellis import Step, best_path, best_paths, forward, total_log10_p

MODEL = """
\\data\\
ngram 1=5
ngram 2=5

\\1-grams:
-0.7\t</s>
-99\t<s>\t-0.2
-0.5\thall\t-0.1
-0.4\troom\t-0.3
-0.9\tcut\t-0.25

\\2-grams:
-0.3\t<s> room
-0.4\troom room
-0.6\troom cut
-0.15\tcut hall
-0.5\thall </s>

\\end\\
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("m.lm").write_text(MODEL)
    Path("m.map").write_text("f1 room 0.5 hall 0.1\nf2 hall 0.7 room 0.2\n")
    Path("t.txt").write_text("f1 f2 f1\n")
    Path("e.txt").write_text("cut\n")
    Path("w.txt").write_text("room room hall hall\n")
    return tmp_path


CHOICES = {"f1": {"room": 0.5, "hall": 0.1}, "f2": {"hall": 0.7, "room": 0.2}}


def all_hidden(model: BackoffModel, text: Sequence[str]) -> Iterator[tuple[float, tuple[str, ...]]]:
    """log10 of the joint probability of a text and each hidden sequence, one by one."""
    for hidden in itertools.product(*(CHOICES[word] for word in text)):
        words = ["<s>", *hidden, "</s>"]
        total = sum(model.log10_p(word, words[:i]) for i, word in enumerate(words) if i)
        yield total + sum(math.log10(CHOICES[w][v]) for w, v in zip(text, hidden, strict=True)), hidden


def test_disambig_finds_the_best_of_all_sequences_and_their_sum(folder: Path) -> None:
    ranked = sorted(all_hidden(read_arpa("m.lm"), ["f1", "f2", "f1"]), reverse=True)
    _, out, _ = call("disambig", "-map", "m.map", "-text", "t.txt", "-lm", "m.lm", "-nbest", "8")
    found = re.findall(r"NBEST_\d (-[\d.]+) <s> (.*) </s>", out)
    assert [tuple(words.split()) for _, words in found] == [hidden for _, hidden in ranked]
    assert [float(score) for score, _ in found] == pytest.approx([score for score, _ in ranked], abs=2e-5)
    _, out, _ = call("disambig", "-map", "m.map", "-text", "t.txt", "-lm", "m.lm", "-totals", "-fb")
    assert float(out) == pytest.approx(math.log10(sum(10**score for score, _ in ranked)), abs=1e-5)
    _, out, _ = call("disambig", "-map", "m.map", "-text", "t.txt", "-lm", "m.lm", "-posteriors", "-fb")
    whole = sum(10**score for score, _ in ranked)
    room = sum(10**score for score, hidden in ranked if hidden[1] == "room") / whole
    assert float(re.search(r"f2\t hall \S+ room (\S+)", out)[1]) == pytest.approx(room, abs=1e-5)  # type: ignore[index]


def test_hidden_ngram_finds_the_best_of_all_events_and_their_sum(folder: Path) -> None:
    model, words = read_arpa("m.lm"), ["room", "room", "hall", "hall"]
    scores = []
    for events in itertools.product([True, False], repeat=4):
        line, total = [words[0]], 0.0
        for i, event in enumerate(events):
            if i:
                total += model.log10_p(words[i], line)
                line.append(words[i])
            if event:
                total += model.log10_p("cut", line)
                line.append("cut")
        scores.append((total, line))
    arguments = ("-text", "w.txt", "-lm", "m.lm", "-hidden-vocab", "e.txt")
    assert call("hidden-ngram", *arguments)[1].split() == max(scores)[1]
    total = float(call("hidden-ngram", *arguments, "-totals", "-fb")[1])
    assert total == pytest.approx(math.log10(sum(10**score for score, _ in scores)), abs=1e-5)


def test_the_n_best_paths_begin_with_the_best_and_are_all_paths_once() -> None:
    random = np.random.default_rng(1)
    steps = []
    for before, after in ((1, 3), (3, 3), (3, 2)):
        costs = -random.random((after, before)).astype(np.float32)
        steps.append(Step(costs, np.repeat(np.arange(after)[:, None], before, axis=1), np.arange(after)))
    paths = [path for path in best_paths(steps, 100) if path.log10_p > -np.inf]
    assert len({tuple(path.labels) for path in paths}) == len(paths) == 18
    assert [path.log10_p for path in paths] == sorted((path.log10_p for path in paths), reverse=True)
    best = best_path(steps, forward(steps, summed=False))
    assert best.labels == paths[0].labels
    summed = total_log10_p(forward(steps, summed=True)[-1])
    assert summed == pytest.approx(math.log10(sum(10**path.log10_p for path in paths)), abs=1e-5)


def test_events_and_hidden_words_that_cannot_be_are_told_by_line(folder: Path) -> None:
    Path("none.map").write_text("f1\n")
    Path("two.txt").write_text("\nf1 f1\nf2\n")
    status, out, err = call("disambig", "-map", "none.map", "-text", "two.txt", "-lm", "m.lm")
    assert (status, out, err) == (0, "<s> <unk> </s>\n", "two.txt: line 2: Disambiguation failed\n")


@pytest.mark.parametrize("number", ["-0.5", "inf", "nan"])
def test_a_map_with_a_number_that_is_no_probability_is_refused(number: str, folder: Path) -> None:
    Path("bad.map").write_text(f"f1 room 0.5\nf2 hall {number}\n")
    status, out, err = call("disambig", "-map", "bad.map", "-text", "t.txt", "-lm", "m.lm", "-write-counts", "c")
    assert (status, out) == (1, "")
    assert err == f"bad.map: line 2: {number} is not a probability for hall\n"
    assert not Path("c").exists()


def test_too_long_lines_are_left_out_and_nul_joins_lines(folder: Path) -> None:
    Path("odd.txt").write_bytes(b"f1 " * 50001 + b"\nf1 f\0 lost\n2\n")
    status, out, err = call("disambig", "-map", "m.map", "-text", "odd.txt", "-lm", "m.lm", "-no-eos")
    assert (status, err) == (0, "odd.txt: line 1: too many words per sentence\n")
    assert len(out.split()) == 3


def test_nothing_to_read_is_nothing_to_do(folder: Path) -> None:
    assert call("disambig") == call("hidden-ngram") == (0, "", "")
    Path("empty").write_text("")
    for tool in ("disambig", "hidden-ngram"):
        assert call(tool, "-text", "empty", "-lm", "m.lm", "-posteriors") == (0, "", "")
        assert call(tool, "-text-map", "empty", "-lm", "m.lm", "-continuous") == (0, "", "")


@pytest.mark.parametrize("weight", [["-mapw", "0"], ["-lmw", "nan"]])
def test_what_cannot_be_stays_impossible_whatever_it_weighs(weight: list[str], folder: Path) -> None:
    Path("zero.map").write_text("f1 room 0\n")
    Path("one.txt").write_text("f1\n")
    found = call("disambig", "-map", "zero.map", "-text", "one.txt", "-lm", "m.lm", "-write-counts", "c", *weight)
    assert found == (0, "", "one.txt: line 1: Disambiguation failed\n")


def test_a_text_that_repeats_itself_is_decoded_line_by_line_as_alone(folder: Path) -> None:
    lines = ["f1 f2 f1", "f2", "f1 f1 f2 f9", "f1 f2 f1"]
    Path("all.txt").write_text("".join(f"{line}\n" for line in lines))
    arguments = ["disambig", "-map", "m.map", "-lm", "m.lm", "-order", "3", "-fb", "-posteriors", "-text"]
    alone = ""
    for line in lines:
        Path("alone.txt").write_text(f"{line}\n")
        alone += call(*arguments, "alone.txt")[1]
    assert call(*arguments, "all.txt")[1] == alone


def test_classes_of_single_words_are_seen_through(folder: Path) -> None:
    Path("c.classes").write_text("room 0.25 bed\nroom 0.75 bath\n")
    Path("words.txt").write_text("bed bath hall hall\n")
    arguments = ["hidden-ngram", "-lm", "m.lm", "-hidden-vocab", "e.txt", "-text"]
    _, plain, _ = call(*arguments, "w.txt", "-nbest", "2")
    status, out, err = call(*arguments, "words.txt", "-nbest", "2", "-classes", "c.classes", "-simple-classes")
    assert (status, err) == (0, "")
    assert out.count("bed") == 2
    best, other = (re.findall(r"NBEST_\d (-[\d.]+)", text) for text in (plain, out))
    # The first word costs nothing, so only the second word's share of the class is there.
    assert [float(p) for p in other] == pytest.approx([float(p) + math.log10(0.75) for p in best], abs=1e-5)


def test_models_over_classes_are_mixed_with_fixed_weights(folder: Path) -> None:
    Path("c.classes").write_text("room 0.25 bed\nroom 0.75 bath\n")
    Path("words.txt").write_text("bed bath hall hall\n")
    arguments = ["hidden-ngram", "-lm", "m.lm", "-hidden-vocab", "e.txt", "-text", "words.txt", "-nbest", "2"]
    arguments += ["-classes", "c.classes", "-simple-classes"]
    _, alone, _ = call(*arguments)
    # A model mixed with itself stays what it is.
    status, mixed, err = call(*arguments, "-mix-lm", "m.lm", "-bayes", "0")
    assert (status, err) == (0, "")
    assert re.sub(r"-[\d.]+", "", mixed) == re.sub(r"-[\d.]+", "", alone)
    scores, expected = (list(map(float, re.findall(r"NBEST_\d (-[\d.]+)", text))) for text in (mixed, alone))
    assert scores == pytest.approx(expected, abs=1e-5)
    status, _, err = call(*arguments, "-mix-lm", "m.lm")
    assert (status, err) == (2, "with -classes only -bayes 0 mixes models while scoring\n")


CLASS_MODEL = """
\\data\\
ngram 1=6
ngram 2=5

\\1-grams:
-0.6\t</s>
-99\t<s>\t-0.2
-0.7\tROOM\t-0.1
-0.8\tHALL\t-0.3
-1.1\tw4\t-0.15
-0.9\tcut\t-0.25

\\2-grams:
-0.4\tROOM cut
-0.3\tcut HALL
-0.5\tROOM ROOM
-0.45\tHALL w4
-0.35\tw4 cut

\\end\\
"""


def test_events_stand_between_words_of_classes_that_tell_themselves(folder: Path) -> None:
    Path("c.lm").write_text(CLASS_MODEL)
    Path("c.classes").write_text("ROOM 0.75 w1\nROOM 0.25 w2\nHALL 1 w3\n")
    Path("w.txt").write_text("w1 w2 w3 w4\nw2 w2 w1 w3 w3\nw9 w1\n")
    arguments = ["hidden-ngram", "-lm", "c.lm", "-order", "2", "-hidden-vocab", "e.txt", "-text", "w.txt"]
    for options in ([], ["-fb", "-posteriors"], ["-nbest", "3"]):
        results = [call(*arguments, "-classes", "c.classes", *more, *options) for more in ([], ["-simple-classes"])]
        assert re.sub(r"[-\d.]+", "N", results[0][1]) == re.sub(r"[-\d.]+", "N", results[1][1])
        numbers = [[float(n) for n in re.findall(r"(?<= )-?\d\S*", out)] for _, out, _ in results]
        assert numbers[0] == pytest.approx(numbers[1], abs=2e-5)


def test_events_stand_between_words_that_classes_explain_in_several_ways(folder: Path) -> None:
    """All placements of events together, each scored by `ngram -classes`: expansions of two words are cut by none."""
    Path("c.lm").write_text(CLASS_MODEL)
    Path("c.classes").write_text("ROOM 0.5 w1\nROOM 0.5 w1 w4\nHALL 0.6 w4\nHALL 0.4 w3 w4\n")
    words = ["w1", "w4", "w3", "w4"]
    Path("w.txt").write_text(" ".join(words) + "\n")
    arguments = ["-order", "4", "-lm", "c.lm", "-classes", "c.classes"]
    total = 0.0
    for placed in itertools.product(("", " cut"), repeat=len(words)):
        Path("one.txt").write_text("".join(f" {word}{event}" for word, event in zip(words, placed, strict=True)))
        out = call("ngram", *arguments, "-no-sos", "-no-eos", "-debug", "2", "-ppl", "one.txt")[1]
        scored = [10 ** float(p) for p in re.findall(r"\[ (\S+) \]\n", out)]
        total += math.prod(scored[1:])
    status, out, err = call("hidden-ngram", *arguments, "-hidden-vocab", "e.txt", "-text", "w.txt", "-fb", "-totals")
    assert (status, err) == (0, "")
    assert float(out) == pytest.approx(math.log10(total), abs=1e-4)
