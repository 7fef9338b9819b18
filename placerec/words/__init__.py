"""Words as text: token streams, selection, sentences."""

from placerec.words.folder import read_vocabulary, write_vocabulary
from placerec.words.selection import Selection, parse_selection, select, selector
from placerec.words.sentences import (
    Sentences,
    continues,
    each_sentence,
    format_sentences,
    place_steps,
    place_triples,
    read_sentences,
    sentences_per_place,
    time_gaps,
    visits,
)
from placerec.words.stream import WordStream, read_stream, write_stream

__all__ = [
    "Selection",
    "Sentences",
    "WordStream",
    "continues",
    "each_sentence",
    "format_sentences",
    "parse_selection",
    "place_steps",
    "place_triples",
    "read_sentences",
    "read_stream",
    "read_vocabulary",
    "select",
    "selector",
    "sentences_per_place",
    "time_gaps",
    "visits",
    "write_stream",
    "write_vocabulary",
]
