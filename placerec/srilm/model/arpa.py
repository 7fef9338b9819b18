"""ARPA files as SRILM reads them: tolerantly, with warnings; section 8 of our SRILM specification."""

from collections.abc import Sequence

import numpy as np

from placerec.arrays import Ints
from placerec.lm.arpa import row_blocks
from placerec.lm.mutable import MutableModel
from placerec.lm.score import ScoreTables
from placerec.lm.trie import closed_trie
from placerec.srilm.model.arpa_lines import Block
from placerec.srilm.model.arpa_reader import Reader
from placerec.srilm.order.contexts import NEVER, ContextTimes
from placerec.srilm.text.streams import Streams
from placerec.srilm.text.vocabulary import WordList


def read_model(
    name: str,
    words: WordList,
    streams: Streams,
    *,
    order: int,
    debug: int = 0,
    limited: bool = False,
    what: str = "lm file",
    cased: bool = False,
) -> tuple[MutableModel, ContextTimes]:
    """Read an ARPA file up to `order`, adding its words to `words`, and say what is odd about it.

    `limited`: n-grams with other words than those of `words` are left out. `cased`: messages show words as they are in
    the file. Raises SrilmError, calling the file a `what`, if it cannot be used.
    """
    expected = len(words.index)
    reader = Reader(name, words, streams, order, limited)
    reader.cased = {} if cased else None
    reader.read()
    model, times = assemble(reader, expected)
    reader.finish(debug, what)
    return model, times


def assemble(reader: Reader, expected: int = 0) -> tuple[MutableModel, ContextTimes]:
    """The model of what was read: n-grams whose context has no weight at that point of the file are dropped.

    `expected`: the size of vocabulary that SRILM makes the model for.
    """
    vocabulary, sorted_number = reader.words.sorted()
    for its in reader.blocks.values():
        its[:] = [_joined(its)]
    blocks = [(n, block) for n, (block,) in sorted(reader.blocks.items())]
    narrow = sorted_number.astype(np.int32)
    # Word by word, as columns lie side by side.
    ngrams = [narrow[block.words.T].T for _, block in blocks]
    trie, rows = closed_trie(vocabulary, reader.order, ngrams)
    del ngrams
    names = np.array(reader.words.names(vocabulary), np.int64)
    model = MutableModel(trie, ~vocabulary.mask(reader.words.non_events), names)
    created = _weights(model, blocks, rows)
    for (n, block), row in zip(blocks, rows, strict=False):
        own, log10_p = row[-1], block.log10_p
        if n > 1 and not (kept := created[n - 2][row[n - 2]] <= block.lines).all():
            _warn_of_dropped(reader, block, np.flatnonzero(~kept))
            own, log10_p = own[kept], log10_p[kept]
        model.stored[n - 1][own] = True
        # Of several values for one row the last is kept: the file's last.
        model.log10_p[n - 1][own] = log10_p
    reader.warn_of_unknown()
    return model, ContextTimes(trie, created, reader.words.numbers(vocabulary), expected)


def _joined(blocks: Sequence[Block]) -> Block:
    """The n-grams of blocks of one order as one block."""
    lines, words, log10_p, weighted, backoff, sizes = zip(*blocks, strict=True)
    return Block(
        np.concatenate(lines),
        # Column by column.
        np.concatenate([matrix.T for matrix in words], axis=1).T,
        np.concatenate(log10_p),
        np.concatenate(weighted),
        np.concatenate(backoff),
        sum(sizes),
    )


def _warn_of_dropped(reader: Reader, block: Block, dropped: Ints) -> None:
    for i in dropped.tolist():
        line = int(block.lines[i])
        ngram = " ".join(str(reader.words.words[word]) for word in block.words[i].tolist())
        ngram = (reader.cased or {}).get(line, ngram)
        reader.said.append((line, 0, f'{reader.name}: line {line}: warning: no bow for prefix of ngram "{ngram}"'))


def tables_of(model: MutableModel, words: WordList) -> ScoreTables:
    """The tables that give words, by SRILM's number, the probabilities of a model."""
    return model.tables(words.numbers(model.trie.vocabulary), len(words.words))


def write_model(model: MutableModel, name: str, streams: Streams, debug: int, *, behind: str = "") -> None:
    """Write a model as an ARPA file, as it is: an n-gram's first words need not be listed, weights may be nan.

    `behind`: what to write after the model.
    """
    if debug >= 1:
        for n, stored in enumerate(model.stored, start=1):
            streams.say(f"writing {int(stored.sum())} {n}-grams")
    with streams.output(name) as file:
        columns = model.log10_p, model.backoff, model.is_context
        file.writelines(row_blocks(model.trie, *columns, stored=model.stored, encoding="latin-1"))
        file.write(behind.encode("latin-1"))


def _weights(model: MutableModel, blocks: Sequence[tuple[int, Block]], rows: Sequence[Sequence[Ints]]) -> list[Ints]:
    """Make contexts of the n-grams with weights; per order below the highest, the line at which each row became one."""
    trie = model.trie
    created = [np.full(len(keys), NEVER) for keys in trie.keys[:-1]]
    for (n, block), row in zip(blocks, rows, strict=False):
        if n < trie.order:
            at = np.flatnonzero(block.weighted)
            its = row[-1][at]
            # Of several values for one row the last is kept: the first line, and the last weight.
            created[n - 1][its[::-1]] = block.lines[at[::-1]]
            model.backoff[n - 1][its] = block.backoff[at]
    for n in range(trie.order - 1, 0, -1):
        nodes = np.flatnonzero(created[n - 1] < NEVER)
        model.is_context[n - 1][nodes] = True
        if n > 1:
            shorter = trie.suffixes[n - 1][nodes]
            sooner = np.flatnonzero(created[n - 1][nodes] < created[n - 2][shorter])
            np.minimum.at(created[n - 2], shorter[sooner], created[n - 1][nodes[sooner]])
    return created
