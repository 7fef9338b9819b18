"""What a descriptor is made of: two descriptors may be compared only if their specifications are equal."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from placerec.arrays import Singles
from placerec.errors import VisionError
from placerec.frames.sequence import Gray
from placerec.vision.centrist import LENGTH as CENTRIST, centrist
from placerec.vision.exact import TERMS
from placerec.vision.gist import VARIANTS, gist
from placerec.vision.images import FITS, SMALLEST, check_gray, fit_image
from placerec.vision.lbp import LENGTH as BINARY, lbp
from placerec.vision.ranks import LENGTH as CELLS, ranks


@dataclass(frozen=True)
class DescriptorSpec:
    """The kind of a descriptor and its settings.

    kind: one of KINDS, or several that are made of images, joined by "+": such a descriptor is the values of each, one
    behind the other (`columns_of`). variant: which GIST. image_size: side in pixels of the square that images are
    fitted to, and fit: how they are. columns: the values of a descriptor that was computed elsewhere. Raises
    VisionError for a value that does not exist, and for a setting that no part has.
    """

    variant: str = "lmgist"
    image_size: int = 128
    fit: str = "squash"
    kind: str = "gist"
    columns: int = 0

    def __post_init__(self) -> None:
        self._check_kind()
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
        return [KINDS[kind].length or self.columns for kind in self.kinds]

    @property
    def length(self) -> int:
        """The number of values of a descriptor."""
        return sum(self.lengths)

    def part(self, *kinds: str) -> "DescriptorSpec":
        """The specification of some of the kinds alone, with those of the settings that they have.

        Raises VisionError for a kind that is not among them.
        """
        for kind in kinds:
            if kind not in self.kinds:
                raise VisionError(f"there are no {kind} descriptors beside those of {self.kind}")
        settings = dict.fromkeys(name for kind in kinds for name in KINDS[kind].settings)
        return DescriptorSpec(kind="+".join(kinds), **{name: getattr(self, name) for name in settings})

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
        return {name: getattr(self, name) for name in ("kind", *self.settings)}


@dataclass(frozen=True)
class Kind:
    """A kind of descriptor: the settings of `DescriptorSpec` that it has, its number of values, and what makes it.

    `describe`: makes it of the fitted image, exact zeros of a constant one; None if it is computed elsewhere, and its
    file tells the length. `told`: what it is, in a line.
    """

    told: str
    settings: tuple[str, ...]
    length: int | None = None
    describe: Callable[[Gray, DescriptorSpec], Singles] | None = None


_FITTED = ("image_size", "fit")
# Another descriptor is added here.
KINDS = {
    "gist": Kind(
        "energy of 4 scales x 6 orientations in 4 x 4 blocks (Oliva and Torralba)",
        ("variant", *_FITTED),
        4 * 6 * 4 * 4,
        lambda gray, spec: gist(gray, variant=spec.variant),
    ),
    "lbp": Kind(
        "shares of local binary patterns of the smoothed image in 2 x 2 windows (Ojala)",
        _FITTED,
        BINARY,
        lambda gray, spec: lbp(gray),
    ),
    "ranks": Kind(
        "the order of 12 x 12 cells from dark to bright",
        _FITTED,
        CELLS,
        lambda gray, spec: ranks(gray),
    ),
    "centrist": Kind(
        "shares of the census transform's codes in 2 x 2 windows (Wu and Rehg)",
        _FITTED,
        CENTRIST,
        lambda gray, spec: centrist(gray),
    ),
    "npy": Kind("computed elsewhere, a row a frame", ("columns",)),
}


def descriptor(gray: Gray, spec: DescriptorSpec) -> Singles:
    """The descriptor of one grey image (h, w) of 0..255: float32 (spec.length,), zeros if the image is constant."""
    describe = describer(spec)
    return describe(fit_image(check_gray(gray), spec.image_size, spec.fit), spec)


def describer(spec: DescriptorSpec) -> Callable[[Gray, DescriptorSpec], Singles]:
    """What makes a descriptor of a fitted image; VisionError if such descriptors are not made from images here."""
    makers = [KINDS[kind].describe for kind in spec.kinds]
    made = [maker for maker in makers if maker is not None]
    if len(made) < len(makers):
        raise VisionError(
            f"the dictionary's descriptors ({spec.columns} values) were computed elsewhere, and images cannot be "
            "described so here; tokenize with --descriptor npy:FILE, and decode the token streams"
        )
    if len(made) == 1:
        return made[0]
    return lambda gray, spec: np.concatenate([maker(gray, spec) for maker in made])
