"""Tasks of an arm: the error e(q), the feed-forward w and the Jacobian J(q) of a command J v = w + K e.

    frame           e = p_d - p,  log(R_d R')                       J: rows of the geometric Jacobian
    posture         e = q_d - q of chosen joints                    rows of the identity
    centre of mass  e = c_d - c                                     sum_i dT_i/dq P_i e_4 / mass (see `arm`)
    axis            e = B'r,  exp(r) a = d, |r| <= pi            B'J_w,  B = R [b1 b2], b1 and b2 perpendicular to the axis in the frame
    relative        e as for frame, with X = X_r^-1 X_f             from dX/dq = X_r^-1 dX_f/dq - X_r^-1 dX_r/dq X
    joint limits    e = clip(q, lower + m range, upper - m range) - q,  m the margin

K is the gain, and ' the transpose. p and R are position and rotation matrix of the frame, p_d and R_d their targets. c is the centre of
mass and c_d its target. a and d are the direction of the axis and its target in world axes, and J_w the angular rows of the geometric
Jacobian. X_f and X_r are the poses of the frame and of the reference frame. The feed-forward of a direction d(t) is B' times its angular
velocity (d x d_dot) / d.d. Complex steps compute the derivatives of this velocity and of J, because each Jacobian here is analytic in q.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .arm import Arm
from .inertia import pseudo_inertia
from .lagrange import STEP, Analytic, Array
from .law import gain
from .motion import Hold, Motion, Sample
from .task import parse_axes, pose_error, rotation_vector

Target = Motion | ArrayLike | None


class Task:
    """A task that moves selected rows of a frame's pose to a target or along a motion. It is the base class of all tasks.

    `gain` and `damping` are scalar, (rows,) or (rows, rows).
    """

    def __init__(
        self,
        frame: str,
        axes: str,
        target: Target = None,
        gain: ArrayLike = 1.0,
        *,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> None:
        self.frame, self.axes = frame, axes
        self._aim(target, gain, motion, damping)
        self.bounds = (lower, upper)

    #: Lower and upper bounds of the coordinates, measured from the target, or from zero without one.
    bounds: tuple[ArrayLike | None, ArrayLike | None] = (None, None)

    def _aim(self, target: Target, gain: ArrayLike, motion: Motion | None, damping: ArrayLike | None) -> None:
        given = target if motion is None else motion
        self.without_target = given is None  # if true, each call passes the task velocity
        self.motion: Motion = given if callable(given) else Hold(np.zeros(0) if given is None else given)
        self.gain, self.damping = gain, damping
        self.breaks: tuple[float, ...] = getattr(self.motion, "breaks", ())

    @property
    def has_bounds(self) -> bool:
        """Whether the task has bounds in place of a target."""
        return any(bound is not None for bound in self.bounds)

    def within(self, arm: Arm, rows: int) -> tuple[Array, Array] | None:
        """The bounds of the coordinates, (rows,) each; None for a task that moves to a target."""
        if not self.has_bounds:
            return None
        low, high = (infinite if bound is None else bound for bound, infinite in zip(self.bounds, (-np.inf, np.inf), strict=True))
        return np.broadcast_to(np.asarray(low, dtype=np.float64), rows), np.broadcast_to(np.asarray(high, dtype=np.float64), rows)

    def gains(self, arm: Arm) -> tuple[Array, Array]:
        """The gain K of the error, and the gain of the error's derivative, (rows, rows) each. The default of the second is 2 K^1/2."""
        rows = self.jacobian(arm, np.zeros(arm.n)).shape[0]
        K = gain(self.gain, rows)
        if self.damping is not None:
            return K, gain(self.damping, rows)
        values, U = np.linalg.eigh(K)
        return K, np.asarray(2.0 * (U * np.sqrt(np.maximum(values, 0.0))) @ U.T)

    def jacobian(self, arm: Arm, q: Analytic) -> Analytic:
        """The Jacobian of the task, (rows, n), analytic in q."""
        return arm._jacobian(q, self.frame)[parse_axes(self.axes)]

    def jacobian_dot(self, arm: Arm, q: Array, v: Array) -> Array:
        """The time derivative dJ/dt for dq/dt = v, (rows, n)."""
        return np.asarray(self.jacobian(arm, q + 1j * STEP * v).imag / STEP)

    def error(self, arm: Arm, q: Array, target: Array) -> Array:
        """The error of the task, (rows,)."""
        return pose_error(arm.pose(q, self.frame), target, parse_axes(self.axes))

    def feedforward(self, arm: Arm, q: Array, sample: Sample) -> tuple[Array, Array]:
        """The velocity and the acceleration of the target, (rows,) each."""
        return sample[1], sample[2]


