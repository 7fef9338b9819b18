"""SRILM's tools on places: the same answers as placerec's own where the models are the same."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from helpers.small_world import PLACES, VOCABULARY, run_through
from helpers.srilm_runs import call

from placerec.arrays import Floats
from placerec.hohmm import Recognizer, Transition
from placerec.lm import BackoffModel, count_ngrams, estimate, smoothing
from placerec.words import Selection, sentences_per_place


def place_models() -> dict[str, BackoffModel]:
    """Unigrams of the places of one run."""
    sentences = sentences_per_place([run_through("training", 1)], Selection())
    return {
        place: estimate(
            count_ngrams(text, 1, vocabulary=VOCABULARY, markers=False), smoothing("witten-bell"), non_events=["</s>"]
        )
        for place, text in sentences.items()
    }


def place_language_model(matrix: Floats) -> str:
    """An ARPA model of the places: a uniform start, then the transitions."""
    p = np.log10(matrix)
    pairs = [f"{p[i, j]:.7g}\t{one} {other}" for i, one in enumerate(PLACES) for j, other in enumerate(PLACES)]
    starts = [f"{-np.log10(len(PLACES)):.7g}\t<s> {place}" for place in PLACES]
    single = ["-99\t</s>", "-99\t<s>\t0", *(f"-99\t{place}\t0" for place in PLACES)]
    counts = f"\\data\\\nngram 1={len(single)}\nngram 2={len(pairs) + len(starts)}\n"
    return "\n".join([counts, "\\1-grams:", *single, "", "\\2-grams:", *starts, *pairs, "", "\\end\\\n"])


@pytest.mark.parametrize("seed", range(6))
def test_disambig_finds_the_places_that_viterbi_decoding_finds(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(seed)
    matrix = rng.dirichlet(np.ones(len(PLACES)), size=len(PLACES)) / 10 + 0.9 * np.eye(len(PLACES))
    models = place_models()
    Path("places.lm").write_text(place_language_model(matrix))
    lines = []
    for word in VOCABULARY:
        shares = [f"{place} {10 ** models[place].log10_p(word, ()):.9g}" for place in PLACES]
        lines.append(f"{word} {' '.join(shares)}\n")
    Path("words.map").write_text("".join(lines))
    streams = [run_through(f"run{k}", 100 * seed + k) for k in range(3)]
    Path("words.txt").write_text("".join(" ".join(stream.words) + "\n" for stream in streams))
    command = ["-map", "words.map", "-text", "words.txt", "-lm", "places.lm", "-order", "2", "-no-eos"]
    status, out, error = call("disambig", *command)
    assert (status, error) == (0, "")
    recognizer = Recognizer({place: models[place] for place in PLACES}, transition=Transition(matrix))
    changes = 0
    for stream, line in zip(streams, out.splitlines(), strict=True):
        best = recognizer.decode(stream, viterbi=True).best
        assert line.split()[1:] == list(best)
        changes += sum(a != b for a, b in pairwise(best))
    assert changes > 6
    # Decided frame by frame, by all words of the sequence, places are those of smoothing.
    _, out, _ = call("disambig", *command, "-fb")
    smoothed = [list(recognizer.decode(stream, smooth=True).best) for stream in streams]
    assert [line.split()[1:] for line in out.splitlines()] == smoothed
