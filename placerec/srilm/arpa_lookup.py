"""ARPA files for scoring only: as look-up tables, where nothing about them is out of the ordinary."""

from typing import TYPE_CHECKING

from placerec.lm.lookup import Entries, Lookup, build_lookup
from placerec.srilm.arpa_block import Block
from placerec.srilm.arpa_reader import Reader
from placerec.srilm.streams import Streams
from placerec.srilm.vocabulary import WordList

if TYPE_CHECKING:
    from placerec.lm.draft import Draft


def read_lookup(
    name: str, words: WordList, streams: Streams, *, order: int, debug: int = 0, limited: bool = False
) -> "Lookup | Draft":
    """Read an ARPA file as `read_model` does: the same words, messages and errors, and a Draft where it must be."""
    reader = Reader(name, words, streams, order, limited)
    reader.read()
    model: Lookup | Draft | None = _lookup(reader)
    if model is None:
        from placerec.srilm.arpa import assemble

        model, _ = assemble(reader)
    else:
        reader.warn_of_unknown()
    reader.finish(debug, "lm file")
    return model


def _lookup(reader: Reader) -> Lookup | None:
    """The tables; None after a failure, and where the orders do not follow each other."""
    ends = [line for _, its in sorted(reader.blocks.items()) for block in its for line in block.lines[[0, -1]].tolist()]
    if reader.failure or not reader.blocks or ends != sorted(ends):
        return None
    orders = range(1, min(reader.order, reader.top) + 1)
    return build_lookup(len(reader.words.words), [[_entries(b) for b in reader.blocks.get(n, [])] for n in orders])


def _entries(block: Block) -> Entries:
    return Entries(block.words, block.log10_p, block.weighted, block.backoff)
