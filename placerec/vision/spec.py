"""What a descriptor is made of: two descriptors may be compared only if their specifications are equal."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from placerec.arrays import Singles
from placerec.errors import SourceError, VisionError
from placerec.frames.image import as_image
from placerec.frames.sequence import ColourImage, Image, gray_levels
from placerec.vision.centrist import LENGTH as CENTRIST, centrist
from placerec.vision.colour import LENGTH as RATIOS, colour_grid, describe_grid
from placerec.vision.exact import TERMS
from placerec.vision.gist import VARIANTS, gist
from placerec.vision.images import FITS, SMALLEST, check_gray, fit_image
from placerec.vision.lbp import LENGTH as BINARY, lbp
from placerec.vision.network import Network
from placerec.vision.onnx import describe_fitted, fit_for, runner, with_file
from placerec.vision.ranks import LENGTH as CELLS, ranks


@dataclass(frozen=True)
class DescriptorSpec:
    """The kind of a descriptor and its settings.

    kind: one of KINDS, or several that are made of images, joined by "+": such a descriptor is the values of each, one
    behind the other (`columns_of`). variant: which GIST. image_size: side in pixels of the square that images are
    fitted to, and fit: how they are. columns: the values of a descriptor that was computed elsewhere. network: the
    image network of the kind `onnx` (`onnx.open_network`), or what `as_dict` says of it. Raises VisionError for a value
    that does not exist, and for a setting that no part has.
    """

    variant: str = "lmgist"
    image_size: int = 128
    fit: str = "squash"
    kind: str = "gist"
    columns: int = 0
    network: Network | None = None

    def __post_init__(self) -> None:
        self._check_kind()
        told: Any = self.network
        if isinstance(told, dict):
            object.__setattr__(self, "network", Network(**told))
        if ("onnx" in self.kinds) != (self.network is not None):
            one = "descriptors are made by the network in a file; name it, as in onnx:net.onnx"
            raise VisionError(f"onnx {one}" if self.network is None else f"{self.kind} descriptors have no network")
        for field in fields(self):
            if field.name not in ("kind", *self.settings) and getattr(self, field.name) != field.default:
                raise VisionError(f"{self.kind} descriptors have no {field.name}; leave it out")
        if self.variant not in VARIANTS:
            raise VisionError(f"no GIST variant is called {self.variant!r}; choose one of {', '.join(VARIANTS)}")
        if self.fit not in FITS:
            raise VisionError(f"no fit is called {self.fit!r}; choose one of {', '.join(FITS)}")
        if not isinstance(self.image_size, int) or self.image_size < SMALLEST:
            raise VisionError(f"an image size of {self.image_size} cannot be used; give a number of {SMALLEST} or more")
        if self.kind == "npy" and not (isinstance(self.columns, int) and 1 <= self.columns <= TERMS):
            raise VisionError(f"descriptors of {self.columns} values cannot be used; they may have 1 to {TERMS}")

    def _check_kind(self) -> None:
        # What a file says may be of any type.
        parts = self.kind.split("+") if isinstance(self.kind, str) else [self.kind]
        for part in parts:
            if part not in tuple(KINDS):
                raise VisionError(f"no descriptor is called {part!r}; choose one of {', '.join(KINDS)}")
            if len(parts) > 1 and KINDS[part].describe is None:
                raise VisionError(f"{part} descriptors are computed elsewhere, and cannot be joined to others")
            if parts.count(part) > 1:
                raise VisionError(f"the descriptor {self.kind!r} names {part} twice; leave it out")

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds that it is joined of, in the order of their values."""
        return tuple(self.kind.split("+"))

    @property
    def settings(self) -> tuple[str, ...]:
        """The names of the settings that some part has."""
        return tuple(dict.fromkeys(name for kind in self.kinds for name in KINDS[kind].settings))

    @property
    def lengths(self) -> list[int]:
        """The number of values of each kind, in their order."""
        own = self.columns if self.network is None else self.network.length
        return [KINDS[kind].length or own for kind in self.kinds]

    @property
    def length(self) -> int:
        """The number of values of a descriptor."""
        return sum(self.lengths)

    @property
    def colours(self) -> bool:
        """Whether images are wanted in colours."""
        return any(KINDS[kind].colours for kind in self.kinds)

    def part(self, *kinds: str) -> "DescriptorSpec":
        """The specification of some of the kinds alone, with those of the settings that they have.

        Raises VisionError for a kind that is not among them.
        """
        for kind in kinds:
            if kind not in self.kinds:
                raise VisionError(f"there are no {kind} descriptors beside those of {self.kind}")
        settings = dict.fromkeys(name for kind in kinds for name in KINDS[kind].settings)
        return DescriptorSpec(kind="+".join(kinds), **{name: getattr(self, name) for name in settings})

    def with_network(self, file: Path | str) -> "DescriptorSpec":
        """The specification with the file of the network; VisionError if there is none, or if it is another."""
        if self.network is None:
            raise VisionError(f"{file}: is not wanted, for the words are of {self.kind} descriptors; leave it out")
        return replace(self, network=with_file(self.network, file))

    def holds(self, part: "DescriptorSpec") -> bool:
        """Whether the values of `part` stand among those of this descriptor."""
        return {*part.kinds} <= {*self.kinds} and self.part(*part.kinds) == part

    def columns_of(self, part: "DescriptorSpec") -> slice | list[int]:
        """Where the values of `part` stand among those of this descriptor; VisionError unless all of them do."""
        if part == self:
            return slice(None)
        if not self.holds(part):
            raise VisionError(f"{part.kind} descriptors are no part of {self.kind} descriptors with these settings")
        ends = np.cumsum(self.lengths).tolist()
        spans = {kind: range(start, end) for kind, start, end in zip(self.kinds, [0, *ends], ends, strict=False)}
        if len(part.kinds) == 1:
            return slice(spans[part.kind].start, spans[part.kind].stop)
        return [column for kind in part.kinds for column in spans[kind]]

    def as_dict(self) -> dict[str, Any]:
        """The kind and the settings that it has, as files hold them: `DescriptorSpec(**...)` is the way back."""
        told = {name: getattr(self, name) for name in ("kind", *self.settings)}
        return told if self.network is None else {**told, "network": self.network.as_dict()}


