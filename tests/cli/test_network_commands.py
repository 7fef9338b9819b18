"""Words of an image network and of colours, as a user meets them: described, learned, decoded, and live."""

import json
import re
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.network_camera import jpegs, network_camera
from helpers.networks import looking_network
from helpers.recordings import write_video
from helpers.small_world import write_coloured
from helpers.typed_commands import done, fails, misused

from placerec.errors import VisionError
from placerec.frames import find_sequences
from placerec.frames.image import read_image
from placerec.frames.sequence import Colours
from placerec.inspection.frame import view_frame
from placerec.model import load_recognizer
from placerec.page.propose import Proposer
from placerec.vision import DictionarySet

pytest.importorskip("onnx")
SMALL = ("--size", 3, "-q")


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four runs through two places that only colours tell apart, a network, its words, and what they teach."""
    root = tmp_path_factory.mktemp("world")
    for number in range(4):
        write_coloured(root / f"runs/seq{number + 1}", number)
    net = looking_network(root / "net.onnx")
    runs = [root / f"runs/seq{number}" for number in (1, 2, 3)]
    done("train-words", *runs, "--descriptor", f"onnx:{net}#seen", "-o", root / "words.npz", *SMALL)
    done("tokenize", root / "runs", "-w", root / "words.npz", "--network", net, "-o", root / "tokens", "-q")
    done("train-lm", *(root / f"tokens/seq{number}.tsv" for number in (1, 2, 3)), "-o", root / "model", "-q")
    return root


def accuracy(beliefs: Path) -> float:
    found = re.search(r"accuracy +([\d.]+) %", done("evaluate", beliefs).stdout)
    assert found
    return float(found[1])


def opened(path: Path) -> Colours:
    """The colours of an image file."""
    image = read_image(path, colours=True)
    assert not isinstance(image, np.ndarray)
    return image.colours


def test_the_words_of_a_network_tell_places_apart(world: Path, tmp_path: Path) -> None:
    done("decode", world / "tokens/seq4.tsv", "-m", world / "model", "-o", tmp_path / "beliefs", "-q")
    assert accuracy(tmp_path / "beliefs") > 90
    runs = [world / f"runs/seq{n}" for n in (1, 2, 3)]
    done("train-words", *runs, "-o", tmp_path / "w.npz", "--image-size", 16, *SMALL)
    done("tokenize", world / "runs", "-w", tmp_path / "w.npz", "-o", tmp_path / "tokens", "-q")
    done("train-lm", *(tmp_path / f"tokens/seq{n}.tsv" for n in (1, 2, 3)), "-o", tmp_path / "model", "-q")
    done("decode", tmp_path / "tokens/seq4.tsv", "-m", tmp_path / "model", "-o", tmp_path / "gray", "-q")
    # Grey levels know nothing of the places.
    assert accuracy(tmp_path / "gray") < 80


def test_images_are_decoded_with_the_network(world: Path, tmp_path: Path) -> None:
    given = ("decode", world / "runs/seq4", "-w", world / "words.npz", "-m", world / "model")
    net = world / "net.onnx"
    found = done(*given, "--network", net)
    assert found.stdout == done("decode", world / "tokens/seq4.tsv", "-m", world / "model").stdout
    fails(r"the words are of a network \(SHA-256 .*\), whose file is not named; say --network FILE", *given)
    other = shutil.copy(net, tmp_path / "other.onnx")
    assert done(*given, "--network", other).stdout == found.stdout
    looking_network(tmp_path / "other.onnx", 36)
    fails(r"other\.onnx: is another network .* name the file that they were learned with", *given, "--network", other)


def test_a_network_goes_live(world: Path) -> None:
    pictures = jpegs(world / "runs/seq4/std_cam")
    given = ("-w", world / "words.npz", "-m", world / "model", "--network", world / "net.onnx")
    with network_camera(pictures, wait=0.05) as address:
        run = done("decode", f"camera:{address}", "--live", *given)
    header, *lines = run.stdout.splitlines()
    assert header.split("\t")[:2] == ["frame", "time"]
    best = [dict(zip(header.split("\t"), line.split("\t"), strict=True))["best"] for line in lines]
    assert len(best) > 8
    assert (best[1], best[-1]) == ("hall", "kitchen")


def test_any_number_of_jobs_gives_the_same_bytes(world: Path, tmp_path: Path) -> None:
    net = world / "net.onnx"
    for jobs in (1, 2):
        args = ("--descriptor", f"gist+onnx:{net}#seen+colour", "--image-size", 16, "--jobs", jobs, "-q")
        done("describe", world / "runs", "-o", tmp_path / f"{jobs}.npz", *args)
    assert (tmp_path / "1.npz").read_bytes() == (tmp_path / "2.npz").read_bytes()
    with np.load(tmp_path / "1.npz") as arrays:
        values, meta = arrays["descriptors"], json.loads(str(arrays["meta"]))
    assert values.shape == (64, 384 + 48 + 72)
    assert np.allclose(np.linalg.norm(values[:, 384:432], axis=1), 1, atol=1e-5)
    told = meta["descriptor"]
    assert (told["kind"], told["network"]["layer"], told["network"]["length"]) == ("gist+onnx+colour", "seen", 48)
    assert "file" not in told["network"]
    # Each part of a joined descriptor is what it is alone.
    done("describe", world / "runs", "-o", tmp_path / "gist.npz", "--image-size", 16, "-q")
    done("describe", world / "runs", "-o", tmp_path / "colour.npz", "--descriptor", "colour", "-q")
    for name, part in (("gist", values[:, :384]), ("colour", values[:, 432:])):
        with np.load(tmp_path / f"{name}.npz") as arrays:
            assert np.array_equal(arrays["descriptors"], part)


def test_a_video_has_the_words_of_its_frames(world: Path, tmp_path: Path) -> None:
    frames = [opened(path) for path in sorted((world / "runs/seq4/std_cam").iterdir())]
    path = write_video(tmp_path / "run.avi", "FFV1", frames)
    done("tokenize", path, "-w", world / "words.npz", "--network", world / "net.onnx", "-o", tmp_path / "t", "-q")

    def words(path: Path) -> list[str]:
        header, *lines = path.read_text().splitlines()
        return [line.split("\t")[header.split("\t").index("word")] for line in lines if not line.startswith("##")]

    same = [a == b for a, b in zip(words(tmp_path / "t/run.tsv"), words(world / "tokens/seq4.tsv"), strict=True)]
    assert sum(same) > 12


def test_learn_takes_a_network_as_a_view(world: Path, tmp_path: Path) -> None:
    net = world / "net.onnx"
    views = f"gist,colour:pn,onnx:{net}#seen:pn,gist+onnx:{net}#seen:pn"
    args = ("--views", views, "--size", 3, "--image-size", 16, "-q")
    result = done("learn", world / "runs", "--test", world / "runs/seq4", "-o", tmp_path / "model", *args)
    assert re.search(r"accuracy (9\d|100)\.", result.stdout), result.stdout
    assert "needs --network FILE, the file of the network, and nothing else" in result.stdout
    made = DictionarySet.load(tmp_path / "model/words.npz", network=net)
    assert [one.view for one in made.dictionaries] == ["gist", "colour:pn", "onnx:pn", "gist+onnx:pn"]
    (path,) = (tmp_path / "model/beliefs").glob("seq4.tsv")
    again = done("decode", world / "runs/seq4", "-m", tmp_path / "model", "--network", net)
    assert again.stdout == path.read_text()


def test_a_program_hands_the_recognizer_images_in_colours(world: Path) -> None:
    made = DictionarySet.load(world / "words.npz", network=world / "net.onnx")
    recognizer = load_recognizer(world / "model", dictionary=made)
    for path in sorted((world / "runs/seq4/std_cam").iterdir())[:8]:
        image = read_image(path, colours=True)
        assert not isinstance(image, np.ndarray)
        assert made.words_of(image) == made.words_of(image.colours)
        assert recognizer.update(image.colours).best == "hall"
        with pytest.raises(VisionError, match="the image is grey, and colours are looked at; give"):
            recognizer.update(image.gray)
    assert DictionarySet.load(world / "words.npz").fingerprint == made.fingerprint


def test_what_looks_at_words_takes_the_network(world: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    net = ("--network", world / "net.onnx")
    done("show-words", world / "words.npz", world / "runs", *net, "-o", tmp_path / "words.png")
    image = next((world / "runs/seq4/std_cam").iterdir())
    seen = done("show-frame", image, world / "runs", "-w", world / "words.npz", *net, "-o", tmp_path / "seen.png")
    assert "nearest" in seen.stdout
    view = view_frame(image, DictionarySet.load(world / "words.npz", network=world / "net.onnx").dictionaries[0])
    # In the size and the colours that the network sees: red before blue.
    expected = cv2.resize(opened(image), (32, 32), interpolation=cv2.INTER_LINEAR)[..., ::-1]
    assert view.picture.shape == (32, 32, 3)
    assert np.abs(view.picture.astype(int) - expected).mean() < 3
    changes = done("stability", world / "runs", "-w", world / "words.npz", *net, "--json")
    assert json.loads(changes.stdout)["frames"] == 64
    for command in (("show-words", world / "words.npz"), ("stability", "-w", world / "words.npz")):
        fails("whose file is not named; say --network FILE", *command, world / "runs")


def test_pages_and_comparisons_take_the_network(world: Path, tmp_path: Path) -> None:
    pytest.importorskip("sklearn")
    net, words = ("--network", world / "net.onnx"), ("-w", world / "words.npz")
    done("decode", world / "runs/seq4", *words, "-m", world / "model", *net, "-o", tmp_path / "beliefs", "-q")
    page = ("report", tmp_path / "beliefs", "--frames", world / "runs/seq4", *words, "-o", tmp_path / "r.html", "-q")
    done(*page, *net)
    fails("whose file is not named; say --network FILE", *page, "--no-cache")
    given = ("compare", world / "runs", "--test", world / "runs/seq4", *words, "--methods", "hohmm,naive-bayes", "-q")
    found = done(*given, *net, "-o", tmp_path / "out")
    assert re.search(r"naive-bayes +(9\d|100)\.", found.stdout), found.stdout
    shutil.copy(world / "words.npz", world / "model/words.npz")
    sequences = find_sequences([world / "runs/seq4"])
    proposer = Proposer(sequences, world / "model", world / "net.onnx")
    assert proposer.spec.network is not None
    assert proposer.spec.network.file == str(world / "net.onnx")


def test_what_names_no_network(world: Path, tmp_path: Path) -> None:
    given = ("train-words", world / "runs", "-o", tmp_path / "w.npz", *SMALL)
    fails("none.onnx: no such file", *given, "--descriptor", f"onnx:{tmp_path}/none.onnx")
    message = "has no layer 'x'; its layers are answers, strong, corners, seen, logits"
    fails(message, *given, "--descriptor", f"onnx:{world}/net.onnx#x")
    misused("'onnx' is not one of gist, lbp, ranks, centrist, colour, onnx:FILE", *given, "--descriptor", "onnx")
    fails("onnx descriptors are made by the network in a file; name it, as in onnx:net.onnx", *given, "--views", "onnx")
    misused("names two networks, a.onnx and b.onnx; one is possible", *given, "--views", "onnx:a.onnx,onnx:b.onnx:pn")
    done("train-words", world / "runs", "--descriptor", "colour", "-o", tmp_path / "colour.npz", *SMALL)
    unwanted = ("tokenize", world / "runs", "-w", tmp_path / "colour.npz", "-o", tmp_path / "t")
    fails(
        r"net\.onnx: is not wanted, for the words are of colour descriptors; leave it out",
        *unwanted,
        "--network",
        world / "net.onnx",
    )
    done(*unwanted, "-q")
