"""An image network in an ONNX file, run by OpenCV: a descriptor.

Images go through one by one: OpenCV runs several at once no faster, and so a frame's numbers do not depend on the
frames around it, nor on `--jobs`. Where OpenCV cannot read a file, onnxruntime does, if it is installed; the two
differ in the last digits.
"""

import re
import threading
import tomllib
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Singles
from placerec.errors import VisionError, check_optional
from placerec.frames.image import quiet
from placerec.frames.sequence import Colours
from placerec.vision.exact import TERMS
from placerec.vision.images import fit_pixels
from placerec.vision.network import SIZE, Network
from placerec.vision.onnx_file import NetworkFile, cut, read_network

# What the file of settings may say.
KEYS = ("layer", "size", "fit", "white", "mean", "deviation", "channels", "layout", "tokens")


def open_network(file: Path | str, layer: str = "") -> Network:
    """The network in an ONNX file, run once to see how many values there are.

    `layer`: the tensor or node to read out, "" for the one that the settings name, else the first output. The
    settings are those in FILE.toml beside FILE.onnx (KEYS), if there is one; what they leave out is told by the
    file, or as the fields' defaults are. Raises VisionError naming the file for one that cannot be used, for
    settings that are none or do not fit it, and where what comes out is no vector.
    """
    path = Path(file)
    settings = _settings(path.with_suffix(".toml"))
    found = read_network(path)
    try:
        named = str(settings.pop("layer", ""))
        tensor = found.tensor(layer or named)
        input_of = _input(found, settings.pop("size", None), settings.pop("layout", ""))
        given = Network(found.digest, 1, tensor, **input_of, **settings, file=str(path.absolute()))
        return replace(given, length=_Runner(given, found).length)
    except VisionError as error:
        raise VisionError(f"{path}: {error}") from error


def with_file(network: Network, file: Path | str) -> Network:
    """The network whose file is there; VisionError naming it if its digest is another."""
    found = read_network(Path(file)).digest
    if found != network.digest:
        raise VisionError(
            f"{file}: is another network (SHA-256 {found[:12]}...) than that of the words ({network.digest[:12]}...); "
            "name the file that they were learned with"
        )
    return replace(network, file=str(Path(file).absolute()))


def fit_for(network: Network, colours: Colours) -> Colours:
    """An image (h, w, 3) of any size as the network takes it, (height, width, 3)."""
    return np.asarray(fit_pixels(colours, network.height, network.width, network.fit), np.uint8)


def describe_fitted(network: Network, fitted: Colours) -> Singles:
    """What the network says of a fitted image (height, width, 3) blue, green, red: float32 (length,), of length 1.

    Exact zeros for an image of one colour throughout. Raises VisionError if the file is not named, or is another.
    """
    if (fitted == fitted[0, 0]).all():
        return np.zeros(network.length, np.float32)
    return runner(network)(fitted)


_loading = threading.Lock()


def runner(network: Network) -> "_Runner":
    """The network, ready to run, loaded once for each process; raises VisionError as `describe_fitted`."""
    with _loading:
        return _opened(network, network.file)


@lru_cache(maxsize=2)
def _opened(network: Network, file: str) -> "_Runner":
    if not file:
        wanted = f"the words are of a network (SHA-256 {network.digest[:12]}...)"
        raise VisionError(f"{wanted}, whose file is not named; say --network FILE")
    found = read_network(Path(file))
    try:
        if found.digest != network.digest:
            raise VisionError("was written over while it was used")
        return _Runner(network, found)
    except VisionError as error:
        raise VisionError(f"{file}: {error}") from error


class _Runner:
    """A network that is loaded; for any number of threads, one at a time."""

    def __init__(self, network: Network, found: NetworkFile) -> None:
        self._network, self._lock = network, threading.Lock()
        noise = np.random.default_rng(0).integers(0, 256, (network.height, network.width, 3), np.uint8)
        self._run, output = _loaded(network, found, _fed(network, noise))
        try:
            self.length = len(_read_out(network, output))
        except VisionError as error:
            raise VisionError(f"{error}; {found.listed()}") from error

    def __call__(self, fitted: Colours) -> Singles:
        values = self._vector(fitted).astype(np.float64)
        norm = float(np.sqrt(np.square(values).sum()))
        if not np.isfinite(norm):
            raise VisionError(f"the network gives infinite values or NaN; {self._network.layer} cannot be used for it")
        return (values / norm if norm else values).astype(np.float32)

    def _vector(self, fitted: Colours) -> Singles:
        with self._lock:
            output = self._run(_fed(self._network, fitted))
        return _read_out(self._network, output)


