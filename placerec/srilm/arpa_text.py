"""Models as ARPA text, whatever n-grams they list: `ngram -write-lm`."""

from collections.abc import Iterator

import numpy as np

from placerec.lm.arpa import format_arpa
from placerec.lm.arpa_text import LOG_ZERO
from placerec.lm.draft import Draft
from placerec.lm.trie import Ints


def format_draft(draft: Draft) -> str:
    """The ARPA text of a model, as `format_arpa` writes it.

    Unlike there, an n-gram may be listed though its first words are not: SRILM reads and writes such files.
    """
    if _regular(draft):
        return format_arpa(draft.model())
    lines = ["\n\\data\\\n", *(f"ngram {n}={int(its.sum())}\n" for n, its in enumerate(draft.stored, start=1))]
    contexts = np.zeros(1, np.int64)
    for n, ranks in enumerate(draft.trie.context_ranks(), start=1):
        lines.append(f"\n\\{n}-grams:\n")
        rows = np.flatnonzero(draft.stored[n - 1])
        prefix = draft.trie.prefix(n)[rows] if n > 1 else np.zeros(len(rows), np.int64)
        lines += _section(draft, n, rows[np.lexsort((draft.trie.word(n)[rows], contexts[prefix]))])
        contexts = ranks
    return "".join([*lines, "\n\\end\\\n"])


def _regular(draft: Draft) -> bool:
    """Whether the first words of every n-gram are listed too, and its last one, and every number is one."""
    for n in range(2, draft.order + 1):
        stored = draft.stored[n - 1]
        if not draft.stored[n - 2][draft.trie.prefix(n)[stored]].all():
            return False
        if not draft.stored[0][draft.trie.word(n)[stored]].all():
            return False
    numbers = [*(its[node] for its, node in zip(draft.backoff, draft.node, strict=True)), *draft.log10_p]
    return not any(np.isnan(its).any() for its in numbers)


def _section(draft: Draft, n: int, rows: Ints) -> Iterator[str]:
    texts = draft.trie.texts(n)
    for row in rows.tolist():
        weight = f"\t{_shown(draft.backoff[n - 1][row])}" if draft.node[n - 1][row] else ""
        yield f"{_shown(draft.log10_p[n - 1][row])}\t{texts[row]}{weight}\n"


def _shown(value: np.float32) -> str:
    return f"{LOG_ZERO if value == -np.inf else float(value):.7g}"
