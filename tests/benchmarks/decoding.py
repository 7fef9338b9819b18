"""How fast words become beliefs, beside KenLM, hmmlearn and the plain twin, turn by turn in one process.

    python tests/benchmarks/decoding.py [TOKENS]

Five places, 400 visual words, models of order 4; the words are made from a seed, each place prefers words of its own.

scoring    all words under the five models at once; beside kenlm's `full_scores`, one model after the other
filtering  the probabilities of five places into beliefs; beside hmmlearn's `score` in log space
on-line    one word after the other, until the belief is known; beside the dictionaries of placerec/reference.py
"""

import math
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import kenlm
import numpy as np
from hmmlearn.hmm import CategoricalHMM

from placerec import reference
from placerec.hohmm import Recognizer, filter_stream, fixed_transition
from placerec.lm import BackoffModel, count_ngrams, estimate, smoothing, with_unigrams, write_arpa
from placerec.lm.backoff import unite_models

PLACES, WORDS, ORDER, STAY, TURNS = 5, 400, 4, 0.99, 5
NAMES = [f"w{number:03d}" for number in range(WORDS)]


def make_words(tokens: int, place: int, seed: int) -> list[str]:
    """Words in runs; two of three are drawn from the place's own part of the dictionary."""
    rng = np.random.default_rng([seed, place])
    own = place * WORDS // PLACES + np.minimum(rng.geometric(0.04, tokens) - 1, WORDS // PLACES - 1)
    drawn = np.where(rng.random(tokens) < 0.67, own, rng.integers(0, WORDS, tokens))
    moves = rng.random(tokens) >= 0.5
    moves[0] = True
    return [NAMES[word] for word in drawn[np.flatnonzero(moves)[np.cumsum(moves) - 1]].tolist()]


def make_models(tokens: int) -> dict[str, BackoffModel]:
    """One model per place, of a fifth of `tokens` each, in visits of 200 words."""
    models = {}
    for place in range(PLACES):
        words = make_words(tokens // PLACES, place, seed=0)
        visits = [words[start : start + 200] for start in range(0, len(words), 200)]
        counts = count_ngrams(visits, ORDER, vocabulary=NAMES, markers=False)
        model = estimate(counts, smoothing("witten-bell"), non_events=["</s>"])
        models[f"place{place}"] = with_unigrams(model, ["<unk>", "<s>", "</s>"])
    return models


def make_stream(tokens: int) -> list[str]:
    """A run through the places, 100 words in each."""
    parts = [make_words(tokens // PLACES + 100, place, seed=1) for place in range(PLACES)]
    stream: list[str] = []
    while len(stream) < tokens:
        visit = len(stream) // 100
        start = visit // PLACES * 100
        stream += parts[visit % PLACES][start : start + 100]
    return stream[:tokens]


def ratio(ours: Callable[[], object], theirs: Callable[[], object]) -> tuple[float, float, float]:
    """Median seconds of both, measured in turns, and the median of theirs / ours."""
    times = []
    for _ in range(TURNS):
        start = time.perf_counter()
        ours()
        middle = time.perf_counter()
        theirs()
        times.append((middle - start, time.perf_counter() - middle))
    a, b = (statistics.median(column) for column in zip(*times, strict=True))
    return a, b, statistics.median(their / our for our, their in times)


def report(what: str, tokens: int, ours: float, theirs: float, times: float, peer: str) -> None:
    """One line: microseconds per word of both, and how many times faster we are."""
    mine, other = ours / tokens * 1e6, theirs / tokens * 1e6
    print(f"{what:10s} {mine:8.3f} us a word; {peer} {other:8.3f}; {times:.1f} times faster")


def measure_scoring(models: dict[str, BackoffModel], stream: list[str]) -> np.ndarray:
    """Print the scoring line; log10 p (T, C) of the stream."""
    config = kenlm.Config()
    config.show_progress, config.arpa_complain = False, kenlm.ARPALoadComplain.NONE
    union, text = unite_models(list(models.values())), " ".join(stream)
    with tempfile.TemporaryDirectory() as folder:
        peers = []
        for place, model in models.items():
            write_arpa(model, Path(folder) / f"{place}.arpa")
            peers.append(kenlm.Model(str(Path(folder) / f"{place}.arpa"), config))
    scored = union.score(stream)
    theirs = np.array([[p for p, _, _ in peer.full_scores(text, bos=False, eos=False)] for peer in peers]).T
    print(f"           largest difference from KenLM: {abs(scored - theirs).max():.1e}")

    def score_by_kenlm() -> None:
        for peer in peers:
            for _ in peer.full_scores(text, bos=False, eos=False):
                pass

    report("scoring", len(stream), *ratio(lambda: union.score(stream), score_by_kenlm), "kenlm")
    return scored


def measure_filtering(models: dict[str, BackoffModel], stream: list[str]) -> None:
    """Print the filtering line: unigram emissions, since those are what hmmlearn has."""
    transition = fixed_transition(PLACES, STAY)
    log10_p = np.array([[model.log10_p(name) for model in models.values()] for name in NAMES])
    ids = np.array([NAMES.index(name) for name in NAMES])[[int(word[1:]) for word in stream]]
    peer = CategoricalHMM(PLACES, implementation="log")
    peer.startprob_, peer.transmat_ = np.full(PLACES, 1 / PLACES), transition.matrix
    peer.emissionprob_ = 10**log10_p.T / (10**log10_p.T).sum(axis=1, keepdims=True)
    rows, column = log10_p[ids], ids[:, None]
    report(
        "filtering",
        len(stream),
        *ratio(lambda: filter_stream(rows, transition), lambda: peer.score(column)),
        "hmmlearn",
    )


def as_dictionaries(model: BackoffModel) -> reference.Model:
    """The same model for the plain twin."""
    p, weight = {}, {}
    for n in range(1, model.order + 1):
        columns = model.trie.texts(n), model.log10_probs[n - 1].tolist(), model.backoffs[n - 1].tolist()
        for text, log10_p, backoff in zip(*columns, strict=True):
            p[tuple(text.split(" "))] = 10**log10_p
            if not math.isnan(backoff):
                weight[tuple(text.split(" "))] = 10**backoff
    return p, weight


def measure_online(models: dict[str, BackoffModel], stream: list[str]) -> None:
    """Print the on-line line."""
    recognizer = Recognizer(models, transition=fixed_transition(PLACES, STAY))
    twins = [as_dictionaries(model) for model in models.values()]

    def follow() -> None:
        recognizer.reset()
        for word in stream:
            recognizer.update(word)

    report("on-line", len(stream), *ratio(follow, lambda: reference.belief(stream, twins, ORDER, STAY)), "plain twin")


def main(tokens: int) -> None:
    """Print one line per measurement."""
    models, stream = make_models(tokens // 4), make_stream(tokens)
    measure_scoring(models, stream)
    measure_filtering(models, stream)
    measure_online(models, stream[:20_000])


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000)
