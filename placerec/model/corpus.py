"""What TOKENS on a command line name: token stream files, folders of them, or a folder of sentences."""

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
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
    read_sentences,
    read_stream,
    read_vocabulary,
    sentences_per_place,
)

STREAM_SUFFIXES = (".tsv", ".tsv.gz")
TOKENS_JSON = "tokens.json"
VOCABULARY = "vocab.txt"


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
    files = stream_files(sources)
    streams = [read_stream(path) for path in files]
    names = unique_names([(stream.name, path) for stream, path in zip(streams, files, strict=True)], StreamError)
    return [
        WordStream(name, s.frames, s.times, s.places, s.words, s.distances)
        for name, s in zip(names, streams, strict=True)
    ]


def holds_sentences(sources: Sequence[Path | str]) -> bool:
    """Whether `sources` are one folder of sentences, and not token streams."""
    folder = Path(sources[0])
    return len(sources) == 1 and folder.is_dir() and not any(p.name.endswith(STREAM_SUFFIXES) for p in folder.iterdir())


def read_corpus(
    sources: Sequence[Path | str],
    *,
    selection: Selection,
    vocabulary: Path | str | None = None,
    remedy: str = "add it, or remove the line",
) -> Corpus:
    """Read what to train on: token streams, or one folder of sentences (PLACE.txt, one visit a line).

    `vocabulary`: a vocab.txt; by default the one beside the streams, or in or beside the folder. Raises StreamError
    for anything missing or broken, and for a word that the vocabulary lacks, with file, line and `remedy`.
    """
    if holds_sentences(sources):
        return _sentence_corpus(Path(sources[0]), vocabulary, remedy)
    files = stream_files(sources)
    words = read_vocabulary(vocabulary or _beside([path.parent for path in files]))
    made_by = dictionary_of(files)
    streams = read_streams(sources)
    for stream, path in zip(streams, files, strict=True):
        _check_listed(stream.words, frozenset(words), path, remedy)
    # The first file of each place is enough to tell where its name stands.
    first = {place: path for stream, path in reversed([*zip(streams, files, strict=True)]) for place in stream.places}
    check_twins((place, _position(path, "place", place)) for place, path in first.items() if place)
    sentences = [sentences_per_place([stream], selection) for stream in streams]
    record = record_streams(streams, sentences, made_by.fingerprint if made_by else None)
    return Corpus(_joined(sentences), words, record)


def _joined(parts: Iterable[Mapping[str, Sentences]]) -> dict[str, Sentences]:
    sentences: dict[str, Sentences] = {}
    for part in parts:
        for place, text in part.items():
            sentences.setdefault(place, []).extend(text)
    return dict(sorted(sentences.items()))


def _sentence_corpus(folder: Path, vocabulary: Path | str | None, remedy: str) -> Corpus:
    files = sorted((p for p in folder.iterdir() if p.suffix == ".txt" and p.name != VOCABULARY), key=lambda p: p.stem)
    if not files:
        raise StreamError(f"{folder}: holds neither token streams (.tsv) nor sentences (PLACE.txt)")
    words = read_vocabulary(vocabulary or _beside([folder, folder.resolve().parent]))
    check_twins((path.stem, str(path)) for path in files)
    sentences = {}
    for path in files:
        if reason := check_place(path.stem):
            raise StreamError(f"{path}: place {path.stem!r} {reason}; rename the file")
        sentences[path.stem] = read_sentences(path)
        _check_listed((word for visit in sentences[path.stem] for word in visit), frozenset(words), path, remedy)
    visits = {place: len(text) for place, text in sentences.items()}
    return Corpus(sentences, words, Record((LearnedSequence(folder.resolve().name, visits),)))


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
