"""How dictionaries are learned: the options of `train-words`."""

from dataclasses import asdict, dataclass
from typing import Literal, get_args

import numpy as np

from placerec.errors import VisionError
from placerec.vision.som import RULES, WIDTH, Rule
from placerec.vision.spec import KINDS, DescriptorSpec

Units = Literal["live", "all"]
UNITS: tuple[str, ...] = get_args(Units)
PROJECTIONS = ("plain", "pn", "half")
# What words are made of by default, with the views of `View.default`: docs/vision.md has what each is worth.
DEFAULT_KIND = "gist+lbp+ranks"


@dataclass(frozen=True)
class View:
    """A way of looking at a frame: the descriptors of some `kinds`, () for all there are, and a projection of them."""

    kinds: tuple[str, ...]
    projection: str

    @classmethod
    def parse(cls, text: str) -> "View":
        """A view from `plain`, `pn`, `half`, `KIND`, `KIND:pn` or `KIND+KIND:half`; VisionError for anything else."""
        if text in PROJECTIONS:
            return cls((), text)
        kinds, colon, projection = text.partition(":")
        for kind in kinds.split("+"):
            if kind not in KINDS:
                known = ", ".join((*PROJECTIONS, *KINDS))
                raise VisionError(
                    f"no view is called {text!r}; choose some of {known}, as in gist, gist:pn, gist+lbp:pn"
                )
        if colon and projection not in PROJECTIONS:
            raise VisionError(
                f"{text!r}: no projection is called {projection!r}; choose one of {', '.join(PROJECTIONS)}"
            )
        return cls(tuple(kinds.split("+")), projection or "plain")

    @classmethod
    def default(cls, spec: DescriptorSpec, labelled: bool = True) -> tuple["View", ...]:
        """The views of descriptors where none are named: the first kind as it is, then each kind place-normalised.

        Half whitened where no two places are `labelled`.
        """
        projected = "pn" if labelled else "half"
        return tuple(
            cls((), projection) if len(spec.kinds) == 1 else cls((kind,), projection)
            for kind, projection in ((spec.kinds[0], "plain"), *((kind, projected) for kind in spec.kinds))
        )

    def part_of(self, spec: DescriptorSpec) -> DescriptorSpec:
        """The descriptors that are looked at; VisionError if they are no part of those of `spec`."""
        return spec.part(*self.kinds) if self.kinds else spec

    def name_in(self, spec: DescriptorSpec) -> str:
        """What dictionaries of this view are named by: `pn`, and with other kinds beside, `gist` or `lbppn`."""
        return self.told_in(spec).replace("+", "").replace(":", "")

    def told_in(self, spec: DescriptorSpec) -> str:
        """The view in words, without the kinds where they are all there are: `pn`, `gist`, `gist+lbp:pn`."""
        return self.projection if self.kinds == spec.kinds else str(self)

    def __str__(self) -> str:
        kinds = "+".join(self.kinds)
        return self.projection if not kinds else kinds if self.projection == "plain" else f"{kinds}:{self.projection}"


@dataclass(frozen=True)
class DictionaryOptions:
    """How a dictionary of size x size words is learned: the options of `train-words`.

    `components`: how many principal components the map sees. `fraction`: the share of the frames, drawn by `seed`,
    that PCA and map see. `units`: answer with those that at least one training frame hit (`live`: no language model
    can know the others), or with `all`. `rule`, `width`, `epochs`: how the map learns, see `train_som`. Raises
    VisionError for a value that cannot be used.
    """

    size: int = 10
    components: int = 80
    seed: int = 0
    fraction: float = 1.0
    epochs: int | None = None
    units: Units = "live"
    rule: Rule = "batch"
    width: float = WIDTH

    def __post_init__(self) -> None:
        for name in ("size", "components", "epochs"):
            value = getattr(self, name)
            if not (isinstance(value, int) and value >= 1) and not (name == "epochs" and value is None):
                raise VisionError(f"{name} {value} cannot be used; give a number of 1 or more")
        if not isinstance(self.seed, int) or self.seed < 0:
            raise VisionError(f"seed {self.seed} cannot be used; give a number of 0 or more")
        if not isinstance(self.fraction, float | int) or not 0 < self.fraction <= 1:
            raise VisionError(f"fraction {self.fraction} cannot be used; give a number above 0 and up to 1")
        if not isinstance(self.width, float | int) or not 0 < self.width < np.inf:
            raise VisionError(f"width {self.width} cannot be used; give a number above 0")
        for name, value, choices in (("choice of units", self.units, UNITS), ("rule", self.rule, RULES)):
            if value not in choices:
                raise VisionError(f"no {name} is called {value!r}; choose one of {', '.join(choices)}")


@dataclass(frozen=True)
class DictionarySetOptions:
    """How a set of dictionaries is learned: one for every view and size, the views outermost.

    `views`: descriptors and projection of each, as `View.parse` reads them: `gist`, `gist:pn`, `gist+lbp:pn`; without
    a kind (`plain`, `pn`) of all descriptors there are; () for those of `View.default`. `plain` are the principal
    components, `pn` these place-normalised (`views.place_normalised`), `half` these half whitened
    (`views.half_whitened`). `sizes`: the sides of the maps. The other
    options are those of `DictionaryOptions`, and every map's. Raises VisionError for a value that cannot be used.
    """

    views: tuple[str, ...] = ()
    sizes: tuple[int, ...] = (10, 20)
    components: int = 80
    seed: int = 0
    fraction: float = 1.0
    epochs: int | None = None
    units: Units = "live"
    rule: Rule = "batch"
    width: float = WIDTH

    def __post_init__(self) -> None:
        if not self.sizes:
            raise VisionError("no sizes are given; name at least one")
        for name in ("views", "sizes"):
            values = getattr(self, name)
            if len(set(values)) < len(values):
                raise VisionError(f"{name} {','.join(map(str, values))} name one twice; leave it out")
        for view in self.views:
            View.parse(view)
        for size in self.sizes:
            self.of_map(size)

    @classmethod
    def of(cls, options: "DictionaryOptions | DictionarySetOptions") -> "DictionarySetOptions":
        """The options as they are, or those of a set of one dictionary."""
        if isinstance(options, DictionarySetOptions):
            return options
        every = asdict(options)
        return cls(("plain",), (every.pop("size"),), **every)

    def of_map(self, size: int) -> DictionaryOptions:
        """The options of the maps of one size."""
        every = {name: value for name, value in asdict(self).items() if name not in ("views", "sizes")}
        return DictionaryOptions(size, **every)

    def views_of(self, spec: DescriptorSpec, labelled: bool = True) -> tuple[View, ...]:
        """The views of descriptors of `spec`; VisionError if one needs others, or if two are one.

        `labelled`: whether there are frames of two places.
        """
        views = tuple(map(View.parse, self.views)) or View.default(spec, labelled)
        for number, view in enumerate(views):
            part = view.part_of(spec), view.projection
            if part in [(other.part_of(spec), other.projection) for other in views[:number]]:
                raise VisionError(f"the view {view} of {spec.kind} descriptors is named twice; leave it out")
        return views

    def kind(self) -> str:
        """The kinds of descriptors that the views need, joined, where nothing else says which: `DEFAULT_KIND`, or GIST
        for views without a kind."""
        if not self.views:
            return DEFAULT_KIND
        return "+".join(dict.fromkeys(kind for view in self.views for kind in View.parse(view).kinds)) or "gist"
