"""ARPA files for scoring only: as tables at once, where nothing about them is out of the ordinary."""

from placerec.lm.score import Ngrams, ScoreTables, build_regular_tables
from placerec.srilm.model.arpa_reader import Reader
from placerec.srilm.text.streams import Streams
from placerec.srilm.text.vocabulary import WordList


def read_tables(
    name: str, words: WordList, streams: Streams, *, order: int, debug: int = 0, limited: bool = False
) -> ScoreTables:
    """Read an ARPA file as `read_model` does: the same words, messages, errors and probabilities."""
    reader = Reader(name, words, streams, order, limited)
    reader.read()
    tables = _regular_tables(reader)
    if tables is None:
        from placerec.srilm.model.arpa import assemble, tables_of

        tables = tables_of(assemble(reader)[0], words)
    else:
        reader.warn_of_unknown()
    reader.finish(debug, "lm file")
    return tables


def _regular_tables(reader: Reader) -> ScoreTables | None:
    """None after a failure, and where the orders do not follow each other."""
    ends = [line for _, its in sorted(reader.blocks.items()) for block in its for line in block.lines[[0, -1]].tolist()]
    if reader.failure or not reader.blocks or ends != sorted(ends):
        return None
    orders = [reader.blocks.get(n, []) for n in range(1, min(reader.order, reader.top) + 1)]
    columns = [[Ngrams(block.words, block.log10_p, block.backoff, block.weighted) for block in its] for its in orders]
    return build_regular_tables(len(reader.words.words), columns)
