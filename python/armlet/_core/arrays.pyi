"""Type of the function that validates array arguments."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

def numbers(function: str, name: str, value: Any, *shapes: tuple[int | str, ...]) -> NDArray[np.float64]: ...
