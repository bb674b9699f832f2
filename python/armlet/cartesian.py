"""Joint paths along poses of a frame: lines, arcs, rounded corners and splines, by inverse kinematics at knots.

    q(s), s in [0, 1]:   not-a-knot cubic spline through knots (s_k, q_k) with X(q_k) = X_d(s_k)
    error on a segment:  largest of nine samples + d/8,   d the largest second difference of the samples

A segment whose error exceeds the tolerance is halved. Where the curve is smooth, the spline's error is of the order h^4.

Here X(q) is the pose of the frame, or the chosen coordinates of this pose. X_d(s) is the desired pose at the path position s. A segment of
length h is between two knots. The error is the distance and the angle between X(q(s)) and X_d(s). For each initial knot, inverse kinematics
starts from the solution at the previous knot. For a knot that halves a segment, it starts from the spline. So the path stays on one branch
of solutions, such as elbow up.
"""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core, rotations
from ._core import Arm, Task
from .arguments import choice, finite, instance, number, require_partner, text
from .border import border, bordered
from .errors import InputError, SolveError
from .pickling import sealed
from .pose_curves import NoCircleError, PoseCurve, columns_of, cubic
from .status import Status

__all__ = ["CartesianPath", "cartesian_path"]

_NAME = "cartesian_path"
_Array = NDArray[Any]
_ALL = "xyzrxryrz"
# Smallest initial number of spline segments between two poses, and largest number of knots of a path.
_FIRST, _MOST = 8, 20_000
# Largest change of a joint position between knots, rad or m. Shortest segment that may be halved, relative to the length of the path.
_STEP, _LEAST = 0.5, 1e-9
# Relative positions on a segment at which its error is evaluated.
_SAMPLES = np.linspace(0.0, 1.0, 9)
# A configuration counts as singular if the smallest singular value of the frame's Jacobian is below this multiple of the largest one.
_SINGULAR = 1e-2


class _Problem(NamedTuple):
    arm: Arm
    frame: str
    axes: str
    curve: PoseCurve
    tolerance: _Array
    limits: bool

    def solve(self, s: _Array, q: _Array, **options: Any) -> tuple[_Array, _Array]:
        """Search for joint positions at the path positions s (M,), with the initial guesses q (M, n).

        Return the joint positions, (M, n), and whether each row is a solution, (M,).
        """
        task = Task(self.frame, self.axes, target=self.curve.at(s))
        accuracy = max(1e-11, min(1e-9, 1e-3 * float(self.tolerance.min())))
        keywords = {"tolerance": accuracy, "restarts": 0, "limits": self.limits} | options
        found = _core.inverse_kinematics(self.arm, [task], q, **keywords)
        reached: _Array = np.asarray(found.reached).reshape(s.size, -1)
        return found.q, np.asarray(reached.all(axis=1))

    def errors(self, q: _Array, s: _Array) -> _Array:
        """Return the distance (m) and the angle (rad) between the frame and the curve, (M, 2)."""
        curve, wanted = self.curve, self.curve.at(s)
        letters = columns_of(self.axes)
        got = self.arm.pose_vector(q, self.frame)
        places = [k for k, letter in enumerate(letters) if letter < 3]
        away = np.linalg.norm(got[:, [letters[k] for k in places]] - wanted[:, places], axis=1)
        turned = np.zeros(s.size)
        if curve.turns:
            turned = rotations.angle(rotations.of_vector(got[:, 3:]), rotations.of_vector(wanted[:, curve.turns]))
        elif curve.single:
            apart = got[:, [letters[k] for k in curve.single]] - wanted[:, curve.single]
            turned = np.abs(np.remainder(apart + np.pi, 2.0 * np.pi) - np.pi).max(axis=1)
        return np.stack([away, turned], axis=1)


