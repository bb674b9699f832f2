"""Rest-to-rest motions of one link under torque limits, with a fixed shape s(u) of the path over time.

    I theta_ddot + G sin theta = tau;   theta = theta0 + (thetaf - theta0) s(u),  u = t/T,  k = I D / T^2 with D = |thetaf - theta0|
    along x = sg theta, sg the direction of motion:   tau(u) = k s''(u) + G sin x(u)
    excess(k) = max over u of max(tau - tau_max, tau_min - tau),   convex in k:  the durations with excess <= 0 are one interval

T is the duration, I the inertia, and G the gravity moment. If sg = -1, tau_max and -tau_min are exchanged in the excess. ' is the
derivative with respect to u. The shape is an integral of s'', which is defined piece by piece. A grid and its refinement give the extremes
over u, golden section gives the smallest excess, and bisection gives its zeros. With s'' = 4 and then -4 this is `bang_bang_time`, whose a
is 4 k.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from .lagrange import Array

# The torque may exceed each limit by this fraction of the larger limit.
SLACK = 1e-12

Piece = tuple[float, float, Polynomial, Polynomial]


class Profile(NamedTuple):
    """The feasible durations, s, of the symmetric bang-bang profile, and the feasible interval of a, N m.

    a is the inertia times the acceleration of the first half. If no duration is feasible, the durations are NaN.
    """

    feasible: bool
    t_min: float
    t_max: float
    a_min: float
    a_max: float
    hold_start: bool
    hold_end: bool


class ProfileReport(NamedTuple):
    """The feasible durations, s, which are NaN if there are none, and the feasible interval of k, N m.

    `missing` is the smallest excess of the torque over its limits, N m; 0 if a duration is feasible.
    """

    feasible: bool
    t_min: float
    t_max: float
    k_min: float
    k_max: float
    hold_start: bool
    hold_end: bool
    missing: float


def lowest(f: Callable[[Array], Array], low: float, high: float) -> tuple[float, float]:
    """The minimum of f over an interval, on a grid of more than 1,000 points and then on finer grids about its lowest points."""
    grid = np.linspace(low, high, 1025 + int(256 * (high - low) / (2 * np.pi)))
    values = f(grid)
    valley = (values <= np.r_[np.inf, values[:-1]]) & (values <= np.r_[values[1:], np.inf])
    # A local minimum is lower than its nearest grid value by much less than this margin. So it is safe to exclude the higher local minima.
    valley &= values <= values.min() + 1e-3 * np.ptp(values)
    around = np.flatnonzero(valley)
    around = around[np.argsort(values[around])[:4]]
    a, b = grid[np.maximum(around - 1, 0)], grid[np.minimum(around + 1, grid.size - 1)]
    rows = np.arange(around.size)
    for _ in range(8):
        fine = a[:, None] + (b - a)[:, None] * np.linspace(0.0, 1.0, 17)
        heights = f(fine)
        k = heights.argmin(axis=1)
        a, b = fine[rows, np.maximum(k - 1, 0)], fine[rows, np.minimum(k + 1, 16)]
    best = int(heights.min(axis=1).argmin())
    return float(fine[best, k[best]]), float(heights[best].min())


def shape(second: Sequence[tuple[float, float, Polynomial]]) -> list[Piece]:
    """The pieces (from, to, s, s'') of a shape, from pieces (from, to, s''). At the start s = s' = 0; scaling makes s = 1 at the end."""
    pieces, value, rate = [], 0.0, 0.0
    for low, high, acceleration in second:
        speed = acceleration.integ(lbnd=low, k=[rate])
        position = speed.integ(lbnd=low, k=[value])
        pieces.append((low, high, position, acceleration))
        value, rate = float(position(high)), float(speed(high))
    return [(low, high, position / value, acceleration / value) for low, high, position, acceleration in pieces]


def _durations(
    theta0: float, thetaf: float, inertia: float, gravity_moment: float, tau_max: float, tau_min: float | None, pieces: list[Piece]
) -> ProfileReport:
    bottom = -tau_max if tau_min is None else tau_min
    sg = 1.0 if thetaf >= theta0 else -1.0
    high, low = (tau_max, bottom) if sg > 0.0 else (-bottom, -tau_max)
    x0, D, G, slack = sg * theta0, abs(thetaf - theta0), gravity_moment, SLACK * max(tau_max, -bottom)

    def torque_margin(k: float, position: Polynomial, acceleration: Polynomial) -> Callable[[Array], Array]:
        """The function of u that returns the distance of the torque to the nearer limit. It is negative outside of the limits."""

        def inside(u: Array) -> Array:
            tau = k * acceleration(u) + G * np.sin(x0 + D * position(u))
            return np.minimum(high - tau, tau - low)

        return inside

    def excess(k: float) -> float:
        return -min(lowest(torque_margin(k, position, acceleration), a, b)[1] for a, b, position, acceleration in pieces)

    def edge(inside: float, outside: float) -> float:
        """The zero of the excess between k = inside (no excess) and k = outside, by bisection."""
        for _ in range(60):
            middle = 0.5 * (inside + outside)
            inside, outside = (middle, outside) if excess(middle) <= 0.0 else (inside, middle)
        return inside

    hold_start, hold_end = (bool(low - slack <= G * np.sin(x) <= high + slack) for x in (x0, x0 + D))
    if D == 0.0:
        t = 0.0 if hold_start else np.nan
        return ProfileReport(hold_start, t, t, 0.0, 0.0, hold_start, hold_end, 0.0 if hold_start else excess(0.0))
    # For k above `most`, the torque k s'' + G sin x exceeds a limit where |s''| is largest, for every value of sin x.
    largest = max(abs(float(acceleration(u))) for a, b, _, acceleration in pieces for u in np.linspace(a, b, 201))
    most = (high - low + 2.0 * abs(G)) / largest
    best, least = (0.0, excess(0.0)) if excess(0.0) <= 0.0 else golden(excess, 0.0, most)
    if least > slack:
        return ProfileReport(False, np.nan, np.nan, np.nan, np.nan, hold_start, hold_end, least)
    k_max = edge(best, most)
    k_min = 0.0 if excess(0.0) <= 0.0 else edge(best, 0.0)
    if k_max <= 0.0:
        return ProfileReport(False, np.nan, np.nan, np.nan, np.nan, hold_start, hold_end, 0.0)
    t_max = float(np.sqrt(inertia * D / k_min)) if k_min > 0.0 else np.inf
    return ProfileReport(True, float(np.sqrt(inertia * D / k_max)), t_max, k_min, k_max, hold_start, hold_end, 0.0)


