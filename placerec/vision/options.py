"""How dictionaries are learned: the options of `train-words`."""

from dataclasses import asdict, dataclass
from typing import Literal, get_args

import numpy as np

from placerec.errors import VisionError
from placerec.vision.som import RULES, WIDTH, Rule

Units = Literal["live", "all"]
UNITS: tuple[str, ...] = get_args(Units)
VIEWS = ("plain", "pn")


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

    `views`: `plain`, the principal components, and `pn`, place-normalised (`views.place_normalised`). `sizes`: the
    sides of the maps. The other options are those of `DictionaryOptions`, and every map's. Raises VisionError for a
    value that cannot be used.
    """

    views: tuple[str, ...] = VIEWS
    sizes: tuple[int, ...] = (10, 20)
    components: int = 80
    seed: int = 0
    fraction: float = 1.0
    epochs: int | None = None
    units: Units = "live"
    rule: Rule = "batch"
    width: float = WIDTH

    def __post_init__(self) -> None:
        for name in ("views", "sizes"):
            values = getattr(self, name)
            if not values:
                raise VisionError(f"no {name} are given; name at least one")
            if len(set(values)) < len(values):
                raise VisionError(f"{name} {','.join(map(str, values))} name one twice; leave it out")
        for view in self.views:
            if view not in VIEWS:
                raise VisionError(f"no view is called {view!r}; choose some of {', '.join(VIEWS)}")
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