# What the kinds of a descriptor see of an image, one for each: little, and all that it takes to describe it.
Fitted = tuple[NDArray[Any], ...]


def _fit_gray(image: Image, spec: DescriptorSpec) -> NDArray[Any]:
    return fit_image(check_gray(gray_levels(image)), spec.image_size, spec.fit)


def _fit_colours(image: Image, spec: DescriptorSpec) -> NDArray[Any]:
    return colour_grid(_coloured(image).colours)


def _fit_network(image: Image, spec: DescriptorSpec) -> NDArray[Any]:
    return fit_for(_network(spec), _coloured(image).colours)


def _coloured(image: Image) -> ColourImage:
    if not isinstance(image, ColourImage):
        raise VisionError("the image is grey, and colours are looked at; give (height, width, 3) blue, green, red")
    return image


def _network(spec: DescriptorSpec) -> Network:
    assert spec.network is not None
    return spec.network


@dataclass(frozen=True)
class Kind:
    """A kind of descriptor: the settings of `DescriptorSpec` that it has, its number of values, and what makes it.

    `describe`: makes it of what `fit` leaves of an image, exact zeros of a constant one; None if it is computed
    elsewhere. Without a length, a file tells it. `colours`: whether it is made of colours.
    """

    settings: tuple[str, ...]
    length: int | None = None
    describe: Callable[[NDArray[Any], DescriptorSpec], Singles] | None = None
    fit: Callable[[Image, DescriptorSpec], NDArray[Any]] = _fit_gray
    colours: bool = False


_FITTED = ("image_size", "fit")
# Another descriptor is added here.
KINDS = {
    "gist": Kind(
        ("variant", *_FITTED),
        4 * 6 * 4 * 4,
        lambda gray, spec: gist(gray, variant=spec.variant),
    ),
    "lbp": Kind(
        _FITTED,
        BINARY,
        lambda gray, spec: lbp(gray),
    ),
    "ranks": Kind(
        _FITTED,
        CELLS,
        lambda gray, spec: ranks(gray),
    ),
    "centrist": Kind(
        _FITTED,
        CENTRIST,
        lambda gray, spec: centrist(gray),
    ),
    "colour": Kind(
        (),
        RATIOS,
        lambda grid, spec: describe_grid(grid),
        _fit_colours,
        colours=True,
    ),
    "onnx": Kind(
        ("network",),
        None,
        lambda fitted, spec: describe_fitted(_network(spec), fitted),
        _fit_network,
        colours=True,
    ),
    "npy": Kind(("columns",)),
}


def descriptor(image: Image | NDArray[Any], spec: DescriptorSpec) -> Singles:
    """The descriptor of one image of 0..255: float32 (spec.length,), zeros if the image is constant.

    image: grey levels (h, w); a `ColourImage`, or (h, w, 3) blue, green, red, where the descriptor looks at colours.
    Raises VisionError for an image that cannot be used.
    """
    check_describable(spec)
    return describe_parts(fit_parts(image, spec), spec)


def fit_parts(image: Image | NDArray[Any], spec: DescriptorSpec) -> Fitted:
    """What the kinds of descriptors see of an image, which is made smaller once for all that see the same."""
    if spec.colours and isinstance(image, np.ndarray) and image.ndim == 3:
        try:
            image = as_image(image, "the image", colours=True)
        except SourceError as error:
            raise VisionError(str(error)) from error
    fits = {fit: fit(image, spec) for fit in dict.fromkeys(KINDS[kind].fit for kind in spec.kinds)}
    return tuple(fits[KINDS[kind].fit] for kind in spec.kinds)


def describe_parts(parts: Fitted, spec: DescriptorSpec) -> Singles:
    """The descriptor of an image of which `fit_parts` made these."""
    makers = (KINDS[kind].describe for kind in spec.kinds)
    values = [maker(part, spec) for maker, part in zip(makers, parts, strict=True) if maker is not None]
    return values[0] if len(values) == 1 else np.concatenate(values)


def check_describable(spec: DescriptorSpec) -> None:
    """VisionError if such descriptors cannot be made from images here."""
    if any(KINDS[kind].describe is None for kind in spec.kinds):
        raise VisionError(
            f"the dictionary's descriptors ({spec.columns} values) were computed elsewhere, and images cannot be "
            "described so here; tokenize with --descriptor npy:FILE, and decode the token streams"
        )
    if spec.network is not None:
        runner(spec.network)
