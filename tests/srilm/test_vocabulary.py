"""The rules of section 3, one by one."""

import io
from pathlib import Path

from placerec.srilm.text.streams import Streams
from placerec.srilm.text.vocabulary import WordList, format_indices, format_words, read_aliases, read_words


def streams() -> tuple[Streams, io.BytesIO]:
    return Streams(io.BytesIO(), io.BytesIO(), err := io.BytesIO()), err


def listed(tmp_path: Path, text: str) -> str:
    (tmp_path / "list").write_text(text)
    return str(tmp_path / "list")


def test_four_words_are_there_before_all_others() -> None:
    words = WordList()
    assert [words.add(word) for word in ("<unk>", "<s>", "</s>", "-pau-", "b", "a", "b")] == [0, 1, 2, 3, 4, 5, 4]
    assert format_words(words) == "-pau-\n</s>\n<s>\n<unk>\na\nb\n"
    assert format_indices(words) == "0 <unk>\n1 <s>\n2 </s>\n3 -pau-\n4 b\n5 a\n.\n"


def test_names_are_sorted_by_their_bytes() -> None:
    words = WordList()
    for word in ("\xe9", "z", "Z", "a"):
        words.add(word)
    assert format_words(words).split()[-4:] == ["Z", "a", "z", "\xe9"]


def test_open_and_closed_vocabularies() -> None:
    words = WordList()
    assert words.number("a") == 4
    words.closed = True
    assert (words.number("a"), words.number("b")) == (4, 0)
    assert "b" not in words.index


def test_non_events() -> None:
    assert WordList().non_events == {"<s>", "-pau-", "<unk>"}
    assert WordList(open_unknown=True).non_events == {"<s>", "-pau-"}


def test_lower_case_is_for_ascii_and_comes_first() -> None:
    words = WordList(lower=True)
    assert words.add("<S>") == 1
    assert words.add("<UNK>") == 0
    assert words.add("A\xc9") == words.add("a\xc9") == 4
    assert words.words[4] == "a\xc9"


def test_first_words_of_a_file_are_added(tmp_path: Path) -> None:
    words = WordList()
    ours, _ = streams()
    read_words(words, listed(tmp_path, "b 0.5\n\n##c\na\n<s>\nb\n"), ours)
    assert words.words[4:] == ["b", "a"]
    read_words(words, listed(tmp_path, "x\n"), ours, silent=True)
    assert words.words[6:] == ["x"]
    assert "x" in words.non_events


def test_another_unknown_word(tmp_path: Path) -> None:
    words = WordList()
    words.map_unknown("OOV")
    assert "<unk>" not in words.index
    assert words.non_events == {"<s>", "-pau-", "OOV"}
    words.closed = True
    assert words.number("never seen") == words.index["OOV"]
    assert "<unk>" not in format_words(words)


def test_aliases_share_a_number(tmp_path: Path) -> None:
    words = WordList()
    former = words.add("colour")
    ours, err = streams()
    name = listed(tmp_path, "color colour\nlonely\ncolour shade\n")
    read_aliases(words, name, ours)
    assert words.index["color"] == former
    assert words.words[former] is None
    assert words.index["colour"] == words.index["shade"]
    assert format_words(words).split()[-3:] == ["color", "colour", "shade"]
    assert err.getvalue().decode() == f"{name}: line 2: warning: line contains only one token\n"


def test_the_sorted_vocabulary_knows_the_numbers() -> None:
    words = WordList()
    words.add("b")
    words.add("a")
    vocabulary, renumbered = words.sorted()
    assert [vocabulary.words[number] for number in renumbered] == ["<unk>", "<s>", "</s>", "-pau-", "b", "a"]


def test_meta_words() -> None:
    words = WordList(meta_tag="__meta__")
    asked = ("__meta__2", "__meta__", "__meta__07x", "__meta__x", "meta")
    assert [words.occurrences(word) for word in asked] == [2, 0, 7, -1, -1]
    assert WordList().occurrences("__meta__2") == -1


def test_meta_words_are_words_of_a_closed_vocabulary() -> None:
    words = WordList(meta_tag="@@")
    words.closed = True
    assert words.number("@@3") == words.index["@@3"]
    assert words.number("@@x") == words.index["<unk>"]
