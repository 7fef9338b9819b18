"""`ngram -classes`: what classes stand for, and the model that they make; section T4 of our specification."""

from collections.abc import Callable
from functools import partial

from placerec.lm.mutable import MutableModel, Trace
from placerec.srilm.model.arpa import tables_of
from placerec.srilm.model.class_expansion import expanded
from placerec.srilm.model.class_scorers import ClassModel, Definitions, SimpleClasses
from placerec.srilm.model.scorers import Model, Scorer
from placerec.srilm.text.classes_file import read_expansions
from placerec.srilm.text.streams import Streams
from placerec.srilm.text.vocabulary import WordList
from placerec.srilm.tools.options import Parsed


def read_definitions(options: Parsed, words: WordList, streams: Streams) -> Definitions:
    """What -classes says, or if that is empty, what stands behind the model; their words are added to `words`."""
    expansions = list(read_expansions(streams.lines(options["classes"]), streams))
    if not expansions and options["lm"] != "-":
        expansions = list(read_expansions(streams.lines(options["lm"]), streams, behind_model=True))
    definitions = Definitions(expansions, words)
    # Classes are not among the words that a text is made of.
    words.silent |= {str(words.words[number]) for number in definitions.of}
    return definitions


def with_classes(model: Model, definitions: Definitions, options: Parsed) -> Scorer:
    """The scorer of a model whose tokens are words and classes."""
    if options["simple-classes"]:
        return partial(SimpleClasses, model, definitions)
    return ClassModel(model, definitions)


def expand_classes(
    mutable: MutableModel,
    definitions: Definitions,
    options: Parsed,
    words: WordList,
    messages: Callable[[MutableModel], Trace],
) -> MutableModel:
    """`-expand-classes`: the model of words that a model of words and classes makes."""
    model = ClassModel(Model(partial(tables_of, mutable, words), words), definitions)
    return expanded(
        mutable, model, words, longest=options["expand-classes"], exact=options["expand-exact"], messages=messages
    )
