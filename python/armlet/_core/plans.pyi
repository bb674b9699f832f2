"""Types of minimum-time planning for one link."""

from typing import Any, SupportsIndex, final, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._types import _Array, _Flags, _Number

@overload
def bang_bang_time(  # type checkers use this overload for numbers, which are also valid arrays
    theta0: _Number, thetaf: _Number, inertia: _Number, gravity_moment: _Number, tau_max: _Number, *, tau_min: _Number | None = None
) -> BangBangReport:
    """The shortest and the longest duration of a rest-to-rest motion with the symmetric bang-bang acceleration, under torque limits.

    The link is `inertia * theta_ddot + gravity_moment sin theta = tau` with `tau_min <= tau <= tau_max`. For the first half of the duration
    `T` the acceleration towards `thetaf` is `A = 4 |thetaf - theta0| / T^2`. For the second half it is `-A`.

    Args:
        theta0, thetaf: start and end, rad from the downward vertical. Angles beyond +-pi are not wrapped.
        inertia: inertia about the joint, kg m^2, > 0.
        gravity_moment: mass times gravity times distance of the centre of mass, N m. With a negative value, the angles are measured from
            the upward vertical.
        tau_max: largest torque, N m, >= 0; > 0 if `tau_min` is None.
        tau_min: smallest torque, N m, <= 0; `-tau_max` if None (keyword only).

    Returns:
        A `BangBangReport` for numbers. Arrays broadcast, and return a `BangBangBatch` whose fields are arrays. If no duration is feasible,
        `feasible` is false, the durations are NaN, and `reason` states the limit, its place and the missing torque. This is not an error.

    Raises:
        InputError: a number is not finite, the inertia is not positive, or the torque limits are out of range.

    Source: docs/minimum_time.md.

    >>> import armlet as al, math
    >>> r = al.bang_bang_time(-math.pi / 2, math.pi / 2, inertia=1.0, gravity_moment=1.5, tau_max=1.0)
    >>> r.feasible, round(r.t_min, 6), round(r.t_max, 6)
    (True, 3.544908, 5.013257)
    >>> al.bang_bang_time(-math.pi / 2, math.pi / 2, 1.0, 2.5, 1.0).reason[:60]
    'tau_max at theta = 0.000000 rad (phase1:switch) needs a slow'
    """

@overload
def bang_bang_time(
    theta0: ArrayLike,
    thetaf: ArrayLike,
    inertia: ArrayLike,
    gravity_moment: ArrayLike,
    tau_max: ArrayLike,
    *,
    tau_min: ArrayLike | None = None,
) -> BangBangBatch:
    """The shortest and the longest duration of a rest-to-rest motion with the symmetric bang-bang acceleration, under torque limits.

    The link is `inertia * theta_ddot + gravity_moment sin theta = tau` with `tau_min <= tau <= tau_max`. For the first half of the duration
    `T` the acceleration towards `thetaf` is `A = 4 |thetaf - theta0| / T^2`. For the second half it is `-A`.

    Args:
        theta0, thetaf: start and end, rad from the downward vertical. Angles beyond +-pi are not wrapped.
        inertia: inertia about the joint, kg m^2, > 0.
        gravity_moment: mass times gravity times distance of the centre of mass, N m. With a negative value, the angles are measured from
            the upward vertical.
        tau_max: largest torque, N m, >= 0; > 0 if `tau_min` is None.
        tau_min: smallest torque, N m, <= 0; `-tau_max` if None (keyword only).

    Returns:
        A `BangBangReport` for numbers. Arrays broadcast, and return a `BangBangBatch` whose fields are arrays. If no duration is feasible,
        `feasible` is false, the durations are NaN, and `reason` states the limit, its place and the missing torque. This is not an error.

    Raises:
        InputError: a number is not finite, the inertia is not positive, or the torque limits are out of range.

    Source: docs/minimum_time.md.

    >>> import armlet as al, math
    >>> r = al.bang_bang_time(-math.pi / 2, math.pi / 2, inertia=1.0, gravity_moment=1.5, tau_max=1.0)
    >>> r.feasible, round(r.t_min, 6), round(r.t_max, 6)
    (True, 3.544908, 5.013257)
    >>> al.bang_bang_time(-math.pi / 2, math.pi / 2, 1.0, 2.5, 1.0).reason[:60]
    'tau_max at theta = 0.000000 rad (phase1:switch) needs a slow'
    """

