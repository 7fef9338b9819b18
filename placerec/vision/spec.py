"""What a descriptor is made of: two descriptors may be compared only if their specifications are equal."""

from dataclasses import dataclass

from placerec.errors import VisionError
from placerec.vision.gist import VARIANTS, Floats, gist
from placerec.vision.images import FITS, SMALLEST, Gray, check_gray, fit_image


@dataclass(frozen=True)
class DescriptorSpec:
    """GIST variant, side in pixels of the square that images are fitted to, and how they are fitted.

    Raises VisionError for a value that does not exist.
    """

    variant: str = "lmgist"
    image_size: int = 128
    fit: str = "squash"

    def __post_init__(self) -> None:
        if self.variant not in VARIANTS:
            raise VisionError(f"no GIST variant is called {self.variant!r}; choose one of {', '.join(VARIANTS)}")
        if self.fit not in FITS:
            raise VisionError(f"no fit is called {self.fit!r}; choose one of {', '.join(FITS)}")
        if not isinstance(self.image_size, int) or self.image_size < SMALLEST:
            raise VisionError(f"an image size of {self.image_size} cannot be used; give a number of {SMALLEST} or more")

    @property
    def length(self) -> int:
        """The number of values of a descriptor: 4 scales x 6 orientations x 4 x 4 blocks."""
        return 4 * 6 * 4 * 4


def descriptor(gray: Gray, spec: DescriptorSpec) -> Floats:
    """The descriptor of one grey image (h, w) of 0..255: float32 (spec.length,), zeros if the image is constant."""
    gray = check_gray(gray)
    return gist(fit_image(gray, spec.image_size, spec.fit), variant=spec.variant)
