"""What the tests of assumptions require of a prediction fit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .samples import Samples

__all__ = ["Blocks", "Evidence"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Blocks(Samples):
    """Means over blocks of samples. `weights` (blocks, size) has the shares of the samples of each block."""

    begins: NDArray[np.intp]
    weights: Array

    def filtered(self, column: Array) -> Array:
        """The means of a column (K, ..) over the blocks."""
        size = self.weights.shape[1]
        return np.asarray(np.einsum("bs,bs...->b...", self.weights, column[self.begins[:, None] + np.arange(size)]))

    def sampled(self, function: Callable[..., Array], *series: Array) -> Array:
        """The means of a function over the blocks. The function of the means would differ from it."""
        return self.filtered(function(*series))


@dataclass(frozen=True)
class Evidence:
    """What the tests of assumptions require: blocks of samples, and an arm with the drives of the plant.

    `columns` (M, n, P) are those of the values, and `explained` (M, n) is the torque of the fitted plant along the filtered motion.
    """

    arm: _core.Arm
    blocks: Blocks
    columns: Array
    explained: Array
    untested: tuple[str, ...]
