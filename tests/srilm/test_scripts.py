"""compute-best-mix, add-ppls and change-lm-vocab, and how tools are started."""

import gzip
import math
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers.srilm_runs import call

from placerec.srilm.text.streams import SrilmError
from placerec.srilm.text.vocabulary import WordList
from placerec.srilm.tools.change_lm_vocab import restricted
from placerec.srilm.tools.compute_best_mix import best_mix, starting_weights
from placerec.srilm.tools.run import TOOLS

ROOT = Path(__file__).resolve().parents[2]
BIN = ROOT / "bin"


def scored(*log10_p: str) -> str:
    """What `ngram -debug 2 -ppl` prints for a sentence of these log probabilities."""
    lines = [f"\tp( w | v ...) \t= [2gram] 0.5 [ {value} ]\n" for value in log10_p]
    return "w w\n" + "".join(lines) + "1 sentences, 2 words, 0 OOVs\n0 zeroprobs, logprob= -1 ppl= 2 ppl1= 3\n\n"


def two_models(folder: Path) -> tuple[str, str]:
    (folder / "a").write_text(scored("-1", "-2", "-inf", "-0.5", "-inf"))
    (folder / "b").write_text(scored("-2", "-1", "-inf", "-1", "-0.5"))
    return str(folder / "a"), str(folder / "b")


def test_best_mix_finds_the_weights_of_a_mixture() -> None:
    random = np.random.default_rng(0)
    p = random.dirichlet(np.ones(5), size=2)
    text = np.where(random.random(20_000) < 0.3, random.choice(5, 20_000, p=p[0]), random.choice(5, 20_000, p=p[1]))
    weights, steps = best_mix(p[:, text], [0.5, 0.5], 1e-6)
    assert weights.tolist() == pytest.approx([0.3, 0.7], abs=0.03)
    assert math.fsum(weights) == pytest.approx(1)
    logliks = [step.loglik for step in steps]
    assert logliks == sorted(logliks)
    once, _ = best_mix(p, [0.5, 0.5], 1e-6, counts=np.bincount(text, minlength=5).astype(np.float64))
    assert once.tolist() == pytest.approx(weights.tolist(), abs=1e-9)


def test_best_mix_of_nothing_keeps_the_start() -> None:
    weights, steps = best_mix(np.zeros((2, 0)), [0.25, 0.75], 0.001)
    assert (weights.tolist(), steps) == ([0.25, 0.75], [])


def test_compute_best_mix_tells_its_steps_and_the_result(tmp_path: Path) -> None:
    status, out, err = call("compute-best-mix", "precision=0.01", *two_models(tmp_path))
    assert status == 0
    # By hand: tokens (0.1, 0.01), (0.01, 0.1), (10^-0.5, 0.1), (0, 10^-0.5); the one without mass is left out.
    p = [(0.1, 0.01), (0.01, 0.1), (10**-0.5, 0.1), (0.0, 10**-0.5)]
    a = 0.5
    expected: list[str] = []
    while True:
        mixed = [a * x + (1 - a) * y for x, y in p]
        ppl = math.prod(mixed) ** -0.25
        expected.append(f"iteration {len(expected) + 1}, lambda = ({a:g} {1 - a:g}), ppl = {ppl:g}")
        moved = sum(a * x / m for (x, _), m in zip(p, mixed, strict=True)) / 4
        a, before = moved, a
        if abs(a - before) <= 0.01:
            break
    assert len(expected) > 2
    assert err.splitlines() == expected
    assert out == f"4 non-oov words, best lambda ({a:g} {1 - a:g})\npairwise cumulative lambda (1 {1 - a:g})\n"


def test_compute_best_mix_weighs_counts_and_reads_every_level(tmp_path: Path) -> None:
    (tmp_path / "a").write_text(
        "\tp( a |  ) \t= [1gram] 0.1 [ -1 *3 ]\n\tp( b | a b ) \t= [2gram] 0.1 [ -2 ] / 0.9999\n"
    )
    status, out, _ = call("compute-best-mix", str(tmp_path / "a"), str(tmp_path / "a"), str(tmp_path / "a"))
    assert (status, out) == (
        0,
        "4 non-oov words, best lambda (0.5 0.25 0.25)\npairwise cumulative lambda (1 0.333333 0.25)\n",
    )


def test_compute_best_mix_of_texts_that_differ(tmp_path: Path) -> None:
    first, _ = two_models(tmp_path)
    other = tmp_path / "c"
    other.write_text(scored("-1"))
    status, _, err = call("compute-best-mix", first, str(other))
    assert status == 1
    assert err == "mismatch in number of samples (5 != 1)\n"