class PostureTask(Task):
    """A task that moves the joints `joints`, or all joints, to desired positions."""

    def __init__(
        self,
        target: Target = None,
        gain: ArrayLike = 1.0,
        *,
        joints: Sequence[str] | None = None,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> None:
        self.joints = joints
        self._aim(target, gain, motion, damping)
        self.bounds = (lower, upper)

    def _chosen(self, arm: Arm) -> list[int]:
        return list(range(arm.n)) if self.joints is None else [arm.joint_names.index(name) for name in self.joints]

    def jacobian(self, arm: Arm, q: Analytic) -> Analytic:
        return np.eye(arm.n, dtype=q.dtype)[self._chosen(arm)]

    def error(self, arm: Arm, q: Array, target: Array) -> Array:
        return target - q[self._chosen(arm)]


class JointLimitTask(PostureTask):
    """A task that moves joints out of a margin at both ends of their ranges. The margin is a fraction of the range."""

    def __init__(
        self, gain: ArrayLike = 1.0, margin: float = 0.1, *, joints: Sequence[str] | None = None, damping: ArrayLike | None = None
    ) -> None:
        super().__init__([], gain, joints=joints, damping=damping)
        self.margin = margin

    def _chosen(self, arm: Arm) -> list[int]:
        span = arm.limits["upper"] - arm.limits["lower"]
        return [j for j in super()._chosen(arm) if np.isfinite(span[j])]

    def error(self, arm: Arm, q: Array, target: Array) -> Array:
        lower, upper = arm.limits["lower"], arm.limits["upper"]
        away = self.margin * (upper - lower)
        chosen = self._chosen(arm)
        return np.asarray((np.clip(q, lower + away, upper - away) - q)[chosen])

    def feedforward(self, arm: Arm, q: Array, sample: Sample) -> tuple[Array, Array]:
        rest = np.zeros(len(self._chosen(arm)))
        return rest, rest


class CentreOfMassTask(Task):
    """A task that moves selected coordinates of the centre of mass, in world axes."""

    def __init__(
        self,
        axes: str,
        target: Target = None,
        gain: ArrayLike = 1.0,
        *,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> None:
        self.axes = axes
        self._aim(target, gain, motion, damping)
        self.bounds = (lower, upper)

    def jacobian(self, arm: Arm, q: Analytic) -> Analytic:
        moments = pseudo_inertia(arm.parameters.reshape(-1, 10))[:, :, 3]
        columns: Any = sum(slope @ moment for slope, moment in zip(arm._walk(q)[1], moments, strict=True))
        return np.asarray(columns.T[parse_axes(self.axes)] / moments[:, 3].sum())

    def error(self, arm: Arm, q: Array, target: Array) -> Array:
        return target - arm.center_of_mass(q)[parse_axes(self.axes)]


class AxisTask(Task):
    """A task that turns the direction `axis` (3,) of a frame to a direction (3,) of the world.

    Its two rows are rotations about two directions that are perpendicular to `axis`.
    """

    def __init__(
        self,
        frame: str,
        axis: ArrayLike,
        target: Target = None,
        gain: ArrayLike = 1.0,
        *,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> None:
        self.frame = frame
        self.axis: Array = _unit(np.asarray(axis, dtype=np.float64))
        self._aim(target, gain, motion, damping)
        self.bounds = (lower, upper)
        # Let c be the coordinate axis that is most nearly perpendicular to the task's axis. b2 is perpendicular to both axes, and
        # b1 = b2 x axis. If the task's axis is z, b1 is x and b2 is y.
        second = _unit(np.cross(self.axis, np.eye(3)[np.argmin(np.abs(self.axis))]))
        along_z = bool(self.axis[2] == 1.0)
        self.across: Array = np.eye(3)[:2] if along_z else np.stack([np.cross(second, self.axis), second])

    def _turned(self, arm: Arm, q: Analytic) -> Analytic:
        """The matrix B = R [b1 b2], (3, 2)."""
        return np.asarray(arm._frame(q, self.frame)[0][:3, :3] @ self.across.T)

    def jacobian(self, arm: Arm, q: Analytic) -> Analytic:
        return np.asarray(self._turned(arm, q).T @ arm._jacobian(q, self.frame)[3:])

    def error(self, arm: Arm, q: Array, target: Array) -> Array:
        a, d = arm.pose(q, self.frame)[:3, :3] @ self.axis, _unit(target)
        middle, B = a + d, self._turned(arm, q)
        if np.linalg.norm(middle) < 1e-15:  # the directions are opposite, so the rotation is pi about b1
            return np.array([np.pi, 0.0])
        # The rotation by pi about a, and then by pi about the direction m in the middle, is the shortest rotation from a to d.
        m = _unit(middle)
        turn = (2 * np.outer(m, m) - np.eye(3)) @ (2 * np.outer(a, a) - np.eye(3))
        return np.asarray(B.T @ rotation_vector(turn))

    def feedforward(self, arm: Arm, q: Array, sample: Sample) -> tuple[Array, Array]:
        d, rate, acceleration = sample
        moved, faster = d + 1j * STEP * rate, rate + 1j * STEP * acceleration
        spin = np.cross(moved, faster) / (moved @ moved)
        B = self._turned(arm, q)
        return np.asarray(B.T @ spin.real), np.asarray(B.T @ (spin.imag / STEP))


class RelativeTask(Task):
    """A task that controls selected rows of the pose of a frame in the axes of another frame."""

    def __init__(
        self,
        frame: str,
        reference: str,
        axes: str,
        target: Target = None,
        gain: ArrayLike = 1.0,
        *,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> None:
        super().__init__(frame, axes, target, gain, motion=motion, damping=damping, lower=lower, upper=upper)
        self.reference = reference

    def _pose(self, arm: Arm, q: Analytic) -> tuple[Analytic, Analytic]:
        (X_f, slope_f), (X_r, slope_r) = arm._frame(q, self.frame), arm._frame(q, self.reference)
        back = np.linalg.inv(X_r)
        X = back @ X_f
        return X, back @ slope_f - back @ slope_r @ X

    def jacobian(self, arm: Arm, q: Analytic) -> Analytic:
        X, slope = self._pose(arm, q)
        spin = slope[:, :3, :3] @ X[:3, :3].T
        rows = [slope[:, 0, 3], slope[:, 1, 3], slope[:, 2, 3], spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]]
        return np.stack(rows)[parse_axes(self.axes)]

    def error(self, arm: Arm, q: Array, target: Array) -> Array:
        return pose_error(self._pose(arm, q)[0], target, parse_axes(self.axes))


def _unit(x: Array) -> Array:
    return np.asarray(x / np.linalg.norm(x))
