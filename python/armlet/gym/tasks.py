"""Tasks of environments: initial state, error, reward and end of a run.

    reward = 1 / (1 + (|e| / scale)^2) - effort * (1/n) sum_i u_i^2,   u = action, within [-1, 1]

`error`, `reward`, `reached` and `points` compute all rows together: the first axis of an array is the row, one row per arm. The reward has
no unit. `e` is the error after the step. For `Reach` it is the target minus the frame's position, m. For `Track` it is
`[q_d - q, v_d - v]`, rad and rad/s, or m and m/s for prismatic joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from .._core import Arm, Motion
from ..arguments import finite, number, shown, text
from ..border import bordered
from ..errors import InputError

__all__ = ["Reach", "Task", "Track"]

Array: TypeAlias = NDArray[np.float64]


@bordered
class Task:
    """Base class of tasks. Derive your task from it. Each environment calls `prepare` once.

    The reward of a step is `1 / (1 + (|e| / scale)^2) - effort * mean(action^2)`, without a unit. `e` is the error. With `effort = 0` the
    reward is 1 at the target and 1/2 where `|e| = scale`.

    Args:
        q0: centre of the initial configurations and of targets, (n,), rad or m; None: the middle of the limits.
        spread: a run starts within `q0 +- spread`, rad or m, and within the limits. It starts at rest, except for `Track`.
        scale: norm of the error at which the reward is 1/2 with `effort = 0`, in the error's unit.
        effort: weight of the mean square of the action in the reward. A full action of all joints costs `effort` per step.
    """

    def __init__(self, *, q0: ArrayLike | None = None, spread: float = 0.1, scale: float = 0.1, effort: float = 0.0) -> None:
        for name, value in (("spread", spread), ("scale", scale), ("effort", effort)):
            value = number(type(self).__name__, name, value)
            if not (np.isfinite(value) and value >= 0.0) or (name == "scale" and value == 0.0):
                raise InputError(f"{type(self).__name__}: {name} is out of range: expected a finite number >= 0, got {value}")
        self.q0, self.spread, self.scale, self.effort = q0, spread, scale, effort

    def prepare(self, arm: Arm, q_limit: tuple[Array, Array], v_limit: Array, period: float, steps: int) -> None:
        """Store the arm, the bounds of its state, the time between actions, s, and the number of actions of a run."""
        self.arm, self.q_limit, self.v_limit, self.period, self.steps = arm, q_limit, v_limit, period, steps
        middle = (q_limit[0] + q_limit[1]) / 2
        name = type(self).__name__
        self.centre = middle if self.q0 is None else finite(name, "q0", _core.numbers(name, "q0", self.q0, (arm.n,)))
        self.starts = self._around(self.spread)

    def draw(self, rng: np.random.Generator) -> tuple[Array, Array, Array]:
        """Draw the initial position and velocity, (n,) each, and the goal of one run, an array of fixed length."""
        return _within(self.starts, rng), np.zeros(self.arm.n), np.zeros(0)

    def _draws(self, rngs: Sequence[np.random.Generator]) -> tuple[Array, Array, Array]:
        """Call `draw` once per generator and return the results as rows.

        The tasks of this file draw all rows together, with the same random numbers as `draw`.
        """
        q0, v0, goal = (np.array(part) for part in zip(*(self.draw(rng) for rng in rngs), strict=True))
        return q0, v0, goal

    def bound(self) -> Array:
        """The largest magnitude of each entry of the error in observations, (m,). Larger errors are clipped."""
        raise NotImplementedError

    def error(self, k: NDArray[np.int64], q: Array, v: Array, goal: Array) -> Array:
        """The error after `k` steps, (B, m); `k` is (B,). It is the last part of an observation."""
        raise NotImplementedError

    def reward(self, error: Array, action: Array, k: NDArray[np.int64], q: Array, v: Array) -> Array:
        """The reward of a step, (B,). `error` is the error after the step, `action` is clipped to [-1, 1]."""
        size = _norms(error) / self.scale
        pay: Array = 1.0 / (1.0 + size * size)
        return pay - self.effort * (action * action).mean(axis=-1) if self.effort else pay

    def reached(self, error: Array, k: NDArray[np.int64], q: Array, v: Array) -> NDArray[np.bool_]:
        """Whether a run has reached its goal, (B,). The base class always returns False."""
        return np.zeros(len(q), dtype=np.bool_)

    def points(self, k: NDArray[np.int64], q: Array, goal: Array) -> Array:
        """Positions at which a picture draws targets, (B, points, 3), m, after `k` steps (B,). The base class has no targets."""
        return np.zeros((len(q), 0, 3))

    def _around(self, spread: float) -> tuple[Array, Array]:
        """The box of configurations within `spread` of the centre and within the limits.

        Return its lower corner and its size, (n,) each.
        """
        low, high = np.maximum(self.centre - spread, self.q_limit[0]), np.minimum(self.centre + spread, self.q_limit[1])
        return low, np.maximum(low, high) - low


def works_row_by_row(task: Task) -> bool:
    """Whether `error`, `reward` and `reached` are methods of this file. These compute each row without data of other rows."""
    own = type(task)
    known = {Task, Reach, Track}
    return all(any(getattr(own, name) is getattr(kind, name) for kind in known) for name in ("error", "reward", "reached"))


def _within(box: tuple[Array, Array], rng: np.random.Generator) -> Array:
    """A random configuration in `box`. It equals the result of `rng.uniform` to the last bit."""
    low, span = box
    drawn: Array = low + span * rng.random(len(low))
    return drawn


def _norms(rows: Array) -> Array:
    """Norms (B,) of rows (B, m), equal to numpy's to the last bit."""
    if rows.ndim != 2 or not 0 < rows.shape[1] < 8:
        return np.asarray(np.linalg.norm(rows, axis=-1), dtype=np.float64)
    first, *others = (rows * rows).T
    norms: Array = np.sqrt(sum(others, start=first))
    return norms


