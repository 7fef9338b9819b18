"""What TOKENS on a command line name: token stream files, folders of them, or a folder of sentences."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

from placerec.errors import StreamError
from placerec.frames.find import MAX_DEPTH
from placerec.frames.folder import holds_images
from placerec.frames.places import check_place, check_twins
from placerec.model.folder import MODEL_JSON, TOKENS
from placerec.model.record import LearnedSequence, Record, Recorder
from placerec.words import Selection, Sentences, each_sentence, read_vocabulary, sentences_per_place
from placerec.words.folder import (
    VOCABULARY,
    dictionary_of,
    each_stream,
    find_vocabulary,
    is_stream,
    no_streams,
    stream_files,
)
from placerec.words.stream import FIRST, column_of, locate, read_dictionaries

REMEDY = "add it, or remove the line"
# Sentences of a text that are in memory at one time.
TOGETHER = 4096

# Takes some sentences: the dictionary of their words, their place, and they themselves.
Keep = Callable[[str, str, Sentences], None]


@dataclass(frozen=True)
class Corpus:
    """Sentences per place, in alphabetical order, with their vocabulary and what is recorded of their sequences."""

    sentences: Mapping[str, Sentences] = field(repr=False)
    vocabulary: Sequence[str] = field(repr=False)
    record: Record


def holds_sentences(sources: Sequence[Path | str]) -> bool:
    """Whether `sources` are one folder of sentences, and not token streams."""
    folder = Path(sources[0])
    return len(sources) == 1 and folder.is_dir() and not any(map(is_stream, folder.iterdir()))


def read_corpus(
    sources: Sequence[Path | str],
    *,
    selection: Selection,
    vocabulary: Path | str | None = None,
    dictionary: str = FIRST,
    remedy: str = REMEDY,
) -> Corpus:
    """Token streams or a folder of sentences, read into memory, with the words of one dictionary.

    Arguments and errors are those of `gather_corpus`.
    """
    sentences: dict[str, Sentences] = {}

    def keep(_: str, place: str, text: Sentences) -> None:
        sentences.setdefault(place, []).extend(text)

    gathered = gather_corpus(
        sources, keep, selection=selection, vocabulary=vocabulary, dictionaries=[dictionary], remedy=remedy
    )
    return Corpus(dict(sorted(sentences.items())), *gathered[dictionary])


def gather_corpus(
    sources: Sequence[Path | str],
    keep: Keep,
    *,
    selection: Selection,
    vocabulary: Path | str | None = None,
    dictionaries: Sequence[str] = (FIRST,),
    remedy: str = REMEDY,
) -> dict[str, tuple[Sequence[str], Record]]:
    """Read token streams or one folder of sentences (PLACE.txt, one visit a line): vocabulary and record.

    The sentences are handed to `keep`, some of a place and a dictionary at a time, in order; one stream at a time is in
    memory. `vocabulary`: a vocab.txt; by default the one beside the streams, or in or beside the folder.
    `dictionaries`: those whose words are read, by name; what is returned has vocabulary and record for each. Raises
    StreamError for anything missing or broken, and for a word that the vocabulary lacks, with file, line and `remedy`.
    """
    if holds_sentences(sources):
        return {FIRST: _gather_sentences(Path(sources[0]), keep, vocabulary, remedy)}
    files = stream_files(sources)
    words = vocabularies_of(files, dictionaries, vocabulary)
    made_by = dictionary_of(files)
    listed = {name: frozenset(own) for name, own in words.items()}
    recorders = {name: Recorder() for name in dictionaries}
    # The first file of each place is enough to tell where its name stands.
    first: dict[str, Path] = {}
    for path, stream in zip(files, each_stream(files), strict=True):
        for name in dictionaries:
            if name not in stream.dictionaries:
                raise StreamError(f"{path}: has no column {column_of(name)!r} as other files have; tokenize all alike")
            own = stream.in_dictionary(name)
            _check_listed(own.words, listed[name], path, remedy, column_of(name))
            sentences = sentences_per_place([own], selection)
            for place, text in sentences.items():
                first.setdefault(place, path)
                keep(name, place, text)
            recorders[name].add(own, sentences)
    check_twins((place, locate(path, "place", place)) for place, path in first.items())
    return {name: (words[name], recorders[name].record(made_by.of(name) if made_by else None)) for name in dictionaries}


def dictionaries_in(sources: Sequence[Path | str]) -> tuple[str, ...]:
    """The names of the dictionaries that token streams have words of, as the first stream tells; of texts the first."""
    return (FIRST,) if holds_sentences(sources) else read_dictionaries(stream_files(sources)[0])


def vocabularies_of(
    files: Sequence[Path], dictionaries: Sequence[str], vocabulary: Path | str | None = None
) -> dict[str, Sequence[str]]:
    """The words of each dictionary of token streams, from the vocab.txt beside them, or `vocabulary` of one alone."""
    if vocabulary is not None and len(dictionaries) > 1:
        raise StreamError(
            f"{vocabulary}: holds the words of one dictionary, and the token streams have {len(dictionaries)}; leave "
            "it out, or train as in the paper, on the first one"
        )
    folders = [path.parent for path in files]
    return {name: read_vocabulary(vocabulary or find_vocabulary(folders, name)) for name in dictionaries}


def _gather_sentences(
    folder: Path, keep: Keep, vocabulary: Path | str | None, remedy: str
) -> tuple[Sequence[str], Record]:
    if (folder / MODEL_JSON).exists():
        made = folder / TOKENS
        remedy = f"name {made}/" if made.is_dir() else "name the tokens/ that `placerec tokenize` makes of images"
        raise StreamError(f"{folder}: is a model of train-lm, and no token streams; {remedy}")
    files = sorted((p for p in folder.iterdir() if p.suffix == ".txt" and p.name != VOCABULARY), key=lambda p: p.stem)
    # Many who record images lay a times.txt or a README.txt beside them.
    if not files or (vocabulary is None and not (folder / VOCABULARY).exists() and holds_images(folder, MAX_DEPTH)):
        raise no_streams(folder, "holds neither token streams (.tsv) nor sentences (PLACE.txt)")
    words = read_vocabulary(vocabulary or find_vocabulary([folder, folder.resolve().parent]))
    check_twins((path.stem, str(path)) for path in files)
    listed = frozenset(words)
    visits = {}
    for path in files:
        if reason := check_place(path.stem):
            raise StreamError(f"{path}: place {path.stem!r} {reason}; rename the file")
        keep(FIRST, path.stem, [])
        visits[path.stem] = 0
        sentences = each_sentence(path)
        while some := list(islice(sentences, TOGETHER)):
            _check_listed((word for visit in some for word in visit), listed, path, remedy)
            keep(FIRST, path.stem, some)
            visits[path.stem] += len(some)
    return words, Record((LearnedSequence(folder.resolve().name, visits),))


def _check_listed(words: Iterable[str], listed: frozenset[str], path: Path, remedy: str, column: str = "word") -> None:
    for word in words:
        if word not in listed:
            position = locate(path, column, word)
            raise StreamError(f"{position}: the word {word!r} is not in the vocabulary; {remedy}")
