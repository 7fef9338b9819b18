"""The tolerant ARPA reader: its messages, what it keeps and drops, and the order in which contexts are found."""

import re
from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from placerec.lm.arpa import row_blocks
from placerec.lm.mutable import MutableModel
from placerec.srilm.model import arpa_reader
from placerec.srilm.model.arpa import read_model
from placerec.srilm.model.arpa_reader import log_value
from placerec.srilm.order.contexts import ContextTimes, message_order
from placerec.srilm.text.streams import SrilmError, Streams
from placerec.srilm.text.vocabulary import WordList
from placerec.srilm.tools.ngram import ngram

HEADER = "\\data\\\nngram 1=2\nngram 2=1\n"
GOOD = HEADER + "\\1-grams:\n-1\ta\t-0.5\n-2\tb\n\\2-grams:\n-0.1\ta b\n\\end\\\n"


def format_draft(mutable: MutableModel) -> str:
    """A model's text, with whatever it lists."""
    columns = mutable.log10_p, mutable.backoff, mutable.is_context
    return b"".join(row_blocks(mutable.trie, *columns, stored=mutable.stored, encoding="latin-1")).decode("latin-1")


def read(
    text: str | bytes,
    folder: Path,
    *,
    order: int = 3,
    debug: int = 0,
    words: WordList | None = None,
    limited: bool = False,
) -> tuple[MutableModel, ContextTimes, list[str]]:
    """Read a model from a file `m`; also what was said, without the file's name."""
    data = text if isinstance(text, bytes) else text.encode("latin-1")
    (folder / "m").write_bytes(data)
    said = BytesIO()
    name = str(folder / "m")
    try:
        mutable, times = read_model(
            name, words or WordList(), Streams(BytesIO(), BytesIO(), said), order=order, debug=debug, limited=limited
        )
    except SrilmError as error:
        raise SrilmError((said.getvalue().decode("latin-1") + str(error)).replace(name, "m")) from error
    return mutable, times, said.getvalue().decode("latin-1").replace(name, "m").splitlines()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("ngram 2=1", "ngram 101=1", "m: line 3: ngram order 101 out of range"),
        ("ngram 2=1", "ngram 2=-1", "m: line 3: ngram number -1 out of range"),
        ("ngram 2=1", f"ngram {'1' * 5000}=1", f"m: line 3: ngram order {2**63 - 1} out of range"),
        ("\\2-grams", f"\\{'1' * 5000}-grams", f"m: line 7: invalid ngram order {2**63 - 1}"),
        ("ngram 2=1", "ngram two=1", "m: line 3: unexpected input"),
        ("\\2-grams", "\\3-grams", "m: line 7: invalid ngram order 3"),
        ("\\2-grams", "\\0-grams", "m: line 7: invalid ngram order 0"),
        ("-0.1\ta b", "-0.1 a", "m: line 8: ngram line has 2 fields (4 expected)"),
        ("-0.1\ta b", "-0.1 a b c d e f", "m: line 8: ngram line has 5 fields (4 expected)"),
        ("-0.1\ta b", "x a b", 'm: line 8: bad prob "x"'),
        ("-0.5", "y", 'm: line 5: bad bow "y"'),
        ("\\end\\", "", "m: line 9: reached EOF before \\end\\"),
        ("\\data\\", "data", "m: line 9: reached EOF before \\end\\"),
    ],
)
def test_errors_end_the_reading(old: str, new: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(SrilmError) as caught:
        read(GOOD.replace(old, new), tmp_path)
    assert str(caught.value) == f"{message}\nformat error in lm file m"
    assert caught.value.status == 1


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("-1\ta", "0.1\ta", 'm: line 5: warning: questionable prob "0.1"'),
        ("-1\ta", "nan\ta", 'm: line 5: warning: questionable prob "nan"'),
        ("-0.5", "inf", 'm: line 5: warning: questionable bow "inf"'),
        ("a b\n", "a b -7\n", 'm: line 8: ignoring non-zero bow "-7" for maximal ngram'),
        ("a b\n", "b a\n", 'm: line 8: warning: no bow for prefix of ngram "b a"'),
        ("\tb\n", "\t<unk>\n", "m: line 6: warning: non-zero probability for <unk> in closed-vocabulary LM"),
        ("-2\tb\n", "", "m: line 8: warning: 1 1-grams read, expected 2"),
    ],
)
def test_warnings_do_not(old: str, new: str, message: str, tmp_path: Path) -> None:
    assert read(GOOD.replace(old, new), tmp_path)[2] == [message]


