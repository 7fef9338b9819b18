"""Reading a model as a person would: what is in it, and how it arrives at a probability."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from placerec.errors import LanguageModelError, refuse_string
from placerec.lm.arpa import arpa_files, first_comment, read_with_complaint
from placerec.lm.backoff import BackoffModel
from placerec.lm.check import context_sums, power_of_ten
from placerec.lm.score import Contexts
from placerec.lm.vocabulary import SENTENCE_START


def inspect_model(path: Path | str, ngrams: Sequence[str] = (), *, top: int = 5) -> dict[str, Any]:
    """What an ARPA file holds, as plain data.

    `ngrams_per_order`; `contexts` and their lowest and highest sum; per order the `top` n-grams by joint probability
    (how often the model expects them); for each of `ngrams` (words joined by blanks) its p, step by step, and the `top`
    words most probable after it. `refused_by_kenlm`: what KenLM refuses though SRILM reads it, empty if nothing. Orders
    without n-grams above all others do not count. Raises LanguageModelError for a file that is not ARPA or a word that
    it does not list.
    """
    return _inspected(path, *read_with_complaint(path), ngrams, top)


def inspect_models(folder: Path | str, ngrams: Sequence[str] = (), *, top: int = 5) -> list[dict[str, Any]]:
    """What `inspect_model` tells of each ARPA file in a folder (`arpa_files`), such as MODEL/.

    Each of `ngrams` is explained by the models that list its words, for each dictionary has words of its own. Raises
    LanguageModelError as `inspect_model` does, and for an n-gram whose words no model lists.
    """
    found, left = [], dict.fromkeys(ngrams)
    for path in arpa_files(folder):
        model, refused = read_with_complaint(path)
        own = [ngram for ngram in ngrams if all(word in model for word in ngram.split())]
        found.append(_inspected(path, model, refused, own, top))
        for ngram in own:
            left.pop(ngram, None)
    if left:
        raise LanguageModelError(f"{folder}: no model there has all words of {next(iter(left))!r}")
    return found


def _inspected(path: Path | str, model: BackoffModel, refused: str, ngrams: Sequence[str], top: int) -> dict[str, Any]:
    orders = range(1, model.listed_order + 1)
    sums = np.concatenate([totals for _, _, totals in context_sums(model)])
    try:
        explained = [explain(model, ngram.split(), top=top) for ngram in ngrams]
    except LanguageModelError as error:
        raise LanguageModelError(f"{path}: {error}") from error
    return {
        "path": str(path),
        "comment": first_comment(path),
        "refused_by_kenlm": refused,
        "order": model.listed_order,
        "ngrams_per_order": [len(model.trie.keys[n - 1]) for n in orders],
        "contexts": len(sums),
        "lowest_sum": float(sums.min()),
        "highest_sum": float(sums.max()),
        "most_frequent": [most_frequent(model, n, top) for n in orders],
        "explained": explained,
    }


def most_frequent(model: BackoffModel, n: int, top: int) -> list[dict[str, Any]]:
    """The `top` n-grams of order n by joint probability (that of the context times p of the last word)."""
    joint = model.log10_probs[0].astype(np.float64)
    start = model.trie.vocabulary.index.get(SENTENCE_START)
    if start is not None:
        # <s> is never predicted: what follows it is reached with certainty at the start of a sentence.
        joint[start] = 0.0 if n > 1 else -np.inf
    for k in range(2, n + 1):
        joint = joint[model.trie.prefix(k)] + model.log10_probs[k - 1]
    first = np.argsort(-joint, kind="stable")[:top]
    texts = model.trie.texts(n) if len(first) else []
    return [{"ngram": texts[row], "p": _finite(10 ** float(joint[row]))} for row in first.tolist()]


def explain(model: BackoffModel, words: Sequence[str], *, top: int = 0) -> dict[str, Any]:
    """How the model arrives at p(last word | words before): the contexts it tried, the weights paid, what answered.

    `next`: the `top` words that are most probable after all of them.
    """
    refuse_string(words, LanguageModelError)
    if not words:
        raise LanguageModelError("an n-gram to explain holds no word")
    for word in words:
        if word not in model:
            raise LanguageModelError(f"the word {word!r} is not in the model")
    *history, word = words
    history = history[max(0, len(history) - model.order + 1) :]
    tables, ids = model.tables, model.ids([*history, word])
    digits = tables.digits(ids)
    contexts = Contexts(tables, digits, 0)
    log10_p, answered = tables.find(contexts, digits)
    found = int(answered[-1])
    steps: list[dict[str, Any]] = []
    for k in range(len(history), found - 1, -1):
        context, table = history[len(history) - k :], tables.tables[k - 1]
        row = table.rows.find(contexts.codes[k][-1:])[0]
        steps.append(
            {
                "ngram": " ".join([*context, word]),
                "found": False,
                "context": " ".join(context),
                "context_listed": bool(table.is_context[row]),
                "log10_backoff": _finite(float(table.backoff[row])),
            }
        )
    listed = float(tables.find(contexts, digits, found)[0][-1])
    ngram = " ".join([*history, word][-found:])
    steps.append({"ngram": ngram, "found": True, "log10_p": _finite(listed)})
    total = float(log10_p[-1])
    following = [{"word": after, "p": power_of_ten(p)} for after, p in model.next_words(words, top)]
    return {
        "word": word,
        "history": history,
        "log10_p": _finite(total),
        "p": power_of_ten(total),
        "steps": steps,
        "next": following,
    }


def format_inspection(found: dict[str, Any]) -> str:
    """The inspection as text for people."""
    lines = [f"{found['path']}: order {found['order']}"]
    if found["comment"]:
        lines.append(found["comment"])
    if found["refused_by_kenlm"]:
        lines.append(f"KenLM refuses it: {found['refused_by_kenlm']}")
    lines.append(
        "n-grams  " + ", ".join(f"{count} of order {n}" for n, count in enumerate(found["ngrams_per_order"], 1))
    )
    lines.append(f"contexts {found['contexts']}, each sums to {found['lowest_sum']:.7f} .. {found['highest_sum']:.7f}")
    for n, entries in enumerate(found["most_frequent"], 1):
        if entries:
            lines.append(f"most frequent of order {n}, by the model's own probability")
            lines += [f"  {entry['p']:<12.6g} {entry['ngram']}" for entry in entries]
    for explained in found["explained"]:
        lines += ["", *_explanation(explained)]
    return "\n".join(lines)


def _explanation(explained: dict[str, Any]) -> list[str]:
    given = f" | {' '.join(explained['history'])}" if explained["history"] else ""
    lines = [f"p({explained['word']}{given})"]
    terms = []
    for step in explained["steps"]:
        if step["found"]:
            lines.append(f"  {step['ngram']!r} is listed: log10 p = {_show(step['log10_p'])}")
            terms.append(_show(step["log10_p"]))
        elif step["context_listed"]:
            lines.append(
                f"  {step['ngram']!r} is not listed: back off from {step['context']!r},"
                f" weight {_show(step['log10_backoff'])}"
            )
            terms.append(_show(step["log10_backoff"]))
        else:
            lines.append(f"  {step['ngram']!r} is not listed, nor is its context {step['context']!r}: nothing to pay")
    lines.append(f"  log10 p = {' + '.join(terms)} = {_show(explained['log10_p'])}, p = {explained['p']:.7g}")
    if explained["next"]:
        context = " ".join([*explained["history"], explained["word"]])
        lines.append(f"most probable after {context!r}")
        lines += [f"  {entry['p']:<12.6g} {entry['word']}" for entry in explained["next"]]
    return lines


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _show(value: float | None) -> str:
    return "-inf" if value is None else f"{value:.7g}"