def trapezoid_time(
    theta0: _Number,
    thetaf: _Number,
    inertia: _Number,
    gravity_moment: _Number,
    tau_max: _Number,
    *,
    tau_min: _Number | None = None,
    ramp: _Number | None = None,
) -> ProfileReport:
    """The shortest and the longest duration of a rest-to-rest motion with a trapezoidal speed profile, under torque limits.

    The link accelerates for `ramp * T`, moves with constant speed, and brakes for `ramp * T`, where `T` is the duration. With `ramp = 1/2`
    it is the profile of `bang_bang_time`. While the speed is constant, the torque balances gravity.

    Args:
        theta0, thetaf, inertia, gravity_moment, tau_max, tau_min: as for `bang_bang_time`, but numbers only.
        ramp: duration of the acceleration as a fraction of `T`, in (0, 1/2]; 1/3 if None (keyword only).

    Returns:
        A `ProfileReport` of the trapezoid.

    Raises:
        InputError: a number is not finite, or outside its range.

    Source: docs/minimum_time.md.

    >>> import armlet as al
    >>> r = al.trapezoid_time(0.0, 1.0, 1.0, 0.5, 1.0, ramp=0.25)
    >>> r.feasible, round(r.t_min, 4)
    (True, 2.4116)
    """

def minimum_jerk_time(
    theta0: _Number, thetaf: _Number, inertia: _Number, gravity_moment: _Number, tau_max: _Number, *, tau_min: _Number | None = None
) -> ProfileReport:
    """The shortest and the longest duration of the minimum-jerk motion, rest to rest, under torque limits.

    `theta = theta0 + (thetaf - theta0) (10 u^3 - 15 u^4 + 6 u^5)` with `u = t/T`, so the acceleration at both ends is zero.

    Args:
        theta0, thetaf, inertia, gravity_moment, tau_max, tau_min: as for `bang_bang_time`, but numbers only.

    Returns:
        A `ProfileReport` of the quintic.

    Raises:
        InputError: a number is not finite, or outside its range.

    Source: docs/minimum_time.md.

    >>> import armlet as al
    >>> r = al.minimum_jerk_time(0.0, 1.0, 1.0, 0.0, 1.0)
    >>> r.feasible, round(r.t_min**2, 6)
    (True, 5.773503)
    """

def torque_optimal_time(
    theta0: _Number,
    thetaf: _Number,
    inertia: _Number,
    gravity_moment: _Number,
    tau_max: _Number,
    *,
    tau_min: _Number | None = None,
    viscous: _Number | None = None,
    coulomb: _Number | None = None,
) -> TorqueOptimum:
    """The fastest rest-to-rest motion of one link under torque limits.

    `inertia * theta_ddot + gravity_moment sin theta + viscous theta_dot + coulomb sign(theta_dot) = tau` with `tau_min <= tau <= tau_max`.
    The *monotone* motion has full torque towards the goal, and then full torque against the motion. The fields `t`, `theta_switch` and
    `t_switch` describe the fastest monotone motion. `best` is the fastest of this motion, a *back-swing* (torque -, +, -) and an
    *overshoot* (torque +, -, +), where + is towards the goal.

    Args:
        theta0, thetaf: start and end, rad from the downward vertical. Angles beyond +-pi are not wrapped.
        inertia: inertia about the joint, kg m^2, > 0.
        gravity_moment: mass times gravity times distance of the centre of mass, N m. With a negative value, the angles are measured from
            the upward vertical.
        tau_max: largest torque, N m, >= 0; > 0 if `tau_min` is None.
        tau_min: smallest torque, N m, <= 0; `-tau_max` if None (keyword only, as all below).
        viscous: viscous friction, N m s/rad, >= 0. With friction, the motion is integrated numerically.
        coulomb: Coulomb friction, N m, >= 0.

    Returns:
        A `TorqueOptimum`. If no monotone motion is feasible, `t` is NaN, and `reason` states the missing torque. This is not an error.

    Raises:
        InputError: a number is not finite, or outside its range.

    Source: docs/minimum_time.md.

    >>> import armlet as al, math
    >>> o = al.torque_optimal_time(math.pi / 2, 3.0, inertia=1.0, gravity_moment=1.0, tau_max=1.02)
    >>> round(o.t, 3), o.certified_global, o.best.kind, round(o.best.t, 3)
    (8.419, False, 'back-swing', 5.702)
    >>> q, v, a, tau = o.profile(0.0)
    >>> tau
    -1.02
    """

def _restore_plan(function: str, arguments: tuple[Any, ...]) -> Any: ...

