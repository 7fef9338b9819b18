"""Is a model right? Every context must sum to 1, and KenLM must give every word of any stream the same probability.

KenLM is an independent scorer: optional, never the trainer.
"""

import math
import re
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from placerec.arrays import Floats, Ints, Mask
from placerec.errors import LanguageModelError, check_optional
from placerec.lm.arpa import read_with_complaint, with_unigrams, write_arpa
from placerec.lm.backoff import BackoffModel
from placerec.lm.logs import ABOUT_LOG_ZERO
from placerec.lm.trie import Trie, per_context
from placerec.lm.vocabulary import SENTENCE_END, SENTENCE_START, UNKNOWN

# Half a unit of the seventh digit for each of the terms that a context's sum is made of.
SUM_TOLERANCE = 1e-5
# KenLM adds float32 numbers, we add float64 ones: `float32` keeps 7 digits of values up to 100.
AGREEMENT_TOLERANCE = 2e-6
_LARGEST_POWER = 308
KENLM_MAX_ORDER = 6
KENLM_PURPOSE = "scoring with KenLM"
_REASON = re.compile(r" threw [\w:]+(?: because `.*?')?\. (.*?)(?: Byte: \d+)?\)$", re.DOTALL)
Scorer = Callable[[Sequence[str]], Floats]


@dataclass(frozen=True)
class ModelCheck:
    """What `check_model` found in one file."""

    path: str
    order: int
    contexts: int
    lowest_sum: float
    highest_sum: float
    worst_context: str
    tokens: int
    largest_difference: float | None  # None: KenLM does not do this order, or does not load any copy of the model
    refused: str = ""  # what KenLM refuses in the file, with the place

    @property
    def ok(self) -> bool:
        """Whether sums and probabilities are within the tolerances."""
        sums = max(abs(self.lowest_sum - 1), abs(self.highest_sum - 1)) <= SUM_TOLERANCE
        return sums and (self.largest_difference is None or self.largest_difference <= AGREEMENT_TOLERANCE)

    def sentence(self) -> str:
        """The check in a line for people."""
        sums = f"{self.contexts} contexts sum to {self.lowest_sum:.7f} .. {self.highest_sum:.7f}"
        if self.largest_difference is not None:
            scores = f"KenLM agrees on {self.tokens} tokens, largest difference {self.largest_difference:.1e}"
        else:
            scores = "not compared" if self.refused else f"KenLM does no order above {KENLM_MAX_ORDER}, not compared"
        if self.refused:
            scores = f"KenLM refuses it ({self.refused}), SRILM reads it; {scores}"
        verdict = "ok" if self.ok else f"FAIL (worst context: {self.worst_context})"
        return f"{self.path}: order {self.order}: {sums}; {scores}: {verdict}"


def context_sums(model: BackoffModel) -> Iterator[tuple[int, Ints, Floats]]:
    """Per order: n, the rows (m,) of order n-1 that are contexts, and the sum (m,) over all words of p(word | context).

    <s> is not predicted and left out; the empty context comes first, as row 0 of order 0.
    """
    with np.errstate(over="ignore"):
        word_p = [np.power(10.0, log10_p.astype(np.float64)) for log10_p in model.log10_probs]
    start = model.trie.vocabulary.index.get("<s>", -1)
    if start >= 0:
        word_p[0][start] = 0.0
    total = np.array([word_p[0].sum()])
    yield 1, np.zeros(1, np.int64), total
    for n in range(2, model.order + 1):
        prefix, suffix = model.trie.prefix(n), model.trie.suffixes[n - 1]
        size = len(model.trie.keys[n - 2])
        # What the shorter context gives the same words, which the longer one overrules. A suffix that the file leaves
        # out has its backed-off value.
        shorter = np.where(suffix >= 0, word_p[n - 2][suffix], _backed_off_p(model, n, suffix < 0))
        context_suffix = model.trie.suffixes[n - 2] if n > 2 else np.zeros(size, np.int64)
        shorter_total = np.where(context_suffix >= 0, total[context_suffix], 1.0)
        with np.errstate(over="ignore"):
            weight = np.power(10.0, np.nan_to_num(model.backoffs[n - 2].astype(np.float64), nan=0.0, neginf=-np.inf))
        seen = per_context(prefix, size, word_p[n - 1])
        total = seen + weight * (shorter_total - per_context(prefix, size, shorter))
        rows = np.flatnonzero(~np.isnan(model.backoffs[n - 2]) | (np.bincount(prefix, minlength=size) > 0))
        yield n, rows, total[rows]


def power_of_ten(value: float) -> float:
    """10 to the power of `value`; a file's weights may be beyond what float64 holds, which gives inf."""
    return 10.0**value if value < _LARGEST_POWER else math.inf


def _backed_off_p(model: BackoffModel, n: int, rows: Mask) -> Floats:
    """p float64 (m_n,) of the masked n-grams of order n without their first word, word by word; 0 elsewhere."""
    p = np.zeros(len(rows))
    texts = model.trie.texts(n) if rows.any() else []
    for row in np.flatnonzero(rows).tolist():
        words = texts[row].split(" ")
        p[row] = power_of_ten(model.log10_p(words[-1], words[1:-1]))
    return p


