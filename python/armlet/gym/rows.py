"""The common part of single and vector environments: B arms under torques, with their task, limits and times.

    tau = tau_max * action,   observation = [q, v, error],   terminated: reached, beyond the limits or diverged,   truncated: at the horizon

An action is held for one period, which is a whole number of steps of `dt`. Actions are clipped to [-1, 1], and observations to the
observation space. A *row* is one of the B arms.
"""

from __future__ import annotations

import copy
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from .. import _core
from .._core import Arm, Plant, RigidArm, planar_arm
from ..arguments import finite, number, shown
from ..errors import InputError
from ..scenario import Scenario
from .stepping import Stepper
from .tasks import Reach, Task, Track, works_row_by_row

__all__ = ["Rows"]

Array: TypeAlias = NDArray[np.float64]


class _Bounds(NamedTuple):
    """Bounds of observations, positions, speeds and torques, (B, ..) each."""

    low: Array
    high: Array
    q_min: Array
    q_max: Array
    v_limit: Array
    tau_max: Array


class Rows:
    """B simultaneous runs.

    Args:
        rows: the number B of runs.
        plant, task, tau_max, dt, period, horizon, q_limit, v_limit: see `ArmEnv`.
    """

    def __init__(
        self,
        rows: int,
        plant: Plant | Arm | Scenario | None,
        task: Task | None,
        *,
        tau_max: ArrayLike | None,
        dt: float | None,
        period: float,
        horizon: float | None,
        q_limit: ArrayLike | None,
        v_limit: ArrayLike | None,
    ) -> None:
        if isinstance(plant, Scenario):
            built = plant.build()
            motion = getattr(built.law, "motion", None)
            if task is None and motion is not None and len(motion(0.0)[0]) == built.plant.arm.n:
                task = Track(motion)
            plant, given = built.plant, built.arguments
            tau_max = given.get("tau_max") if tau_max is None else tau_max
            dt = given.get("dt") if dt is None else dt
            horizon = given["t_end"] if horizon is None else horizon
        if plant is None:
            # The default arm is in a horizontal plane; each link has 0.5 m length and 1 kg/m.
            plant = planar_arm([0.5, 0.5], gravity=[0.0, 0.0])
            tau_max = [2.0, 1.0] if tau_max is None else tau_max
            task = Reach(axes="xy", q0=[0.0, 1.0], reach=1.0) if task is None else task
        self.plant = plant if isinstance(plant, Plant) else RigidArm(plant)
        self.arm = arm = self.plant.arm
        # The caller may pass one task to several environments, but `prepare` adapts a task to one arm. So the task is copied.
        self.task = Reach() if task is None else copy.copy(task)
        limits = arm.limits or {}
        self.tau_max = _positive("tau_max", _either("tau_max", tau_max, limits.get("effort"), None, arm.n), arm.n)
        self.v_limit = _positive("v_limit", _either("v_limit", v_limit, limits.get("v_max"), 20.0, arm.n), arm.n)
        low, high = (_either(name, None, limits.get(name), sign * 2.0 * np.pi, arm.n) for name, sign in (("q_min", -1), ("q_max", 1)))
        if q_limit is not None:
            low, high = (np.broadcast_to(_core.numbers("ArmEnv", "q_limit", side, (), (arm.n,)), (arm.n,)) for side in _pair(q_limit))
        if not (np.isfinite(low).all() and np.isfinite(high).all() and (low < high).all()):
            raise InputError(f"ArmEnv: q_limit is no range: expected finite low < high, got {low}, {high}")
        self.q_limit = (low, high)
        self.dt = 2e-3 if dt is None else number("ArmEnv", "dt", dt)
        self.period, self.horizon = number("ArmEnv", "period", period), 5.0 if horizon is None else number("ArmEnv", "horizon", horizon)
        self.steps = _whole("period", self.period, "dt", self.dt)
        self.length = _whole("horizon", self.horizon, "period", self.period)
        self.task.prepare(arm, self.q_limit, self.v_limit, self.period, self.length)
        bound = self.task.bound()
        self.low = np.concatenate([low, -self.v_limit, -bound])
        self.high = np.concatenate([high, self.v_limit, bound])
        self.observations = Box(self.low, self.high, dtype=np.float64)
        self.actions = Box(-1.0, 1.0, (arm.n,), dtype=np.float64)
        self.states = Stepper(self.plant, rows, self.dt, self.steps)
        self.k = np.zeros(rows, dtype=np.int64)
        self.goal = np.zeros((rows, 0))
        # One row of bounds per arm, so that numpy combines arrays of equal shape without broadcasting.
        self._each = _Bounds(*(np.tile(side, (rows, 1)) for side in (self.low, self.high, low, high, self.v_limit, self.tau_max)))
        self._apart = works_row_by_row(self.task)
        # Task errors of the present states. They are None before the first step, and for a task that may use other rows' data.
        self._errors: Array | None = None

    def reset(self, rows: NDArray[np.int64], rngs: list[np.random.Generator]) -> None:
        """Start new runs in the rows `rows`. Each row has a separate random generator."""
        if not len(rows):
            return
        q0, v0, goal = self.task._draws([rngs[row] for row in rows])
        if self.goal.shape[1] != goal.shape[1]:
            self.goal = np.zeros((len(self.k), goal.shape[1]))
        self.states.reset(rows, q0, v0)
        self.k[rows], self.goal[rows] = 0, goal
        if self._errors is not None:
            self._errors[rows] = self.task.error(self.k[rows], self.states.q[rows], self.states.v[rows], self.goal[rows])

    def step(self, action: ArrayLike) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, NDArray[np.bool_]]]:
        """Advance all rows by one period. Return reward, terminated, truncated and info, (B,) each.

        A row that diverges keeps the state before the step.
        """
        given = np.clip(self._checked(action), -1.0, 1.0)
        states, each = self.states, self._each
        # `states.step` assigns new arrays, so these arrays do not change.
        before_q, before_v = states.q, states.v
        states.step(given * each.tau_max)
        diverged = _rows_with(~(np.isfinite(states.q) & np.isfinite(states.v)))
        if diverged.any():
            rows = np.flatnonzero(diverged)
            states.reset(rows, before_q[rows], before_v[rows])
        self.k += 1
        q, v = states.q, states.v
        error = self._error()
        left = _rows_with((q < each.q_min) | (q > each.q_max) | (np.abs(v) > each.v_limit)) | diverged
        reached = self.task.reached(error, self.k, q, v) & ~left
        reward = np.asarray(self.task.reward(error, given, self.k, q, v), dtype=np.float64)
        self._errors = error if self._apart else None
        return reward, reached | left, self.k >= self.length, {"reached": reached, "diverged": diverged}

    def observe(self) -> Array:
        """The observations of all rows, (B, 2 n + m), clipped to the observation space. The error of the task has m entries."""
        errors = self._error() if self._errors is None else self._errors
        observed: Array = np.clip(np.concatenate([self.states.q, self.states.v, errors], axis=-1), self._each.low, self._each.high)
        return observed

    def _error(self) -> Array:
        return self.task.error(np.minimum(self.k, self.length), self.states.q, self.states.v, self.goal)

    def _checked(self, action: ArrayLike) -> Array:
        # In a single environment, `ArmEnv.step` has added the axis of rows to the action (n,).
        return finite("step", "action", _core.numbers("step", "action", action, self.states.q.shape))


