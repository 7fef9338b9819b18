"""What TOKENS on a command line name: token stream files, folders of them, or a folder of sentences."""

import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

from placerec.errors import StreamError
from placerec.files import read_text
from placerec.frames.naming import unique_names
from placerec.frames.places import check_place, check_twins
from placerec.model.record import LearnedSequence, Record, record_streams
from placerec.words import (
    Selection,
    Sentences,
    WordStream,
    each_sentence,
    read_stream,
    read_vocabulary,
    sentences_per_place,
)
from placerec.words.stream import stream_name

STREAM_SUFFIXES = (".tsv", ".tsv.gz")
TOKENS_JSON = "tokens.json"
VOCABULARY = "vocab.txt"
REMEDY = "add it, or remove the line"
# Sentences of a text that are in memory at one time.
TOGETHER = 4096

Keep = Callable[[str, Sentences], None]


@dataclass(frozen=True)
class TokenMaker:
    """The dictionary that made token streams, the sequences that it was learnt from, and a folder that says so."""

    folder: Path
    fingerprint: str
    trained_on: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Corpus:
    """Sentences per place, in alphabetical order, with their vocabulary and what is recorded of their sequences."""

    sentences: Mapping[str, Sentences] = field(repr=False)
    vocabulary: Sequence[str] = field(repr=False)
    record: Record


def stream_files(sources: Iterable[Path | str]) -> list[Path]:
    """The token stream files that `sources` (files, or folders of .tsv files) name, in order; none of them twice."""
    files: dict[str, Path] = {}
    for source in map(Path, sources):
        if not source.exists():
            raise StreamError(f"{source}: no such file or folder; token streams (.tsv) are expected")
        found = sorted(p for p in source.iterdir() if p.name.endswith(STREAM_SUFFIXES)) if source.is_dir() else [source]
        if not found:
            raise StreamError(f"{source}: holds no token stream (.tsv); `placerec tokenize` makes them of images")
        for path in found:
            if files.setdefault(os.path.abspath(path), path) is not path:
                raise StreamError(f"{path}: is given twice; name each sequence once")
    return list(files.values())


def read_streams(sources: Iterable[Path | str]) -> list[WordStream]:
    """The token streams that `sources` name, with names of their own (StreamError for two of one name)."""
    return list(_each_stream(stream_files(sources)))


def _each_stream(files: Sequence[Path]) -> Iterator[WordStream]:
    names = unique_names([(stream_name(path), path) for path in files], StreamError)
    for name, path in zip(names, files, strict=True):
        yield read_stream(path).renamed(name)


def holds_sentences(sources: Sequence[Path | str]) -> bool:
    """Whether `sources` are one folder of sentences, and not token streams."""
    folder = Path(sources[0])
    return len(sources) == 1 and folder.is_dir() and not any(p.name.endswith(STREAM_SUFFIXES) for p in folder.iterdir())


def read_corpus(
    sources: Sequence[Path | str],
    *,
    selection: Selection,
    vocabulary: Path | str | None = None,
    remedy: str = REMEDY,
) -> Corpus:
    """What to train on, in memory; as `gather_corpus` reads it."""
    sentences: dict[str, Sentences] = {}

    def keep(place: str, text: Sentences) -> None:
        sentences.setdefault(place, []).extend(text)

    words, record = gather_corpus(sources, keep, selection=selection, vocabulary=vocabulary, remedy=remedy)
    return Corpus(dict(sorted(sentences.items())), words, record)


def gather_corpus(
    sources: Sequence[Path | str],
    keep: Keep,
    *,
    selection: Selection,
    vocabulary: Path | str | None = None,
    remedy: str = REMEDY,
) -> tuple[Sequence[str], Record]:
    """Read token streams or one folder of sentences (PLACE.txt, one visit a line): their vocabulary and record.

    The sentences are handed to `keep`, a place and some of its sentences at a time, in order; one stream at a time is
    in memory. `vocabulary`: a vocab.txt; by default the one beside the streams, or in or beside the folder. Raises
    StreamError for anything missing or broken, and for a word that the vocabulary lacks, with file, line and `remedy`.
    """
    if holds_sentences(sources):
        return _gather_sentences(Path(sources[0]), keep, vocabulary, remedy)
    files = stream_files(sources)
    words = read_vocabulary(vocabulary or _beside([path.parent for path in files]))
    made_by = dictionary_of(files)
    listed = frozenset(words)
    # The first file of each place is enough to tell where its name stands.
    first: dict[str, Path] = {}

    def streams() -> Iterator[tuple[WordStream, Mapping[str, Sentences]]]:
        for path, stream in zip(files, _each_stream(files), strict=True):
            _check_listed(stream.words, listed, path, remedy)
            sentences = sentences_per_place([stream], selection)
            for place, text in sentences.items():
                first.setdefault(place, path)
                keep(place, text)
            yield stream, sentences

    record = record_streams(streams(), made_by.fingerprint if made_by else None)
    check_twins((place, _position(path, "place", place)) for place, path in first.items())
    return words, record


