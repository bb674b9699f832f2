"""Tasks of environments: start, error, reward and end of a run.

    reward = 1 / (1 + (|e| / scale)^2) - effort * (1/n) sum_i u_i^2,   u = action, within [-1, 1]

Every method but `draw` works on all rows at once: arrays have the axis of the rows first. The reward has no unit. The error `e` is that
after the step. For `Reach` it is the target minus the frame's position, m. For `Track` it is `[q_d - q, v_d - v]`, rad and rad/s, or m and
m/s for slides. With `effort = 0` a reward is in (0, 1], so that ending a run early is never an advantage.
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
    """Derive from it for a task of your own; each environment calls `prepare` once.

    The reward of a step is `1 / (1 + (|e| / scale)^2) - effort * mean(action^2)`, without a unit: 1 at the target, 1/2 where `|e| = scale`.

    Args:
        q0: configuration about which runs start and targets lie, (n,), rad or m; None: the middle of the limits, 0 where there are none.
        spread: a run starts within `q0 +- spread`, at rest, rad or m.
        scale: norm of the error at which the reward is 1/2, in the error's unit.
        effort: what the mean square of the action costs, per step: a full action of all joints costs `effort`.
    """

    def __init__(self, *, q0: ArrayLike | None = None, spread: float = 0.1, scale: float = 0.1, effort: float = 0.0) -> None:
        for name, value in (("spread", spread), ("scale", scale), ("effort", effort)):
            value = number(type(self).__name__, name, value)
            if not (np.isfinite(value) and value >= 0.0) or (name == "scale" and value == 0.0):
                raise InputError(f"{type(self).__name__}: {name} is out of range: expected a finite number >= 0, got {value}")
        self.q0, self.spread, self.scale, self.effort = q0, spread, scale, effort

    def prepare(self, arm: Arm, q_limit: tuple[Array, Array], v_limit: Array, period: float, steps: int) -> None:
        """Receive the arm, the bounds of its state, the time between actions, s, and the number of actions of a run."""
        self.arm, self.q_limit, self.v_limit, self.period, self.steps = arm, q_limit, v_limit, period, steps
        middle = (q_limit[0] + q_limit[1]) / 2
        name = type(self).__name__
        self.centre = middle if self.q0 is None else finite(name, "q0", _core.numbers(name, "q0", self.q0, (arm.n,)))
        self.starts = self._around(self.spread)

    def draw(self, rng: np.random.Generator) -> tuple[Array, Array, Array]:
        """Draw the initial position and velocity, (n,), and the goal of one run, an array of a fixed length."""
        return _within(self.starts, rng), np.zeros(self.arm.n), np.zeros(0)

    def _draws(self, rngs: Sequence[np.random.Generator]) -> tuple[Array, Array, Array]:
        """One `draw` per generator, as rows. The tasks of this file draw all rows at once, with the same numbers."""
        q0, v0, goal = (np.array(part) for part in zip(*(self.draw(rng) for rng in rngs), strict=True))
        return q0, v0, goal

    def bound(self) -> Array:
        """The largest magnitude of each entry of the error."""
        raise NotImplementedError

    def error(self, k: NDArray[np.int64], q: Array, v: Array, goal: Array) -> Array:
        """The remaining error, (B, m), after `k` steps (B,); the last part of an observation."""
        raise NotImplementedError

    def reward(self, error: Array, action: Array, k: NDArray[np.int64], q: Array, v: Array) -> Array:
        """The reward of a step, (B,), from the error after it; `action` is clipped to [-1, 1]."""
        size = _norms(error) / self.scale
        pay: Array = 1.0 / (1.0 + size * size)
        return pay - self.effort * (action * action).mean(axis=-1) if self.effort else pay

    def reached(self, error: Array, k: NDArray[np.int64], q: Array, v: Array) -> NDArray[np.bool_]:
        """Whether a run is done, (B,); by default never."""
        return np.zeros(len(q), dtype=np.bool_)

    def points(self, k: NDArray[np.int64], q: Array, goal: Array) -> Array:
        """Where a picture shows targets, (B, points, 3), m, after `k` steps (B,): by default nowhere."""
        return np.zeros((len(q), 0, 3))

    def _around(self, spread: float) -> tuple[Array, Array]:
        """The box of configurations within `spread` of the centre and within the limits: its lower corner and its size."""
        low, high = np.maximum(self.centre - spread, self.q_limit[0]), np.minimum(self.centre + spread, self.q_limit[1])
        return low, np.maximum(low, high) - low


def works_row_by_row(task: Task) -> bool:
    """Whether error, reward and end are those of this file, which compute each row from this row alone."""
    own = type(task)
    known = {Task, Reach, Track}
    return all(any(getattr(own, name) is getattr(kind, name) for kind in known) for name in ("error", "reward", "reached"))


def _within(box: tuple[Array, Array], rng: np.random.Generator) -> Array:
    """A random configuration, with the bits of `rng.uniform` in a tenth of its time for a few joints."""
    low, span = box
    drawn: Array = low + span * rng.random(len(low))
    return drawn


def _norms(rows: Array) -> Array:
    """The norms of (B, m) rows, with the same bits as numpy. Adding columns takes a twentieth of the time of sums over short rows."""
    if rows.ndim != 2 or not 0 < rows.shape[1] < 8:
        return np.asarray(np.linalg.norm(rows, axis=-1), dtype=np.float64)
    first, *others = (rows * rows).T
    norms: Array = np.sqrt(sum(others, start=first))
    return norms


@bordered
class Reach(Task):
    """Move to a target: the position of a frame at a random configuration, which is therefore reachable.

    The error is `e = p_target - p`, m, in the chosen axes. The reward is that of `Task`.

    Args:
        frame: the frame that moves to the target; None: `arm.tip_frame`.
        axes: which of "xyz".
        reach: the configuration of the target is within `q0 +- reach`, rad or m.
        within: done when the frame is this near, m, and all joints slower than `at_rest`; None: runs go on to their horizon.
        at_rest: rad/s or m/s.
        **common: `q0`, `spread`, `scale` (m), `effort`, of `Task`.
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
        # Two places of the frame are at most the diameter of its workspace apart; random places show it to within half.
        places = arm.position(np.random.default_rng(0).uniform(*q_limit, (200, arm.n)), self.tip)
        self.farthest = 1.5 * 2.0 * float(np.linalg.norm(places - places.mean(axis=0), axis=-1).max())

    def draw(self, rng: np.random.Generator) -> tuple[Array, Array, Array]:
        q0, v0, _ = super().draw(rng)
        return q0, v0, self.arm.position(_within(self.targets, rng), self.tip)[self.rows]

    def _draws(self, rngs: Sequence[np.random.Generator]) -> tuple[Array, Array, Array]:
        if type(self).draw is not Reach.draw:
            return super()._draws(rngs)
        n, (low, span), (first, reach) = self.arm.n, self.starts, self.targets
        # What each generator draws in two calls.
        numbers = np.array([rng.random(2 * n) for rng in rngs])
        places = self.arm.position(first + reach * numbers[:, n:], self.tip)
        return low + span * numbers[:, :n], np.zeros((len(rngs), n)), places[:, self.rows]

    def bound(self) -> Array:
        return np.full(len(self.rows), self.farthest)

    def error(self, k: NDArray[np.int64], q: Array, v: Array, goal: Array) -> Array:
        error: Array = goal - self.arm.position(q, self.tip)[..., self.rows]
        return error

    def points(self, k: NDArray[np.int64], q: Array, goal: Array) -> Array:
        # Along an axis that is free the target is where the frame is.
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
    """Follow a motion of the joints, from near its start.

    The error is `e = [q_d - q, v_d - v]`, rad and rad/s (m and m/s for slides). The reward is that of `Task`. Its `scale` is one number for
    positions and speeds: an error of `scale` rad counts as much as one of `scale` rad/s.

    Args:
        motion: what to follow, such as `Sinusoid(..)`.
        **common: `spread`, `scale` (rad or m), `effort`, of `Task`.
    """

    def __init__(self, motion: Motion, **common: Any) -> None:
        super().__init__(**common)
        self.motion = motion

    def prepare(self, arm: Arm, q_limit: tuple[Array, Array], v_limit: Array, period: float, steps: int) -> None:
        samples = [self.motion(k * period) for k in range(steps + 1)]
        # Rows are at different times: the motion is sampled once, at the times of the actions.
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