def golden(f: Callable[[float], float], low: float, high: float, width: float = 1e-9) -> tuple[float, float]:
    """The minimum (argument, value) of a function with one local minimum, by golden section."""
    ratio = (np.sqrt(5.0) - 1.0) / 2.0
    left, right = high - ratio * (high - low), low + ratio * (high - low)
    f_left, f_right = f(left), f(right)
    while high - low > width * (1.0 + abs(low) + abs(high)):
        if f_left <= f_right:
            high, right, f_right = right, left, f_left
            left = high - ratio * (high - low)
            f_left = f(left)
        else:
            low, left, f_left = left, right, f_right
            right = low + ratio * (high - low)
            f_right = f(right)
    return (left, f_left) if f_left <= f_right else (right, f_right)


def trapezoid_time(
    theta0: float,
    thetaf: float,
    inertia: float,
    gravity_moment: float,
    tau_max: float,
    *,
    tau_min: float | None = None,
    ramp: float = 1.0 / 3.0,
) -> ProfileReport:
    """The feasible durations for constant acceleration for ramp T, then constant speed, then constant deceleration for ramp T."""
    one, none = Polynomial([1.0]), Polynomial([0.0])
    pieces = [(0.0, ramp, one), (ramp, 1.0 - ramp, none), (1.0 - ramp, 1.0, -one)]
    return _durations(theta0, thetaf, inertia, gravity_moment, tau_max, tau_min, shape([p for p in pieces if p[0] < p[1]]))


def minimum_jerk_time(
    theta0: float, thetaf: float, inertia: float, gravity_moment: float, tau_max: float, *, tau_min: float | None = None
) -> ProfileReport:
    """The feasible durations of the quintic with zero speed and acceleration at both ends: s'' is a cubic with zeros at 0, 1/2 and 1."""
    acceleration = Polynomial.fromroots([0.0, 0.5, 1.0])
    return _durations(theta0, thetaf, inertia, gravity_moment, tau_max, tau_min, shape([(0.0, 1.0, acceleration)]))


def bang_bang_time(
    theta0: float, thetaf: float, inertia: float, gravity_moment: float, tau_max: float, *, tau_min: float | None = None
) -> Profile:
    """The feasible durations of the symmetric bang-bang profile.

    The torque is a + G sin x in the first half, then -a + G sin x. Here a is the inertia times the acceleration, and G the gravity moment.
    """
    bottom = -tau_max if tau_min is None else tau_min
    sg = 1.0 if thetaf >= theta0 else -1.0
    high, low = (tau_max, bottom) if sg > 0.0 else (-bottom, -tau_max)
    x0, x1 = sg * theta0, sg * thetaf
    middle, D, G = 0.5 * (x0 + x1), abs(thetaf - theta0), gravity_moment

    def most(a: float, b: float) -> float:
        return -lowest(lambda x: -G * np.sin(x), a, b)[1]

    def least(a: float, b: float) -> float:
        return lowest(lambda x: G * np.sin(x), a, b)[1]

    a_max = min(high - most(x0, middle), least(middle, x1) - low)
    a_min = max(0.0, low - least(x0, middle), most(middle, x1) - high)
    slack = SLACK * max(tau_max, -bottom)
    hold_start, hold_end = (bool(low - slack <= G * np.sin(x) <= high + slack) for x in (x0, x1))
    if D == 0.0:
        t = 0.0 if hold_start else np.nan
        return Profile(hold_start, t, t, a_min, a_max, hold_start, hold_end)
    if not (a_max > 0.0 and a_max >= a_min - slack):
        return Profile(False, np.nan, np.nan, a_min, a_max, hold_start, hold_end)
    t_max = float(np.sqrt(4 * inertia * D / a_min)) if a_min > 0.0 else np.inf
    return Profile(True, float(np.sqrt(4 * inertia * D / a_max)), t_max, a_min, a_max, hold_start, hold_end)
