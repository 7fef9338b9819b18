"""How an image network describes an image: what is fed to it, and what is read out; all that its words depend on."""

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from placerec.errors import VisionError
from placerec.vision.exact import TERMS
from placerec.vision.images import FITS, SMALLEST

SIZE = 224  # of the image, in pixels, where neither file nor settings tell
MEAN, DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)  # of ImageNet's images: red, green, blue, white 1
CHOICES = {"fit": FITS, "channels": ("rgb", "bgr"), "layout": ("nchw", "nhwc"), "tokens": ("first", "mean")}
_LARGEST = 4096  # pixels a side


@dataclass(frozen=True)
class Network:
    """An image network, and all else that its descriptors depend on. `onnx.open_network` makes it of a file.

    `digest`: the SHA-256 of the ONNX file. `length`: the values of a descriptor. `layer`: the tensor that is read out.
    `height`, `width`: of the image, in pixels, and `fit`: how a frame is made that large. A value v of 0..255 becomes
    (v / 255 * white - mean) / deviation, with `mean` and `deviation` of each channel in the order `channels`.
    `layout`: of the input. `tokens`: what becomes of a layer (1, tokens, d): the first one, or their mean; maps are
    averaged over space. `file`: where the file is on this machine, no part of a dictionary.
    """

    digest: str
    length: int
    layer: str
    height: int = SIZE
    width: int = SIZE
    fit: str = "squash"
    white: float = 1.0
    mean: tuple[float, float, float] = MEAN
    deviation: tuple[float, float, float] = DEVIATION
    channels: str = "rgb"
    layout: str = "nchw"
    tokens: str = "first"
    file: str = field(default="", compare=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("mean", "deviation"):
            object.__setattr__(self, name, _three(name, getattr(self, name)))
        if min(self.deviation) <= 0:
            raise VisionError(f"a deviation of {min(self.deviation):g} cannot be used; give numbers above 0")
        for name, choices in CHOICES.items():
            if getattr(self, name) not in choices:
                raise VisionError(f"{name} {getattr(self, name)!r} is not known; choose one of {', '.join(choices)}")
        for side in (self.height, self.width):
            if not _is_whole(side, SMALLEST, _LARGEST):
                raise VisionError(f"a size of {side!r} cannot be used; give {SMALLEST} to {_LARGEST} pixels")
        if not (_is_number(self.white) and self.white > 0):
            raise VisionError(f"white {self.white!r} cannot be used; give 1, or 255")
        if not _is_whole(self.length, 1, TERMS):
            raise VisionError(f"a network of {self.length!r} values cannot be used; they may be 1 to {TERMS}")

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """The shape of an input of one image."""
        image = (self.height, self.width)
        return (1, 3, *image) if self.layout == "nchw" else (1, *image, 3)

    def as_dict(self) -> dict[str, Any]:
        """All but where the file is, as words.npz holds it: `Network(**...)` is the way back."""
        return {name: value for name, value in asdict(self).items() if name != "file"}


def _three(name: str, values: Any) -> tuple[float, float, float]:
    if not isinstance(values, list | tuple) or len(values) != 3 or not all(map(_is_number, values)):
        raise VisionError(f"{name} {values!r} cannot be used; give three numbers, one a channel")
    first, second, third = map(float, values)
    return first, second, third


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))


def _is_whole(value: Any, least: int, most: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and least <= value <= most
