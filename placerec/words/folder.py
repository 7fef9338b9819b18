"""The tokens folder: NAME.tsv, the token stream of a sequence; vocab.txt, all words; tokens.json, what made them.

The words of a further dictionary are in vocab.DICTIONARY.txt. tokens.json has the fingerprint of the `dictionary`, or
of all of them together, and the sequences that it was `trained_on`, for those who train and calibrate; of several
`dictionaries` the fingerprint of each, by its column. Another tokeniser writes none.
"""

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from placerec.errors import StreamError, at, refuse_string
from placerec.files import all_lines, encoded, read_text, whole_folder, write_text
from placerec.frames.find import MAX_DEPTH
from placerec.frames.folder import holds_images, is_image
from placerec.frames.naming import unique_names
from placerec.version import __version__
from placerec.words.stream import (
    FIRST,
    WordStream,
    check_word,
    column_of,
    dictionary_in,
    format_header,
    format_rows,
    read_stream,
    stream_name,
)

if TYPE_CHECKING:
    from placerec.vision import DictionarySet

STREAM_SUFFIXES = (".tsv", ".tsv.gz")
VOCABULARY, TOKENS_JSON = "vocab.txt", "tokens.json"
OWNED = ("*.tsv", VOCABULARY, "vocab.*.txt", TOKENS_JSON)


@dataclass(frozen=True)
class TokenMaker:
    """The dictionary that made token streams, the sequences that it was learnt from, and a folder that says so.

    `dictionaries`: of several the fingerprint of each, by name; `fingerprint` is that of all of them together.
    """

    folder: Path
    fingerprint: str
    trained_on: frozenset[str] = frozenset()
    dictionaries: Mapping[str, str] = field(default_factory=dict)

    def of(self, dictionary: str) -> str | None:
        """The fingerprint of a dictionary, None if it made no words."""
        return (self.dictionaries or {FIRST: self.fingerprint}).get(dictionary)


def is_stream(path: Path) -> bool:
    """Whether a path is named as a token stream is."""
    return path.name.endswith(STREAM_SUFFIXES)


def stream_files(sources: Iterable[Path | str]) -> list[Path]:
    """The token stream files that `sources` (files, or folders of .tsv files) name, in order; none of them twice."""
    files: dict[str, Path] = {}
    for source in map(Path, sources):
        if not source.exists():
            raise StreamError(f"{source}: no such file or folder; token streams (.tsv) are expected")
        found = sorted(p for p in source.iterdir() if is_stream(p)) if source.is_dir() else [source]
        if not found:
            raise no_streams(source, "holds no token stream (.tsv)")
        if not is_stream(found[0]) and holds_images(source, 0):
            raise no_streams(source, "is no token stream (.tsv)")
        if found[0].suffix == ".npz":
            raise StreamError(f"{source}: is no token stream (.tsv); the words.npz of train-words is what -w names")
        for path in found:
            if files.setdefault(os.path.abspath(path), path) is not path:
                raise StreamError(f"{path}: is given twice; name each sequence once")
    return list(files.values())


def no_streams(source: Path, missing: str) -> StreamError:
    """The error that a file or folder is not what is expected, in the words of `missing`, and what makes it of images.

    `source` is looked through for images, so that the command can be told.
    """
    if not holds_images(source, MAX_DEPTH):
        return StreamError(f"{source}: {missing}; `placerec tokenize` makes token streams of images")
    what = "images" if source.is_dir() else "one image" if is_image(source) else "a recording"
    command = f"placerec tokenize {source.parent if is_image(source) else source} -w words.npz -o tokens/"
    return StreamError(f"{source}: {missing}, but {what}; `{command}` makes token streams of that")


def read_streams(sources: Iterable[Path | str]) -> list[WordStream]:
    """The token streams that `sources` name, with names of their own (StreamError for two of one name)."""
    return list(each_stream(stream_files(sources)))


