"""select-vocab: the words of several corpora, weighted so that a held-out text becomes probable.

SRILM's manual page select-vocab, and A. Venkataraman and W. Wang, "Techniques for effective vocabulary selection",
Eurospeech 2003: the relative frequencies of the corpora are mixed, word by word, with the weights under which the
held-out text is most probable.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from placerec.arrays import Floats
from placerec.lm.vocabulary import SENTENCE_END, SENTENCE_START, UNKNOWN
from placerec.srilm.text.numbers import whole_float
from placerec.srilm.text.streams import SrilmError, Streams, exit_status, tokens
from placerec.srilm.tools.assignments import records
from placerec.srilm.tools.compute_best_mix import best_mix
from placerec.srilm.tools.lm_scripts import arpa_lines, p_of_line
from placerec.srilm.tools.options import Option, parse

TOOL = "select-vocab"
OPTIONS = {
    "heldout": Option("string", None, "the text that is to become probable"),
    "quiet": Option("flag", False, "say nothing of the search"),
    "scale": Option("float", 1e6, "what weights are multiplied by"),
}
_PRECISION = 0.001
_MARKERS = {SENTENCE_START, SENTENCE_END, UNKNOWN}


@exit_status
def select_vocab(arguments: Sequence[str], streams: Streams, tool: str = TOOL) -> int:
    """Print all words of the corpora, each with its weight."""
    options = parse(tool, OPTIONS, arguments, streams)
    if not options["heldout"] or not options.rest:
        raise SrilmError(f"usage: {tool} [-quiet] [-scale N] -heldout FILE CORPUS ...  (texts, counts, or models)", 2)
    held_out = frequencies(options["heldout"], streams, tool)
    corpora = [frequencies(name, streams, tool) for name in options.rest]
    words = sorted(set().union(*corpora))
    p = np.array([shares(corpus, words) for corpus in corpora])
    counts = np.array([held_out.get(word, 0.0) for word in words])
    # Of words that no corpus gives any probability nothing is learned.
    tested = (counts > 0) & p.any(axis=0)
    start = [1 / len(corpora)] * len(corpora)
    weights, steps = best_mix(p[:, tested], start, _PRECISION, counts=counts[tested])
    if not options["quiet"]:
        for number, step in enumerate(steps, start=1):
            shown = " ".join(f"{weight:g}" for weight in step.weights)
            streams.say(f"iteration {number}, weights = ({shown}), log likelihood = {step.loglik:g}")
        pairs = zip(options.rest, weights.tolist(), strict=True)
        streams.say("weights: " + ", ".join(f"{name} {weight:g}" for name, weight in pairs))
    mixed = (options["scale"] * (weights @ p)).tolist()
    streams.print("".join(f"{word}\t{value:.6f}\n" for word, value in zip(words, mixed, strict=True)))
    return 0


def shares(corpus: Mapping[str, float], words: Sequence[str]) -> Floats:
    """The relative frequencies of words, float64 (V,); all 0 in a corpus without words."""
    counts = np.array([corpus.get(word, 0.0) for word in words])
    relative: Floats = counts / max(counts.sum(), np.finfo(np.float64).tiny)
    return relative


def frequencies(name: str, streams: Streams, tool: str) -> dict[str, float]:
    """How often a corpus has each word: of a model its probabilities, of counts those of single words, else of a text.

    Which of these a file is its lines tell: a model has `\\data\\`, counts end in a number, all of them.
    """
    text: Counter[str] = Counter()
    counts: dict[str, float] | None = {}
    skipped = 1 if name.endswith(".sentid") else 0
    lines = enumerate(records(name, streams), start=1)
    for _, line in lines:
        if line.startswith("\\data\\"):
            return _spoken(
                {
                    found.ngram[0]: p_of_line(found, tool)
                    for found in arpa_lines(lines, name, tool)
                    if found.order == 1 and found.ngram
                }
            )
        fields = tokens(line)
        text.update(fields[skipped:])
        count = whole_float(fields[-1]) if len(fields) > 1 else None
        if fields and (count is None or not 0 <= count < math.inf):
            counts = None
        elif len(fields) == 2 and counts is not None and count is not None:
            counts[fields[0]] = counts.get(fields[0], 0.0) + count
    return _spoken(text if counts is None else counts)


def _spoken(frequencies: Mapping[str, float]) -> dict[str, float]:
    """The frequencies without those of what is no word."""
    return {word: float(value) for word, value in frequencies.items() if word not in _MARKERS}