@bordered
@sealed
class CartesianPath:
    """A joint path along poses, made by `cartesian_path`. `path(s)` returns `q, dq/ds, d2q/ds2`, each `(..., n)`. `time_path` accepts it.

    Attributes:
        s: path positions of the knots, 0 to 1, `(K,)`.
        q: joint positions at the knots, rad or m, `(K, n)`. If `feasible` is False, they end at or before the place of the failure. If
            the first pose is not reachable, the only row is the initial guess.
        error: largest distance, m, and angle, rad, between frame and curve, `(2,)`; NaN if not feasible. It is the largest sample plus an
            estimate of the increase between samples.
        corners: indices of the knots at the poses. With `stops=path.corners[1:-1]`, `time_path` stops at all poses between the ends.
        length: length of the curve, m. The length of a line is sqrt(distance^2 + (0.1 m/rad angle)^2).
        feasible: whether the arm can follow the whole path.
        reason: the reason why the arm cannot follow it, as a text; None if it can.
        shortfall: the reason as a dict, or None. `kind` is "limit", "singularity", "unreachable", "jump" or "unresolved".
            `s` and `length` (m from the start) are the place. `target` is the desired pose there, `joint` the joint at its limit, or None.
    """

    def __init__(
        self, s: ArrayLike, q: ArrayLike, error: ArrayLike, corners: list[int], length: float, shortfall: dict[str, Any] | None
    ) -> None:
        name = "CartesianPath"
        self.s = finite(name, "s", _core.numbers(name, "s", s, ("K",))).copy()
        self.q = finite(name, "q", _core.numbers(name, "q", q, (self.s.size, "n"))).copy()
        self.error = _core.numbers(name, "error", error, (2,)).copy()
        self.corners, self.length, self.shortfall = list(corners), number(name, "length", length), shortfall
        self._slopes = _core._spline_slopes(self.s, self.q, "not-a-knot") if shortfall is None else None

    @property
    def feasible(self) -> bool:
        return self.shortfall is None

    @property
    def reason(self) -> str | None:
        why = self.shortfall
        if why is None:
            return None
        texts = {
            "limit": f"joint {why['joint']} is at its limit",
            "singularity": "the arm is at a singularity",
            "unreachable": "the pose is out of reach",
            "jump": "the joint positions would jump to another solution of inverse kinematics",
            "unresolved": f"the tolerance requires more than {_MOST} knots",
        }
        return f"the arm can't follow the poses from s = {why['s']:.9f} ({why['length']:.6g} m from the start): {texts[why['kind']]}"

    def __bool__(self) -> bool:
        return self.feasible

    def __call__(self, s: ArrayLike) -> tuple[_Array, _Array, _Array]:
        """Return `q, q', q''` at path positions `s` in [0, 1], each `(..., n)`: joint positions and their derivatives with respect to s."""
        self._require()
        at = finite("CartesianPath", "s", _core.numbers("CartesianPath", "s", s))
        if np.any(at < 0.0) or np.any(at > 1.0):
            raise InputError("CartesianPath: s is not on the path: expected 0 to 1")
        parts = cubic(self.s, self.q, np.asarray(self._slopes), np.ravel(at))
        q, dq, ddq = (part.reshape(*at.shape, -1) for part in parts)
        return q, dq, ddq

    @property
    def _waypoints_and_knots(self) -> tuple[_Array, _Array]:
        """The joint positions and the path positions of the knots, as arguments of `time_path`."""
        self._require()
        return self.q, self.s

    def _require(self) -> None:
        if not self.feasible:
            raise SolveError(f"CartesianPath: {self.reason}", Status.INFEASIBLE, partial=self)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, CartesianPath):
            return NotImplemented
        return bool(np.array_equal(self.s, other.s) and np.array_equal(self.q, other.q) and self.reason == other.reason)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        if not self.feasible:
            return f"<CartesianPath: {self.reason}>"
        return f"<CartesianPath: {self.s.size} knots, {self.length:.4g} m, within {self.error[0]:.1e} m and {self.error[1]:.1e} rad>"


