"""Names for the types of numpy arrays that most of the package works on; shapes are given where they are used."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]
# Integers of any size, also real numbers where counts may be such.
Numbers = NDArray[Any]
