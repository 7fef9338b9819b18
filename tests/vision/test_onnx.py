"""Image networks: what is fed to them and read out, by numbers that are known; and what is refused."""

import hashlib
import json
import pickle
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from helpers.networks import FLAT, MEAN, PRODUCT, WEIGHTS, looking_network, mean_network, write_network
from helpers.recordings import pictures

from placerec.arrays import Singles
from placerec.errors import MissingExtraError, VisionError
from placerec.frames.sequence import Colours
from placerec.vision import onnx, onnx_file
from placerec.vision.network import DEVIATION, MEAN as MEANS, Network
from placerec.vision.onnx import describe_fitted, fit_for, open_network, with_file

pytest.importorskip("onnx")
SHOWN = pictures(1)[0]  # 48 x 64


def unit(values: Any) -> Singles:
    found: Singles = np.asarray(values / np.sqrt(np.square(values).sum()), np.float32)
    return found


def described(network: Network, picture: Colours = SHOWN) -> Singles:
    found = describe_fitted(network, fit_for(network, picture))
    assert (found.dtype, found.shape) == (np.dtype(np.float32), (network.length,))
    return found


def failure(path: Path, layer: str = "") -> str:
    with pytest.raises(VisionError) as raised:
        open_network(path, layer)
    message = str(raised.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message.removeprefix(f"{path}: ")


def settings(path: Path, text: str) -> Path:
    path.with_suffix(".toml").write_text(text)
    return path


def test_red_green_blue_by_imagenet_and_of_length_one(tmp_path: Path) -> None:
    network = open_network(mean_network(tmp_path / "a.onnx"))
    assert (network.height, network.width, network.layout, network.layer, network.length) == (16, 24, "nchw", "out", 5)
    small = fit_for(network, SHOWN)
    assert np.array_equal(small, cv2.resize(SHOWN, (24, 16), interpolation=cv2.INTER_AREA))
    fed = ((small[..., ::-1] / 255 - MEANS) / DEVIATION).mean(axis=(0, 1))
    assert np.allclose(described(network), unit(fed @ WEIGHTS), atol=1e-5)
    assert network.digest == hashlib.sha256((tmp_path / "a.onnx").read_bytes()).hexdigest()


def test_settings_beside_the_file(tmp_path: Path) -> None:
    text = 'channels = "bgr"\nwhite = 255\nmean = [104, 117, 123]\ndeviation = [1, 2, 3]\n'
    network = open_network(settings(mean_network(tmp_path / "a.onnx"), text))
    fed = ((fit_for(network, SHOWN) - np.array([104.0, 117, 123])) / [1, 2, 3]).mean(axis=(0, 1))
    assert np.allclose(described(network), unit(fed @ WEIGHTS), atol=1e-5)


def test_channels_last_by_the_file(tmp_path: Path) -> None:
    turned = ("Transpose", ["image"], ["turned"], {"perm": [0, 3, 1, 2]})
    nodes: list[tuple[Any, ...]] = [turned, (MEAN[0], ["turned"], MEAN[2]), FLAT, PRODUCT]
    path = write_network(tmp_path / "a.onnx", nodes, shape=(1, 16, 24, 3), weights={"W": WEIGHTS})
    network = open_network(path)
    assert (network.layout, network.height, network.width) == ("nhwc", 16, 24)
    first = open_network(mean_network(tmp_path / "b.onnx"))
    assert np.allclose(described(network), described(first), atol=1e-6)


@pytest.mark.parametrize(
    ("shape", "text", "size"),
    [
        (("N", 3, 16, 24), "", (16, 24)),
        ((1, 3, 16, 24), "size = [16, 24]", (16, 24)),
        (("N", 3, "H", "W"), "", (224, 224)),
        (("N", 3, "H", "W"), "size = 40", (40, 40)),
        (("N", 3, "H", "W"), "size = [32, 40]", (32, 40)),
        (("N", "C", "H", "W"), "size = 40", (40, 40)),
    ],
)
def test_the_size_is_the_files_or_of_the_settings_or_224(
    tmp_path: Path, shape: tuple[int | str, ...], text: str, size: tuple[int, int]
) -> None:
    network = open_network(settings(mean_network(tmp_path / "a.onnx", shape=shape), text))
    assert (network.height, network.width) == size
    assert fit_for(network, SHOWN).shape == (*size, 3)
    assert described(network).any()


def test_the_middle_or_all_of_a_picture(tmp_path: Path) -> None:
    path = mean_network(tmp_path / "a.onnx", shape=("N", 3, 24, 24))
    squashed = fit_for(open_network(path), SHOWN)
    assert np.array_equal(squashed, cv2.resize(SHOWN, (24, 24), interpolation=cv2.INTER_AREA))
    cropped = fit_for(open_network(settings(path, 'fit = "crop"')), SHOWN)
    assert np.array_equal(cropped, cv2.resize(SHOWN, (32, 24), interpolation=cv2.INTER_AREA)[:, 4:28])


def test_a_layer_by_its_tensor_or_node(tmp_path: Path) -> None:
    path = mean_network(tmp_path / "a.onnx")
    small = fit_for(open_network(path), SHOWN)
    means = unit(((small[..., ::-1] / 255 - MEANS) / DEVIATION).mean(axis=(0, 1)))
    for layer in ("flat", "Flatten_flat", "pooled", "GlobalAveragePool_pooled"):
        network = open_network(path, layer)
        assert network.length == 3
        assert np.allclose(described(network), means, atol=1e-5)
    assert open_network(path, "Flatten_flat").layer == "flat"
    settings(path, 'layer = "flat"')
    assert [open_network(path, layer).length for layer in ("", "out")] == [3, 5]


def test_maps_are_averaged_over_space(tmp_path: Path) -> None:
    assert open_network(mean_network(tmp_path / "a.onnx"), "pooled").length == 3
    first = write_network(tmp_path / "b.onnx", [("Relu", ["image"], ["out"])])
    expected = np.maximum((fit_for(open_network(first), SHOWN)[..., ::-1] / 255 - MEANS) / DEVIATION, 0).mean((0, 1))
    assert np.allclose(described(open_network(first)), unit(expected), atol=1e-5)
    # As square maps show, whatever the layout of the input is.
    nodes = [("Transpose", ["image"], ["out"], {"perm": [0, 2, 3, 1]})]
    last = open_network(write_network(tmp_path / "c.onnx", nodes, shape=("N", 3, 16, 16)))
    plain = open_network(write_network(tmp_path / "d.onnx", [("Identity", ["image"], ["out"])], shape=("N", 3, 16, 16)))
    assert last.length == 3
    assert np.allclose(described(last), described(plain), atol=1e-6)


def test_tokens_are_read_by_the_first_one_or_their_mean(tmp_path: Path) -> None:
    nodes = [("Reshape", ["image", "S"], ["rows"]), ("Transpose", ["rows"], ["out"], {"perm": [0, 2, 1]})]
    shape = np.array([1, 3, 384], np.int64)
    path = write_network(tmp_path / "a.onnx", nodes, shape=(1, 3, 16, 24), weights={"S": shape})
    first = open_network(path)
    fed = ((fit_for(first, SHOWN)[..., ::-1] / 255 - MEANS) / DEVIATION).reshape(-1, 3)
    assert first.length == 3
    assert np.allclose(described(first), unit(fed[0]), atol=1e-5)
    mean = open_network(settings(path, 'tokens = "mean"'))
    assert np.allclose(described(mean), unit(fed.mean(axis=0)), atol=1e-5)


def test_a_layer_that_is_not_there_or_no_vector_is_told_with_the_layers(tmp_path: Path) -> None:
    path = mean_network(tmp_path / "a.onnx")
    assert failure(path, "Reshape") == "has no layer 'Reshape'; its layers are pooled, flat, out"
    five = [("Unsqueeze", ["image", "A"], ["out"])]
    axes = {"A": np.array([0], np.int64)}
    message = failure(write_network(tmp_path / "b.onnx", five, weights=axes))
    assert message == "out is float32 (1, 1, 3, 16, 24), which is no vector, map or row of tokens; its layers are out"
    wide = write_network(tmp_path / "c.onnx", [("Flatten", ["image"], ["out"])], shape=("N", 3, 64, 64))
    assert failure(wide) == "out has 12288 values, and 4096 are the most; its layers are out"
    long = [("Relu", ["image" if not i else f"r{i - 1}"], [f"r{i}"]) for i in range(50)]
    message = failure(write_network(tmp_path / "d.onnx", long, outputs=["r49"]), "x")
    assert message.endswith("r48, r49, and 20 before these")


class Bomb:
    """Runs what it likes when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> Any:
        return (Path.touch, (self.path,))


@pytest.mark.parametrize("protocol", range(2, pickle.HIGHEST_PROTOCOL + 1))
def test_pickled_weights_are_never_loaded(tmp_path: Path, protocol: int) -> None:
    path, trace = tmp_path / "net.pt", tmp_path / "trace"
    path.write_bytes(pickle.dumps(Bomb(trace), protocol))
    expected = "holds pickled weights, which are never loaded, for that runs what they hold; export the network as ONNX"
    assert failure(path).startswith(expected)
    assert not trace.exists()
    pickle.loads(path.read_bytes())  # noqa: S301
    assert trace.exists()


def test_pickled_weights_in_a_zip_file_are_never_loaded(tmp_path: Path) -> None:
    import zipfile

    with zipfile.ZipFile(tmp_path / "net.pt", "w") as archive:
        archive.writestr("archive/data.pkl", pickle.dumps(Bomb(tmp_path / "trace")))
    assert failure(tmp_path / "net.pt").startswith("holds pickled weights, which are never loaded")
    assert not (tmp_path / "trace").exists()


def test_what_is_no_network(tmp_path: Path) -> None:
    whole = mean_network(tmp_path / "a.onnx").read_bytes()
    path = tmp_path / "b.onnx"
    assert failure(path) == "no such file"
    assert failure(tmp_path).startswith("is no file; export the network as ONNX")
    for data in (b"", b"hello", whole[:-20], whole[: len(whole) // 2], b"\xff" * 99, bytes(99)):
        path.write_bytes(data)
        assert "is no ONNX file" in failure(path), data[:9]


@pytest.mark.parametrize("step", [1, 7])
def test_a_spoilt_file_is_refused_or_gives_numbers(tmp_path: Path, step: int) -> None:
    whole = mean_network(tmp_path / "a.onnx").read_bytes()
    rng, path = np.random.default_rng(step), tmp_path / "b.onnx"
    for at in range(0, len(whole), step * 5):
        path.write_bytes(whole[:at] + bytes([rng.integers(256)]) + whole[at + 1 :])
        with suppress(VisionError):
            onnx_file.read_network(path)


def test_networks_that_take_no_single_colour_image(tmp_path: Path) -> None:
    path = tmp_path / "a.onnx"
    same = [("Identity", ["image"], ["out"])]
    for shape, shown in (((1, 1, 16, 16), "1 x 1 x 16 x 16"), ((4, 3, 8, 8), "4 x 3 x 8 x 8"), (("N", 9), "? x 9")):
        message = failure(write_network(path, same, shape=shape))
        assert message == f"its input image is {shown}; one image of three channels is wanted"
    both = [("Add", ["image", "mask"], ["out"])]
    message = failure(write_network(path, both, more_inputs=["mask"]))
    assert message == "takes 2 inputs (image, mask); a network that takes one image is wanted"
    message = failure(write_network(path, same, kind="FLOAT16"))
    assert message == "its input image is not of 32-bit floating point; export it in that precision"


def test_weights_in_another_file_are_refused(tmp_path: Path) -> None:
    from onnx import external_data_helper, load, save

    model = load(str(mean_network(tmp_path / "a.onnx")))
    external_data_helper.convert_model_to_external_data(model, location="a.data", size_threshold=0)
    save(model, str(tmp_path / "a.onnx"))
    assert failure(tmp_path / "a.onnx") == "has its weights in another file; export it with external_data=False"


def test_a_file_twice_the_size_of_the_memory_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = mean_network(tmp_path / "a.onnx")
    assert onnx_file.memory_limit() > path.stat().st_size
    monkeypatch.setattr(onnx_file, "memory_limit", lambda: 64 << 20)
    assert open_network(path).length == 5
    with path.open("r+b") as file:
        file.truncate(128 << 20)  # a hole, that takes no room on the disk
    monkeypatch.setattr(Path, "read_bytes", lambda path: pytest.fail("was read"))
    expected = "has 128 MiB, and 3 times as much is needed of 64 MiB of memory; take a smaller network"
    assert failure(path) == expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sizes = 3", "sizes is not known; the settings of a network are layer, size, fit, white, mean, deviation"),
        ("size = [", "cannot be read: "),
    ],
)
def test_settings_that_are_none(tmp_path: Path, text: str, message: str) -> None:
    path = settings(mean_network(tmp_path / "a.onnx"), text)
    with pytest.raises(VisionError) as raised:
        open_network(path)
    assert str(raised.value).startswith(f"{tmp_path / 'a.toml'}: {message}")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("size = 17", "its input is 16 x 24 pixels, and the settings say size 17; leave that out"),
        ("size = [1, 2, 3]", "size [1, 2, 3] cannot be used; give one number, or height and width"),
        ('layout = "nhwc"', "its input is nchw, and the settings say layout 'nhwc'; leave that out"),
        ('fit = "stretch"', "fit 'stretch' is not known; choose one of squash, crop"),
        ('channels = "bgra"', "channels 'bgra' is not known; choose one of rgb, bgr"),
        ("tokens = 1", "tokens 1 is not known; choose one of first, mean"),
        ("mean = 0.5", "mean 0.5 cannot be used; give three numbers, one a channel"),
        ("mean = [1, nan, 1]", "mean [1, nan, 1] cannot be used; give three numbers, one a channel"),
        ("deviation = [1, 0, 1]", "a deviation of 0 cannot be used; give numbers above 0"),
        ("white = 0", "white 0 cannot be used; give 1, or 255"),
    ],
)
def test_settings_that_do_not_fit(tmp_path: Path, text: str, message: str) -> None:
    assert failure(settings(mean_network(tmp_path / "a.onnx"), text)) == message


@pytest.mark.parametrize(("size", "shown"), [("4", "4"), ("1e3", "1000.0"), ("5000", "5000"), ("true", "True")])
def test_sizes_that_cannot_be_used(tmp_path: Path, size: str, shown: str) -> None:
    path = settings(mean_network(tmp_path / "a.onnx", shape=("N", 3, "H", "W")), f"size = {size}")
    assert failure(path) == f"a size of {shown} cannot be used; give 8 to 4096 pixels"


def test_into_a_file_and_back(tmp_path: Path) -> None:
    network = open_network(mean_network(tmp_path / "a.onnx"))
    told: dict[str, Any] = json.loads(json.dumps(network.as_dict()))
    assert "file" not in told
    again = Network(**told)
    assert again == network
    assert hash(again) == hash(network)
    with pytest.raises(VisionError, match=r"a network \(SHA-256 .{12}\.\.\.\), whose file is not named; say --network"):
        described(again)
    assert np.array_equal(described(with_file(again, tmp_path / "a.onnx")), described(network))
    moved = (tmp_path / "a.onnx").rename(tmp_path / "b.onnx")
    assert np.array_equal(described(with_file(again, moved)), described(network))


def test_another_file_is_refused(tmp_path: Path) -> None:
    network = open_network(mean_network(tmp_path / "a.onnx"))
    other = looking_network(tmp_path / "b.onnx")
    with pytest.raises(VisionError, match=f"{other}: is another network .* than that of the words .*; name the file"):
        with_file(network, other)
    other.replace(tmp_path / "a.onnx")
    onnx._opened.cache_clear()
    with pytest.raises(VisionError, match=r"a\.onnx: was written over while it was used"):
        described(network)


def test_a_picture_of_one_colour_is_zero(tmp_path: Path) -> None:
    network = open_network(mean_network(tmp_path / "a.onnx"))
    assert not described(network, np.full((50, 40, 3), (9, 80, 200), np.uint8)).any()


def test_numbers_that_are_none_are_told(tmp_path: Path) -> None:
    network = open_network(write_network(tmp_path / "a.onnx", [("Log", ["image"], ["out"])]))
    with pytest.raises(VisionError, match="the network gives infinite values or NaN; out cannot be used for it"):
        described(network)


def test_any_number_of_threads_gives_the_same(tmp_path: Path) -> None:
    network = open_network(looking_network(tmp_path / "a.onnx"), "seen")
    shown = pictures(40)

    def all_of(images: Iterable[Colours]) -> list[Singles]:
        return [described(network, image) for image in images]

    alone = all_of(shown)
    assert len({values.tobytes() for values in alone}) == 40
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda image: described(network, image), shown))
    assert all(map(np.array_equal, alone, together))
    assert all(map(np.array_equal, all_of(reversed(shown)), reversed(alone)))


def without_opencv(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*args: object) -> None:
        raise cv2.error("it cannot")

    monkeypatch.setattr(cv2.dnn, "readNetFromONNX", refuse)


def test_without_onnxruntime_it_is_said_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = mean_network(tmp_path / "a.onnx")
    without_opencv(monkeypatch)
    monkeypatch.setitem(__import__("sys").modules, "onnxruntime", None)
    expected = r"a network: OpenCV cannot run it \(it cannot\), and another try needs the package onnxruntime"
    with pytest.raises(MissingExtraError, match=expected):
        open_network(path)


def test_onnxruntime_where_opencv_cannot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("onnxruntime")
    path = looking_network(tmp_path / "a.onnx")
    network = open_network(path, "seen")
    found = described(network)
    without_opencv(monkeypatch)
    onnx._opened.cache_clear()
    other = open_network(path, "seen")
    assert other == network
    assert np.allclose(described(other), found, atol=1e-5)
    path.write_bytes(path.read_bytes().replace(b"Conv", b"Cony"))
    assert "OpenCV cannot run it" in (message := failure(path))
    assert "nor can onnxruntime" in message
    onnx._opened.cache_clear()