def _rows(poses: ArrayLike, m: int, columns: list[int]) -> _Array:
    """Check the argument `poses` and return it as rows (K, m), with the entries `columns` of [position; rotation vector]."""
    given = finite(_NAME, "poses", _core.numbers(_NAME, "poses", poses, ("K", 4, 4), ("K", m)))
    if given.ndim == 3:
        turn, last = given[:, :3, :3], given[:, 3]
        off = np.abs(turn @ np.swapaxes(turn, 1, 2) - np.eye(3)).max() if given.size else 0.0
        if off > 1e-6 or np.abs(last - [0.0, 0.0, 0.0, 1.0]).max(initial=0.0) > 1e-6 or np.any(np.linalg.det(turn) < 0.0):
            raise InputError(f"{_NAME}: poses has a matrix that is not a pose: expected a rotation, a position and the last row 0 0 0 1")
        whole = np.concatenate([given[:, :3, 3], rotations.vector(rotations.of_matrix(turn))], axis=1)
        return np.asarray(whole[:, columns])
    return given


def _middles(arcs: ArrayLike, new: _Array, columns: list[int], kind: str) -> tuple[int, ...]:
    """Check the argument `arcs`, and convert its indices to indices of the poses without repetitions.

    `new` is True for each pose that differs from the previous pose.
    """
    given = _core.numbers(_NAME, "arcs", arcs, ("K",))
    if given.size and kind != "lines":
        raise InputError(f"{_NAME}: arcs is not used: expected none with kind {kind!r}")
    if given.size and sum(column < 3 for column in columns) < 2:
        raise InputError(f"{_NAME}: arcs is not used: expected none where axes has fewer than two of x, y, z")
    index = np.cumsum(new) - 1
    middles: list[int] = []
    for i, at in enumerate(given):
        if not (0 < at < new.size - 1 and at == int(at)) or not 0 < index[int(at)] < index[-1]:
            expected = f"indices of poses other than the first and the last, 1 to {new.size - 2}"
            raise InputError(f"{_NAME}: arcs is out of range: expected {expected}, got {at:g} (first bad index {i})")
        middles.append(int(index[int(at)]))
        if i and not middles[i] > middles[i - 1] + 1:
            expected = "increasing indices, with at least one other pose between two of them"
            raise InputError(f"{_NAME}: arcs overlap: expected {expected}, got {at:g} after {given[i - 1]:g} (first bad index {i})")
    return tuple(middles)


