"""Laws for tasks with priorities, whose input is the joint velocity or the torque.

velocity:     v = u,  u by `priority` from  J_i u = w_i + K_i e_i                            (closed-loop inverse kinematics)
torque:       a by `priority` from  J_i a = w_i_dot + D_i (w_i - J_i v) + K_i e_i - dJ_i/dt v,  and a = -c v below all tasks
              tau = M a + C v + g   (computed torque)
limits: low <= u <= high   so that a joint that moves for the time h can then stop before its limit with the deceleration a_max
              (low - v)/h <= a <= (high - v)/h   within +-a_max; low and high for the time 4 h and the deceleration a_max / 2
sampled: a within the results of `saturation.joint_bounds_of_sample`.
torque limits: -tau_max <= M a + C v + g <= tau_max in a level above the limits of a

Task i has the Jacobian J_i, the error e_i, the target velocity w_i, the gain K_i and the damping D_i. c is `joint_damping`, h `horizon`,
and low and high are the results of `saturation.joint_bounds`. With limits, "exact" enumerates active sets.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .arm import Arm
from .diagnosis import EPS
from .inequality import solve_inequalities
from .lagrange import Array
from .law import Law, Terms
from .motion import Sample
from .priority import solve_priority
from .saturation import joint_bounds, joint_bounds_of_sample
from .tasks import Task


class VelocityArm:
    """An arm with the state q, whose input is v. It has no kinetic energy."""

    elastic = False

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self.size = arm.n

    def initial(self, q0: Array, v0: Array, theta0: ArrayLike | None, theta_dot0: ArrayLike | None) -> Array:
        return q0

    def split(self, y: Array) -> tuple[Array, Array, Array | None, Array | None]:
        return y, np.zeros_like(y), None, None

    def rates(self, y: Array, tau: Array, load: Array) -> Array:
        return tau

    def energy(self, y: Array) -> float:
        return 0.0

    def power(self, y: Array, tau: Array, load: Array) -> float:
        return 0.0


def _own(arm: Arm, hold: bool, sensible: bool) -> dict[str, Array]:
    """The limits of the arm, if they `hold`; if `sensible`, without velocity limits that are not positive, and without empty ranges."""
    if not hold:
        return {"lower": np.full(arm.n, -np.inf), "upper": np.full(arm.n, np.inf), "velocity": np.full(arm.n, np.inf)}
    if not sensible:
        return arm.limits
    lower, upper, velocity = (arm.limits[name] for name in ("lower", "upper", "velocity"))
    return {
        "lower": np.where(lower < upper, lower, -np.inf),
        "upper": np.where(lower < upper, upper, np.inf),
        "velocity": np.where(velocity > 0.0, velocity, np.inf),
    }


def _weighted(entry: Any) -> tuple[Task, float]:
    """A task of a level and its weight."""
    return entry if isinstance(entry, tuple) else (entry, 1.0)


class PriorityVelocity(Law):
    """A velocity law for tasks, the highest priority first.

    Limits are for the methods "sns" and "exact". `limits` is whether the limits of the arm replace missing limits, except velocity limits
    that are not positive, and empty ranges. None means only for "sns", without exceptions. If only one of `v_min` and `v_max` is passed,
    it also limits the speed in the other direction.
    """

    def __init__(
        self,
        arm: Arm,
        tasks: Sequence[Any],
        method: str = "clamp",
        eps: float | Sequence[float] | None = None,
        *,
        v_min: ArrayLike | None = None,
        v_max: ArrayLike | None = None,
        q_min: ArrayLike | None = None,
        q_max: ArrayLike | None = None,
        a_max: ArrayLike | None = None,
        horizon: float = 0.1,
        limits: bool | None = None,
    ) -> None:
        self.arm, self.method, self.eps = arm, method, eps
        #: The tasks of each level with their weights.
        self.groups = [[_weighted(task) for task in level] if isinstance(level, list) else [(level, 1.0)] for level in tasks]
        self.tasks = [task for group in self.groups for task, _ in group]
        if any(task.without_target and not task.has_bounds for task in self.tasks):
            raise ValueError("PriorityVelocity: tasks is incomplete: expected a motion or target for each")
        self.gains = [task.gains(arm) for task in self.tasks]
        self.breaks = tuple(b for task in self.tasks for b in task.breaks)
        given = any(x is not None for x in (v_min, v_max, q_min, q_max, a_max))
        self.limited = method == "sns" or given or bool(limits)
        own = _own(arm, method == "sns" if limits is None else limits, bool(limits))
        mirrored = (None if v_min is None else -np.asarray(v_min), None if v_max is None else -np.asarray(v_max))
        chosen: list[Any] = [
            own["lower"] if q_min is None else q_min,
            own["upper"] if q_max is None else q_max,
            next(x for x in (v_min, mirrored[1], -own["velocity"]) if x is not None),
            next(x for x in (v_max, mirrored[0], own["velocity"]) if x is not None),
            np.inf if a_max is None else a_max,
        ]
        self.limits = np.array([np.broadcast_to(np.asarray(x, dtype=np.float64), (arm.n,)) for x in chosen])
        self.horizon = horizon

    def bounds(self, q: Array, time: float, brakes: float, held: bool) -> tuple[Array, Array]:
        """The bounds of joint velocities, (n,) each, for the time `time`, s, and the deceleration `brakes` * a_max.

        If velocities are `held`, the joint brakes only after `time`.
        """
        q_min, q_max, v_min, v_max, a_max = self.limits
        columns = zip(q, q_min, q_max, v_min, v_max, brakes * a_max, strict=True)
        pairs = np.array([joint_bounds(x, low, high, slow, fast, time, a, held) for x, low, high, slow, fast, a in columns])
        return pairs[:, 0], pairs[:, 1]

    def _limited(self, q: Array, v: Array) -> dict[str, Array]:
        lower, upper = self.bounds(q, self.horizon, 1.0, True)
        return {"v_min": lower, "v_max": upper}

    def _sample(self, task: Task, t: float, rows: int) -> Sample:
        """The target of a task; zero for bounds without a target."""
        if task.without_target:
            return np.zeros(rows), np.zeros(rows), np.zeros(rows)
        return task.motion(t)

    def _rows(self, jacobians: list[Array], commands: list[Array]) -> list[tuple[Array, Array, Array]]:
        """The rows of each level with their lower and upper bounds. A task has the same number for both."""
        levels, first = [], 0
        for group in self.groups:
            rows = []
            for k, (task, weight) in enumerate(group, first):
                J, c, K = jacobians[k], commands[k], self.gains[k][0]
                bounds = task.within(self.arm, c.size)
                low, high = (c, c) if bounds is None else (c + np.diag(K) * bounds[0], c + np.diag(K) * bounds[1])
                factor = np.sqrt(weight) if len(group) > 1 else 1.0
                rows.append((factor * J, factor * low, factor * high))
            first += len(group)
            matrices, lower, upper = zip(*rows, strict=True)
            levels.append((np.vstack(matrices), np.concatenate(lower), np.concatenate(upper)))
        return levels

    def _levels(self, t: float, q: Array, v: Array) -> tuple[list[Array], list[Array], Terms]:
        jacobians, velocities, errors = [], [], []
        for task, (K, _) in zip(self.tasks, self.gains, strict=True):
            sample = self._sample(task, t, len(K))
            errors.append(task.error(self.arm, q, sample[0]))
            jacobians.append(task.jacobian(self.arm, q))
            velocities.append(task.feedforward(self.arm, q, sample)[0] + K @ errors[-1])
        return jacobians, velocities, {"e": np.concatenate(errors)}

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        jacobians, commands, terms = self._levels(t, q, v)
        rounding = 8 * EPS * (1.0 + float(np.abs(q).sum()))
        limits = self._limited(q, v) if self.limited else {}
        count = len(self.tasks)
        rows = self._rows(jacobians[:count], commands[:count])
        rows += [(J, c, c) for J, c in zip(jacobians[count:], commands[count:], strict=True)]
        if self.method == "exact" and (limits or self._torque_rows(q, v) or any(not np.array_equal(low, high) for _, low, high in rows)):
            first = [(np.eye(self.arm.n), limits["v_min"], limits["v_max"])] if limits else []
            u = solve_inequalities([*self._torque_rows(q, v), *first, *rows]).x
        else:
            u = solve_priority([J for J, _, _ in rows], [low for _, low, _ in rows], self.method, self.eps, rounding, **limits).v
        return terms | {"tau": self._input(q, v, u), "state_rate": np.zeros(0), "u": u}

    def _torque_rows(self, q: Array, v: Array) -> list[tuple[Array, Array, Array]]:
        """The level of torque limits; none for velocities."""
        return []

    def _input(self, q: Array, v: Array, u: Array) -> Array:
        return u


class PriorityAcceleration(PriorityVelocity):
    """The law for accelerations of tasks, with computed torque. `sample_time` is that of the loop, s, and `tau_max` requires "exact"."""

    def __init__(
        self,
        *arguments: Any,
        joint_damping: float = 5.0,
        tau_max: ArrayLike | None = None,
        sample_time: float | None = None,
        **keywords: Any,
    ) -> None:
        super().__init__(*arguments, **keywords)
        self.tau_max, self.sample_time = tau_max, sample_time
        self.joint_damping = joint_damping
        if self.eps is not None and np.size(self.eps) == len(self.groups) > 1:
            self.eps = [*np.ravel(self.eps), 0.02]  # the last eps is for the level below all tasks

    def _limited(self, q: Array, v: Array) -> dict[str, Array]:
        if self.sample_time is not None:
            joints, h = zip(q, v, *self.limits[:5], strict=True), self.sample_time
            pairs = np.array([joint_bounds_of_sample(x, w, low, high, slow, fast, h, a) for x, w, low, high, slow, fast, a in joints])
            return {"v_min": pairs[:, 0], "v_max": pairs[:, 1]}
        slow, fast = self.bounds(q, 4.0 * self.horizon, 0.5, False)
        a_max = self.limits[4]
        lower, upper = (np.clip((to - v) / self.horizon, -a_max, a_max) for to in (slow, fast))
        return {"v_min": lower, "v_max": upper}

    def _levels(self, t: float, q: Array, v: Array) -> tuple[list[Array], list[Array], Terms]:
        jacobians, commands, errors, rates = [], [], [], []
        for task, (K, D) in zip(self.tasks, self.gains, strict=True):
            sample = self._sample(task, t, len(K))
            rate, acceleration = task.feedforward(self.arm, q, sample)
            J = task.jacobian(self.arm, q)
            errors.append(task.error(self.arm, q, sample[0]))
            rates.append(rate - J @ v)
            jacobians.append(J)
            commands.append(acceleration + D @ rates[-1] + K @ errors[-1] - task.jacobian_dot(self.arm, q, v) @ v)
        below = (np.eye(self.arm.n), -self.joint_damping * v)
        return [*jacobians, below[0]], [*commands, below[1]], {"e": np.concatenate(errors), "e_dot": np.concatenate(rates)}

    def _input(self, q: Array, v: Array, u: Array) -> Array:
        return self.arm.inverse_dynamics(q, v, u)

    def _torque_rows(self, q: Array, v: Array) -> list[tuple[Array, Array, Array]]:
        if self.tau_max is None:
            return []
        n = self.arm.n
        bias, rest, none = self.arm.inverse_dynamics(q, v, np.zeros(n)), np.zeros(n), np.zeros(n)
        weight = self.arm.inverse_dynamics(q, rest, none)
        M = np.array([self.arm.inverse_dynamics(q, rest, unit) - weight for unit in np.eye(n)]).T
        limit = np.broadcast_to(np.asarray(self.tau_max, dtype=np.float64), (n,))
        return [(M, -limit - bias, limit - bias)]