def test_what_is_ordinary_is_read_in_silence(tmp_path: Path) -> None:
    mutable, _, said = read(GOOD, tmp_path)
    assert not said
    assert format_draft(mutable) == (
        "\n\\data\\\nngram 1=2\nngram 2=1\nngram 3=0\n\n\\1-grams:\n-1\ta\t-0.5\n-2\tb\n\n\\2-grams:\n-0.1\ta b\n\n"
        "\\3-grams:\n\n\\end\\\n"
    )
    for odd in (
        "junk\n" + GOOD + "junk\n",
        GOOD.replace("\n", "\r\n"),
        GOOD.replace("\t", " \t "),
        GOOD.replace("-1\ta", "\n##x\n -1\ta"),
        GOOD.replace("\n-2\tb", "\0lost\n\n-2\tb"),
        "\xef\xbb\xbf" + GOOD,
        HEADER + GOOD[GOOD.index("\\2-grams") : GOOD.index("\\end")] + GOOD[len(HEADER) :],
    )[:6]:
        again, _, said = read(odd, tmp_path)
        assert not said
        assert format_draft(again) == format_draft(mutable)


def test_what_is_odd_is_written_as_it_was_read(tmp_path: Path) -> None:
    """An n-gram whose first words are not listed, a word that no 1-gram lists, and numbers that are none."""
    lines = "\n\\data\\\nngram 1=1\nngram 2=1\nngram 3=1\n\n\\1-grams:\nnan\ta\tnan\n\n"
    lines += "\\2-grams:\n-1\ta b\t-0.5\n\n\\3-grams:\n-1\ta b c\n\n\\end\\\n"
    assert format_draft(read(lines, tmp_path)[0]) == lines
    # With a context of three words, of which no shorter n-gram is listed.
    lines = "\\data\\\nngram 3=1\nngram 4=1\n\\3-grams:\n-1\tx y z\t-0.5\n\\4-grams:\n-2\tx y z a\n\\end\\\n"
    mutable, _, said = read(lines, tmp_path, order=4)
    assert said == ['m: line 5: warning: no bow for prefix of ngram "x y z"']
    assert format_draft(mutable).endswith("\n\\3-grams:\n\n\\4-grams:\n-2\tx y z a\n\n\\end\\\n")


def test_numbers_as_srilm_reads_them() -> None:
    assert [log_value(text) for text in ("-0.5", "-.5", "-5.", "-", ".", "-99", "-Inf", "-0.4x5", "0x10", "1e-05")] == [
        -0.5, -0.5, -5, 0, 0, -np.inf, -np.inf, -0.4, 16, 1e-5,
    ]  # fmt: skip
    assert log_value("x") is None


def test_sections_above_the_order_are_not_looked_at(tmp_path: Path) -> None:
    mutable, _, said = read(GOOD.replace("-0.1\ta b", "rubbish"), tmp_path, order=1, debug=1)
    assert said == ["reading 2 1-grams", "skipping 1 2-grams"]
    assert mutable.order == 1
    assert not mutable.is_context[0].any()


def test_a_limited_vocabulary_leaves_n_grams_out(tmp_path: Path) -> None:
    words = WordList()
    words.add("a")
    mutable, _, said = read(GOOD, tmp_path, debug=1, words=words, limited=True)
    assert said == [
        "reading 2 1-grams", "discarded 1 OOV 1-grams", "reading 1 2-grams", "discarded 1 OOV 2-grams",
    ]  # fmt: skip
    assert [int(mask.sum()) for mask in mutable.stored] == [1, 0, 0]


