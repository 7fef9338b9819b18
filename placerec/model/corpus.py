"""What TOKENS on a command line name: token stream files, folders of them, or a folder of sentences."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

from placerec.errors import StreamError
from placerec.frames.places import check_place, check_twins
from placerec.model.record import LearnedSequence, Record, record_streams
from placerec.words import Selection, Sentences, WordStream, each_sentence, read_vocabulary, sentences_per_place
from placerec.words.folder import VOCABULARY, dictionary_of, each_stream, find_vocabulary, is_stream, stream_files
from placerec.words.stream import locate

REMEDY = "add it, or remove the line"
# Sentences of a text that are in memory at one time.
TOGETHER = 4096

Keep = Callable[[str, Sentences], None]


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
    remedy: str = REMEDY,
) -> Corpus:
    """Token streams or a folder of sentences, read into memory; arguments and errors are those of `gather_corpus`."""
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
    words = read_vocabulary(vocabulary or find_vocabulary([path.parent for path in files]))
    made_by = dictionary_of(files)
    listed = frozenset(words)
    # The first file of each place is enough to tell where its name stands.
    first: dict[str, Path] = {}

    def streams() -> Iterator[tuple[WordStream, Mapping[str, Sentences]]]:
        for path, stream in zip(files, each_stream(files), strict=True):
            _check_listed(stream.words, listed, path, remedy)
            sentences = sentences_per_place([stream], selection)
            for place, text in sentences.items():
                first.setdefault(place, path)
                keep(place, text)
            yield stream, sentences

    record = record_streams(streams(), made_by.fingerprint if made_by else None)
    check_twins((place, locate(path, "place", place)) for place, path in first.items())
    return words, record


def _gather_sentences(
    folder: Path, keep: Keep, vocabulary: Path | str | None, remedy: str
) -> tuple[Sequence[str], Record]:
    files = sorted((p for p in folder.iterdir() if p.suffix == ".txt" and p.name != VOCABULARY), key=lambda p: p.stem)
    if not files:
        raise StreamError(f"{folder}: holds neither token streams (.tsv) nor sentences (PLACE.txt)")
    words = read_vocabulary(vocabulary or find_vocabulary([folder, folder.resolve().parent]))
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
            position = locate(path, "word", word)
            raise StreamError(f"{position}: the word {word!r} is not in the vocabulary; {remedy}")