def _loaded(
    network: Network, found: NetworkFile, images: Singles
) -> tuple[Callable[[Singles], NDArray[Any]], NDArray[Any]]:
    """What runs the network, and the output for these images; VisionError if neither OpenCV nor onnxruntime can."""
    data = cut(found, network.layer, network.shape)
    try:
        with quiet():
            net = cv2.dnn.readNetFromONNX(np.frombuffer(data, np.uint8))

        def run(images: Singles) -> NDArray[Any]:
            net.setInput(images)
            # The memory is the network's own, and written over by the next image.
            return np.array(net.forward())

        with quiet():
            return run, run(images)
    except cv2.error as error:
        reason = re.sub(r"OpenCV\(\S+\) \S+: error: ", "", " ".join(str(error).split()))
        reason = f"OpenCV cannot run it ({reason})"
    check_optional("onnxruntime", f"a network: {reason}, and another try")
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.log_severity_level = 4
    try:
        session = onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])
        name = session.get_inputs()[0].name
        return lambda some: np.asarray(session.run(None, {name: some})[0]), session.run(None, {name: images})[0]
    except Exception as error:  # Its errors have no class in common.
        raise VisionError(f"{reason}, nor can onnxruntime ({' '.join(str(error).split())})") from error


def _fed(network: Network, fitted: Colours) -> Singles:
    """The image as the network's input, float32."""
    values = (fitted[..., ::-1] if network.channels == "rgb" else fitted).astype(np.float32)
    values *= np.float32(network.white / 255)
    values -= np.array(network.mean, np.float32)
    values /= np.array(network.deviation, np.float32)
    laid = values.transpose(2, 0, 1) if network.layout == "nchw" else values
    return np.ascontiguousarray(laid)[None]


def _read_out(network: Network, output: NDArray[Any]) -> Singles:
    """The vector in an output, float32; VisionError for what is none."""
    shape = output.shape
    values = output[0] if len(shape) > 1 and shape[0] == 1 else output
    if len(shape) == 4 and values.ndim == 3:
        # Square maps show which of the three is not of space; without them the layout of the input counts.
        first = values.shape[1] == values.shape[2] and (values.shape[0] != values.shape[1] or network.layout == "nchw")
        last = values.shape[0] == values.shape[1] and not first
        nchw = first or (network.layout == "nchw" and not last)
        values = values.mean(axis=(1, 2) if nchw else (0, 1), dtype=np.float64)
    elif len(shape) == 3 and values.ndim == 2:
        values = values[0] if network.tokens == "first" else values.mean(axis=0, dtype=np.float64)
    if values.ndim != 1 or not values.size or output.dtype.kind != "f":
        raise VisionError(f"{network.layer} is {output.dtype} {shape}, which is no vector, map or row of tokens")
    if values.size > TERMS:
        raise VisionError(f"{network.layer} has {values.size} values, and {TERMS} are the most")
    return values.astype(np.float32)


def _settings(path: Path) -> dict[str, Any]:
    """What a file of settings says; VisionError naming it for one that is no TOML, or says what is not known."""
    try:
        settings = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise VisionError(f"{path}: cannot be read: {error}") from error
    for key in settings:
        if key not in KEYS:
            raise VisionError(f"{path}: {key} is not known; the settings of a network are {', '.join(KEYS)}")
    return settings


def _input(found: NetworkFile, size: Any, layout: Any) -> dict[str, Any]:
    """Height, width and layout of the input; `size`, `layout`: what the settings say of them, None and "" for nothing.

    Raises VisionError where the file says something else, or takes no single image of three channels.
    """
    shape = found.shape
    channels = (shape[1], shape[3]) if len(shape) == 4 else ()
    if shape[:1] not in ((None,), (1,)) or not {3, None}.intersection(channels):
        shown = " x ".join("?" if length is None else str(length) for length in shape)
        raise VisionError(f"its input {found.image} is {shown or 'a number'}; one image of three channels is wanted")
    told = {0: "nchw", 1: "nhwc"}[channels.index(3)] if 3 in channels else layout or "nchw"
    if layout not in ("", told):
        raise VisionError(f"its input is {told}, and the settings say layout {layout!r}; leave that out")
    sides = shape[1:3] if told == "nhwc" else shape[2:]
    wanted = tuple(size) if isinstance(size, list | tuple) else (size, size)
    if len(wanted) != 2:
        raise VisionError(f"size {size!r} cannot be used; give one number, or height and width")
    for side, one in zip(sides, wanted, strict=True):
        if None not in (side, one) and side != one:
            sizes = " x ".join(map(str, sides))
            raise VisionError(f"its input is {sizes} pixels, and the settings say size {size!r}; leave that out")
    height, width = (
        SIZE if side is None and one is None else side or one for side, one in zip(sides, wanted, strict=True)
    )
    return {"height": height, "width": width, "layout": told}
