"""The rules of section 2.1, one by one."""

import io
import math
from collections.abc import Sequence

import pytest

from placerec.srilm.text.numbers import leading_float, leading_int
from placerec.srilm.text.streams import SrilmError, Streams
from placerec.srilm.tools.options import Option, Parsed, parse
from placerec.version import __version__

OPTIONS = {
    "order": Option("unsigned", 3, "longest n-gram"),
    "debug": Option("int", 0, "how much to say"),
    "addsmooth": Option("float", -1.0, "what to add"),
    "lm": Option("string", None, "model"),
    "sort": Option("flag", False, "sorted"),
    "skip": Option("flag", False, "not specified", refused=True),
}


def parsed(arguments: Sequence[str], *, stops: bool = False) -> tuple[Parsed, str]:
    streams = Streams(io.BytesIO(), io.BytesIO(), errors := io.BytesIO())
    return parse("ngram-count", OPTIONS, arguments, streams, stops=stops), errors.getvalue().decode()


def test_defaults_and_what_was_given() -> None:
    values, said = parsed(["-sort", "-order", "4"])
    assert (values["order"], values["sort"], values["lm"], values["addsmooth"]) == (4, True, None, -1.0)
    assert values.given == {"sort", "order"}
    assert said == ""


def test_the_last_occurrence_wins() -> None:
    assert parsed(["-lm", "a", "-lm", "b"])[0]["lm"] == "b"


def test_values_may_look_like_options() -> None:
    assert parsed(["-lm", "-sort"])[0]["sort"] is False


def test_other_arguments_are_ignored() -> None:
    values, said = parsed(["foo", "-order", "1", "bar"])
    assert (values["order"], values.rest, said) == (1, ["foo", "bar"], "")


@pytest.mark.parametrize("argument", ["-foo", "--order", "-", "-ord", "--"])
def test_unknown_options_are_warned_of_and_skipped(argument: str) -> None:
    values, said = parsed([argument, "-order", "2"])
    assert said == f'Unknown option "{argument}";  type "ngram-count -help" for information\n'
    assert values["order"] == 2


def test_a_missing_value_leaves_the_default() -> None:
    values, said = parsed(["-sort", "-order"])
    assert said == 'Warning: ngram-count option "-order" needs an argument\n'
    assert values["order"] == 3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["-order", "two"], 'Warning: option "-order" got a non-numeric argument "two".  Using default: 3\n'),
        (["-order", "-1"], 'Warning: option "-order" got a negative argument "-1".  Using default: 3.\n'),
        (
            ["-addsmooth", "x"],
            'Warning: option "-addsmooth" got non-floating-point argument "x".  Using default: -1.\n',
        ),
    ],
)
def test_values_that_are_no_numbers_leave_the_default(arguments: list[str], message: str) -> None:
    values, said = parsed([*arguments, "-sort"])
    assert said == message
    assert values[arguments[0][1:]] == OPTIONS[arguments[0][1:]].default
    assert values["sort"] is True
    assert values.given == {"sort"}


def test_negative_values_are_fine_where_a_number_may_be_negative() -> None:
    values, said = parsed(["-debug", "-1"])
    assert (values["debug"], values.given, values.rest, said) == (-1, {"debug"}, [], "")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0x2", 2),
        ("012", 10),
        ("08", 0),
        ("3x", 3),
        (" +7", 7),
        ("-0X1f", -31),
        ("0x", 0),
        ("99999999999999999999", 2**63 - 1),
        ("-" + "9" * 5000, 1 - 2**63),
        ("1" + "0" * 5000, 2**63 - 1),
        ("0x" + "0" * 5000 + "1", 1),
    ],
)
def test_whole_numbers_are_those_of_strtol(text: str, value: int) -> None:
    assert leading_int(text) == value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3rest", 1e-3),
        (".5", 0.5),
        ("5.", 5.0),
        ("1e", 1.0),
        ("0x1p-1", 0.5),
        ("0x", 0.0),
        ("0x.8", 0.5),
        ("-inf", -math.inf),
        ("Infinity", math.inf),
        ("\t2", 2.0),
        ("0x1p99999", math.inf),
        ("1e999", math.inf),
    ],
)
def test_real_numbers_are_those_of_strtod(text: str, value: float) -> None:
    assert leading_float(text) == value


@pytest.mark.parametrize("text", ["", "x", "-", ".", "e5", "\xa01", "²"])
def test_what_is_no_number(text: str) -> None:
    assert leading_float(text) is None
    assert leading_int(text) is None


def test_nan_is_a_number() -> None:
    assert math.isnan(leading_float("nan") or 0)


@pytest.mark.parametrize("argument", ["-help", "-?"])
def test_help_shows_every_option_and_ends_well(argument: str) -> None:
    with pytest.raises(SrilmError) as caught:
        parsed(["-order", "2", argument])
    assert caught.value.status == 0
    assert all(f" -{name} " in f"{caught.value} " for name in OPTIONS)


def test_version_ends_well() -> None:
    with pytest.raises(SrilmError, match=__version__) as caught:
        parsed(["-version"])
    assert caught.value.status == 0


def test_refused_options_are_named() -> None:
    with pytest.raises(SrilmError) as caught:
        parsed(["-skip"])
    assert (str(caught.value), caught.value.status) == (
        "ngram-count: option -skip is not supported by placerec: not specified",
        2,
    )


def test_ngram_merge_stops_at_the_first_file_or_two_hyphens() -> None:
    assert parsed(["-sort", "a", "-order", "2"], stops=True)[0].rest == ["a", "-order", "2"]
    assert parsed(["-sort", "--", "-order", "2"], stops=True)[0].rest == ["-order", "2"]
