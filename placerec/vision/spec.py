"""What a descriptor is made of: two descriptors may be compared only if their specifications are equal."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

from placerec.arrays import Singles
from placerec.errors import VisionError
from placerec.frames.sequence import Gray
from placerec.vision.centrist import LENGTH, centrist
from placerec.vision.exact import TERMS
from placerec.vision.gist import VARIANTS, gist
from placerec.vision.images import FITS, SMALLEST, check_gray, fit_image


@dataclass(frozen=True)
class DescriptorSpec:
    """The kind of a descriptor and its settings.

    variant: which GIST. image_size: side in pixels of the square that images are fitted to, and fit: how they are.
    columns: the values of a descriptor that was computed elsewhere. Raises VisionError for a value that does not
    exist, and for a setting that the kind does not have.
    """

    variant: str = "lmgist"
    image_size: int = 128
    fit: str = "squash"
    kind: str = "gist"
    columns: int = 0

    def __post_init__(self) -> None:
        # As a tuple: what a file says may be of any type.
        if self.kind not in tuple(KINDS):
            raise VisionError(f"no descriptor is called {self.kind!r}; choose one of {', '.join(KINDS)}")
        for field in fields(self):
            if field.name not in ("kind", *KINDS[self.kind].settings) and getattr(self, field.name) != field.default:
                raise VisionError(f"{self.kind} descriptors have no {field.name}; leave it out")
        if self.variant not in VARIANTS:
            raise VisionError(f"no GIST variant is called {self.variant!r}; choose one of {', '.join(VARIANTS)}")
        if self.fit not in FITS:
            raise VisionError(f"no fit is called {self.fit!r}; choose one of {', '.join(FITS)}")
        if not isinstance(self.image_size, int) or self.image_size < SMALLEST:
            raise VisionError(f"an image size of {self.image_size} cannot be used; give a number of {SMALLEST} or more")
        if self.kind == "npy" and not (isinstance(self.columns, int) and 1 <= self.columns <= TERMS):
            raise VisionError(f"descriptors of {self.columns} values cannot be used; they may have 1 to {TERMS}")

    @property
    def length(self) -> int:
        """The number of values of a descriptor."""
        return KINDS[self.kind].length or self.columns

    def as_dict(self) -> dict[str, Any]:
        """The kind and the settings that it has, as files hold them: `DescriptorSpec(**...)` is the way back."""
        return {name: getattr(self, name) for name in ("kind", *KINDS[self.kind].settings)}


@dataclass(frozen=True)
class Kind:
    """A kind of descriptor: the settings of `DescriptorSpec` that it has, its number of values, and what makes it.

    `describe`: makes it of the fitted image; None if it is computed elsewhere, and its file tells the length.
    """

    settings: tuple[str, ...]
    length: int | None = None
    describe: Callable[[Gray, DescriptorSpec], Singles] | None = None


# Another descriptor is added here.
KINDS = {
    # 4 scales x 6 orientations x 4 x 4 blocks.
    "gist": Kind(("variant", "image_size", "fit"), 4 * 6 * 4 * 4, lambda gray, spec: gist(gray, variant=spec.variant)),
    "centrist": Kind(("image_size", "fit"), LENGTH, lambda gray, spec: centrist(gray)),
    "npy": Kind(("columns",)),
}


def descriptor(gray: Gray, spec: DescriptorSpec) -> Singles:
    """The descriptor of one grey image (h, w) of 0..255: float32 (spec.length,), zeros if the image is constant."""
    describe = describer(spec)
    return describe(fit_image(check_gray(gray), spec.image_size, spec.fit), spec)


def describer(spec: DescriptorSpec) -> Callable[[Gray, DescriptorSpec], Singles]:
    """What makes a descriptor of a fitted image; VisionError if such descriptors are not made from images here."""
    describe = KINDS[spec.kind].describe
    if describe is None:
        raise VisionError(
            f"the dictionary's descriptors ({spec.columns} values) were computed elsewhere, and images cannot be "
            "described so here; tokenize with --descriptor npy:FILE, and decode the token streams"
        )
    return describe
