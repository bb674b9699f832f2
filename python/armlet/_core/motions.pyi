"""Types of desired motions and timed paths."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Self, final

from numpy.typing import ArrayLike
from typing_extensions import disjoint_base

from ._types import _Array, _Number
from .arms import Arm

@disjoint_base
class Motion:
    """A desired motion: `motion(t)` returns `q_d, v_d, a_d`, each `(n,)`. This is the base class of all motions."""
    @property
    def n(self) -> int:
        """Number of coordinates."""
    def __call__(self, /, t: ArrayLike) -> tuple[_Array, _Array, _Array]: ...
    def derivatives(self, t: ArrayLike, order: int) -> _Array:
        """Compute the position and its derivatives with respect to time at the time `t`, for feed-forward on elastic joints.

        The derivatives are velocity, acceleration, jerk and snap. Where the jerk or the snap jumps, the result is the value after the jump.
        They jump at the ends of a `Quintic`, at the knots of a `Table`, and at the knots and grid points of a `TimedPath`. The snap does not
        contain the impulses at jumps of the jerk. At the end of a `Table` or `TimedPath`, the result is that of its last interval.

        Args:
            t: time, s, or an array of times.
            order: the highest derivative, 0 to 4; at most 2 if the acceleration jumps, as in `BangBang` and most results of `time_path`.

        Returns:
            Rows of position, velocity, acceleration, .., `(order + 1, n)`; `(..., order + 1, n)` for an array of times.

        Raises:
            InputError: a time is not finite, or the motion does not have the derivatives.
            SolveError: the motion is a path without a timing.

        >>> import armlet as al
        >>> al.Quintic([0.0], [1.0], 1.0).derivatives(0.5, 4)[:, 0]
        array([  0.5  ,   1.875,   0.   , -30.   ,   0.   ])
        """
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...
    def __eq__(self, other: object, /) -> bool: ...

@final
class Hold(Motion):
    """A constant position `q`, `(n,)`, rad or m.

    >>> import armlet as al
    >>> al.Hold([1.0, 0.0])(2.0)[0]
    array([1., 0.])
    """
    def __new__(cls, q: ArrayLike) -> Self: ...

@disjoint_base
class Sinusoid(Motion):
    """A sum of sinusoids for each joint: `q_d = offset + sum amplitude sin(frequency t + phase)`.

    Args:
        offset: centre of the motion, `(n,)`, rad or m.
        amplitude, frequency, phase: rad or m, rad/s, and rad: `(n,)`, `(n, k)` for k terms per joint, or one number for all. Zeros are
            allowed.

    Raises:
        InputError: a shape is wrong, or a number is not finite.

    Source: docs/plants_and_laws.md.

    >>> import armlet as al
    >>> q_d, v_d, a_d = al.Sinusoid([0.0], [0.5], [2.0], [0.0])(0.0)
    >>> v_d
    array([1.])
    """
    def __new__(cls, offset: ArrayLike, amplitude: ArrayLike, frequency: ArrayLike, phase: ArrayLike) -> Self: ...

@final
class Quintic(Motion):
    """Rest-to-rest motion `q0 + s (q1 - q0)` with `s = 10 x^3 - 15 x^4 + 6 x^5` and `x = t / duration`.

    The motion holds `q0` before time 0 and `q1` after `duration`.

    Args:
        q0, q1: start and end, `(n,)`, rad or m.
        duration: duration of the motion, s, > 0.

    Raises:
        InputError: a shape is wrong, a number is not finite, or `duration` is not positive.

    Source: [SicilianoEtAl2009], section 4.2.

    >>> import armlet as al
    >>> al.Quintic([0.0], [1.0], 2.0)(1.0)[0], al.BangBang([0.0], [1.0], 2.0)(1.0)[0]
    (array([0.5]), array([0.5]))
    """
    def __new__(cls, q0: ArrayLike, q1: ArrayLike, duration: float) -> Self: ...

@final
class BangBang(Motion):
    """Rest-to-rest motion with the symmetric bang-bang acceleration `+-4 (q1 - q0) / duration^2`.

    The motion holds `q0` before time 0 and `q1` after `duration`.

    Args:
        q0, q1: start and end, `(n,)`, rad or m.
        duration: duration of the motion, s, > 0.

    Raises:
        InputError: a shape is wrong, a number is not finite, or `duration` is not positive.

    Source: [SicilianoEtAl2009], section 4.2.

    >>> import armlet as al
    >>> al.Quintic([0.0], [1.0], 2.0)(1.0)[0], al.BangBang([0.0], [1.0], 2.0)(1.0)[0]
    (array([0.5]), array([0.5]))
    """
    def __new__(cls, q0: ArrayLike, q1: ArrayLike, duration: float) -> Self: ...

@final
class Table(Motion):
    """A motion through samples at the times `start + k dt`, the *knots*.

    The motion has the positions `q`, the velocities `v` and the accelerations `a` at the knots, and is a quintic Hermite polynomial between
    them. Before the first knot and after the last one, it rests at the position of that knot. `Table.at` accepts uneven times.

    Args:
        dt: time between two knots, s, > 0.
        q, v, a: positions, velocities and accelerations at the knots, `(K, n)` each, rad or m, per s and per s^2.
        start: time of the first knot, s; zero if None (keyword only).

    Raises:
        InputError: `dt` is not positive, a shape is wrong, or a number is not finite.

    Source: [SicilianoEtAl2009], section 4.2; docs/plants_and_laws.md.

    >>> import armlet as al
    >>> table = al.Table(0.5, [[0.0], [1.0]], [[0.0], [0.0]], [[0.0], [0.0]])
    >>> table(0.25)[0]
    array([0.5])
    """
    def __new__(cls, dt: float, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, start: float | None = None) -> Self: ...
    @staticmethod
    def at(t: ArrayLike, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None, *, spline: str | None = None) -> Spline:
        """Make a motion through knots at uneven times: `armlet.Spline`, which describes the arguments.

        >>> import armlet as al
        >>> al.Table.at([0.0, 0.5, 2.0], [[0.0], [1.0], [1.0]], [[0.0], [1.0], [0.0]])(0.5)[1]
        array([1.])
        """

@final
class Spline(Motion):
    """A motion through knots at their own times, such as the points of a ROS `JointTrajectory`.

    Between two knots the motion is a polynomial in time. Its degree depends on what the knots have:

    ==============================================  ==================================================================
    knots                                           motion
    ==============================================  ==================================================================
    positions                                       cubic spline: `q`, `v`, `a` are continuous
    positions and velocities                        cubic Hermite polynomials: `q`, `v` are continuous, `a` jumps
    positions, velocities and accelerations         quintic Hermite polynomials: `q`, `v`, `a` are continuous
    ==============================================  ==================================================================

    Before the first knot and after the last one, it rests at the position of that knot. With the default `spline="clamped"`, a motion
    through positions alone starts and ends at rest, so that its velocity never jumps. At other jumps of `v` or `a`, integrators restart.

    Args:
        t: times of the knots, `(K,)`, s, `K >= 2`. They increase.
        q: positions at the knots, `(K, n)`, rad or m.
        v: velocities at the knots, `(K, n)`, rad/s or m/s; None if unknown.
        a: accelerations at the knots, `(K, n)`, rad/s^2 or m/s^2; only with `v`.
        spline: end conditions of a motion through positions alone: "clamped" (`v = 0`, the default), "natural" (`a = 0`) or
            "not-a-knot" (keyword only). "not-a-knot" makes the jerk continuous at the second and the last but one knot.

    Raises:
        InputError: the times do not increase, a shape is wrong, a number is not finite, or an argument lacks its partner.

    Source: [deBoor2001], chapter 4; [SicilianoEtAl2009], section 4.2.

    >>> import armlet as al
    >>> motion = al.Spline([0.0, 0.5, 2.0], [[0.0], [1.0], [1.0]], [[0.0], [1.0], [0.0]])
    >>> q, v, a = motion([0.5, 9.0])
    >>> q[:, 0], v[:, 0]
    (array([1., 1.]), array([1., 0.]))
    """
    def __new__(
        cls, t: ArrayLike, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None, *, spline: str | None = None
    ) -> Self: ...

def time_path(
    arm: Arm,
    path: ArrayLike | Callable[[float], Any],
    *,
    tau_max: ArrayLike | Callable[[float], ArrayLike] | None = None,
    v_max: ArrayLike | Callable[[float], ArrayLike] | None = None,
    a_max: ArrayLike | Callable[[float], ArrayLike] | None = None,
    knots: ArrayLike | None = None,
    spline: str | None = None,
    stops: Iterable[int] | None = None,
    start_speed: _Number | None = None,
    end_speed: _Number | None = None,
    friction: ArrayLike | None = None,
    grid: int | None = None,
    refine: bool = True,
    samples: int | None = None,
    torque_rate: ArrayLike | None = None,
    q_min: ArrayLike | None = None,
    q_max: ArrayLike | None = None,
    tip_speed: ArrayLike | Callable[[float], ArrayLike] | None = None,
    tip_acceleration: ArrayLike | Callable[[float], ArrayLike] | None = None,
    frame: str | None = None,
    check_limits: bool | None = None,
) -> TimedPath:
    """The fastest timing of a path of an arm under limits of torque, speed and acceleration.

    The motion is `q(s(t))`, so `v = dq/ds ds/dt`, `a = dq/ds u + d2q/ds2 (ds/dt)^2` with `u = d2s/dt2`, and `tau = M a + C v + g`, plus the
    friction torque with `friction`. Reachability analysis on a grid of `s` computes the timing. A check on a grid ten times finer corrects
    it until no limit is exceeded by more than a relative 1e-9.

    Args:
        arm: the arm; `planar_pr` is allowed.
        path: waypoints `(K, n)`, rad or m, a callable on [0, 1], or a `CartesianPath`. A C2 cubic spline joins waypoints; repeated
            waypoints count once. A callable that returns `q(s)`, `(n,)`, is replaced by the spline through `samples` of its points. A
            callable that returns `q, dq/ds, d2q/ds2`, `(n,)` each, is replaced by quintic Hermite polynomials through its samples.
        tau_max: torque limit, N m or N: number or `(n,)` for both signs, or `(n, 2)` lower and upper (keyword only, as all below).
        v_max, a_max: limits of joint speed (rad/s or m/s) and acceleration (rad/s^2 or m/s^2): number or `(n,)`. One of `tau_max`, `a_max`
            and `tip_acceleration` is required. `tau_max`, `v_max` and `a_max` may vary along the path, with the same limit for both signs.
            They are then `(K, n)` at the waypoints, or a callable `s -> (n,)` that is called at the path's knots. Between these they are
            linear in `s`. A `tau_max` of shape `(n, 2)` always means lower and upper limits, also if `(K, n)` is the same shape.
        q_min, q_max: position limits, rad or m: number or `(n,)`, infinite for joints without limits. A path that exceeds them at or
            between waypoints has no timing. None for both: only `check_limits` applies.
        tip_speed: largest speed of the origin of `frame`, m/s: a number, `(K,)` at the waypoints, or a callable `s -> number`.
        stops: indices of waypoints where the arm stops.

    Other Args:
        knots: path positions of the waypoints, `(K,)`, increasing. None: from 0 to 1, in proportion to the distances between waypoints.
        spline: end conditions of the spline: "natural" (default for waypoints), "clamped", "not-a-knot" (default for a callable).
        start_speed, end_speed: path speeds ds/dt at the ends, 1/s; zero if None.
        friction: True for the arm's damping and Coulomb friction; viscous coefficients, number or `(n,)`, N m s/rad or N s/m; None: none.
            It requires `tau_max` or `torque_rate`.
        grid: number of grid points, including the path's knots. None: 201 points at first. Then grids with additional points follow, until
            the duration changes by less than 1e-4 of its value.
        refine: halve the segments of `grid` on which the motion exceeds limits, or that make the motion longer (default True).
            Without `grid` it must be True.
        samples: number of samples of a callable; 201 if None.
        torque_rate: limit of |d tau/dt|, N m/s or N/s: number or `(n,)`. It requires a rest-to-rest motion without stops and without
            Coulomb friction. The fastest timing is averaged over a window of time, and slowed down until it satisfies this limit. So the
            result is not the fastest one.
        tip_acceleration: largest norm of the acceleration of the origin of `frame`, m/s^2, in the forms of `tip_speed`.
        frame: name of the frame that `tip_speed` and `tip_acceleration` limit.
        check_limits: action if a waypoint, or a sample of a callable, is outside of the arm's joint limits. None warns, True raises, and
            False does neither. It must be None with `q_min` or `q_max`, and for a `CartesianPath`.

    Returns:
        A `TimedPath`. Limits that allow no timing are not an error: `p.feasible` is False, and `p.reason` states the reason.

    Raises:
        InputError: a shape is wrong, a number is not finite or out of range, or limits are missing. With `check_limits=True`, a waypoint
            outside of the joint limits also raises it.

    Warns:
        UserWarning: a waypoint is outside of the joint limits.

    Source: Pham and Pham, A new approach to time-optimal path parameterization based on reachability analysis, T-RO 34(3),
    2018; docs/time_path.md.

    >>> import armlet as al
    >>> arm = al.planar_pr(2.0, 0.5, 0.5)
    >>> p = al.time_path(arm, [[0.0, 0.0], [1.0, 0.0]], tau_max=[8.0, 8.0])
    >>> p.feasible, round(p.duration, 6)
    (True, 1.0)
    >>> q, v, a = p(0.25)
    >>> [round(float(x), 6) for x in (q[0], v[0], a[0])]
    [0.125, 1.0, 4.0]
    """

def _restore_time_path(parts: Sequence[_Array], margin: float, why: tuple[Any, ...] | None) -> TimedPath: ...
def _spline_slopes(s: ArrayLike, q: ArrayLike, spline: str) -> _Array: ...

@final
class TimedPath(Motion):
    """The timing of a path, from `time_path`: a motion whose call `p(t)` returns `q, v, a`.

    Between the points of a grid, the path acceleration is linear in `s`. For a motion with `torque_rate` it is linear in time. The motion
    rests at the start before time 0, and at the end after `duration`.
    """
    def __call__(self, /, t: ArrayLike) -> tuple[_Array, _Array, _Array]: ...
    def path(self, s: ArrayLike) -> tuple[_Array, _Array, _Array]:
        """Compute the path `q` and its derivatives `dq/ds`, `d2q/ds2` at path positions `s`: each `(n,)` for a number, `(..., n)` for an
        array.

        Raises:
            InputError: a position is not finite, or not on the path.
        """
    @property
    def duration(self) -> float:
        """Duration, s; NaN without a timing."""
    @property
    def feasible(self) -> bool:
        """Whether the limits allow a timing."""
    @property
    def margin(self) -> float:
        """The smallest relative distance to a limit, on ten points per grid segment. It is at least -1e-9, and NaN without a timing."""
    @property
    def reason(self) -> str | None:
        """The reason for an infeasible path: the joint, the path position, the limit, and the missing amount. None if there is a timing."""
    @property
    def shortfall(self) -> dict[str, Any] | None:
        """The reason for an infeasible path as a dict; None if there is a timing.

        The keys are `joint`, `joint_name`, `s`, `limit`, `missing` (relative), and `missing_units` (in N m, rad/s^2, ..). For limits of a
        frame, `joint` is None and `joint_name` is the frame's name. For position limits, `missing` is relative to their range.
        """
    @property
    def s(self) -> _Array:
        """Path positions of the grid, `(N + 1,)`."""
    @property
    def s_dot(self) -> _Array:
        """Path speed ds/dt at the grid points, 1/s, `(N + 1,)`."""
    @property
    def t(self) -> _Array:
        """Times of the grid points, s, `(N + 1,)`."""
