"""Type of the function that validates array arguments."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

def numbers(function: str, name: str, value: Any, *shapes: tuple[int | str, ...]) -> NDArray[np.float64]:
    """Check an array argument, and return it as float64: the caller's array if it needs no conversion, otherwise a copy.

    Args:
        function, name: names of the function and of the argument, for messages.
        value: any object.
        shapes: the valid shapes, each a tuple. An entry is the length of an axis, a name for any length, or "..." for any leading axes.
            Without `shapes`, any shape is valid.

    Raises:
        InputError: `value` is not an array of real numbers, or its shape is not valid.

    >>> from armlet import _core
    >>> _core.numbers("f", "x", [1, 2], (2,), ("K", 2))
    array([1., 2.])
    """
