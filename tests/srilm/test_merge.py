"""ngram-merge: a plain twin, exact messages, and what happens to files that are not as they should be."""

import io
import tracemalloc
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

from placerec.srilm.text.streams import Streams
from placerec.srilm.tools.ngram_merge import ngram_merge


def merge(*arguments: str, stdin: bytes = b"") -> tuple[int, str, str]:
    streams = Streams(io.BytesIO(stdin), out := io.BytesIO(), err := io.BytesIO())
    status = ngram_merge(arguments, streams)
    return status, out.getvalue().decode("latin-1"), err.getvalue().decode("latin-1")


def written(folder: Path, *texts: str) -> list[str]:
    names = []
    for number, text in enumerate(texts):
        path = folder / f"{number}.counts"
        path.write_text(text, "latin-1")
        names.append(str(path))
    return names


def test_numbers_are_kept_to_32_bits(tmp_path: Path) -> None:
    big = written(tmp_path, "a\t4294967295\nb\t18446744073709551617\nc\t10000000000000000000\n", "a\t3\n")
    assert merge(*big)[1] == f"a\t2\nb\t4294967295\nc\t{10**19 % 2**32}\n"


def test_real_counts_keep_16_digits(tmp_path: Path) -> None:
    names = written(tmp_path, "a\t0.1\nb\t1e20\nc\tinf\n", "a\t0.2\nd\t0x1p-2\n")
    assert merge("-float-counts", *names)[1] == "a\t0.3\nb\t1e+20\nc\tinf\nd\t0.25\n"


def test_shorter_first_and_words_by_their_bytes(tmp_path: Path) -> None:
    names = written(tmp_path, "a\t1\na b\t1\na-b\t1\n", "a\xe9\t1\nz\t1\n")
    assert merge(*names)[1] == "a\t1\na b\t1\na-b\t1\na\xe9\t1\nz\t1\n"


@pytest.mark.parametrize("line", ["a", "a x", "b -1", "b " * 100 + "1"])
def test_a_malformed_line_ends_its_file(line: str, tmp_path: Path) -> None:
    names = written(tmp_path, f"\na 1\n{line}\nz 9\n", "c 3\n")
    message = "malformed N-gram count or more than 100 words per line"
    assert merge(*names) == (0, "a\t1\nc\t3\n", f"{names[0]}: line 3: {message}\n")


def test_what_cannot_be_done(tmp_path: Path) -> None:
    assert merge() == merge("a") == (1, "", "need at least two input files\n")
    (name,) = written(tmp_path, "a 1\n")
    assert merge("-write", str(tmp_path / "out"), name, "missing") == (1, "", "missing: No such file or directory\n")
    assert not (tmp_path / "out").exists()
    assert merge(name, name, "-sort") == (1, "", "-sort: No such file or directory\n")
    assert merge("-sort", name, name) == (
        0,
        "a\t2\n",
        'Unknown option "-sort";  type "ngram-merge -help" for information\n',
    )


def test_an_n_gram_that_a_file_repeats_stays_apart(tmp_path: Path) -> None:
    assert merge(*written(tmp_path, "a 1\na 2\n", "a 3\n"))[1] == "a\t4\na\t2\n"


def _numbered(start: int, step: int, count: int) -> str:
    return "".join(f"w{number:06d} v\t{number % 7}\n" for number in range(start, start + step * count, step))


@pytest.mark.parametrize("odd", ["", "## a comment\n", "\n", "w006000  v 0\n", "w006000\t1.9\n", "w006000 v\t00\n"])
def test_files_larger_than_what_is_read_at_once(odd: str, tmp_path: Path) -> None:
    third = _numbered(0, 6, 1000) + odd + _numbered(6001, 6, 1000)
    names = written(tmp_path, _numbered(0, 2, 5000), _numbered(0, 3, 4000), third)
    total: Counter[str] = Counter()
    for name in names:
        for line in Path(name).read_text().splitlines():
            if line and not line.startswith("#"):
                *words, count = line.split()
                total[" ".join(words)] += int(float(count))
    expected = "".join(f"{ngram}\t{count}\n" for ngram, count in sorted(total.items()))
    assert merge(*names) == (0, expected, "")


def test_a_malformed_line_far_behind_is_named_when_it_is_reached(tmp_path: Path) -> None:
    names = written(tmp_path, _numbered(0, 2, 5000) + "w020000 v\tx\nz\t1\n", _numbered(0, 2, 6000))
    message = "malformed N-gram count or more than 100 words per line"
    status, out, err = merge(*names)
    assert (status, err) == (0, f"{names[0]}: line 5001: {message}\n")
    assert out.splitlines()[4999:5001] == [f"w009998 v\t{2 * (9998 % 7)}", f"w010000 v\t{10000 % 7}"]


def test_what_is_not_in_order_far_behind_stays_apart(tmp_path: Path) -> None:
    names = written(tmp_path, _numbered(0, 2, 5000) + "w000000 v\t5\n", _numbered(0, 2, 6000))
    assert merge(*names)[1].splitlines()[4999:5002] == ["w009998 v\t4", "w000000 v\t5", "w010000 v\t4"]


Table = dict[tuple[str, ...], int]
_TABLES = st.lists(
    st.dictionaries(
        st.lists(st.sampled_from(["a", "b", "a-", "B"]), min_size=1, max_size=3).map(tuple), st.integers(0, 9)
    ),
    min_size=2,
    max_size=4,
)


@settings(max_examples=60, deadline=None)
@given(_TABLES)
def test_sorted_files_give_the_sums_sorted(tmp_path_factory: pytest.TempPathFactory, tables: list[Table]) -> None:
    texts = ["".join(f"{' '.join(words)}\t{n}\n" for words, n in sorted(table.items())) for table in tables]
    total: Counter[tuple[str, ...]] = Counter()
    for table in tables:
        for words, n in table.items():
            total[words] += n
    expected = "".join(f"{' '.join(words)}\t{n}\n" for words, n in sorted(total.items()))
    assert merge(*written(tmp_path_factory.mktemp("merge"), *texts)) == (0, expected, "")


def test_memory_does_not_grow_with_the_files(tmp_path: Path) -> None:
    text = "".join(f"w{number:07d}\t1\n" for number in range(60_000))
    names = written(tmp_path, text, text)
    tracemalloc.start()
    assert merge("-write", str(tmp_path / "out"), *names)[0] == 0
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (tmp_path / "out").read_text() == text.replace("\t1", "\t2")
    assert peak < 3_000_000
