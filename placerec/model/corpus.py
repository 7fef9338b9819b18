"""What TOKENS on a command line name: token stream files, folders of them, or a folder of sentences."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from placerec.errors import StreamError
from placerec.files import read_text
from placerec.frames.naming import unique_names
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
class Corpus:
    """Sentences per place with their vocabulary, ready for training."""

    sentences: Mapping[str, Sentences] = field(repr=False)
    vocabulary: Sequence[str] = field(repr=False)
    sequences: Sequence[str]
    dictionary: str | None


def stream_files(sources: Iterable[Path | str]) -> list[Path]:
    """The token stream files that `sources` (files, or folders of .tsv files) name, in order."""
    files: list[Path] = []
    for source in map(Path, sources):
        if not source.exists():
            raise StreamError(f"{source}: no such file or folder; token streams (.tsv) are expected")
        found = sorted(p for p in source.iterdir() if p.name.endswith(STREAM_SUFFIXES)) if source.is_dir() else [source]
        if not found:
            raise StreamError(f"{source}: holds no token stream (.tsv); `placerec tokenize` writes them")
        files += found
    return files


def read_streams(sources: Iterable[Path | str]) -> list[WordStream]:
    """The token streams that `sources` name, with names of their own (StreamError for two of one name)."""
    files = stream_files(sources)
    streams = [read_stream(path) for path in files]
    names = unique_names([(stream.name, path) for stream, path in zip(streams, files, strict=True)], StreamError)
    return [
        WordStream(name, s.frames, s.times, s.places, s.words, s.distances)
        for name, s in zip(names, streams, strict=True)
    ]


def read_corpus(sources: Sequence[Path | str], *, selection: Selection, vocabulary: Path | str | None = None) -> Corpus:
    """Read what to train on: token streams, or one folder of sentences (PLACE.txt, one visit a line).

    `vocabulary`: a vocab.txt; by default the one beside the streams, or in or beside the folder. Raises StreamError
    for anything missing or broken, and for a word that the vocabulary lacks, with file and line.
    """
    folder = Path(sources[0])
    if len(sources) == 1 and folder.is_dir() and not any(p.name.endswith(STREAM_SUFFIXES) for p in folder.iterdir()):
        return _sentence_corpus(folder, vocabulary)
    files = stream_files(sources)
    words = read_vocabulary(vocabulary or _beside([path.parent for path in files]))
    listed = frozenset(words)
    streams = read_streams(sources)
    for stream, path in zip(streams, files, strict=True):
        for i, word in enumerate(stream.words):
            if word not in listed:
                raise StreamError(f"{path}: frame {stream.frames[i]}: the word {word!r} is not in the vocabulary")
    return Corpus(
        sentences_per_place(streams, selection), words, [s.name for s in streams], _dictionary(files[0].parent)
    )


def _sentence_corpus(folder: Path, vocabulary: Path | str | None) -> Corpus:
    files = sorted(p for p in folder.iterdir() if p.suffix == ".txt" and p.name != VOCABULARY)
    if not files:
        raise StreamError(f"{folder}: holds neither token streams (.tsv) nor sentences (PLACE.txt)")
    words = read_vocabulary(vocabulary or _beside([folder, folder.resolve().parent]))
    listed = frozenset(words)
    sentences = {}
    for path in files:
        sentences[path.stem] = read_sentences(path)
        for visit in sentences[path.stem]:
            for word in visit:
                if word not in listed:
                    raise StreamError(f"{path}: the word {word!r} is not in the vocabulary")
    return Corpus(sentences, words, [], None)


def _beside(folders: Iterable[Path]) -> Path:
    tried = list(dict.fromkeys(folder / VOCABULARY for folder in folders))
    for path in tried:
        if path.exists():
            return path
    raise StreamError(f"{tried[0]}: no such file; the vocabulary (all words, one a line) is named with --vocab FILE")


def _dictionary(folder: Path) -> str | None:
    """The fingerprint of the dictionary that made the tokens of a folder, None if it is not known."""
    path = folder / TOKENS_JSON
    if not path.exists():
        return None
    try:
        fingerprint = json.loads(read_text(path, StreamError))["dictionary"]
    except (ValueError, KeyError, TypeError) as error:
        raise StreamError(f"{path}: is no description of tokens; tokenize again") from error
    return str(fingerprint)