@final
class BangBangReport:
    """The feasible durations of the symmetric bang-bang profile, from `bang_bang_time`."""
    @property
    def feasible(self) -> bool:
        """Whether some duration satisfies the torque limits."""
    @property
    def t_min(self) -> float:
        """Shortest duration, s; NaN if infeasible."""
    @property
    def t_max(self) -> float:
        """Longest duration, s; infinite if the motion may be arbitrarily slow, NaN if infeasible."""
    @property
    def a_min(self) -> float:
        """The smallest `inertia * A` that the limits allow, N m; `A` is the magnitude of the acceleration. If no duration is feasible, `a_max`
        is below `a_min`, or not positive.
        """
    @property
    def a_max(self) -> float:
        """The largest `inertia * A` that the limits allow, N m; `A` is the magnitude of the acceleration."""
    @property
    def hold_start(self) -> bool:
        """Whether the torque can hold the link at rest at the start."""
    @property
    def hold_end(self) -> bool:
        """Whether the torque can hold the link at rest at the end."""
    @property
    def reason(self) -> str:
        """The reason why no duration is feasible: the limits, their places, and the missing torque. It is empty if a duration is feasible."""
    @property
    def active_upper(self) -> Bind:
        """The torque limit that decides `t_min`."""
    @property
    def active_lower(self) -> Bind | None:
        """The torque limit that decides `t_max`; None if the motion may be arbitrarily slow."""
    def torques(self, t: _Number) -> tuple[float, float, float, float]:
        """Four torques, N m, of the motion of duration `t` in s: at its start, just before and after the switch, and at its end."""
    def __eq__(self, other: object, /) -> bool: ...

@final
class Bind:
    """A torque limit that decides a duration, and the phase, the place and the time at which the torque reaches it."""
    @property
    def limit(self) -> str:
        """The name of the limit: `"tau_min"` or `"tau_max"`."""
    @property
    def phase(self) -> int:
        """The phase of the motion: 1 while accelerating, 2 while braking."""
    @property
    def place(self) -> str:
        """The place in its phase: `"start"`, `"interior"`, `"switch"` or `"end"`."""
    @property
    def theta(self) -> float:
        """The angle, rad, at which the torque reaches the limit."""
    @property
    def time(self) -> float:
        """The time since the start, s, at which the torque reaches the limit; NaN if the motion is infeasible."""
    @property
    def tie(self) -> bool:
        """Whether the other phase reaches its limit at the same duration."""
    def __eq__(self, other: object, /) -> bool: ...

@final
class BangBangBatch:
    """The results of `bang_bang_time` for arrays of problems: the fields of `BangBangReport` as arrays of the broadcast shape."""
    @property
    def shape(self) -> tuple[int, ...]:
        """The common shape of the arguments after broadcasting."""
    @property
    def feasible(self) -> _Flags:
        """Whether some duration satisfies the torque limits, in the broadcast shape."""
    @property
    def t_min(self) -> _Array:
        """Shortest durations, s; NaN if infeasible."""
    @property
    def t_max(self) -> _Array:
        """Longest durations, s; infinite if the motion may be arbitrarily slow, NaN if infeasible."""
    @property
    def a_min(self) -> _Array:
        """The smallest `inertia * A` that the limits allow, N m, with the magnitude `A` of the acceleration."""
    @property
    def a_max(self) -> _Array:
        """The largest `inertia * A` that the limits allow, N m, with the magnitude `A` of the acceleration."""
    @property
    def hold_start(self) -> _Flags:
        """Whether the torque can hold the link at rest at the start."""
    @property
    def hold_end(self) -> _Flags:
        """Whether the torque can hold the link at rest at the end."""
    @property
    def reason(self) -> NDArray[np.str_]:
        """An array of strings with the `BangBangReport.reason` of each problem, which is empty where a duration is feasible."""
    def __getitem__(self, index: SupportsIndex | tuple[SupportsIndex, ...], /) -> BangBangReport: ...