def generated_stream(model: BackoffModel, length: int, seed: int = 0) -> list[str]:
    """`length` words to compare scorers on: listed n-grams, so that all orders answer, and random words."""
    generator = np.random.Generator(np.random.PCG64(seed))
    plain = [word for word in model.words if word not in ("<s>", "</s>", "<unk>")]
    if not plain:
        raise LanguageModelError("the model lists no word but its markers; there is nothing to score")
    texts = model.trie.texts(model.listed_order)
    listed = [text for text in texts if not {"<s>", "</s>", "<unk>"} & set(text.split(" "))]
    words: list[str] = []
    while len(words) < length:
        if listed and generator.random() < 0.7:
            words += listed[int(generator.integers(len(listed)))].split(" ")
        else:
            words.append(plain[int(generator.integers(len(plain)))])
    return words[:length]


def check_model(path: Path | str, *, tokens: int = 2000, seed: int = 0) -> ModelCheck:
    """Check one ARPA file: the sum of every context, and KenLM's log10 p of every token of a generated stream.

    Orders above 6 are not compared (KenLM's limit); what KenLM refuses though SRILM reads it, order 1 for one, is
    compared through a copy that KenLM loads, if there can be one. Raises LanguageModelError for an unreadable file,
    MissingExtraError without KenLM.
    """
    model, refused = read_with_complaint(path)
    if model.listed_order <= KENLM_MAX_ORDER:
        check_optional("kenlm", KENLM_PURPOSE)
    sums, names = [], []
    for n, rows, totals in context_sums(model):
        worst = int(np.argmax(np.abs(totals - 1))) if len(totals) else 0
        if len(totals):
            sums.append(totals)
            names.append((float(totals[worst]), model.trie.texts(n - 1)[int(rows[worst])] if n > 1 else "(empty)"))
    every = np.concatenate(sums)
    words = generated_stream(model, tokens, seed)
    difference = None
    refused = refused or _missing_marker(path, model)
    if model.listed_order <= KENLM_MAX_ORDER:
        try:
            ours, theirs = model.score(words), kenlm_scorer(path)(words)
        except LanguageModelError as error:
            refused = refused or str(error)
        else:
            nowhere = (ours < ABOUT_LOG_ZERO) & (theirs < ABOUT_LOG_ZERO)
            difference = float(np.abs(np.where(nowhere, 0.0, ours) - np.where(nowhere, 0.0, theirs)).max(initial=0.0))
    return ModelCheck(
        path=str(path),
        order=model.listed_order,
        contexts=len(every),
        lowest_sum=float(every.min()),
        highest_sum=float(every.max()),
        worst_context=max(names, key=lambda name: abs(name[0] - 1))[1],
        tokens=len(words) if difference is not None else 0,
        largest_difference=difference,
        refused=refused,
    )


def kenlm_scorer(path: Path | str) -> Scorer:
    """A function that gives KenLM's log10 p float64 (T,) of T words: empty first context, no markers.

    What KenLM refuses though it could do the model, order 1 for one, is loaded through a temporary copy. Raises
    MissingExtraError if KenLM is not installed, LanguageModelError for a file that it cannot load.
    """
    check_optional("kenlm", KENLM_PURPOSE)
    import kenlm

    config = kenlm.Config()
    config.show_progress = False
    config.arpa_complain = kenlm.ARPALoadComplain.NONE
    read, refused = read_with_complaint(path)
    order = read.listed_order
    if order > KENLM_MAX_ORDER:
        raise LanguageModelError(
            f"{path}: order {order}; KenLM scores orders up to {KENLM_MAX_ORDER}; use the native scorer"
        )
    with tempfile.TemporaryDirectory() as folder:
        loadable = Path(path)
        if order == 1 or refused or read.order > KENLM_MAX_ORDER or _missing_marker(path, read):
            loadable = Path(folder) / "copy.arpa"
            write_arpa(_loadable(read), loadable)
        try:
            model = kenlm.Model(str(loadable), config)
        except OSError as error:
            # Its message names the file that it was given, and the lines of its sources.
            match = _REASON.search(str(error))
            reason = (match[1] if match else str(error).splitlines()[0]).strip()
            raise LanguageModelError(f"{path}: KenLM cannot load it: {reason}") from error

    def score(words: Sequence[str]) -> Floats:
        return np.array([p for p, _, _ in model.full_scores(" ".join(words), bos=False, eos=False)], np.float64)

    return score


def _missing_marker(path: Path | str, model: BackoffModel) -> str:
    """What KenLM says of a model that lacks <s> or </s>, an empty text if there are both."""
    missing = [marker for marker in (SENTENCE_START, SENTENCE_END) if marker not in model]
    return f"{path}: {missing[0]} is not among the 1-grams" if missing else ""


def _loadable(model: BackoffModel) -> BackoffModel:
    """The model with KenLM's words, without orders that KenLM does not do, and of order 2 at least."""
    order = min(model.order, KENLM_MAX_ORDER)
    trie = Trie(model.trie.vocabulary, model.trie.keys[:order])
    model = BackoffModel(trie, model.log10_probs[:order], model.backoffs[:order])
    model = with_unigrams(model, [word for word in (SENTENCE_START, SENTENCE_END, UNKNOWN) if word not in model])
    backoffs = list(model.backoffs)
    if order > 1:
        backoffs[-1] = np.full(len(backoffs[-1]), np.nan, np.float32)
        return replace(model, backoffs=tuple(backoffs))
    index = model.trie.vocabulary.index
    bigram = np.array([index[SENTENCE_START] * len(model.trie.vocabulary) + index[SENTENCE_END]])
    weight = np.where(np.isnan(backoffs[0]), np.float32(0), backoffs[0])
    return BackoffModel(
        Trie(model.trie.vocabulary, (model.trie.keys[0], bigram)),
        (model.log10_probs[0], np.full(1, -np.inf, np.float32)),
        (weight, np.full(1, np.nan, np.float32)),
    )
