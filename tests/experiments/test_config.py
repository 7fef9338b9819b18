"""Reading an experiment's file: what is accepted, and what every mistake is told."""

from pathlib import Path

import pytest
from helpers.small_experiment import CONFIG

from placerec.errors import ExperimentError
from placerec.experiments.grid.config import read_config


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "grid.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_all_of_a_config_is_read(tmp_path: Path) -> None:
    options = '[options]\nstay = 0.9\nper = "frame"\nunits = "all"\nas_in_paper = true\n'
    text = CONFIG.replace("[grid]", f"{options}[grid]")
    config = read_config(write(tmp_path, text))
    assert (config.order, config.size, config.seeds) == ((1, 3), (4,), 1)
    assert config.smoothing == ("witten-bell", "lidstone-backoff")
    assert config.select == ("none", "compress:3", "unique")
    assert config.transition == ("fixed", "learned")
    assert (config.stay, config.per, config.units, config.as_in_paper) == (0.9, "frame", "all", True)
    assert (config.sequences, config.test, config.split) == ((), ("run3",), "")


def test_defaults_are_the_papers(tmp_path: Path) -> None:
    text = '[data]\nsequences = ["a"]\nsplit = "leave-one-out"\n[grid]\norder = [1]\nsmoothing = ["witten-bell"]\n'
    config = read_config(write(tmp_path, text + 'select = ["none"]\nsize = [10]\n'))
    assert (config.transition, config.seeds) == (("fixed",), 5)
    assert (config.stay, config.per, config.units, config.as_in_paper) == (0.99, "update", "live", False)


def test_tokens_are_found_by_size_and_seed(tmp_path: Path) -> None:
    config = read_config(write(tmp_path, CONFIG.replace('"tokens"', '"{seed}/of-{size}"')))
    assert config.tokens_folder(10, 3) == tmp_path / "3" / "of-10"


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("[grid]", "[grit]", "unknown table [grit]; there are [data], [grid], [options]"),
        ("order = [1, 3]", "", "[grid] has no 'order'; add it"),
        ("order = [1, 3]", "orders = [1, 3]", "unknown key 'orders' in [grid]; there are order, "),
        ("order = [1, 3]", "order = []", "[grid] order = [] is no list with something in it; write order = [...]"),
        ("order = [1, 3]", "order = 2", "[grid] order = 2 is no list"),
        ("order = [1, 3]", "order = [0]", "[grid] order = 0 cannot be used; give a whole number from 1 to 9"),
        ("order = [1, 3]", "order = [true]", "[grid] order = True cannot be used"),
        ("order = [1, 3]", "order = [1.0]", "[grid] order = 1.0 cannot be used"),
        ("order = [1, 3]", "order = [2, 2]", "[grid] order lists 2 twice; once is enough"),
        ('"witten-bell"', '"good-turing"', "[grid] smoothing = 'good-turing' cannot be used; choose witten-bell, "),
        ('"compress:3"', '"compress:0"', "[grid] select = 'compress:0' cannot be used; give none, unique, subsample:S"),
        ('"compress:3"', "3", "[grid] select = 3 cannot be used; give none, unique, "),
        ("size = [4]", "size = [1]", "[grid] size = 1 cannot be used; give a whole number from 2 to 200"),
        ('"learned"', '"taught"', "[grid] transition = 'taught' cannot be used; choose fixed, learned"),
        ("seeds = 1", "seeds = 0", "[grid] seeds = 0 cannot be used; give how many there are"),
        ("seeds = 1", "seeds = [0, 1]", "[grid] seeds = [0, 1] cannot be used"),
        ('test = ["run3"]', "", "[data] has neither 'test' nor 'split'; give one"),
        ('test = ["run3"]', 'test = ["run3"]\nsplit = "leave-one-out"', "'test' and 'split', which exclude each other"),
        ('test = ["run3"]', 'split = "light"', "[data] split = 'light' looks at images, and tokens are given; give"),
        ('test = ["run3"]', 'split = "leave-two-out"', "[data] split = 'leave-two-out' cannot be used; choose leave-"),
        ('tokens = "tokens"', 'tokens = "t"\nsequences = ["a"]', "'sequences' and 'tokens', which exclude each other"),
        ('tokens = "tokens"', 'tokens = "{side}"', "[data] tokens = '{side}' holds {side}; write the folder as in"),
        ('tokens = "tokens"', 'tokens = "{size"', "[data] tokens = '{size': expected '}'"),
        ('tokens = "tokens"', 'tokens = ""', "[data] tokens = '' cannot be used; give a text that is not empty"),
        ("seeds = 1", "seeds = 2", "[data] tokens = 'tokens' is the same for every seed; write the folder as in"),
        ("[grid]", "[options]\nstay = 1.5\n[grid]", "[options] stay = 1.5 cannot be used; give a probability"),
        ("[grid]", '[options]\nper = "day"\n[grid]', "[options] per = 'day' cannot be used; choose update, frame"),
        ("[grid]", '[options]\nunits = "dead"\n[grid]', "[options] units = 'dead' cannot be used; choose live, all"),
        (
            "[grid]",
            "[options]\nas_in_paper = 1\n[grid]",
            "[options] as_in_paper = 1 cannot be used; write true or false",
        ),
        ("[grid]", "[grid", "is not TOML: "),
        ("[data]", "options = 3\n[data]", "options = 3 is no table; write [options] on a line of its own"),
    ],
)
def test_a_mistake_is_told_with_file_key_value_and_remedy(tmp_path: Path, old: str, new: str, told: str) -> None:
    assert old in CONFIG
    path = write(tmp_path, CONFIG.replace(old, new, 1))
    with pytest.raises(ExperimentError) as caught:
        read_config(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert told in message
    assert "\n" not in message


def test_a_missing_file_or_table_is_told(tmp_path: Path) -> None:
    with pytest.raises(ExperimentError, match=r"grid.toml: no such file"):
        read_config(tmp_path / "grid.toml")
    with pytest.raises(ExperimentError, match=r"the table \[grid\] is missing"):
        read_config(write(tmp_path, '[data]\ntokens = "a"\ntest = ["b"]\n'))
