"""Rules of ngram-count and ngram that chance found, each in a run small enough to work out by hand."""

import math
from collections.abc import Callable
from io import BytesIO
from math import log10
from pathlib import Path

import numpy as np
import pytest

from placerec.errors import LanguageModelError
from placerec.srilm.order.messages import Messages
from placerec.srilm.text.streams import Streams
from placerec.srilm.tools.generation import drand48
from placerec.srilm.tools.ngram import ngram
from placerec.srilm.tools.ngram_count import ngram_count
from placerec.srilm.tools.ngram_merge import ngram_merge

LM = """
\\data\\
ngram 1=5
ngram 2=3

\\1-grams:
-0.60206\t</s>
-99\t<s>\t0
-0.60206\ta\t0
-0.60206\tb\t0
-0.60206\tc

\\2-grams:
-0.30103\t<s> a
-0.30103\ta b
-0.30103\tb </s>

\\end\\
"""
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Runs a tool in a folder of its own; files are given by name, with _ for the full stop."""
    monkeypatch.chdir(tmp_path)

    def call(command: str, stdin: str = "", **files: str) -> tuple[int, str, str]:
        for name, text in {"m_lm": LM, **files}.items():
            Path(name.replace("_", ".")).write_text(text, encoding="latin-1")
        tool, *arguments = command.split()
        tools = {"ngram": ngram, "ngram-count": ngram_count, "ngram-merge": ngram_merge}
        out, err = BytesIO(), BytesIO()
        status = tools[tool](arguments, Streams(BytesIO(stdin.encode("latin-1")), out, err))
        return status, out.getvalue().decode("latin-1"), err.getvalue().decode("latin-1")

    return call


def unigrams(text: str) -> dict[str, str]:
    section = text.split("\\1-grams:\n")[1].split("\n\n")[0]
    return {line.split("\t")[1]: line.split("\t")[0] for line in section.splitlines()}


def test_every_name_of_a_word_counts_as_a_word(run: Run) -> None:
    """V is 5: </s>, a and b with an alias each, so that add-1 of 2 tokens gives (1 + 1) / (2 + 5)."""
    _, out, _ = run("ngram-count -text t -vocab-aliases al -order 1 -addsmooth 1 -lm -", t="a\n", al="A a\nB b\n")
    assert unigrams(out) == {
        "</s>": f"{log10(2 / 7):.7g}",
        "<s>": "-99",
        "a": f"{log10(2 / 7):.7g}",
        # What is left, 3 / 7, is shared by the names of b, of which one share is given.
        "b": f"{log10(3 / 14):.7g}",
    }


def test_what_is_left_is_added_for_every_name(run: Run) -> None:
    """All words are seen: 1/2 is left; 4 names of 3 words share it, and the word with two names gets two shares."""
    model = "\\data\\\nngram 1=3\n\\1-grams:\n-0.60206\t</s>\n-0.90309\ta\n-0.90309\tb\n\\end\\\n"
    _, out, err = run("ngram -lm x.lm -vocab-aliases al -renorm -write-lm - -debug 1", x_lm=model, al="A a\n")
    assert "distributing 0.5 left-over probability mass over all 4 words" in err
    assert unigrams(out) == {
        "</s>": f"{log10(0.375):.7g}",
        "a": f"{log10(0.375):.7g}",
        "b": f"{log10(0.25):.7g}",
    }


def test_pruning_by_probability_recomputes_weights_though_nothing_goes(run: Run) -> None:
    _, out, err = run("ngram -lm m.lm -order 2 -vocab v -prune-lowprobs -write-lm - -debug 4", v="x\n")
    # As -renorm: x is listed, and the weights are those of the masses.
    assert "distributing 0 left-over probability mass over 1 zeroton words" in err
    assert unigrams(out)["x"] == "-99"
    assert f"-99\t<s>\t{log10(0.5 / 0.75):.6g}" in out
    assert "PRUNED" not in err
    less = LM.replace("-0.30103\ta b", "-0.90309\ta b")
    assert (
        "CONTEXT a WORD b LPROB -0.90309 BACKOFF-LPROB -0.60206 PRUNED"
        in run("ngram -lm x.lm -order 2 -prune-lowprobs -write-lm - -debug 4", x_lm=less)[2]
    )


def test_a_tenth_of_a_probability_is_rounded_as_the_c_library_does(run: Run) -> None:
    """log10(0.1 p) is log10 p - 1, half-way between two float32 numbers for every second p."""
    words = [f"w{i}" for i in range(400)]
    numbers = [f"{-2.5 - i / 1000:.7g}" for i in range(400)]
    first = "".join(f"{number}\t{word}\n" for number, word in zip(numbers, words, strict=True))
    other = "\\data\\\nngram 1=1\n\\1-grams:\n-0.1\tx\n\\end\\\n"
    model = f"\\data\\\nngram 1=400\n\\1-grams:\n{first}\\end\\\n"
    _, out, _ = run("ngram -order 1 -lm x.lm -mix-lm y.lm -lambda 0.1 -write-lm -", x_lm=model, y_lm=other)
    found = unigrams(out)
    for number, word in zip(numbers, words, strict=True):
        exact = math.log10(0.1 * math.exp(float(np.float32(number)) * 2.30258509299404568402))
        assert found[word] == f"{np.float32(exact):.7g}"


def test_what_stands_around_a_model_does_not_know_its_settings(run: Run) -> None:
    for wrapper in ("-unk-prob -2", "-zeroprob-word a"):
        _, out, _ = run(f"ngram -lm m.lm -ppl p {wrapper} -no-sos -no-eos -reverse -noise b", p="a b c\n")
        assert out.startswith("file p: 1 sentences, 3 words, 0 OOVs")
        status, out, err = run(f"ngram -lm m.lm {wrapper} -write-lm y")
        assert (status, Path("y").read_text()) == (0, "")
        assert err == "write() method not implemented\nerror writing y\n"
    rescored = run("ngram -lm m.lm -rescore-ngram m.lm -ppl p -no-sos -no-eos -reverse", p="a b c\n")[1]
    assert rescored.startswith("file p: 1 sentences, 3 words, 0 OOVs")


def test_skipping_looks_as_far_back_as_the_model(run: Run) -> None:
    def zeros(order: int) -> str:
        return run(f"ngram -lm m.lm -order {order} -skipoovs -ppl p", p="x a b c\n")[1].splitlines()[1].split()[0]

    assert [zeros(order) for order in (1, 2, 3)] == ["0", "1", "2"]


def test_counts_go_into_the_cache(run: Run) -> None:
    _, out, _ = run("ngram -lm m.lm -order 1 -cache 2 -cache-lambda 0.5 -counts c -debug 2", c="a 1\nb 1\n")
    assert "p( a |  ) \t= [1gram][cache=0] 0.125 " in out
    assert "p( b |  ) \t= [1gram][cache=0] 0.125 " in out
    _, out, _ = run("ngram -lm m.lm -order 1 -cache 2 -cache-lambda 0.5 -ppl p -counts c -debug 3", p="a\n", c="a 1\n")
    assert "p( a |  ) \t= [1gram][cache=0.5][probs=0.25,0.5] 0.375 [ -0.4259688 ] / 0.9999999\n" in out


def test_counts_without_n_grams_have_no_block(run: Run) -> None:
    for options in ("", "-debug 2", "-counts-entropy", "-escape #"):
        assert run(f"ngram -lm m.lm -counts c {options}", c="")[1] == "file c: 0 sentences, 0 words, 0 OOVs\n"


def test_each_group_of_counts_entropy_is_a_word(run: Run) -> None:
    _, out, _ = run("ngram -lm m.lm -counts c -counts-entropy -escape #", c="a 1\n# x\nb 1\n")
    assert out.splitlines()[0] == "0 sentences, 1 words, 0 OOVs"
    assert out.splitlines()[-2] == "file c: 0 sentences, 2 words, 0 OOVs"


def test_minus_one_is_no_discount(run: Run) -> None:
    for option in ("-cdiscount", "-addsmooth", "-cdiscount1", "-addsmooth1"):
        text = "a b a c a d\n"
        given = run(f"ngram-count -text t -order 1 {option} -1 -lm -", t=text)
        assert given == run("ngram-count -text t -order 1 -lm -", t=text)
        assert given != run(f"ngram-count -text t -order 1 {option} 0.5 -lm -", t=text)
    assert run("ngram-count -text t -cdiscount1 -1 -wbdiscount1 -lm -", t="a\n")[0] == 0


def test_a_file_beside_a_method_is_one_more_method(run: Run) -> None:
    status, _, err = run("ngram-count -text t -ukndiscount2 -kn2 f -order 2", t="a\n")
    assert (status, err) == (2, "conflicting discounting options for order 2\n")
    status, _, err = run("ngram-count -text t -ukndiscount -kn f", t="a\n")
    assert (status, err) == (2, "conflicting default discounting options\n")


def test_coefficients_that_a_file_does_not_list_are_0(run: Run) -> None:
    command = "ngram-count -text t -order 1 -gt1 f -lm -"
    status, out, err = run(command, t="a a b b c\n", f="mincount 1\nmaxcount 3\ndiscount 1 0.5\n\n")
    assert (status, err) == (
        0,
        "f: line 4: warning: discount coefficient 2 = 0.0\nf: line 4: warning: discount coefficient 3 = 0.0\n",
    )
    # c and </s> keep half of 1/6 each; the rest goes to a and b, which are left out as if they had not been seen.
    one = np.float32(log10(0.5 / 6))
    once, rest = f"{one:.7g}", f"{np.float32(log10((1 - 2 * 10 ** float(one)) / 2)):.7g}"
    assert unigrams(out) == {"</s>": once, "<s>": "-99", "a": rest, "b": rest, "c": once}
    assert run(command, t="a\n", f="discount 1\n") == (
        1,
        "",
        "f: line 1: unrecognized parameter\nerror in reading discount parameter file f\n",
    )
    assert run(command, t="a\n", f="alpha 1\n")[2].startswith("f: line 1: unrecognized parameter\n")


def test_a_negative_coefficient_makes_weights_nan(run: Run) -> None:
    _, out, _ = run("ngram-count -text t -order 2 -gt2 f -lm -", t="a b\n", f="maxcount 1\ndiscount 1 -0.5\n")
    assert "\nnan\ta b\n" in out
    assert out.split("\ta\t")[1].startswith("nan\n")


def test_a_negative_minimum_is_a_very_large_one(run: Run) -> None:
    text = "a b a b a c a c d\n"
    for method, size in (("", 0), ("-wbdiscount2", 7)):
        _, out, _ = run(f"ngram-count -text t -order 2 -gt2min -1 {method} -lm -", t=text)
        assert f"\nngram 2={size}\n" in out


def test_words_that_are_never_predicted_need_others(run: Run) -> None:
    _, out, _ = run("ngram-count -text e -nonevents e -no-eos -order 1 -lm -", e="e\n")
    assert unigrams(out) == {"</s>": "0", "<s>": "-99"}
    _, out, _ = run("ngram-count -text e -nonevents v -no-eos -order 1 -lm -", e="e f\n", v="e\n")
    assert unigrams(out)["e"] == "-99"


def test_minimum_counts_while_reading_keep_words_out(run: Run) -> None:
    counts = "a 3\na x 1\na b 2\n"
    command = "ngram-count -read c -read-with-mincounts -gt2min 2 -order 2 -sort"
    assert run(f"{command} -write-vocab -", c=counts)[1].split() == ["-pau-", "</s>", "<s>", "<unk>", "a", "b"]
    assert run(f"{command} -limit-vocab -write -", c=counts)[1] == "a\t3\na b\t2\nb\t0\n".replace("b\t0\n", "")
    tagged = run(f"{command} -meta-tag @@ -write -", c=counts)[1]
    assert tagged == "a\t3\na @@1\t1\na b\t2\n"


def test_a_tag_without_a_number_is_a_word(run: Run) -> None:
    _, out, _ = run("ngram-count -read c -meta-tag @@ -order 1 -addsmooth 1 -lm -", c="@@x 1\n@@2 1\na 1\n")
    assert "@@x" in unigrams(out)
    assert "@@2" not in unigrams(out)


def test_steps_are_found_without_walking_them(run: Run) -> None:
    """The total is raised until 3e-6 of the mass is left: by 12886 for a count of 2^32."""
    for method in ("-cdiscount 0", "-cdiscount 0.5", "-ndiscount", "-addsmooth 0.001"):
        status, out, _ = run(
            f"ngram-count -text t -text-has-weights -order 2 -gt2min 2 {method} -lm -", t="4294967296 a b\n"
        )
        assert status == 0
        assert "ngram 2=3" in out


def test_steps_that_are_told_at_once_are_those_of_a_walk(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    command = "ngram-count -text t -text-has-weights -order 3 -gt3min 1 -ndiscount1 -cdiscount 0.3 -debug 1 -lm -"
    text = "3000000 a b c a\n1000000 a b a b\n"
    quick = run(command, t=text)
    walk = Messages.__init__

    def walking(self: Messages, *arguments: object, **options: object) -> None:
        walk(self, *arguments, **options)  # type: ignore[arg-type]
        self.every_step = True

    monkeypatch.setattr(Messages, "__init__", walking)
    assert run(command, t=text) == quick
    assert quick[2].count("incrementing denominator") > 20


def test_the_word_for_unknown_ones_has_a_number_of_its_own(run: Run) -> None:
    _, out, _ = run("ngram-count -text t -map-unk x -write-vocab-index -", t="a\n")
    assert out == "1 <s>\n2 </s>\n3 -pau-\n4 x\n5 a\n.\n"


def test_a_marker_whose_name_is_an_alias_is_none(run: Run) -> None:
    command = "ngram-count -text t -vocab-aliases al -order 2 -sort -write -"
    assert run(command, t="b\n", al="</s> a\n")[1] == "<s>\t1\n<s> b\t1\nb\t1\n"
    assert run(command, t="b\n", al="<s> a\n")[1] == "</s>\t1\nb\t1\nb </s>\t1\n"
    status, out, err = run(command, t="b\n", al="x\n<unk> a\n")
    assert (status, out) == (1, "")
    assert err.splitlines()[-1] == "al: line 2: <unk> must stay the unknown word; take the line out"


@pytest.mark.parametrize("command", ["ngram-count -text t -order 2", "ngram -lm m.lm -ppl t"])
@pytest.mark.parametrize("aliases", ["x y\ny z\n", "x a\na b\nb z\nf a\n"])
def test_names_of_words_without_a_name_end_in_a_message(run: Run, command: str, aliases: str) -> None:
    assert run(f"{command} -vocab-aliases al", t="z c\n", al=aliases)[0] == 0
    status, _, err = run(f"{command} -vocab-aliases al", t="x c\n", al=aliases)
    assert status == 1
    assert "x is another name of a word that lost its own to an alias" in err


def test_a_last_line_without_end_is_copied_without_one(run: Run) -> None:
    run("ngram-count -text t -write-text w", t="a\n\nb")
    assert Path("w").read_text() == "a\nb"
    assert run("ngram -lm m.lm -ppl p -escape #", p="# x\n# y")[1].startswith("# x\n# yfile p: 0 sentences")
    assert run("ngram -lm m.lm -counts p -escape #", p="# y")[1] == "# yfile p: 0 sentences, 0 words, 0 OOVs\n"


def test_a_hyphen_is_minus_zero(run: Run) -> None:
    _, out, _ = run("ngram -lm x.lm -order 2 -write-lm -", x_lm=LM.replace("-0.60206\ta\t0", "-0.60206\ta\t-"))
    assert "\n-0.60206\ta\t-0\n" in out


@pytest.mark.parametrize("option", ["-skip-init 1", "-stop-words x", "-tag", "-tagged", "-memuse", "-write-binary x"])
def test_what_srilm_has_and_we_do_not_is_refused_by_name(run: Run, option: str) -> None:
    status, out, err = run(f"ngram-count -text t {option}", t="a\n")
    assert (status, out) == (2, "")
    assert f"option {option.split()[0]} is not supported" in err


def test_srilm_without_its_library_refuses_maximum_entropy(run: Run) -> None:
    expected = "maxent model estimation not supported (requires liblbfgs)\n"
    assert run("ngram-count -text t -maxent -lm -", t="a\n") == (2, "", expected)


def test_the_report_of_a_text(run: Run) -> None:
    report = run("ngram-count -text t -vocab v -debug 1", t="a x <unk>\nb\0c\nd\n", v="a\n")[2]
    assert report == "t: line 2: 2 sentences, 4 words, 2 OOVs\n0 zeroprobs, logprob= 0 ppl= 1 ppl1= 1\n"
    report = run("ngram-count -text t -vocab v -debug 1", t="x\n", v="a\n")[2]
    assert report.splitlines()[1] == "0 zeroprobs, logprob= 0 ppl= 1 ppl1= undefined"


def test_discarded_n_grams_are_counted_each_time_that_a_context_is_done(run: Run) -> None:
    _, _, err = run("ngram-count -text t -order 2 -debug 1 -lm -", t="p <s> p\n")
    assert "discarded 2 2-gram probs predicting pseudo-events" in err
    _, _, err = run("ngram-count -text t -vocab v -order 1 -wbdiscount -debug 1 -lm -", t="a x\n", v="a\n")
    assert "discarded 1 1-gram probs predicting pseudo-events" in err


def test_weights_that_are_none_are_said_in_order(run: Run) -> None:
    text = "1 a\nx a\n-1 x\n"
    _, out, err = run("ngram -lm m.lm -ppl p -text-has-weights -debug 1", p=text)
    assert err.splitlines()[-1] == "p: line 2: bad sentence weight x"
    assert "-1 sentences, -1 words, -1 OOVs" in out
    assert "-0 " not in run("ngram -lm m.lm -ppl p -text-has-weights", p="-1 a\n")[1]
    unknown = run("ngram -lm m.lm -ppl p -text-has-weights-last", p="a 3\n")
    assert unknown[2] == 'Unknown option "-text-has-weights-last";  type "ngram -help" for information\n'
    only = run("ngram-count -text t -text-has-weights -no-sos -no-eos -order 1", t="3\n")
    assert only == (0, "", "t: line 1: illegal count weight or line too long?\n")


def test_shares_of_mixtures_that_are_none_are_said(run: Run) -> None:
    _, _, err = run("ngram -lm m.lm -mix-lm m.lm -lambda 1.5 -bayes 0 -ppl p", p="a\n")
    assert err == "warning: mixture prior out of range: 1.5\nwarning: mixture prior out of range: -0.5\n"


def test_the_least_order_is_1(run: Run) -> None:
    first = "LM order must be positive -- set to 1\n"
    assert run("ngram-count -text t -order 0 -write-vocab v", t="a\n")[2] == first
    assert run("ngram-count -text t -order 0 -debug 1 -wbdiscount -lm -", t="a\n")[2].splitlines()[2:4] == [
        first.strip(),
        "using WittenBell for 1-grams",
    ]
    _, _, err = run("ngram-count -text t -order 2 -order two", t="a\n")
    assert err == 'Warning: option "-order" got a non-numeric argument "two".  Using default: 2\n'


def test_lines_are_turned_before_markers_are_looked_for(run: Run) -> None:
    _, out, _ = run("ngram -lm m.lm -ppl p -reverse -debug 2", p="b a\n<s> a\n")
    shown = [line.split("= ")[0] for line in out.splitlines() if line.startswith("\tp(")]
    assert shown == [
        "\tp( a | <s> ) \t",
        "\tp( b | a ...) \t",
        "\tp( </s> | b ...) \t",
        "\tp( a | <s> ) \t",
        "\tp( <s> | a ...) \t",
        "\tp( </s> | <s> ...) \t",
    ]


def test_a_scale_of_0_keeps_the_weights(run: Run) -> None:
    other = "\\data\\\nngram 1=2\n\\1-grams:\n-0.30103\tb\n-0.30103\t</s>\n\\end\\\n"
    command = "ngram -lm m.lm -mix-lm y.lm -lambda 0.5 -ppl p -order 1"
    assert run(f"{command} -bayes 2 -bayes-scale 0", y_lm=other, p="a b\n") == run(
        f"{command} -bayes 0", y_lm=other, p="a b\n"
    )


def test_the_totals_of_a_product_are_known_where_sums_are_asked_for(run: Run) -> None:
    command = "ngram -lm m.lm -mix-lm m.lm -loglinear-mix -ppl p -order 1 -debug"
    one = run(f"{command} 2", p="a\n")[1]
    assert "[1gram][1gram][denom=" in one
    assert "[1gram][1gram][cached=" in one
    assert "denom" not in run(f"{command} 3", p="a\n")[1]
    assert "[1gram][1gram][probs=0.25,0.25][" in run(f"{command} 4", p="a\n")[1]


def test_a_discount_of_nothing_keeps_small_counts(run: Run) -> None:
    _, out, _ = run("ngram-count -read c -float-counts -cdiscount 0 -order 1 -lm -", c="b 1e-7\n")
    assert unigrams(out) == {"</s>": "-99", "<s>": "-99", "b": "0"}


def test_probabilities_that_are_none_are_refused(run: Run) -> None:
    with pytest.raises(LanguageModelError, match="a count of 1 in a context counted 1 times before 3 words gets no"):
        run("ngram-count -read c -order 2 -ndiscount -lm -", c="q </s> 5\ng 1\np g 1\n")


def test_the_counts_to_intersect_are_limited_too(run: Run) -> None:
    command = "ngram-count -vocab v -limit-vocab -read c -intersect i -order 1 -sort -write -"
    assert run(command, v="a\n", i="a 1\nb 1\n", c="a 2\nb 2\n")[1] == "a\t2\n"
    tagged = "ngram-count -vocab v -limit-vocab -meta-tag @@ -read c -order 2 -sort -write -"
    assert run(tagged, v="a\n", c="a @@2 1\na b 1\n")[1] == "a\t0\na @@2\t1\n"


def test_a_parameter_file_of_an_order_that_is_not_used_writes_nothing(run: Run) -> None:
    assert run("ngram-count -text t -order 1 -gt7 f -sort", t="a\n")[1] == "</s>\t1\n<s>\t1\na\t1\n"


def test_merged_real_counts_keep_their_sign(run: Run) -> None:
    assert run("ngram-merge -float-counts a b", a="x -0\n", b="y 1\n")[1] == "x\t-0\ny\t1\n"


def test_drawn_sentences_are_those_of_the_c_librarys_random_numbers(run: Run) -> None:
    numbers = drand48(7)
    assert f"{next(numbers):.16f}"[:12] == "0.2664441967"
    first = run("ngram -lm m.lm -order 1 -gen 3 -seed 7")[1]
    assert first == run("ngram -lm m.lm -order 1 -gen 3 -seed 7")[1]
    unknown = LM.replace("-0.60206\tc", "-0.60206\t<unk>")
    _, out, err = run("ngram -lm x.lm -order 1 -gen 20 -seed 1 -debug 2", x_lm=unknown)
    assert "nonword <unk> has nonzero probability 0.25\n" in err
    assert "<unk>" not in out


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("-noise <s> -ppl p", "<s> cannot be left out of sentences"),
        ("-map-unk b -rescore-ngram m.lm -ppl p", "-map-unk goes not with -rescore-ngram"),
    ],
)
def test_what_srilm_does_not_survive_ends_in_a_line(run: Run, command: str, words: str) -> None:
    status, out, err = run(f"ngram -lm m.lm {command}", p="a\n")
    assert (status > 0, out) == (True, "")
    assert words in err.splitlines()[-1]
    assert run("ngram -lm m.lm -noise <s> -write-lm y")[0] == 0
