"""Aliases of the types of arrays and numbers."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]
_Flags = NDArray[np.bool_]
_Number = float | np.floating[Any] | np.integer[Any]
