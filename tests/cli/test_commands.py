"""Every command as a user meets it: help, errors by message and exit code, what goes to stdout and what to stderr."""

import json
import re
import shutil
from pathlib import Path

import click
import pytest
from helpers.several_dictionaries import FURTHER, write_several
from helpers.small_world import PLACES, run_through, write_tokens
from helpers.typed_commands import SMALL, done, fails, make_words, misused, placerec

from placerec.cli import commands
from placerec.cli.shared import SMOOTHING_NAMES, work
from placerec.files import CACHE
from placerec.lm import SMOOTHINGS
from placerec.srilm.tools.run import TOOLS
from placerec.words import write_stream

NAMES = sorted(set(commands.commands) - set(TOOLS))


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two image sequences, a dictionary of the first, tokens, models of words that need no image, and beliefs."""
    root = tmp_path_factory.mktemp("world")
    make_words(root)
    done("train-words", root / "runs/seq2", "-o", root / "other.npz", *SMALL)
    write_tokens(root / "tokens")
    done("train-lm", root / "tokens/run1.tsv", root / "tokens/run2.tsv", "-o", root / "model", "-q")
    done("decode", root / "tokens/run3.tsv", "-m", root / "model", "-o", root / "beliefs", "-q")
    return root


# Help


def test_all_commands_of_the_contract_so_far_are_there() -> None:
    expected = (
        "adapt-lm calibrate check compare decode demo describe evaluate experiment inspect lab label learn relight "
        "report show-frame show-words stability tokenize train-lm train-words update"
    )
    assert " ".join(NAMES) == expected
    assert set(commands.commands) == {*NAMES, *TOOLS}


@pytest.mark.parametrize("tool", TOOLS)
def test_every_tool_of_srilm_helps(tool: str) -> None:
    text = done(tool, "--help").stdout
    assert text == done(tool, "-h").stdout
    assert f"\nExample: placerec {tool} " in text


def test_the_list_of_commands_is_not_cut_off() -> None:
    listed = done("--help").stdout.partition("\nYour images:\n")[2].partition("Your own images")[0]
    assert "..." not in listed
    for name in commands.commands:
        assert len(re.findall(rf"^  {name}(?:\n  )? +[A-Z].*\.$", listed, re.MULTILINE)) == 1, name


def test_commands_are_listed_by_what_people_do() -> None:
    text = done("--help").stdout
    groups = dict(re.findall(r"^(\S.*):\n((?:  .*\n)+)", text.partition("placerec learn")[0], re.MULTILINE))
    assert list(groups)[1:] == ["Your images", "Look", "Language models", "Experiments", "SRILM's tools"]
    assert re.findall(r"^  (\S+)", groups["Your images"], re.MULTILINE)[:3] == ["label", "learn", "describe"]
    assert re.findall(r"^  (\S+)", groups["SRILM's tools"], re.MULTILINE) == list(TOOLS)


@pytest.mark.parametrize(
    ("name", "groups"),
    [
        (
            "decode",
            ["Options", "How sources are read", "How words become beliefs", "What is kept", "The page", "General"],
        ),
        (
            "train-words",
            [
                *("Options", "How sources are read", "How words are learned", "What describes an image"),
                *("What is kept", "Who does the work", "General"),
            ],
        ),
        ("lab", ["Options", "General"]),
    ],
)
def test_options_are_listed_by_what_they_are_for(name: str, groups: list[str]) -> None:
    text = done(name, "--help").stdout
    assert re.findall(r"^(\S.*):$", text, re.MULTILINE) == groups
    assert re.findall(r"^  (-\S+)", text.partition("\nGeneral:\n")[2], re.MULTILINE) == ["-q,", "-v,", "-h,"]
    for option in commands.commands[name].params:
        if isinstance(option, click.Option):
            shown = re.findall(rf"^  (?:-\S+, )*{option.opts[-1]}\b", text, re.MULTILINE)
            assert len(shown) == 1, option.opts


@pytest.mark.parametrize("name", NAMES)
def test_every_command_helps(name: str) -> None:
    text = done(name, "--help").stdout
    assert text == done(name, "-h").stdout
    assert f"Example: placerec {name}" in text
    command = commands.commands[name]
    options = {option for param in command.params for option in param.opts}
    assert {"-q", "--quiet", "-v", "--verbose"} <= options
    for param in command.params:
        if isinstance(param, click.Option):
            assert param.help, f"{param.opts} is not explained"
            shown = re.split(rf"^  (?:-+\w+, )?{param.opts[-1]}\b", text, flags=re.MULTILINE)[1].partition("\n  -")[0]
            told = "default: " in " ".join(shown.split()) or param.required or param.is_flag
            assert told or not isinstance(param.default, int | float | str), f"the default of {param.opts} is not shown"


def test_options_of_one_name_are_one_option() -> None:
    """One spelling across commands: short and long forms always go together, and -o is always the output."""
    forms: dict[str, set[tuple[str, ...]]] = {}
    for command in commands.commands.values():
        for param in command.params:
            if isinstance(param, click.Option):
                forms.setdefault(param.opts[-1], set()).add(tuple(param.opts))
    assert {name for name, spellings in forms.items() if len(spellings) > 1} == set()
    assert forms["--out"] == {("-o", "--out")}


def test_the_names_of_smoothings_are_those_of_the_library() -> None:
    assert tuple(SMOOTHINGS) == SMOOTHING_NAMES


def test_the_folder_of_kept_descriptors_is_that_of_the_library() -> None:
    assert work.CACHE == CACHE


def test_the_version_is_told() -> None:
    assert re.fullmatch(r"placerec, version \d+\.\d+\.\d+\n", done("--version").stdout)


# Usage


def test_no_command_is_an_error_of_usage() -> None:
    result = placerec()
    assert result.exit_code == 2
    assert "train-words" in result.stderr


def test_unknown_commands_and_options_are_errors_of_usage() -> None:
    misused("No such command 'train'", "train")
    misused("No such option", "decode", "--frob")
    misused("Missing argument 'SOURCE...'", "train-words")
    misused("Missing option '-m' / '--model'", "decode", "tokens")
    misused("Missing option '-o' / '--out'", "train-lm", "tokens")


@pytest.mark.parametrize("name", [name for name in NAMES if name != "demo"])
def test_a_command_without_arguments_says_what_it_wants_by_its_example(name: str) -> None:
    misused("Missing argument", name)
    (line,) = placerec(name).stderr.splitlines()
    assert line.startswith(f"placerec {name}: ")
    assert f"; for example: placerec {name} " in line


def test_wrong_usage_is_one_line_with_a_remedy(world: Path) -> None:
    for told, *typed in (
        ("placerec: No such command 'foo'; see `placerec --help`", "foo"),
        ("placerec: No such option '--foo'; see `placerec --help`", "--foo"),
        (
            "placerec decode: Missing argument 'TOKENS...'; "
            "for example: placerec decode tokens/run3.tsv -m model/ -o beliefs/",
            "decode",
        ),
        (
            "placerec inspect: Missing argument 'MODEL.arpa|MODEL/|NAME.explain.jsonl'; "
            'for example: placerec inspect model/kitchen.arpa "w07 w08"',
            "inspect",
        ),
        (
            f"placerec show-words: Invalid value for 'words.npz': File '{world}' is a directory; "
            "for example: placerec show-words words.npz RUNS/ -o words.png",
            *("show-words", world, "words.npz"),
        ),
        (
            "placerec lab: Invalid value for '--scale': 'big' is not one of 'tiny', 'small', 'paper'; "
            "see `placerec lab --help`",
            *("lab", "no", "--scale", "big"),
        ),
        (
            "placerec decode: Option '--model' requires an argument; see `placerec decode --help`",
            *("decode", "tokens", "--model"),
        ),
    ):
        result = placerec(*typed)
        # Older versions of click have a colon in the place of the quotes.
        said = result.stderr.replace("No such option: --foo;", "No such option '--foo';")
        assert (result.exit_code, result.stdout, said) == (2, "", f"{told}\n")


@pytest.mark.parametrize(
    ("command", "option", "value", "message"),
    [
        ("train-lm", "--order", "0", "0 is not in the range 1<=x<=9"),
        ("train-lm", "--smoothing", "kn", "'kn' is not one of 'witten-bell', 'witten-bell-backoff'"),
        ("train-lm", "--delta", "0", "0.0 is not in the range x>0"),
        ("train-lm", "--delta", "nan", "nan is not a number that can be used"),
        ("train-lm", "--delta", "inf", "inf is not a number that can be used"),
        ("train-lm", "--select", "some", "Invalid value for '--select': selection 'some' is unknown; give none"),
        ("train-lm", "--select", "subsample:0", "selection 'subsample:0' is unknown"),
        ("train-lm", "--min-count", "0", "Invalid value for '--min-count': minimum count '0' is not understood"),
        ("decode", "--stay", "nan", "nan is not a number that can be used"),
        ("decode", "--stay", "1.5", "1.5 is not in the range 0<=x<=1"),
        ("decode", "--scorer", "srilm", "'srilm' is not one of 'native', 'kenlm'"),
        ("train-words", "--size", "1", "1 is not in the range 2<=x<=200"),
        ("train-words", "--fraction", "0", "0.0 is not in the range 0<x<=1"),
        ("train-words", "--fraction", "nan", "nan is not a number that can be used"),
        ("train-words", "--image-size", "100000", "100000 is not in the range 8<=x<=1024"),
        ("train-words", "--seed", "-1", "-1 is not in the range x>=0"),
        ("describe", "--variant", "gist", "'gist' is not one of 'lmgist', 'classic'"),
        ("tokenize", "--format", "video", "'video' is not one of 'auto', 'sequences', 'places'"),
        ("lab", "--scale", "big", "'big' is not one of 'tiny', 'small', 'paper'"),
    ],
)
def test_bad_values_are_errors_of_usage(world: Path, command: str, option: str, value: str, message: str) -> None:
    given: dict[str, list[object]] = {
        "train-lm": [world / "tokens", "-o", world / "no"],
        "decode": [world / "tokens/run3.tsv", "-m", world / "model"],
        "train-words": [world / "runs", "-o", world / "no"],
        "describe": [world / "runs", "-o", world / "no"],
        "tokenize": [world / "runs", "-w", world / "words.npz", "-o", world / "no"],
        "lab": [world / "no"],
    }
    misused(message, command, *given[command], option, value)
    assert not (world / "no").exists()


def test_empty_paths_and_dashes_are_refused_where_nothing_is_streamed(world: Path) -> None:
    misused("Invalid value for '-o' / '--out': the path is empty", "train-lm", world / "tokens", "-o", "")
    misused("Invalid value for 'SOURCE...': the path is empty", "train-words", "", "-o", world / "no")
    misused("`-` is no stream here; name a path", "train-lm", "-", "-o", world / "no")
    misused("`-` is no stream here; name a path", "describe", world / "runs", "-o", "-")


def test_a_folder_is_no_file_to_write(world: Path) -> None:
    for command in ("train-words", "describe"):
        misused("is a directory", command, world / "runs", "-o", world / "tokens")


# Images


# Outputs


def test_outputs_that_hold_other_things_are_refused_before_any_work(world: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    foreign = r"holds notes\.txt, which this command does not write; name another folder"
    tokenize = ("tokenize", world / "runs", "-w", world / "words.npz")
    for args in (tokenize, ("train-lm", world / "tokens"), ("decode", world / "tokens", "-m", world / "model")):
        fails(foreign, *args, "-o", tmp_path)
        fails(r"notes\.txt: is a file, and a folder is to be written", *args, "-o", tmp_path / "notes.txt")
    assert placerec(*tokenize, "-o", tmp_path).stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_parents_of_an_output_are_made(world: Path, tmp_path: Path) -> None:
    done("train-lm", world / "tokens", "-o", tmp_path / "a/b/model")
    assert (tmp_path / "a/b/model/model.json").exists()


def test_an_output_is_replaced_whole(world: Path, tmp_path: Path) -> None:
    done("decode", world / "tokens", "-m", world / "model", "-o", tmp_path / "out")
    done("decode", world / "tokens/run1.tsv", "-m", world / "model", "-o", tmp_path / "out")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["beliefs.json", "run1.tsv"]


# Models


def test_training_refuses_words_and_vocabularies_it_cannot_use(world: Path, tmp_path: Path) -> None:
    write_tokens(tmp_path, ["run"])
    path = tmp_path / "run.tsv"
    path.write_text(path.read_text().replace("w04", "w99", 1))
    line = 1 + next(i for i, text in enumerate(path.read_text().splitlines()) if "w99" in text)
    fails(rf"run\.tsv:{line}: the word 'w99' is not in the vocabulary", "train-lm", path, "-o", tmp_path / "model")
    fails(r"none\.txt: no such file", "train-lm", path, "-o", tmp_path / "model", "--vocab", tmp_path / "none.txt")
    (tmp_path / "vocab.txt").unlink()
    fails(
        r"vocab\.txt: no such file; the vocabulary .* is named with --vocab FILE",
        "train-lm",
        path,
        "-o",
        tmp_path / "model",
    )
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.tsv"]
    result = done("decode", path, "-m", world / "model")
    assert "warning: run: words that the models do not list: 1 skipped, 'w99' first\n" in result.stderr


def test_training_options_reach_the_model(world: Path, tmp_path: Path) -> None:
    done(
        "train-lm", world / "tokens", "-o", tmp_path / "model", "--order", 3, "--smoothing", "lidstone",
        "--delta", 0.25, "--select", "compress:2", "--min-count", "1,2", "--markers",
    )  # fmt: skip
    described = json.loads((tmp_path / "model/model.json").read_text())
    found = {name: described[name] for name in ("order", "smoothing", "delta", "select", "min_count", "markers")}
    assert found == {
        "order": 3,
        "smoothing": "lidstone",
        "delta": 0.25,
        "select": "compress:2",
        "min_count": [1, 2],
        "markers": True,
    }


def test_visits_are_learned_and_forgotten(world: Path, tmp_path: Path) -> None:
    first, second = world / "tokens/run1.tsv", world / "tokens/run2.tsv"
    done("train-lm", first, "-o", tmp_path / "model")
    before = (tmp_path / "model/hall.arpa").read_bytes()
    learned = done("update", tmp_path / "model", second)
    assert learned.stdout == ""
    stays = f"{tmp_path / 'model'}: the weight of words stays as it was learned; train again to learn it anew\n"
    assert learned.stderr == f"{tmp_path / 'model'}: learned run2; estimated again: hall, kitchen, office\n{stays}"
    assert (tmp_path / "model/hall.arpa").read_bytes() == (world / "model/hall.arpa").read_bytes() != before
    again = done("update", tmp_path / "model", second).stderr
    assert again == f"{tmp_path / 'model'}: has learned run2 already; nothing is changed\n"
    forgotten = done("update", tmp_path / "model", second, "--forget").stderr
    assert forgotten == f"{tmp_path / 'model'}: forgotten run2; estimated again: hall, kitchen, office\n{stays}"
    assert (tmp_path / "model/hall.arpa").read_bytes() == before
    assert done("update", tmp_path / "model", second, "-q").stderr == ""
    misused("Missing argument 'TOKENS...'", "update", tmp_path / "model")


def test_check_and_inspect_name_what_they_cannot_read(world: Path, tmp_path: Path) -> None:
    (tmp_path / "empty.arpa").write_text("")
    for command in ("check", "inspect"):
        fails(r"none\.arpa: no such file", command, tmp_path / "none.arpa")
        fails(r"empty\.arpa:1: the file ends where", command, tmp_path / "empty.arpa")
        (tmp_path / "none").mkdir(exist_ok=True)
        fails("none: holds no ARPA file", command, tmp_path / "none")
    fails("the word 'zz' is not in the model", "inspect", world / "model/hall.arpa", "w01 zz")


def test_check_is_content_with_our_models_and_not_with_others(world: Path, tmp_path: Path) -> None:
    pytest.importorskip("kenlm")
    models = sorted((world / "model").glob("*.arpa"))
    assert [path.stem for path in models] == list(PLACES)
    assert [line.endswith(": ok") for line in done("check", *models).stdout.splitlines()] == [True] * 3
    assert [one["ok"] for one in json.loads(done("check", *models, "--json").stdout)] == [True] * 3
    bad = tmp_path / "bad.arpa"
    bad.write_text(re.sub(r"^-\S+(?=\tw03)", "-0.1", models[0].read_text(), count=1, flags=re.MULTILINE))
    result = placerec("check", bad)
    assert result.exit_code == 1
    assert "FAIL (worst context" in result.stdout
    assert result.stderr == "placerec: a model is not as it should be; see above\n"


def test_check_and_inspect_do_all_files_of_a_folder(tmp_path: Path) -> None:
    pytest.importorskip("kenlm")
    write_several(tmp_path / "tokens")
    model = tmp_path / "model"
    done("train-lm", tmp_path / "tokens", "-o", model, "-q")
    folders = [model, *(model / name for name in FURTHER)]
    files = [str(folder / f"{place}.arpa") for folder in folders for place in PLACES]
    lines = done("check", model).stdout.splitlines()
    assert [line.partition(":")[0] for line in lines] == files
    assert [one["path"] for one in json.loads(done("check", model, "--json").stdout)] == files
    text = done("inspect", model, "w01 w02", "pn10.w1", "--top", 1).stdout
    assert [line for line in text.splitlines() if ": order " in line] == [f"{file}: order 2" for file in files]
    shown = json.loads(done("inspect", model, "w01 w02", "pn10.w1", "--json").stdout)
    assert [one["path"] for one in shown] == files
    explained = [[entry["word"] for entry in one["explained"]] for one in shown]
    assert explained == [["w02"]] * 3 + [[]] * 3 + [["pn10.w1"]] * 3
    fails("model: no model there has all words of 'w01 pn10.w1'", "inspect", model, "w02", "w01 pn10.w1")
    (model / "pn10/office.arpa").write_text("")
    # What was checked before is told.
    result = placerec("check", model)
    assert result.exit_code == 1
    assert len(result.stdout.splitlines()) == 8
    assert result.stderr.startswith(f"placerec: {model}/pn10/office.arpa:1: ")


def test_inspect_shows_ngrams(world: Path) -> None:
    text = done("inspect", world / "model/hall.arpa", "w01 w02", "--top", 1).stdout
    assert "order 2" in text
    assert "w01 w02" in text
    assert json.loads(done("inspect", world / "model/hall.arpa", "w01 w02", "--json").stdout)


# Decoding


def test_decode_refuses_what_does_not_fit(world: Path, tmp_path: Path) -> None:
    images, model = world / "runs/seq2", ("-m", world / "seen-model")
    fails(
        "seen-model: was trained on the words of another dictionary",
        "decode",
        images,
        *model,
        "-w",
        world / "other.npz",
    )
    fails("2 sequences to decode: name a folder for their beliefs with -o", "decode", world / "seen", *model)
    fails("seq2: holds no token stream", "decode", images, *model)
    tokens = world / "seen/seq2.tsv"
    fails("is a token stream, which needs no dictionary", "decode", tokens, *model, "-w", world / "words.npz")
    fails("nowhere: no such model folder; `placerec train-lm", "decode", tokens, "-m", tmp_path / "nowhere")
    fails("nowhere: no such file or folder", "decode", tmp_path / "nowhere", *model)
    done("tokenize", images, "-w", world / "other.npz", "-o", tmp_path / "tokens")
    fails("tokens: its words are of another dictionary", "decode", tmp_path / "tokens", *model)


def test_decode_to_stdout_and_to_a_file_are_the_same(world: Path) -> None:
    shown = done("decode", world / "tokens/run3.tsv", "-m", world / "model")
    assert shown.stdout == (world / "beliefs/run3.tsv").read_text()
    assert shown.stderr == ""


def test_decode_of_images_is_decode_of_their_words(world: Path) -> None:
    model = ("-m", world / "seen-model", "-q")
    images = done("decode", world / "runs/seq2", *model, "-w", world / "words.npz").stdout
    assert images == done("decode", world / "seen/seq2.tsv", *model).stdout
    assert len(images.splitlines()) == 13


def test_decode_streams(world: Path) -> None:
    model = ("-m", world / "model")
    answered = done("decode", "-", *model, stdin="w01\t1.5\nzz\n\nw02\r\n")
    rows = [line.split("\t") for line in answered.stdout.splitlines()]
    assert [row[:5] for row in rows[1:]] == [
        ["0", "1.5", "", "w01", "1"],
        ["1", "", "", "zz", "0"],
        ["2", "", "", "", "0"],
        ["3", "", "", "w02", "1"],
    ]
    assert answered.stderr.splitlines() == [
        "warning: <stdin>:2: the word 'zz' is not in the models' vocabulary; skipped",
        "warning: <stdin>: lines skipped because the models do not list their word: 2",
    ]
    assert done("decode", "-", *model, stdin="").stdout.count("\n") == 1
    misused("it takes neither -o nor --explain", "decode", "-", *model, "-o", world / "no")
    misused("`-` cannot be mixed with files", "decode", "-", world / "tokens", *model)


def test_bad_seconds_end_a_stream_with_an_error(world: Path) -> None:
    result = placerec("decode", "-", "-m", world / "model", stdin="w01\t1\nw01\tsoon\n")
    assert result.exit_code == 1
    assert len(result.stdout.splitlines()) == 2
    assert result.stderr == "placerec: <stdin>:2: time 'soon' is not a number of seconds\n"


# Calibration


def test_calibrate_tells_what_it_found_and_refuses_training(world: Path, tmp_path: Path) -> None:
    shutil.copytree(world / "model", tmp_path / "model")
    text = done("calibrate", tmp_path / "model", world / "tokens/run3.tsv", "--stay", "0.9", "-q").stdout
    assert re.fullmatch(r"temperature  \d.*\nlog loss     \d.* -> \d.*60 frames.*\n", text)
    assert json.loads((tmp_path / "model/model.json").read_text())["calibration"]["options"]["stay"] == 0.9
    fails("run1: trained .*, which is surer of it", "calibrate", tmp_path / "model", world / "tokens/run1.tsv")


# Evaluation


def test_evaluate_names_what_it_cannot_judge(world: Path, tmp_path: Path) -> None:
    (tmp_path / "words.txt").write_text("w01 w02")
    done("decode", tmp_path / "words.txt", "-m", world / "model", "-o", tmp_path / "beliefs")
    fails("no frame of words has a label", "evaluate", tmp_path / "beliefs/words.tsv")
    fails(r"run3\.tsv:1: not a beliefs file: no column selected, best", "evaluate", world / "tokens/run3.tsv")
    fails(r"none\.tsv: no such file", "evaluate", tmp_path / "none.tsv")
    plot = ("--plot", tmp_path / "picture.xyz")
    fails(r"picture\.xyz: no kind of picture; let its name end", "evaluate", world / "beliefs", *plot)


def test_json_has_names_as_they_are(world: Path, tmp_path: Path) -> None:
    text = (world / "beliefs/run3.tsv").read_text().replace("kitchen", "k\u00fcche")
    assert "k\u00fcche" in done("evaluate", "-", "--json", stdin=text.encode()).stdout


def test_evaluate_reads_a_pipe(world: Path) -> None:
    text = (world / "beliefs/run3.tsv").read_text()
    piped = json.loads(done("evaluate", "-", "--json", stdin=text).stdout)
    named = json.loads(done("evaluate", world / "beliefs", "--json").stdout)
    assert piped.pop("sequences").keys() == {"stdin"}
    assert named.pop("sequences").keys() == {"run3"}
    # What made the beliefs stands beside their file.
    assert (piped.pop("made_by"), len(named.pop("made_by"))) == ([], 1)
    assert piped == named
    assert piped["frames"] == 60


# Talk


def test_json_holds_no_nan(world: Path, tmp_path: Path) -> None:
    """JSON has no NaN: other languages' parsers stop there. An unstamped run has times that are not known."""
    write_stream(run_through("run", 5), tmp_path / "run.tsv")
    (tmp_path / "run.txt").write_text(" ".join(run_through("run", 5).words))
    for args in (
        ("decode", tmp_path / "run.txt", "-m", world / "model", "--json"),
        ("evaluate", world / "beliefs", "--json"),
        ("inspect", world / "model/hall.arpa", "w01 w02", "--json"),
    ):
        text = done(*args).stdout
        for part in text.splitlines() if args[0] == "decode" else [text]:
            json.loads(part, parse_constant=pytest.fail)


def test_quiet_is_silent_and_other_commands_tell_what_they_did(world: Path, tmp_path: Path) -> None:
    small = ("--size", 2, "--image-size", 16)
    for i, args in enumerate(
        (
            ("train-words", world / "runs", *small),
            ("tokenize", world / "runs", "-w", world / "words.npz"),
            ("train-lm", world / "tokens"),
            ("decode", world / "tokens", "-m", world / "model"),
            ("relight", world / "runs", "--light", "dim"),
        )
    ):
        told, quiet = (done(*args, "-o", tmp_path / f"{i}{q}", *q.split()) for q in ("", "-q"))
        assert quiet.output == "", args
        assert told.stdout == ""
        assert told.stderr.count("\n") >= 1, args


def test_there_is_no_progress_bar_without_a_terminal(world: Path, tmp_path: Path) -> None:
    result = done("tokenize", world / "runs", "-w", world / "words.npz", "-o", tmp_path / "tokens", "--no-cache")
    assert result.stderr == (
        f"24 frames described\n{tmp_path / 'tokens'}: 2 sequences, " + result.stderr.rpartition("2 sequences, ")[2]
    )
    assert "\r" not in result.stderr
    assert "%" not in result.stderr