def each_stream(files: Sequence[Path]) -> Iterator[WordStream]:
    """The token streams in files one after the other, with names of their own (StreamError for two of one name)."""
    names = unique_names([(stream_name(path), path) for path in files], StreamError)
    for name, path in zip(names, files, strict=True):
        yield read_stream(path).renamed(name)


def read_vocabulary(path: Path | str) -> tuple[str, ...]:
    """The words of a vocab.txt, one a line, in its order; StreamError for an empty file or a word listed twice."""
    words: dict[str, int] = {}
    for i, line in enumerate(all_lines(path, StreamError), start=1):
        if not line.strip():
            continue
        word = check_word(path, i, line.strip())
        if word in words:
            raise StreamError(at(path, i, f"the word {word!r} is listed already, on line {words[word]}"))
        words[word] = i
    if not words:
        raise StreamError(f"{path}: holds no word; one word a line is expected")
    return tuple(words)


def write_vocabulary(words: Iterable[str], path: Path | str) -> None:
    """Write a vocab.txt: one word a line; StreamError for a string in place of words."""
    refuse_string(words, StreamError)
    write_text(Path(path), "".join(f"{word}\n" for word in words))


def vocabulary_file(folder: Path, dictionary: str = FIRST) -> Path:
    """Where a tokens folder has the words of a dictionary."""
    return folder / (f"vocab.{dictionary}.txt" if dictionary else VOCABULARY)


def find_vocabulary(folders: Iterable[Path], dictionary: str = FIRST) -> Path:
    """The vocab.txt of a dictionary in the first of `folders` that holds one; StreamError if none does."""
    tried = list(dict.fromkeys(vocabulary_file(folder, dictionary) for folder in folders))
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


def check_dictionary(files: Iterable[Path], trained_on: Mapping[str, str | None], model: Path) -> None:
    """Raise StreamError if the token streams in `files` are known to be in other words than those of `model`.

    `trained_on`: the fingerprint of each of the model's dictionaries, by its name; None where it is unknown.
    """
    made_by = dictionary_of(files)
    for name, fingerprint in trained_on.items():
        if made_by and fingerprint and made_by.of(name) not in (fingerprint, None):
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
        several = {
            dictionary_in(column): str(fingerprint) for column, fingerprint in found.get("dictionaries", {}).items()
        }
        trained_on = frozenset(map(str, found.get("trained_on", ())))
        return TokenMaker(folder, str(found["dictionary"]), trained_on, several)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise StreamError(f"{path}: is no description of tokens; tokenize again") from error


def write_tokens(streams: Iterable[WordStream], dictionaries: "DictionarySet", out: Path) -> None:
    """Write the tokens folder `out`, whole or not at all."""
    with whole_folder(out, OWNED) as folder:
        fill_folder(streams, dictionaries, folder)


def fill_folder(parts: Iterable[WordStream], dictionaries: "DictionarySet", folder: Path) -> tuple[set[str], set[str]]:
    """Write pieces of token streams, those of a sequence in order, and what goes with them.

    Returns the names of the sequences and the words that were written.
    """
    names: set[str] = set()
    seen: set[str] = set()
    for part in parts:
        path = folder / f"{part.name}.tsv"
        with path.open("ab") as file:
            file.write(
                encoded(path, format_rows(part) if part.name in names else format_header(part) + format_rows(part))
            )
        names.add(part.name)
        seen.update(part.words, *(column.words for column in part.further.values()))
    for dictionary in dictionaries.dictionaries:
        write_vocabulary(dictionary.vocabulary, vocabulary_file(folder, dictionary.name))
    description: dict[str, object] = {
        "format": "placerec tokens 1",
        "version": __version__,
        "dictionary": dictionaries.fingerprint,
        "trained_on": list(dictionaries.sequences),
    }
    if len(dictionaries.dictionaries) > 1:
        description["dictionaries"] = {
            column_of(dictionary.name): dictionary.fingerprint for dictionary in dictionaries.dictionaries
        }
    write_text(folder / TOKENS_JSON, json.dumps(description, indent=2) + "\n")
    return names, seen