@pytest.mark.parametrize(
    ("text", "models", "weights"),
    [
        ("0.5", 2, [0.5, 0.5]),
        ("0.5", 3, [0.5, 0.25, 0.25]),
        ("0.5", 1, [0.5]),
        ("0.2 0.3", 3, [0.2, 0.3, 0.5]),
        ("0.2 0.3", 2, [0.2, 0.3]),
        ("1 1", 2, [1, 1]),
        ("1 1", 3, None),
        ("0 0", 2, None),
        ("x", 2, None),
    ],
)
def test_starting_weights(text: str, models: int, weights: list[float] | None) -> None:
    if weights is None:
        with pytest.raises(SrilmError, match=f"lambda={text}"):
            starting_weights(text, models)
    else:
        assert starting_weights(text, models) == pytest.approx(weights)


def test_add_ppls_adds_the_totals() -> None:
    blocks = (
        "file a.txt: 2 sentences, 10 words, 1 OOVs\n1 zeroprobs, logprob= -20 ppl= 1 ppl1= 1\n"
        "file b: c.txt: 1 sentences, 5 words, 0 OOVs\n0 zeroprobs, logprob= -7.5 ppl= 1 ppl1= 1\n"
        "w\n1 sentences, 5 words, 0 OOVs\n0 zeroprobs, logprob= -99 ppl= 1 ppl1= 1\n"
    )
    ppl = 10 ** (27.5 / 16)
    assert call("add-ppls", stdin=blocks.encode()) == (
        0,
        f"file TOTAL: 3 sentences, 15 words, 1 OOVs\n1 zeroprobs, logprob= -27.5 ppl= {ppl:g}\n",
        "",
    )


def test_add_ppls_where_nothing_was_scored() -> None:
    block = b"file a: 0 sentences, 2 words, 2 OOVs\n0 zeroprobs, logprob= 0 ppl= undefined ppl1= undefined\n"
    assert call("add-ppls", stdin=block)[1].endswith("0 zeroprobs, logprob= 0 ppl= undefined\n")
    assert call("add-ppls")[1] == "file TOTAL: 0 sentences, 0 words, 0 OOVs\n"


ARPA = """\\data\\
ngram 1=4
ngram 2=3

\\1-grams:
-1\t</s>
-99\t<s>\t-0.5
-1\ta\t-0.25
-1\tb

\\2-grams:
-0.5\t<s> a
-0.5\ta </s>
-0.5\ta b

\\end\\
"""


def test_a_restricted_model_keeps_its_header_and_its_empty_lines() -> None:
    lines = ARPA.splitlines()
    assert restricted(lines, {"<s>", "</s>", "a"}, WordList()).splitlines() == [
        line for line in lines if "b" not in line
    ]


def test_n_grams_of_words_that_do_not_stand_alone_in_the_vocabulary_go(tmp_path: Path) -> None:
    """ngram takes the first word of each line: `b` is there again, with a share of what is left."""
    (tmp_path / "v").write_text("a\nb z\n")
    (tmp_path / "m.lm").write_text(ARPA)
    status, out, err = call(
        "change-lm-vocab", "-vocab", str(tmp_path / "v"), "-lm", str(tmp_path / "m.lm"), "-order", "2"
    )
    assert (status, err) == (
        0,
        "-: line 14: warning: 3 1-grams read, expected 4\n-: line 14: warning: 2 2-grams read, expected 3\n",
    )
    assert f"{math.log10(0.8):.7g}\tb\n" in out
    assert "a b" not in out


def test_change_lm_vocab_writes_a_model_of_the_vocabulary(tmp_path: Path) -> None:
    (tmp_path / "v").write_text("a\nc\n")
    (tmp_path / "m.lm").write_text(ARPA)
    out = tmp_path / "out.lm"
    arguments = ["-vocab", str(tmp_path / "v"), "-lm", str(tmp_path / "m.lm"), "-write-lm", str(out), "-order", "2"]
    status, _, err = call("change-lm-vocab", *arguments)
    warnings = [f"-: line 14: warning: {n - 1} {k}-grams read, expected {n}" for k, n in ((1, 4), (2, 3))]
    assert (status, err.splitlines()) == (0, warnings)
    lines = dict(re.findall(r"^(\S+)\t(\S+)", out.read_text(), re.MULTILINE)[i][::-1] for i in range(4))
    assert lines == {"</s>": "-1", "<s>": "-99", "a": "-1", "c": f"{math.log10(0.8):.7g}"}
    assert call("change-lm-vocab", *arguments, "-subset")[0] == 0
    assert "\tc" not in out.read_text()


def test_change_lm_vocab_that_only_adds_words_is_ngram_renorm(shared: Path, tmp_path: Path) -> None:
    golden = shared / "srilm/golden"
    model = golden / "expected/nc-vwsmall-wbi-o4/x.lm"
    (tmp_path / "x.lm.gz").write_bytes(model.read_bytes() if model.exists() else Path(f"{model}.gz").read_bytes())
    arguments = ["-lm", f"{tmp_path}/x.lm.gz", "-vocab", f"{golden}/inputs/vocab_vw_all.txt", "-order", "4"]
    status, out, _ = call("change-lm-vocab", *arguments)
    expected = golden / "expected/ng-vocab-renorm2/y.lm"
    whole = gzip.decompress(Path(f"{expected}.gz").read_bytes()) if not expected.exists() else expected.read_bytes()
    assert (status, out) == (0, whole.decode("latin-1"))