def test_of_duplicates_the_last_counts(tmp_path: Path) -> None:
    mutable, _, said = read(GOOD.replace("-0.1\ta b\n", "-0.1\ta b\n-0.2\ta b\n"), tmp_path)
    assert said == ["m: line 10: warning: 2 2-grams read, expected 1"]
    assert mutable.log10_p[1][mutable.stored[1]].tolist() == [np.float32(-0.2)]


def test_a_context_is_one_from_the_line_with_its_weight_on(tmp_path: Path) -> None:
    """`x a b` with a weight makes contexts of `a b` and `b`; n-grams of theirs that came before are lost."""
    text = "\\data\\\nngram 3=4\n\\3-grams:\n-1\ta b c\n-1\tx a b\t-0.5\n-1\ta b c\n-1\ta b d\n\\end\\\n"
    mutable, _, said = read(text.replace("ngram 3=4", "ngram 3=4\nngram 4=0"), tmp_path, order=4)
    prefix = "warning: no bow for prefix of ngram"
    assert said == [f'm: line 5: {prefix} "a b c"', f'm: line 6: {prefix} "x a b"']
    assert mutable.trie.texts(3)[int(np.flatnonzero(mutable.stored[2])[0])] == "a b c"
    assert int(mutable.stored[2].sum()) == 2
    assert [int(mask.sum()) for mask in mutable.is_context] == [1, 1, 1, 0]
    assert format_draft(mutable).count("\n-1\ta b") == 2


numbers = st.sampled_from(["-1", "-0.25", "-99", "-3e-05", "-1.51078e-08", "-123456.7", "-0"])
names = st.sampled_from(["a", "b", "<s>", "</s>", "w" * 8, "w" * 9, "w" * 16, "w" * 17, "\xe9t\xe9"])


@st.composite
def models(draw: st.DrawFn) -> str:
    """ARPA files of order 3, with n-grams of any words, some with weights, some twice."""
    sections = []
    counts = []
    for n in (1, 2, 3):
        ngrams = draw(st.lists(st.tuples(numbers, st.lists(names, min_size=n, max_size=n), st.none() | numbers)))
        weight = ["" if number is None or n == 3 else f"\t{number}" for _, _, number in ngrams]
        lines = [f"{p}\t{' '.join(words)}{tail}\n" for (p, words, _), tail in zip(ngrams, weight, strict=True)]
        sections.append(f"\n\\{n}-grams:\n{''.join(lines)}")
        counts.append(f"ngram {n}={len(ngrams)}\n")
    return "\\data\\\n" + "".join(counts) + "".join(sections) + "\n\\end\\\n"