def _rows_with(flags: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether each row of `flags` (B, n) has at least one true entry, (B,)."""
    found = np.zeros(len(flags), dtype=np.bool_)
    found[np.flatnonzero(flags) // flags.shape[1]] = True
    return found


def _either(name: str, given: ArrayLike | None, stated: Any, default: float | None, n: int) -> Array:
    """Return the argument as (n,). If it is None, return the values of the model, and the default for joints without a finite value.

    Raises:
        InputError: the default is None, and a joint has no finite value.
    """
    if given is not None:
        return np.broadcast_to(_core.numbers("ArmEnv", name, given, (), (n,)), (n,))
    known: Array = np.full(n, np.inf) if stated is None else stated
    if default is None and not np.isfinite(known).all():
        raise InputError("ArmEnv: tau_max is missing: expected a number or (n,), because the arm has a joint without a finite effort limit")
    return known if default is None else np.where(np.isfinite(known), known, default)


def _positive(name: str, values: Array, n: int) -> Array:
    if not (np.isfinite(values).all() and (values > 0.0).all()):
        raise InputError(f"ArmEnv: {name} is out of range: expected finite numbers > 0, got {values}")
    return values


def _pair(q_limit: Any) -> tuple[Any, Any]:
    if not isinstance(q_limit, tuple | list) or len(q_limit) != 2:
        raise InputError(f"ArmEnv: q_limit is no pair: expected (low, high), a number or (n,) each, got {shown(q_limit)}")
    return q_limit[0], q_limit[1]


def _whole(name: str, value: float, unit_name: str, unit: float) -> int:
    """Return `value / unit`, which must be an integer >= 1."""
    count = value / unit if unit > 0.0 and np.isfinite(unit) else np.nan
    if not (np.isfinite(count) and round(count) >= 1 and abs(count - round(count)) <= 1e-9 * count):
        raise InputError(f"ArmEnv: {name} is no multiple of {unit_name}: expected a whole number of {unit:g} s, got {value:g} s")
    return round(count)
