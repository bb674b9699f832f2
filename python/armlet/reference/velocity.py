"""Task priority closed over an arm whose joint velocities are the input.

q' = u,   u = the chosen priority map of  J_i u = x_dot_d,i + gain_i (x_d,i - x_i)      (closed-loop inverse kinematics)
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .arm import Arm
from .lagrange import Array
from .law import Law, Terms, gain
from .motion import Hold, Motion
from .priority import EPS, solve_priority
from .task import Coordinates, parse_axes


class Task:
    """Rows of a frame that follow a motion (rows,) or rest at a target; gain scalar, (rows,) or (rows, rows)."""

    def __init__(self, frame: str, axes: str, motion: Motion | None = None, target: ArrayLike | None = None, gain: ArrayLike = 0.0) -> None:
        if (motion is None) == (target is None):
            raise ValueError("Task: expected either motion or target")
        self.frame, self.axes, self.gain = frame, axes, gain
        self.motion: Motion = motion if motion is not None else Hold([] if target is None else target)


class VelocityArm:
    """State q; the input is v. Kinetic energy plays no part."""

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


class PriorityVelocity(Law):
    """Tasks in falling priority."""

    def __init__(self, arm: Arm, tasks: Sequence[Task], method: str = "clamp", eps: float | Sequence[float] | None = None) -> None:
        self.arm, self.tasks, self.method, self.eps = arm, list(tasks), method, eps
        self.gains = [gain(task.gain, len(parse_axes(task.axes))) for task in self.tasks]
        self.breaks = tuple(b for task in self.tasks for b in getattr(task.motion, "breaks", ()))

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        jacobians, velocities, errors = [], [], []
        for task, K in zip(self.tasks, self.gains, strict=True):
            x_d, x_dot_d, _ = task.motion(t)
            coordinates = Coordinates(self.arm, x_d, task.frame, task.axes)
            errors.append(coordinates.error(q))
            jacobians.append(coordinates.jacobian(q))
            velocities.append(x_dot_d + K @ errors[-1])
        rounding = 8 * EPS * (1.0 + float(np.abs(q).sum()))
        u = solve_priority(jacobians, velocities, self.method, self.eps, rounding).v
        return {"tau": u, "state_rate": np.zeros(0), "e": np.concatenate(errors)}
