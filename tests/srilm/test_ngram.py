"""`ngram`: small runs worked out by hand from our SRILM specification, and odd models."""

import json
from collections.abc import Callable
from io import BytesIO
from math import log10
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from placerec.srilm.text import sentences
from placerec.srilm.text.streams import Streams
from placerec.srilm.tools.ngram import ngram

# log10 of 1/2, 1/4 and 1/8: sums of them are easily checked.
H, Q, E = "-0.30103", "-0.60206", "-0.90309"
LM = f"""
\\data\\
ngram 1=4
ngram 2=3

\\1-grams:
{H}\t</s>
-99\t<s>\t{H}
{Q}\ta\t{E}
{Q}\tb\t-0.1

\\2-grams:
{Q}\t<s> a
{H}\ta b
{Q}\tb </s>

\\end\\
"""
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Runs `ngram` in a folder of its own on files that are given by name (`lm` stands for m.lm)."""
    monkeypatch.chdir(tmp_path)

    def call(command: str, stdin: bytes = b"", **files: str) -> tuple[int, str, str]:
        for name, text in {"lm": LM, **files}.items():
            Path("m.lm" if name == "lm" else name).write_text(text, encoding="latin-1")
        out, err = BytesIO(), BytesIO()
        status = ngram(command.split(), Streams(BytesIO(stdin), out, err))
        return status, out.getvalue().decode("latin-1"), err.getvalue().decode("latin-1")

    return call


def test_srilms_answers_to_odd_models(shared: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(shared / "arpa")
    cases = [json.loads(line) for line in (shared / "arpa/expected.jsonl").read_text().splitlines()]
    assert len(cases) > 60
    for case in cases:
        out, err = BytesIO(), BytesIO()
        arguments = ["-order", "7", "-lm", case["file"], "-ppl", "-"]
        status = ngram(arguments, Streams(BytesIO(b"a b a zzz\n"), out, err))
        said = err.getvalue().decode("latin-1").splitlines()
        assert (status, out.getvalue().decode().rstrip("\n").split("\n"), said) == tuple(
            case["srilm"][key] for key in ("exit", "stdout", "stderr")
        ), case["file"]


def test_what_is_refused_and_what_is_warned_of(run: Run) -> None:
    assert run("-lm m.lm -factored")[0] == 2
    assert "-factored" in run("-lm m.lm -factored")[2]
    assert run("-lm m.lm -frobnicate") == (
        0,
        "",
        'Unknown option "-frobnicate";  type "ngram -help" for information\n',
    )
    assert run("-null -lm m.lm") == (2, "", "-null, -lm, and -use-server are mutually exclusive\n")
    assert run("-ppl t") == (1, "", "need at least an -lm file specified\n")


def p(*log10_probs: float | np.float32, of: int = 1) -> str:
    """The probability, or perplexity (of so many words), of log probabilities that are kept in single precision."""
    return f"{10 ** (sum(float(np.float32(value)) for value in log10_probs) / of):.7g}"


def test_words_by_hand(run: Run) -> None:
    """p(a|<s>) is listed, p(b|a) too, p(a|b) = -0.1 + 1/4, p(</s>|a) = 1/8 * 1/2."""
    single = np.float32
    first = (-0.60206, -0.30103, single(-0.1) + single(-0.60206), single(-0.90309) + single(-0.30103))
    assert run("-lm m.lm -order 2 -ppl t -debug 2", t="a b a\nx\n")[1] == (
        "a b a\n"
        "\tp( a | <s> ) \t= [2gram] 0.25 [ -0.60206 ]\n"
        "\tp( b | a ...) \t= [2gram] 0.5 [ -0.30103 ]\n"
        f"\tp( a | b ...) \t= [1gram] {p(first[2])} [ -0.70206 ]\n"
        f"\tp( </s> | a ...) \t= [1gram] {p(first[3])} [ -1.20412 ]\n"
        "1 sentences, 3 words, 0 OOVs\n"
        f"0 zeroprobs, logprob= -2.80927 ppl= {p(*first, of=-4)} ppl1= {p(*first, of=-3)}\n"
        "\n"
        "x\n"
        "\tp( <unk> | <s> ) \t= [OOV] 0 [ -inf ]\n"
        "\tp( </s> | <unk> ...) \t= [1gram] 0.5 [ -0.30103 ]\n"
        "1 sentences, 1 words, 1 OOVs\n"
        "0 zeroprobs, logprob= -0.30103 ppl= 2 ppl1= undefined\n"
        "\n"
        "file t: 2 sentences, 4 words, 1 OOVs\n"
        f"0 zeroprobs, logprob= -3.1103 ppl= {p(*first, -0.30103, of=-5)} ppl1= {p(*first, -0.30103, of=-3)}\n"
    )


def test_the_order_limits_what_is_read_and_used(run: Run) -> None:
    _, out, err = run("-lm m.lm -order 1 -ppl t -debug 1", t="a b\n")
    assert err == "reading 4 1-grams\nskipping 3 2-grams\n"
    assert "logprob= -1.50515 " in out


def test_unknown_words_zeros_and_their_stand_ins(run: Run) -> None:
    text = {"t": "x\n"}
    assert "0 OOVs\n0 zeroprobs, logprob= -2.30103" in run("-lm m.lm -ppl t -unk-prob -2", **text)[1]
    assert "1 OOVs" in run("-lm m.lm -ppl t -unk-prob -99", **text)[1]
    tagged = run("-lm m.lm -ppl t -debug 2 -zeroprob-word a", **text)[1]
    assert "p( <unk> | <s> ) \t= [OOV][2gram] 0.25 [ -0.60206 ]" in tagged
    assert "0 OOVs\n1 zeroprobs" in run("-lm m.lm -ppl t -vocab v", v="x\n", **text)[1]
    assert "0 OOVs\n0 zeroprobs" in run("-lm m.lm -ppl t -map-unk b", **text)[1]


def test_sentences_are_prepared(run: Run) -> None:
    def total(options: str, text: str) -> str:
        return run(f"-lm m.lm -order 2 -ppl t {options}", t=text)[1].split("ppl=")[0]

    assert total("", "<s> a </s>\n") == total("", "a\n")
    assert total("", "a -pau- b\n") == total("", "a b\n")
    assert total("-noise b", "a b\n") == total("", "a\n")
    Path("n").write_text("b\n")
    assert total("-noise-vocab n", "a b\n") == total("", "a\n")
    assert total("-reverse", "b a\n") == total("", "a b\n")
    # Lines are turned before markers are looked for.
    assert total("-reverse", "<s> b a </s>\n") == total("", "</s> a b <s>\n")
    assert total("-tolower", "A B\n") == total("", "a b\n")
    assert total("-no-sos", "a\n").endswith("1 words, 0 OOVs\n0 zeroprobs, logprob= -1.80618 ")
    assert total("-no-eos", "a\n").startswith("file t: 0 sentences, 1 words")
    assert total("", "\n \n## a\n") == "file t: 0 sentences, 0 words, 0 OOVs\n"
    assert total("-text-has-weights", "3 a\n").startswith("file t: 3 sentences, 3 words")


def test_escaped_lines_part_the_text_in_groups(run: Run) -> None:
    group = "1 sentences, 1 words, 0 OOVs\n"
    group += (
        f"0 zeroprobs, logprob= -1.80618 ppl= {p(-0.60206, -1.20412, of=-2)} ppl1= {p(-0.60206, -1.20412, of=-1)}\n\n"
    )
    _, out, _ = run("-lm m.lm -order 2 -ppl t -escape #!", t="#!1\na\n#!2\na\n")
    assert out.startswith(f"#!1\n{group}#!2\n{group}file t: 2 sentences, 2 words")
    assert run("-lm m.lm -ppl t -escape #!", t="a\n")[1].startswith("file t: ")


def test_counts_are_scored_with_their_own_context(run: Run) -> None:
    counts = "a b\t2\nb\t1\nx\t1\na b </s>\t1\n-oops\n<s> a\t0\n"
    status, out, err = run("-lm m.lm -order 2 -counts c -debug 2", c=counts)
    assert (status, err.splitlines()[-1]) == (0, "c: line 5: malformed N-gram count or more than 100 words per line")
    assert out.startswith(
        "\tp( <unk> |  ) \t= [OOV] 0 [ -inf ]\n"
        "\tp( b |  ) \t= [1gram] 0.25 [ -0.60206 ]\n"
        "\tp( b | a ) \t= [2gram] 0.5 [ -0.30103 *2 ]\n"
        "0 sentences, 4 words, 1 OOVs\n"
    )


def test_a_written_model_reads_back_the_same(run: Run) -> None:
    run("-lm m.lm -order 2 -write-lm y.lm")
    assert Path("y.lm").read_text() == LM
    run("-lm y.lm -order 3 -write-lm z.lm -write-vocab v")
    assert "ngram 3=0" in Path("z.lm").read_text()
    assert Path("v").read_text() == "-pau-\n</s>\n<s>\n<unk>\na\nb\n"


def test_static_mixtures_list_all_and_take_means(run: Run) -> None:
    other = LM.replace(f"{H}\ta b", f"{Q}\ta b").replace(f"{Q}\tb </s>", f"{Q}\tb a")
    run("-lm m.lm -order 2 -mix-lm o.lm -lambda 0.75 -write-lm y.lm", **{"o.lm": other})
    lines = Path("y.lm").read_text().splitlines()
    assert "ngram 2=4" in lines
    found = {line.split("\t")[1]: float(line.split("\t")[0]) for line in lines if line.count("\t") == 1}
    # Where the first model backs off it gives 10^-0.1 * 1/4.
    assert found["a b"] == pytest.approx(log10(0.75 * 0.5 + 0.25 * 0.25), abs=1e-6)
    assert found["b a"] == pytest.approx(log10(0.75 * 10**-0.70206 + 0.25 * 0.25), abs=1e-6)


def test_dynamic_mixtures_cannot_be_written(run: Run) -> None:
    status, out, err = run("-lm m.lm -mix-lm m.lm -bayes 0 -ppl t -write-lm y.lm", t="a\n")
    assert (status, err) == (0, "write() method not implemented\nerror writing y.lm\n")
    assert out == run("-lm m.lm -ppl t", t="a\n")[1]
    assert Path("y.lm").read_bytes() == b""


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.text("ab# \n\0\v", max_size=60), st.integers(1, 20))
def test_a_text_is_scored_alike_in_blocks_of_any_size(run: Run, text: str, size: int) -> None:
    whole = run("-lm m.lm -order 2 -ppl t", t=text)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sentences, "_BLOCK", size)
        assert run("-lm m.lm -order 2 -ppl t", t=text) == whole
    # At debug level 1 every line is read by itself.
    assert run("-lm m.lm -order 2 -ppl t -debug 1", t=text)[1].endswith(whole[1])


def test_a_cache_runs_across_sentences(run: Run) -> None:
    _, out, _ = run("-lm m.lm -order 2 -cache 2 -cache-lambda 0.5 -ppl t -debug 2", t="a\na\n")
    tags = [line.split("= ")[1].split(" ")[0] for line in out.splitlines() if line.startswith("\tp(")]
    assert tags == ["[2gram][cache=0]", "[1gram][cache=0]", "[2gram][cache=0.5]", "[1gram][cache=0.5]"]
    # p(a|<s>): 1/2 * 1/4 + 1/2 * 1/2.
    assert "[2gram][cache=0.5] 0.375 [ -0.4259688 ]" in out


def test_rescoring_keeps_the_n_grams_of_the_other_model(run: Run) -> None:
    other = "\\data\\\nngram 1=3\n\\1-grams:\n-1\ta\n-1\tzzz\n-99\t<s>\n\\end\\\n"
    run("-lm m.lm -order 1 -rescore-ngram o.lm -write-lm y.lm", **{"o.lm": other})
    lines = Path("y.lm").read_text().splitlines()
    # a keeps its 1/4, zzz is unknown and shares with </s> what is left: 3/8 each.
    assert [line.split("\t") for line in lines[5:9]] == [
        ["-0.4259687", "</s>"],
        ["-99", "<s>"],
        ["-0.60206", "a"],
        ["-0.4259687", "zzz"],
    ]


def test_generated_text_is_reproducible(run: Run) -> None:
    first = run("-lm m.lm -order 2 -gen 20 -seed 5")[1]
    assert first == run("-lm m.lm -order 2 -gen 20 -seed 5")[1] != run("-lm m.lm -order 2 -gen 20 -seed 6")[1]
    assert {word for line in first.splitlines() for word in line.split()} == {"a", "b"}
    assert len(first.splitlines()) == 20
    continued = run("-lm m.lm -order 2 -gen 2 -seed 5 -gen-prefixes p", p="b x\na\n")[1].splitlines()
    assert [line.split()[0] for line in continued] == ["b", "b", "a", "a"]


OTHER = LM.replace(f"{H}\ta b", f"{E}\ta b")


@pytest.mark.parametrize("options", ["", "-bayes 0", "-bayes 1", "-order 1", "-debug 2"])
def test_a_list_of_models_is_mixed_as_options_say(run: Run, options: str) -> None:
    text = "a b\nb a a\n"
    command = f"-order 2 -mix-lm o.lm -lambda 0.5 -mix-lm2 m.lm -mix-lambda2 0.2 -ppl t {options}"
    expected = run(f"-lm m.lm {command}", t=text, **{"o.lm": OTHER})
    listed = "m.lm -weight 0.5\no.lm -weight 0.3 -type ARPA\n\nm.lm -weight 0.2\n"
    assert run(f"-lm list -read-mix-lms -order 2 -ppl t {options}", list=listed) == expected
    assert expected[0] == 0


def test_models_of_a_list_have_orders_of_their_own(run: Run) -> None:
    _, found, _ = run(
        "-lm list -read-mix-lms -order 2 -bayes 0 -ppl t -debug 2", t="a b\n", list="m.lm -weight 1 -order 1"
    )
    assert found == run("-lm m.lm -order 1 -ppl t -debug 2", t="a b\n")[1]


@pytest.mark.parametrize(
    ("listed", "complaint"),
    [
        ("m.lm\n", "list: line 1: 'm.lm' is no line"),
        ("m.lm -weight 0.5\no.lm -weight x\n", "list: line 2: 'o.lm -weight x' is no line"),
        ("m.lm -weight 1 -type COUNTLM\n", "list: line 1: 'm.lm -weight 1 -type COUNTLM' is no line"),
        ("m.lm -weight 1 -classes c\n", "list: line 1: 'm.lm -weight 1 -classes c' is no line"),
        ("m.lm 1\n", "list: line 1: 'm.lm 1' is no line"),
        ("m.lm -weight 0.5\nm.lm -weight 0.4\n", "list: the weights of 2 models sum to 0.9, not to 1"),
        ("", "list: the weights of 0 models sum to 0, not to 1"),
        ("none.lm -weight 1\n", "none.lm: No such file or directory"),
    ],
)
def test_a_list_that_is_none_of_models_is_refused(run: Run, listed: str, complaint: str) -> None:
    status, out, err = run("-lm list -read-mix-lms -ppl t", t="a\n", list=listed)
    assert (status, out) == (1, "")
    assert complaint in err
