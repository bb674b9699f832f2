"""The states of many arms under torques that are held for some steps of the classical Runge-Kutta method (`rk4`)."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from .._core import Plant, _BatchStepper

__all__ = ["Stepper"]

Array: TypeAlias = NDArray[np.float64]


class Stepper:
    """The states of `rows` arms, `q` and `v`, (B, n); one period is `steps` of `dt`."""

    q: Array
    v: Array

    def __init__(self, plant: Plant, rows: int, dt: float, steps: int) -> None:
        self._made_of, self._steps = (plant, rows, dt), steps
        self._arms = _BatchStepper(plant, rows, dt)
        self.q, self.v = np.zeros((2, rows, plant.arm.n))

    def step(self, tau: Array) -> None:
        """Advance all rows by one period under `tau`, (B, n). A row that diverges is not finite."""
        self.q, self.v = self._arms.step(tau, self._steps)

    def reset(self, rows: NDArray[np.int64], q: Array, v: Array) -> None:
        """Set the states of these rows, (len(rows), n) each."""
        self.q, self.v = self._arms.put(rows.tolist(), q, v)

    def __getstate__(self) -> tuple[object, ...]:
        return self._made_of, self._steps, self._arms.states, self.q, self.v

    def __setstate__(self, state: tuple[object, ...]) -> None:
        self._made_of, self._steps, states, self.q, self.v = state  # type: ignore[assignment]  # as `__getstate__` gives them
        self._arms = _BatchStepper(*self._made_of)
        self._arms.states = states  # type: ignore[assignment]  # as above
