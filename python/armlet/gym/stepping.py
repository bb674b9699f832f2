"""Two ways to advance the states of many arms under given torques, held for some steps of the classical Runge-Kutta method (`rk4`):

    k1 = f(x), k2 = f(x + h/2 k1), k3 = f(x + h/2 k2), k4 = f(x + h k3), x' = x + h/6 (k1 + 2 k2 + 2 k3 + k4),  f = [v, a(q, v, tau)]

`Lanes` asks the arm for the accelerations of all rows in one call: for rigid arms. `OneByOne` has a `Simulator` per row: for any plant, and
for a few rows.
"""

from __future__ import annotations

from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .._core import Plant, RigidArm, Simulator
from ..errors import InputError, SolveError
from ..status import Status

__all__ = ["Lanes", "OneByOne", "Stepper", "stepper"]

Array: TypeAlias = NDArray[np.float64]
#: From so many rows on one call for all costs less than a call for each (planar arm of two joints, arm of seven joints).
MANY = 32


class Stepper(Protocol):
    """The states of B arms, `q` and `v`, (B, n)."""

    q: Array
    v: Array

    def step(self, tau: Array) -> None:
        """Advance all rows by one period under `tau`, (B, n). A row that diverges is not finite."""

    def reset(self, rows: NDArray[np.int64], q: Array, v: Array) -> None:
        """Put these rows there, (len(rows), n) each."""


def stepper(plant: Plant, rows: int, dt: float, steps: int) -> Stepper:
    """The cheaper of the two; `steps` of `dt` are one period."""
    made = plant.__getnewargs_ex__()[1]
    if rows >= MANY and isinstance(plant, RigidArm) and made.get("wall") is None:
        return Lanes(plant, bool(made.get("friction")), rows, dt, steps)
    return OneByOne(plant, rows, dt, steps)


class Lanes:
    def __init__(self, plant: Plant, friction: bool, rows: int, dt: float, steps: int) -> None:
        self.arm, self.friction, self.dt, self.steps = plant.arm, friction, dt, steps
        self.q, self.v = np.zeros((2, rows, plant.arm.n))

    def _acceleration(self, q: Array, v: Array, tau: Array) -> Array:
        try:
            return self.arm.forward_dynamics(q, v, tau, friction=self.friction)
        except InputError:
            # Some row is beyond all numbers, which the arm refuses: such rows stand at 0 while the others keep their lanes.
            bad = np.array([not self._finite(*row) for row in zip(q, v, tau, strict=True)])
            q, v, tau = (np.where(bad[:, None], 0.0, x) for x in (q, v, tau))
            a = self.arm.forward_dynamics(q, v, tau, friction=self.friction)
            a[bad] = np.nan
            return a

    def _finite(self, q: Array, v: Array, tau: Array) -> bool:
        try:
            self.arm.forward_dynamics(q, v, tau, friction=self.friction)
        except InputError:
            return False
        return True

    def step(self, tau: Array) -> None:
        h, q1, v1 = self.dt, self.q, self.v
        with np.errstate(over="ignore", invalid="ignore"):
            for _ in range(self.steps):
                a1 = self._acceleration(q1, v1, tau)
                v2 = v1 + h / 2 * a1
                a2 = self._acceleration(q1 + h / 2 * v1, v2, tau)
                v3 = v1 + h / 2 * a2
                a3 = self._acceleration(q1 + h / 2 * v2, v3, tau)
                v4 = v1 + h * a3
                a4 = self._acceleration(q1 + h * v3, v4, tau)
                q1, v1 = q1 + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4), v1 + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        self.q, self.v = q1, v1

    def reset(self, rows: NDArray[np.int64], q: Array, v: Array) -> None:
        self.q[rows], self.v[rows] = q, v


class OneByOne:
    def __init__(self, plant: Plant, rows: int, dt: float, steps: int) -> None:
        self.steps = steps
        # Without a limit of the state, as `Lanes`: the limits are the environment's.
        self.loops = [Simulator(plant, None, np.zeros(plant.arm.n), dt=dt, state_limit=np.inf) for _ in range(rows)]
        self.q, self.v = np.zeros((2, rows, plant.arm.n))

    def step(self, tau: Array) -> None:
        for loop, own in zip(self.loops, tau, strict=True):
            try:
                for _ in range(self.steps):
                    loop.step(own)
            except SolveError:
                continue  # the loop keeps its status until the row is reset
        self._read(range(len(self.loops)))

    def reset(self, rows: NDArray[np.int64], q: Array, v: Array) -> None:
        for row, q0, v0 in zip(rows, q, v, strict=True):
            self.loops[row].reset(q0, v0)
        self._read(rows)

    def _read(self, rows: NDArray[np.int64] | range) -> None:
        for row in rows:
            loop = self.loops[row]
            self.q[row], self.v[row] = (loop.q, loop.v) if loop.status is Status.SUCCESS else (np.nan, np.nan)