@border
def cartesian_path(
    arm: Arm,
    poses: ArrayLike,
    q0: ArrayLike,
    *,
    frame: str,
    tolerance: ArrayLike = 1e-4,
    axes: str | None = None,
    kind: str = "lines",
    blend: float = 0.0,
    arcs: ArrayLike = (),
    limits: bool = True,
) -> CartesianPath:
    """Find a joint path that moves a frame along poses.

    Args:
        arm: an arm with frames.
        poses: two or more poses in world axes: `(K, 4, 4)`, or `(K, m)` rows with one number per letter of `axes`. Without `axes` a row
            is position (m) and rotation vector (rad), m = 6.
        q0: initial guess of the joint positions at the first pose, `(n,)`, rad or m. It determines the branch of solutions.
        frame: name of the frame. This and all following arguments are keyword-only.
        tolerance: largest error between knots: one number for m and rad, or `(2,)`.
        axes: letters such as "xyz" or "x y rz"; None: the whole pose. It contains none, one, or all of rx, ry, rz.
        kind: "lines": straight lines in position and geodesics in rotation; "spline": one smooth curve through all poses.
        blend: a corner between two lines is rounded from this length before it to the same length after it, m; only for "lines". The length
            is at most half of each line, and is measured as in `CartesianPath.length`. With 0 a corner is rounded only within the
            tolerance.
        arcs: indices of poses in the middle of an arc, only for "lines". The arc is on the circle through the previous, this and the next
            position.
        limits: whether the path must respect the joint limits of the arm.

    Returns:
        A `CartesianPath`. Poses that the arm cannot follow are not an error: `feasible` is False, and `reason` states place and cause.

    Raises:
        InputError: a type or shape is wrong, a number is not finite or out of range, a name is unknown, or all poses are equal. It is also
            raised if the three positions of an arc are on one line.

    Source: docs/time_path.md.

    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> path = al.cartesian_path(arm, [[0.6, 0.0], [0.6, 0.4]], [-0.5, 1.0], frame="link2", axes="xy", tolerance=1e-5)
    >>> path.feasible, bool(path.error[0] <= 1e-5)
    (True, True)
    >>> q, dq, ddq = path(0.5)
    >>> [round(float(x), 4) for x in arm.position(q, "link2")]
    [0.6, 0.2, 0.0]
    """
    instance(_NAME, "arm", arm, Arm, "an Arm such as planar_arm(..)")
    instance(_NAME, "limits", limits, (bool, np.bool_), "True or False")
    frame, kind = text(_NAME, "frame", frame), choice(_NAME, "kind", kind, ("lines", "spline"))
    letters = _ALL if axes is None else text(_NAME, "axes", axes)
    try:
        Task(frame, letters, target=np.zeros(len(columns_of(letters)) or 1))
        arm.position(np.zeros(arm.n), frame)
    except (InputError, ValueError) as error:
        message = str(error).partition(": ")[2] or f"axes is not made of x y z rx ry rz: expected a text such as 'xyz', got {letters!r}"
        raise InputError(f"{_NAME}: {message}") from None
    columns = columns_of(letters)
    turns = [k for k, column in enumerate(columns) if column > 2]
    if len(turns) == 2:
        raise InputError(f"{_NAME}: axes names two axes of rotation: expected one or all three, got {letters!r}")
    rows = _rows(poses, len(columns), columns)
    start = finite(_NAME, "q0", _core.numbers(_NAME, "q0", q0, (arm.n,)))
    bound = np.broadcast_to(finite(_NAME, "tolerance", _core.numbers(_NAME, "tolerance", tolerance, (), (2,))), (2,))
    blend = number(_NAME, "blend", blend)
    if not np.all(bound >= 1e-8):
        raise InputError(f"{_NAME}: tolerance is out of range: expected numbers >= 1e-08, got {bound.min()}")
    if not 0.0 <= blend < np.inf:
        raise InputError(f"{_NAME}: blend is out of range: expected a radius >= 0, got {blend}")
    require_partner(_NAME, "blend", blend, 'kind="lines"', kind == "lines", 0.0)
    if rows.shape[0] < 2:
        raise InputError(f"{_NAME}: poses are too few: expected two or more, got {rows.shape[0]}")
    whole = PoseCurve(rows, turns if len(turns) == 3 else [], turns if len(turns) == 1 else [], kind == "spline", blend)
    if not whole.length > 0.0:
        raise InputError(f"{_NAME}: poses are equal: expected at least two different poses")
    new = np.concatenate([[True], np.diff(whole.along) > 1e-12 * whole.length])
    middles = _middles(arcs, new, columns, kind)
    try:
        curve = PoseCurve(rows[new], whole.turns, whole.single, whole.smooth, blend, middles)
    except NoCircleError as error:
        at = int(np.flatnonzero(new)[error.args[0]])
        raise InputError(f"{_NAME}: arcs has no circle at pose {at}: expected three positions that are not on one line") from None
    found = _followed(_Problem(arm, frame, letters, curve, bound, bool(limits)), start)
    if found.shortfall is None:
        # For a repeated pose, the index is that of the knot of its first occurrence.
        found.corners = [found.corners[k] for k in np.cumsum(new) - 1]
    return found