def _gather_sentences(
    folder: Path, keep: Keep, vocabulary: Path | str | None, remedy: str
) -> tuple[Sequence[str], Record]:
    files = sorted((p for p in folder.iterdir() if p.suffix == ".txt" and p.name != VOCABULARY), key=lambda p: p.stem)
    if not files:
        raise StreamError(f"{folder}: holds neither token streams (.tsv) nor sentences (PLACE.txt)")
    words = read_vocabulary(vocabulary or _beside([folder, folder.resolve().parent]))
    check_twins((path.stem, str(path)) for path in files)
    listed = frozenset(words)
    visits = {}
    for path in files:
        if reason := check_place(path.stem):
            raise StreamError(f"{path}: place {path.stem!r} {reason}; rename the file")
        keep(path.stem, [])
        visits[path.stem] = 0
        sentences = each_sentence(path)
        while some := list(islice(sentences, TOGETHER)):
            _check_listed((word for visit in some for word in visit), listed, path, remedy)
            keep(path.stem, some)
            visits[path.stem] += len(some)
    return words, Record((LearnedSequence(folder.resolve().name, visits),))


def _check_listed(words: Iterable[str], listed: frozenset[str], path: Path, remedy: str) -> None:
    for word in words:
        if word not in listed:
            position = _position(path, "word", word)
            raise StreamError(f"{position}: the word {word!r} is not in the vocabulary; {remedy}")


def _position(path: Path, column: str, value: str) -> str:
    """`path:line` of the first `value` in a column of a token stream, or among the words of a plain text."""
    lines = read_text(path, StreamError).removeprefix("\ufeff").replace("\r\n", "\n").split("\n")
    header = lines[0].split("\t")
    for number, line in enumerate(lines, start=1):
        if "word" not in header:
            found = line.split()
        else:
            found = line.split("\t")[header.index(column) :][:1] if number > 1 else []
        if value in found:
            return f"{path}:{number}"
    return str(path)


def _beside(folders: Iterable[Path]) -> Path:
    tried = list(dict.fromkeys(folder / VOCABULARY for folder in folders))
    for path in tried:
        if path.exists():
            return path
    raise StreamError(f"{tried[0]}: no such file; the vocabulary (all words, one a line) is named with --vocab FILE")


def dictionary_of(files: Iterable[Path]) -> TokenMaker | None:
    """The dictionary that made the token streams in `files`, None if it is not known.

    Raises StreamError if there are two: the same word would mean different things.
    """
    makers = [maker for folder in dict.fromkeys(path.parent for path in files) if (maker := _maker(folder))]
    for other in makers[1:]:
        if other.fingerprint != makers[0].fingerprint:
            raise StreamError(
                f"{other.folder}: its words are of another dictionary than those of {makers[0].folder}; "
                "tokenize both with one words.npz"
            )
    return makers[0] if makers else None


def check_dictionary(files: Iterable[Path], trained_on: str | None, model: Path) -> None:
    """Raise StreamError if the token streams in `files` are known to be in other words than those of `model`."""
    made_by = dictionary_of(files)
    if made_by and trained_on and made_by.fingerprint != trained_on:
        raise StreamError(
            f"{made_by.folder}: its words are of another dictionary than those that trained {model}; "
            "tokenize with the words.npz of the training"
        )


def _maker(folder: Path) -> TokenMaker | None:
    path = folder / TOKENS_JSON
    if not path.exists():
        return None
    try:
        found = json.loads(read_text(path, StreamError))
        return TokenMaker(folder, str(found["dictionary"]), frozenset(map(str, found.get("trained_on", ()))))
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise StreamError(f"{path}: is no description of tokens; tokenize again") from error