@final
class ProfileReport:
    """The feasible durations of a trapezoidal or minimum-jerk motion, from `trapezoid_time` or `minimum_jerk_time`."""
    @property
    def feasible(self) -> bool:
        """Whether some duration satisfies the torque limits."""
    @property
    def t_min(self) -> float:
        """Shortest duration, s; NaN if infeasible."""
    @property
    def t_max(self) -> float:
        """Longest duration, s; infinite if the motion may be arbitrarily slow, NaN if infeasible."""
    @property
    def k_min(self) -> float:
        """The smallest `inertia * |thetaf - theta0| / T^2` that the limits allow, N m."""
    @property
    def k_max(self) -> float:
        """The largest `inertia * |thetaf - theta0| / T^2` that the limits allow, N m."""
    @property
    def theta_upper(self) -> float:
        """The angle, rad, at which the torque reaches the limit that decides `t_min`."""
    @property
    def theta_lower(self) -> float:
        """The angle, rad, at which the torque reaches the limit that decides `t_max`; NaN if no limit decides it."""
    @property
    def hold_start(self) -> bool:
        """Whether the torque can hold the link at rest at the start."""
    @property
    def hold_end(self) -> bool:
        """Whether the torque can hold the link at rest at the end."""
    @property
    def missing(self) -> float:
        """The torque, N m, by which both limits must be widened to make a duration feasible; 0 if a duration is feasible."""
    @property
    def reason(self) -> str:
        """The reason why no duration is feasible, with the missing torque. It is empty if a duration is feasible."""
    def __eq__(self, other: object, /) -> bool: ...

@final
class TorqueOptimum:
    """The fastest monotone motion, and the fastest of all monotone motions, back-swings and overshoots, from `torque_optimal_time`."""
    @property
    def feasible(self) -> bool:
        """Whether a monotone motion is feasible."""
    @property
    def t(self) -> float:
        """The duration of the fastest monotone motion, s; NaN if none is feasible."""
    @property
    def theta_switch(self) -> float:
        """The angle, rad, at which the torque of the monotone motion switches."""
    @property
    def t_switch(self) -> float:
        """The time, s, at which the torque of the monotone motion switches."""
    @property
    def v_peak(self) -> float:
        """The signed velocity of the monotone motion at its switch, rad/s."""
    @property
    def certified_global(self) -> bool:
        """Whether Sturm's comparison theorem proves that no motion is faster than the fastest monotone motion."""
    @property
    def sturm_bound(self) -> float:
        """The duration `pi / sqrt(|gravity_moment|/inertia - (viscous/(2 inertia))^2)`, s. A shorter optimal motion switches at most once.

        This is not proved with Coulomb friction. For an overdamped link the value is infinite.
        """
    @property
    def reason(self) -> str:
        """The reason why no monotone motion is feasible, with the missing torque. It is empty if one is feasible."""
    @property
    def best(self) -> Best:
        """The fastest motion of the three families: monotone, back-swing and overshoot."""
    @overload
    def profile(self, t: _Number) -> tuple[float, float, float, float]:
        """Compute `q, v, a, tau` (rad, rad/s, rad/s^2, N m) of the best motion at the time `t` in s, a number or an array.

        The motion is at rest before the time 0 and after its end. Without a motion the call raises `InputError`.
        """
    @overload
    def profile(self, t: ArrayLike) -> tuple[_Array, _Array, _Array, _Array]:
        """Compute `q, v, a, tau` (rad, rad/s, rad/s^2, N m) of the best motion at the time `t` in s, a number or an array.

        The motion is at rest before the time 0 and after its end. Without a motion the call raises `InputError`.
        """
    @overload
    def monotone_profile(self, t: _Number) -> tuple[float, float, float, float]:
        """Compute `q, v, a, tau` (rad, rad/s, rad/s^2, N m) of the fastest monotone motion at the time `t` in s, a number or an array.

        Without a monotone motion the call raises `InputError`.
        """
    @overload
    def monotone_profile(self, t: ArrayLike) -> tuple[_Array, _Array, _Array, _Array]:
        """Compute `q, v, a, tau` (rad, rad/s, rad/s^2, N m) of the fastest monotone motion at the time `t` in s, a number or an array.

        Without a monotone motion the call raises `InputError`.
        """
    def __eq__(self, other: object, /) -> bool: ...

@final
class Best:
    """The fastest motion of the three families: monotone, back-swing and overshoot."""
    @property
    def kind(self) -> str:
        """The family: `"monotone"`, `"back-swing"` (torque -, +, -), `"overshoot"` (torque +, -, +), or `"none found"`. A torque towards the
        goal is +.
        """
    @property
    def t(self) -> float:
        """The duration, s; NaN if no motion was found."""
    @property
    def switches(self) -> tuple[float, ...]:
        """The angles at which the torque switches, rad, in order of time."""
    @property
    def t_switches(self) -> tuple[float, ...]:
        """The times at which the torque switches, s."""
    @property
    def theta_turn(self) -> float:
        """The angle, rad, at which a back-swing or an overshoot reverses; NaN for the monotone motion."""
    @property
    def t_turn(self) -> float:
        """The time, s, at which a back-swing or an overshoot reverses; NaN for the monotone motion."""
    def __eq__(self, other: object, /) -> bool: ...