@bordered
class Reach(Task):
    """A task of moving a frame to a target. The target is the frame's position at a random configuration, so it is reachable.

    The error is `e = p_target - p`, m, along the chosen axes. `Task` defines the reward.

    Args:
        frame: the frame that moves to the target; None: `arm.tip_frame`.
        axes: the world axes of the error, one or more letters of "xyz".
        reach: the configuration of the target is within `q0 +- reach`, rad or m.
        within: distance to the target, m, at which a run ends if all joints are slower than `at_rest`. None: a run ends at its horizon.
        at_rest: largest joint velocity at which a run can end, rad/s or m/s.
        **common: `q0`, `spread`, `scale` (m), `effort`, as for `Task`.
    """

    def __init__(
        self,
        frame: str | None = None,
        axes: str = "xyz",
        *,
        reach: float = 1.5,
        within: float | None = None,
        at_rest: float = 0.1,
        **common: Any,
    ) -> None:
        super().__init__(**common)
        axes = text("Reach", "axes", axes)
        if not axes or set(axes) - set("xyz") or len(set(axes)) < len(axes):
            raise InputError(f'Reach: axes are unknown: expected some of "xyz", got {shown(axes)}')
        for name, value in (("reach", reach), ("within", within), ("at_rest", at_rest)):
            if not (name == "within" and value is None) and not 0.0 <= number("Reach", name, value) < np.inf:
                raise InputError(f"Reach: {name} is out of range: expected a finite number >= 0, got {shown(value)}")
        self.frame = None if frame is None else text("Reach", "frame", frame)
        self.axes, self.spread_of_targets, self.within, self.at_rest = axes, reach, within, at_rest
        self.rows = ["xyz".index(axis) for axis in axes]

    def prepare(self, arm: Arm, q_limit: tuple[Array, Array], v_limit: Array, period: float, steps: int) -> None:
        super().prepare(arm, q_limit, v_limit, period, steps)
        self.tip = str(arm.tip_frame if self.frame is None else self.frame)
        self.targets = self._around(self.spread_of_targets)
        # Two positions of the frame differ at most by the diameter of the workspace. Random positions estimate the diameter; the factor 1.5
        # is a margin.
        places = arm.position(np.random.default_rng(0).uniform(*q_limit, (200, arm.n)), self.tip)
        self.farthest = 1.5 * 2.0 * float(np.linalg.norm(places - places.mean(axis=0), axis=-1).max())

    def draw(self, rng: np.random.Generator) -> tuple[Array, Array, Array]:
        q0, v0, _ = super().draw(rng)
        return q0, v0, self.arm.position(_within(self.targets, rng), self.tip)[self.rows]

    def _draws(self, rngs: Sequence[np.random.Generator]) -> tuple[Array, Array, Array]:
        if type(self).draw is not Reach.draw:
            return super()._draws(rngs)
        n, (low, span), (first, reach) = self.arm.n, self.starts, self.targets
        # One call of `rng.random(2 n)` draws the same numbers as two calls of `rng.random(n)`.
        numbers = np.array([rng.random(2 * n) for rng in rngs])
        places = self.arm.position(first + reach * numbers[:, n:], self.tip)
        return low + span * numbers[:, :n], np.zeros((len(rngs), n)), places[:, self.rows]

    def bound(self) -> Array:
        return np.full(len(self.rows), self.farthest)

    def error(self, k: NDArray[np.int64], q: Array, v: Array, goal: Array) -> Array:
        error: Array = goal - self.arm.position(q, self.tip)[..., self.rows]
        return error

    def points(self, k: NDArray[np.int64], q: Array, goal: Array) -> Array:
        # Along an axis that is not in the task, the picture shows the target at the frame's position.
        targets = np.array(self.arm.position(q, self.tip))
        targets[..., self.rows] = goal
        return targets[:, None]

    def reached(self, error: Array, k: NDArray[np.int64], q: Array, v: Array) -> NDArray[np.bool_]:
        if self.within is None:
            return super().reached(error, k, q, v)
        near = _norms(error) <= self.within
        return np.asarray(near & (np.abs(v).max(axis=-1) <= self.at_rest), dtype=np.bool_)