def _followed(problem: _Problem, start: _Array) -> CartesianPath:
    """Follow the curve from the solution that inverse kinematics finds from `start`, (n,)."""
    curve = problem.curve
    breaks = curve.corners
    wanted = np.unique(np.concatenate([np.linspace(a, b, _FIRST + 1) for a, b in itertools.pairwise(breaks)]))
    first, reached = problem.solve(np.zeros(1), start[None])
    if not reached[0]:
        return _refused(problem, np.zeros(1), start[None], 0.0)
    s, q, waiting = [0.0], [first[0]], list(wanted[:0:-1])
    while waiting:
        at = waiting[-1]
        found, reached = problem.solve(np.array([at]), q[-1][None])
        if reached[0] and np.abs(found[0] - q[-1]).max() <= _STEP:
            s.append(waiting.pop())
            q.append(found[0])
        elif at - s[-1] < 1e-6:
            return _refused(problem, np.array(s), np.array(q), at)
        else:
            waiting.append(0.5 * (s[-1] + at))
    return _refined(problem, np.array(s), np.array(q))


def _refined(problem: _Problem, s: _Array, q: _Array) -> CartesianPath:
    """Halve segments until the error of the spline is within the tolerance."""
    while True:
        h = np.diff(s)
        places = (s[:-1, None] + _SAMPLES * h[:, None]).clip(0.0, 1.0)
        between = cubic(s, q, _core._spline_slopes(s, q, "not-a-knot"), places.ravel())[0]
        samples = problem.errors(between, places.ravel()).reshape(h.size, _SAMPLES.size, 2)
        curvature = np.abs(np.diff(samples, n=2, axis=1)).max(axis=1)
        error = samples.max(axis=1) + curvature / 8.0
        coarse = (error > problem.tolerance).any(axis=1)
        if not coarse.any():
            corners = [int(np.argmin(np.abs(s - at))) for at in problem.curve.corners]
            return CartesianPath(s, q, error.max(axis=0), corners, problem.curve.length, None)
        if s.size + coarse.sum() > _MOST or h[coarse].min() < _LEAST:
            worst = int(np.argmin(np.where(coarse, h, np.inf)))
            kind = "unresolved" if h[coarse].min() >= _LEAST else "jump"
            return _refused(problem, s[: worst + 1], q[: worst + 1], float(s[worst]), kind)
        middles = s[:-1][coarse] + 0.5 * h[coarse]
        found, reached = problem.solve(middles, cubic(s, q, _core._spline_slopes(s, q, "not-a-knot"), middles)[0])
        if not reached.all():
            at = float(middles[np.argmin(reached)])
            known = s < at
            return _refused(problem, s[known], q[known], at)
        where = np.flatnonzero(coarse) + 1
        s, q = np.insert(s, where, middles), np.insert(q, where, found, axis=0)


def _refused(problem: _Problem, s: _Array, q: _Array, at: float, kind: str | None = None) -> CartesianPath:
    """Make the result for an arm that cannot follow the poses beyond the path position `at`, with the reason."""
    target, last = np.array([at]), q[-1:]
    joint = None
    if kind is None:
        anywhere = bool(problem.solve(target, last, restarts=50)[1][0])
        free, reached = problem.solve(target, last, limits=False)
        lower, upper = problem.arm.limits["q_min"], problem.arm.limits["q_max"]
        past = np.maximum(lower - free[0], free[0] - upper)
        jacobian = problem.arm.jacobian(last[0], problem.frame)[columns_of(problem.axes)]
        sizes = np.linalg.svd(jacobian, compute_uv=False)
        if reached[0] and past.max() > 0.0 and problem.limits and np.abs(free - last).max() <= _STEP:
            kind, joint = "limit", int(past.argmax())
        elif not anywhere:
            kind = "unreachable"
        else:
            kind = "singularity" if sizes[-1] < _SINGULAR * sizes[0] else "jump"
    length = problem.curve.length
    why = {"kind": kind, "s": float(at), "length": float(at * length), "target": problem.curve.at(target)[0], "joint": joint}
    return CartesianPath(s, q, [np.nan, np.nan], [], length, why)
