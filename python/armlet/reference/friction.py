"""The fastest motions of one link with friction, rest to rest, by shooting in time.

    I x_ddot + G sin x + d x_dot + c sign(x_dot) = u,  -down <= u <= up
    push: u = up from rest at x0, forwards in time;   brake: u = -down to rest at x1, backwards in time

x is the angle, I the inertia, G the gravity moment, d the viscous friction, c the Coulomb friction and u the torque.

The monotone motion changes from push to brake where both have the same angle and speed. A swing is two monotone motions: from x0 to a
turning point, and from the turning point to x1. Both have the same torque at the turning point.

The steps are classical Runge-Kutta. Newton's method finds the switch from push to brake. The turning point is searched on a grid
and refined by golden section.
"""

import math
from typing import NamedTuple

import numpy as np

from .lagrange import Array
from .profiles import golden

# In the time in which a constant torque up + down + |G| moves the link from rest over the distance, there are at least STEPS steps.
# MOST is the largest number of points of a curve.
STEPS, MOST = 300, 30_000

Point = tuple[float, float, float]


class Leg(NamedTuple):
    """A monotone motion: its duration, s, and the angle, rad, the time, s, and the speed, rad/s, of its switch. NaN if infeasible."""

    t: float
    switch: float
    t_switch: float
    v_peak: float


NONE = Leg(np.nan, np.nan, np.nan, np.nan)


class Link(NamedTuple):
    """One link with its friction. The largest torque is `up` in the direction of x, and `down` against it."""

    inertia: float
    gravity: float
    up: float
    down: float
    viscous: float
    coulomb: float

    def acceleration(self, x: float, v: float, pushing: bool) -> float:
        """The acceleration of a motion with v >= 0, under the torque `up` if `pushing`, otherwise `-down`."""
        torque = self.up if pushing else -self.down
        return (torque - self.gravity * math.sin(x) - self.viscous * v - self.coulomb) / self.inertia

    def mirrored(self) -> "Link":
        """The link in the coordinate -x."""
        return self._replace(up=self.down, down=self.up)


def step(link: Link, x: float, v: float, h: float, pushing: bool) -> tuple[float, float]:
    """One classical Runge-Kutta step of h seconds. For h < 0 the step goes backwards in time."""
    a1 = link.acceleration(x, v, pushing)
    a2 = link.acceleration(x + h / 2 * v, v + h / 2 * a1, pushing)
    a3 = link.acceleration(x + h / 2 * v + h * h / 4 * a1, v + h / 2 * a2, pushing)
    a4 = link.acceleration(x + h * v + h * h / 2 * a2, v + h * a3, pushing)
    return x + h * v + h * h / 6 * (a1 + a2 + a3), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)


def curve(link: Link, x: float, end: float, h: float, pushing: bool) -> list[Point]:
    """The points (time, x, v) of a motion from rest at x, until it passes `end` or the link stops. For h < 0 time decreases."""
    points = [(0.0, x, 0.0)]
    for k in range(1, MOST):
        x, v = step(link, points[-1][1], points[-1][2], h, pushing)
        if not v > 0.0:
            break
        points.append((k * h, x, v))
        if (x - end) * h > 0.0:
            break
    return points


def monotone(link: Link, x0: float, x1: float) -> Leg:
    """The monotone motion from rest at x0 to rest at x1. x1 may be smaller than x0."""
    if x1 < x0:
        leg = monotone(link.mirrored(), -x0, -x1)
        return leg._replace(switch=-leg.switch, v_peak=-leg.v_peak)
    if x1 == x0 or link.acceleration(x0, 0.0, True) <= 0.0 or link.acceleration(x1, 0.0, False) >= 0.0:
        return NONE
    h = math.sqrt(2.0 * link.inertia * (x1 - x0) / (link.up + link.down + abs(link.gravity))) / STEPS
    if link.viscous > 0.0:
        h = min(h, 0.1 * link.inertia / link.viscous)
    push = np.array(curve(link, x0, x1, h, True))
    brake = np.array(curve(link, x1, x0, -h, False))[::-1]
    # The speed of the push minus the speed of the brake, at the angles of the push that the brake also passes.
    ahead = push[:, 2] - np.interp(push[:, 1], brake[:, 1], brake[:, 2], left=np.inf, right=-np.inf)
    crossed = np.flatnonzero((ahead[:-1] <= 0.0) & (ahead[1:] > 0.0) & np.isfinite(ahead[:-1]))
    if not crossed.size:
        return NONE
    first = push[crossed[0]]
    last = brake[min(int(np.searchsorted(brake[:, 1], first[1])), len(brake) - 1)]
    return _meet(link, first, last)


def _meet(link: Link, first: Array, last: Array) -> Leg:
    """The motion that switches where push and brake have the same angle and speed, by Newton's method.

    `first` is a point of the push and `last` a point of the brake, both near the switch. The unknowns are the time s from `first` to the
    switch, and the time r from the switch to `last`.
    """
    s = r = 0.0
    for _ in range(50):
        x, v = step(link, first[1], first[2], s, True)
        y, w = step(link, last[1], last[2], -r, False)
        a, b = link.acceleration(x, v, True), link.acceleration(y, w, False)
        ds, dr = np.linalg.solve([[v, w], [a, b]], [y - x, w - v])
        s, r = s + ds, r + dr
        if abs(ds) + abs(dr) <= 1e-15 * (first[0] - last[0]):
            break
    t_switch = first[0] + s
    return Leg(t_switch - last[0] + r, x, t_switch, v)


def swing(link: Link, x0: float, x1: float, side: float, samples: int = 60) -> tuple[float, tuple[float, float]]:
    """The fastest motion that is found with a turning point before x0 (side -1) or beyond x1 (side 1), at most pi rad away.

    The result is its duration, s, and both switches, rad. The duration is infinite if no such motion is found.
    """
    start = x0 if side < 0.0 else x1

    def legs(turn: float) -> tuple[Leg, Leg]:
        return monotone(link, x0, turn), monotone(link, turn, x1)

    def time(depth: float) -> float:
        total = sum(leg.t for leg in legs(start + side * depth))
        return float(total) if np.isfinite(total) else np.inf

    grid = np.pi * (np.arange(1, samples + 1) / samples) ** 2
    times = np.array([time(depth) for depth in grid])
    k = int(times.argmin())
    if not np.isfinite(times[k]):
        return np.inf, (np.nan, np.nan)
    depth, T = golden(time, float(grid[k - 1]) if k else 0.0, float(grid[min(k + 1, samples - 1)]), width=1e-6)
    there, back = legs(start + side * depth)
    return T, (there.switch, back.switch)
