"""Words as text: token streams, selection, sentences."""

from placerec.words.folder import read_vocabulary as read_vocabulary, write_vocabulary as write_vocabulary
from placerec.words.selection import (
    Selection as Selection,
    parse_selection as parse_selection,
    select as select,
    selector as selector,
)
from placerec.words.sentences import (
    Sentences as Sentences,
    each_sentence as each_sentence,
    format_sentences as format_sentences,
    place_steps as place_steps,
    place_triples as place_triples,
    read_sentences as read_sentences,
    sentences_per_place as sentences_per_place,
    time_gaps as time_gaps,
    visits as visits,
)
from placerec.words.stream import WordStream as WordStream, read_stream as read_stream, write_stream as write_stream