@bordered
class Track(Task):
    """A task of following a motion of the joints, beginning near the start of the motion.

    The error is `e = [q_d - q, v_d - v]`, rad and rad/s (m and m/s for prismatic joints). `Task` defines the reward. `scale` is one
    number for positions and speeds: an error of `scale` rad counts as much as an error of `scale` rad/s.

    Args:
        motion: the desired motion, such as `Sinusoid(..)`.
        **common: `spread`, `scale` (rad or m), `effort`, as for `Task`.
    """

    def __init__(self, motion: Motion, **common: Any) -> None:
        super().__init__(**common)
        self.motion = motion

    def prepare(self, arm: Arm, q_limit: tuple[Array, Array], v_limit: Array, period: float, steps: int) -> None:
        samples = [self.motion(k * period) for k in range(steps + 1)]
        # Rows can be at different times. So the motion is sampled once, at the times of all actions.
        self.desired = np.array([np.concatenate([q, v]) for q, v, _ in samples])
        if self.desired.shape[-1] != 2 * arm.n:
            raise InputError(f"Track: motion has the wrong size: expected {arm.n} joints, got {self.desired.shape[-1] // 2}")
        self.q0 = self.desired[0, : arm.n]
        super().prepare(arm, q_limit, v_limit, period, steps)

    def draw(self, rng: np.random.Generator) -> tuple[Array, Array, Array]:
        q0, _, goal = super().draw(rng)
        return q0, self.desired[0, self.arm.n :].copy(), goal

    def _draws(self, rngs: Sequence[np.random.Generator]) -> tuple[Array, Array, Array]:
        if type(self).draw is not Track.draw:
            return super()._draws(rngs)
        low, span = self.starts
        numbers = np.array([rng.random(self.arm.n) for rng in rngs])
        return low + span * numbers, np.tile(self.desired[0, self.arm.n :], (len(rngs), 1)), np.zeros((len(rngs), 0))

    def bound(self) -> Array:
        span = np.maximum(np.abs(self.q_limit[0]), np.abs(self.q_limit[1]))
        bound: Array = np.abs(self.desired).max(axis=0) + np.concatenate([span, self.v_limit])
        return bound

    def error(self, k: NDArray[np.int64], q: Array, v: Array, goal: Array) -> Array:
        error: Array = self.desired[k] - np.concatenate([q, v], axis=-1)
        return error

    def points(self, k: NDArray[np.int64], q: Array, goal: Array) -> Array:
        targets: Array = self.arm.position(self.desired[k, : self.arm.n], str(self.arm.tip_frame))
        return targets[:, None]