@settings(max_examples=100, deadline=None)
@given(models())
def test_whole_blocks_are_read_as_line_by_line(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    folder = tmp_path_factory.mktemp("models")
    quick, times, said = read(text, folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(arpa_reader, "parse_block", lambda *args, **options: None)
        slow, slow_times, slow_said = read(text, folder)
    assert said == slow_said
    assert format_draft(quick) == format_draft(slow)
    for n in range(3):
        np.testing.assert_array_equal(quick.trie.keys[n], slow.trie.keys[n])
        np.testing.assert_array_equal(quick.is_context[n], slow.is_context[n])
    # The highest order has no contexts.
    assert len(times.created) == len(slow_times.created) == 2
    for created, slowly in zip(times.created, slow_times.created, strict=True):
        np.testing.assert_array_equal(created, slowly)


@settings(max_examples=100, deadline=None)
@given(models(), st.integers(1, 60), st.none() | st.tuples(st.sampled_from("\0\v\n"), st.integers(0, 200)))
def test_the_size_of_blocks_changes_nothing(
    tmp_path_factory: pytest.TempPathFactory, text: str, size: int, odd: tuple[str, int] | None
) -> None:
    if odd is not None:
        text = text[: odd[1]] + odd[0] + text[odd[1] :]
    folder, seen = tmp_path_factory.mktemp("models"), []
    for block in (size, arpa_reader._BLOCK):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(arpa_reader, "_BLOCK", block)
            try:
                mutable, _, said = read(text, folder)
                seen.append((format_draft(mutable), said))
            except SrilmError as error:
                seen.append((str(error), []))
    assert seen[0] == seen[1]


@settings(max_examples=100, deadline=None)
@given(models(), st.lists(st.lists(names, max_size=6), max_size=4), st.integers(1, 4))
def test_a_model_read_for_scoring_gives_the_same_answers(
    tmp_path_factory: pytest.TempPathFactory, text: str, sentences: list[list[str]], order: int
) -> None:
    folder = tmp_path_factory.mktemp("models")
    (folder / "m").write_text(text, encoding="latin-1")
    lines = "".join(" ".join(words) + "\n" for words in sentences)
    command = ["-order", str(order), "-lm", str(folder / "m"), "-ppl", "-", "-debug"]
    # At debug level 3 the whole model is read.
    seen = {}
    for debug in ("2", "3"):
        out, err = BytesIO(), BytesIO()
        assert ngram([*command, debug], Streams(BytesIO(lines.encode("latin-1")), out, err)) == 0
        said = [line for line in err.getvalue().splitlines() if line and b"for this context sum to" not in line]
        seen[debug] = re.sub(rb" / \S+$", b"", out.getvalue(), flags=re.MULTILINE), said
    assert seen["2"] == seen["3"]


class Table:
    """A hash table of section 15, entry by entry: `children` by number, in the order of insertion."""

    def __init__(self, expected: int) -> None:
        self.children: dict[int, Table] = {}
        self.slots: list[int | None] = [None] * self.capacity(expected)

    @staticmethod
    def capacity(entries: int) -> int:
        need = entries if entries < 8 else int(np.float32(entries + 1) / np.float32(0.8))
        return 1 << max(0, (need - 1).bit_length()) if need else 1

    def insert(self, path: Sequence[int]) -> None:
        if not path:
            return
        if path[0] not in self.children:
            if self.capacity(len(self.children) + 1) > len(self.slots):
                old = [key for key in self.slots if key is not None]
                self.slots = [None] * self.capacity(len(self.children) + 1)
                for key in old:
                    self.put(key)
            self.put(path[0])
            self.children[path[0]] = Table(0)
        self.children[path[0]].insert(path[1:])

    def put(self, key: int) -> None:
        bits = len(self.slots).bit_length() - 1
        slot = ((key * 1103515245 + 12345) % 2**64 >> 30 - bits) % 2**bits if bits >= 3 else 0
        while self.slots[slot] is not None:
            slot = (slot + 1) % len(self.slots)
        self.slots[slot] = key

    def walk(self, depth: int, path: tuple[int, ...] = ()) -> Iterator[tuple[int, ...]]:
        for key in self.slots:
            if key is not None and depth == 1:
                yield (*path, key)
            elif key is not None:
                yield from self.children[key].walk(depth - 1, (*path, key))


@settings(max_examples=40, deadline=None)
@given(st.lists(st.lists(st.integers(0, 40), min_size=1, max_size=2), min_size=1, max_size=60))
def test_contexts_are_told_of_in_the_order_of_the_hash_tables(
    tmp_path_factory: pytest.TempPathFactory, contexts: list[list[int]]
) -> None:
    """Every context has a weight in the file; SRILM's numbers of the words start at 4."""
    ordered = [*([word] for word in range(41)), *(context for context in contexts if len(context) == 2)]
    lines = {n: [f"-1\t{' '.join(f'w{word}' for word in c)}\t-1\n" for c in ordered if len(c) == n] for n in (1, 2)}
    text = "\\data\\\nngram 1=41\nngram 2=0\nngram 3=0\n" + "".join(
        f"\\{n}-grams:\n{''.join(its)}" for n, its in lines.items()
    )
    mutable, times, _ = read(text + "\\end\\\n", tmp_path_factory.mktemp("models"))
    table = Table(4)
    for context in ordered:
        table.insert([word + 4 for word in reversed(context)])
    order = message_order(mutable.trie, lambda: times)
    for n in (1, 2):
        rows = np.flatnonzero(mutable.is_context[n - 1])
        walked = rows[np.argsort(order(n + 1, rows))]
        texts = mutable.trie.texts(n)
        found = [tuple(int(word[1:]) + 4 for word in reversed(texts[row].split())) for row in walked.tolist()]
        assert found == list(table.walk(n))
