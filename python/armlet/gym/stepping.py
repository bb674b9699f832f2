"""The states of many arms, advanced by steps of the classical Runge-Kutta method (`rk4`) under constant torques."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from .._core import Plant, _BatchStepper

__all__ = ["Stepper"]

Array: TypeAlias = NDArray[np.float64]


class Stepper:
    """The states of `rows` arms: `q` and `v`, (B, n) each. One period is `steps` steps of `dt`."""

    q: Array
    v: Array

    def __init__(self, plant: Plant, rows: int, dt: float, steps: int) -> None:
        self._made_of, self._steps = (plant, rows, dt), steps
        self._arms = _BatchStepper(plant, rows, dt)
        self.q, self.v = np.zeros((2, rows, plant.arm.n))

    def step(self, tau: Array) -> None:
        """Advance all rows by one period under torques `tau`, (B, n). The state of a diverged row is not finite."""
        self.q, self.v = self._arms.step(tau, self._steps)

    def reset(self, rows: NDArray[np.int64], q: Array, v: Array) -> None:
        """Set the states of the rows `rows` to `q` and `v`, (len(rows), n) each."""
        self.q, self.v = self._arms.put(rows.tolist(), q, v)

    def __getstate__(self) -> tuple[object, ...]:
        return self._made_of, self._steps, self._arms.states, self.q, self.v

    def __setstate__(self, state: tuple[object, ...]) -> None:
        self._made_of, self._steps, states, self.q, self.v = state  # type: ignore[assignment]  # the types of `__getstate__`
        self._arms = _BatchStepper(*self._made_of)
        self._arms.states = states  # type: ignore[assignment]  # the type of `__getstate__`