def test_the_search_survives_tokens_that_are_all_but_impossible(tmp_path: Path) -> None:
    (tmp_path / "a").write_text(scored("-1", "-319", "-inf", "-1e999"))
    (tmp_path / "b").write_text(scored("-1", "-inf", "-319", "-1"))
    status, out, err = call("compute-best-mix", "lambda=0 1", str(tmp_path / "a"), str(tmp_path / "b"))
    assert (status, out.splitlines()[0]) == (0, "4 non-oov words, best lambda (0 1)")
    assert "nan" not in err


def test_change_lm_vocab_needs_a_vocabulary() -> None:
    status, _, err = call("change-lm-vocab", "-lm", "x")
    assert (status, err.split()[0]) == (0, "usage:")


def run(*command: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHON": sys.executable}
    return subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, env=environment, timeout=60, cwd=cwd
    )


def test_each_tool_has_a_file_that_starts_it() -> None:
    for tool in TOOLS:
        assert os.access(BIN / tool, os.X_OK)
        assert f"TOOL={tool} " in (BIN / tool).read_text()


def test_a_tool_runs_from_anywhere_through_a_link(tmp_path: Path) -> None:
    (tmp_path / "my tool").symlink_to(BIN / "ngram-merge")
    (tmp_path / "streams.py").write_text("raise SystemExit('the current folder was searched')")
    (tmp_path / "numpy.py").write_text("raise SystemExit('the current folder was searched')")
    (tmp_path / "a").write_text("a 1\n")
    done = run("./my tool", "-foo", "a", "a", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "a\t2\n")
    assert done.stderr == 'Unknown option "-foo";  type "./my tool -help" for information\n'


def test_a_tool_found_by_its_name_is_called_by_it() -> None:
    done = run("env", f"PATH={BIN}:{os.environ['PATH']}", "ngram-merge", "-foo")
    assert done.stderr.startswith('Unknown option "-foo";  type "ngram-merge -help" for information\n')
    assert done.returncode == 1


def test_a_tool_ends_quietly_when_nobody_reads(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("".join(f"w{number:06d} 1\n" for number in range(50_000)))
    done = run("sh", "-c", f"'{BIN}/ngram-merge' a a | head -1", cwd=tmp_path)
    assert (done.stdout, done.stderr) == ("w000000\t2\n", "")


def test_a_full_disk_is_an_error() -> None:
    if not Path("/dev/full").exists():
        pytest.skip("needs /dev/full")
    done = run("sh", "-c", f"echo a 1 | '{BIN}/ngram-merge' /dev/null - > /dev/full")
    assert (done.returncode, done.stderr) == (1, f"{BIN}/ngram-merge: standard output: No space left on device\n")


def test_an_interrupted_tool_says_nothing() -> None:
    # Tests that run behind a shell's & ignore the signal, and what they start inherits that.
    start = "import os, signal, sys; signal.signal(signal.SIGINT, signal.SIG_DFL); os.execv(sys.argv[1], sys.argv[1:])"
    command = [sys.executable, "-c", start, f"{BIN}/ngram-merge", "/dev/null", "-"]
    environment = os.environ | {"PYTHON": sys.executable}
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, env=environment)
    assert process.stdin is not None
    # More than a pipe holds: when all is written, the tool is reading.
    process.stdin.write(b"a 1\n" * 100_000)
    process.stdin.flush()
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert err == b""
    assert process.returncode == -signal.SIGINT


def test_a_missing_numpy_is_named(tmp_path: Path) -> None:
    run(sys.executable, "-m", "venv", "--without-pip", tmp_path / "empty")
    # A checkout without .venv, whose Python would be taken.
    checkout = tmp_path / "checkout"
    shutil.copytree(BIN, checkout / "bin")
    (checkout / "placerec").symlink_to(ROOT / "placerec")
    done = run("env", f"PYTHON={tmp_path}/empty/bin/python", checkout / "bin/ngram-count", "-version")
    assert done.returncode == 1
    assert re.fullmatch(rf"{checkout}/bin/ngram-count: needs numpy: run `.* -m pip install numpy`\n", done.stderr)


def test_placerec_hands_arguments_through() -> None:
    module = [sys.executable, "-m", "placerec", "ngram-merge"]
    assert run(*module, "--", cwd=ROOT).stderr == "need at least two input files\n"
    done = run(*module, "--no-such", cwd=ROOT)
    assert done.stderr.startswith('Unknown option "--no-such";  type "placerec ngram-merge -help" for information\n')
    assert run(*module, "-help", cwd=ROOT).returncode == 0


def test_tools_load_numpy_and_our_rooms_only() -> None:
    script = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r}); from placerec.srilm.tools.run import run; "
        "run('ngram-count', ['-version']); "
        "print(sorted({'click', 'cv2', 'scipy', 'kenlm', 'placerec.vision', 'placerec.cli'} & set(sys.modules)))"
    )
    assert run(sys.executable, "-c", script).stdout == "[]\n"
