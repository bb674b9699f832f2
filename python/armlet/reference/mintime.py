"""The fastest rest-to-rest motion of one link under gravity and torque limits, by quadrature and a search on a grid.

    I theta_ddot + G sin theta = tau,  tau_min <= tau <= tau_max;   x = sg theta with sg the direction of motion

I is the inertia, G the gravity moment, and x the angle along the motion. A *leg* is a motion between the angles r and p under constant
torque, at rest at r. On it, I x_dot^2/2 = (x - r) (tau - G mean sin on [r, x]), so

    t(r -> p) = integral_0^1  2 sqrt(|h|) du / sqrt(2 |tau - G mean sin| / I),   x = r + h u^2,  h = p - r

which has a smooth integrand. A motion consists of such legs. There are three families of motions, with these signs of the torque: monotone
(+,-), back-swing (-,+,-), and overshoot (+,-,+). An overshoot is the back-swing of the mirrored motion in reverse time. The module
`friction` computes motions with friction.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from . import friction
from .lagrange import Array
from .profiles import SLACK, golden, lowest

GAUSS = np.polynomial.legendre.leggauss(24)


class Best(NamedTuple):
    """The fastest motion of the three families: its duration, s, its switching angles, rad, and its family."""

    t: float
    switches: tuple[float, ...]
    kind: str


class Optimum(NamedTuple):
    """The fastest monotone motion (NaN if none is feasible), and the fastest motion of the three families."""

    feasible: bool
    t: float
    theta_switch: float
    t_switch: float
    v_peak: float
    certified_global: bool
    sturm_bound: float
    best: Best


def quad(f: Callable[[Array], Array], low: float, high: float, tol: float = 1e-14, depth: int = 40) -> float:
    """Adaptive Gauss-Legendre quadrature. An interval is halved, at most `depth` times, until its halves agree with it."""
    nodes, weights = GAUSS

    def rule(a: float, b: float) -> float:
        half = 0.5 * (b - a)
        return float(half * (weights @ f(a + half * (nodes + 1.0))))

    def refine(a: float, b: float, coarse: float, left_depth: int) -> float:
        c = 0.5 * (a + b)
        left, right = rule(a, c), rule(c, b)
        if left_depth == 0 or not np.isfinite(left + right) or abs(left + right - coarse) <= tol * abs(total):
            return left + right
        return refine(a, c, left, left_depth - 1) + refine(c, b, right, left_depth - 1)

    total = rule(low, high)
    return refine(low, high, total, depth)


class Link:
    """The legs of a link: motions with constant torque that start or end at rest, in the coordinate x along the motion."""

    def __init__(self, inertia: float, gravity_moment: float, up: float, down: float) -> None:
        self.I, self.G, self.up, self.down = inertia, gravity_moment, up, down

    def push(self, r: float, x: Array, tau: float) -> Array:
        """The mean net torque on [r, x]: tau minus the mean of the gravity torque G sin, N m.

        The mean of sin is sin(middle) sinc(half), which is accurate at every distance.
        """
        half = 0.5 * (x - r)
        mean: Array = tau - self.G * np.sin(r + half) * np.sinc(half / np.pi)
        return mean

    def possible(self, r: float, p: float, tau: float) -> bool:
        """Whether the kinetic energy is positive inside the leg from r to p under the torque tau."""
        side = 1.0 if p >= r else -1.0
        low, high = min(r, p), max(r, p)
        grid = np.linspace(low, high, 65 + int(64 * (high - low)))
        least = float((side * self.push(r, grid, tau)).min())
        # Between grid points with the distance 1/64 rad, the mean torque falls by at most G/64^2/8, about 3e-5 G. So a least value above
        # 1e-4 G shows that the torque is positive everywhere.
        if p == r or least <= 0.0 or least > 1e-4 * abs(self.G):
            return p == r or least > 0.0
        return lowest(lambda x: side * self.push(r, x, tau), low, high)[1] > 0.0

    def time(self, r: float, p: float, tau: float, exact: bool = True) -> float:
        """The duration of a leg from r to p, s. If `exact` is false, the quadrature is not adaptive."""
        h = p - r

        def rate(u: Array) -> Array:
            integrand: Array = 2.0 * np.sqrt(abs(h)) / np.sqrt(2.0 * np.abs(self.push(r, r + h * u * u, tau)) / self.I)
            return integrand

        return quad(rate, 0.0, 1.0, depth=40 if exact else 0)

    def energy(self, r: float, x: float, tau: float) -> float:
        """The work of the torque and of gravity from r to x, J."""
        return (x - r) * float(self.push(r, np.array([x]), tau)[0])

    def monotone(self, x0: float, x1: float) -> friction.Leg:
        """The monotone motion from x0 to x1, with the torque `up` and then `-down`; NaN if it is infeasible.

        The kinetic energies of both legs are equal at the switch.
        """
        up, down = self.up, self.down

        def gap(x: float) -> float:
            """The energy gained up to x minus the energy that braking from x removes. Its derivative is up + down."""
            return self.energy(x0, x, up) - self.energy(x1, x, -down)

        if gap(x0) >= 0.0 or gap(x1) <= 0.0:
            return friction.NONE
        low, high = x0, x1
        for _ in range(200):
            middle = 0.5 * (low + high)
            if middle in (low, high):
                break
            low, high = (middle, high) if gap(middle) < 0.0 else (low, middle)
        if not (self.possible(x0, low, up) and self.possible(x1, low, -down)):
            return friction.NONE
        first = self.time(x0, low, up)
        speed = float(np.sqrt(2.0 * self.energy(x0, low, up) / self.I))
        return friction.Leg(first + self.time(x1, low, -down), low, first, speed)

    def swing(self, x0: float, x1: float, first: float, exact: bool) -> tuple[float, float, float]:
        """The duration, turning point and last switch of a back-swing whose first switch is at `first` < x0.

        The torques are `-down`, `up`, `-down`. The result is (inf, NaN, NaN) if the motion is infeasible.
        """
        up, down, none = self.up, self.down, (np.inf, np.nan, np.nan)
        if not self.possible(x0, first, -down):
            return none
        speed = self.energy(x0, first, -down)
        turn = self._turn(first, speed)
        if turn is None:
            return none
        # At the last switch, the energy gained since the turning point equals the energy lost until the end. The derivative of their
        # difference is up + down.
        last = turn + self.energy(x1, turn, -down) / (up + down)
        if not (turn < last < x1 and self.possible(turn, last, up) and self.possible(x1, last, -down)):
            return none
        legs = ((x0, first, -down), (turn, first, up), (turn, last, up), (x1, last, -down))
        return sum(self.time(*leg, exact=exact) for leg in legs), turn, last

    def _turn(self, first: float, energy: float) -> float | None:
        """The turning point, at which the positive torque stops the backward motion. None if it is more than 20 rad below `first`."""

        def left(x: Array) -> Array:
            kept: Array = energy + (x - first) * self.push(first, x, self.up)
            return kept

        x: Array = first - 1e-2 * np.arange(2001, dtype=np.float64)
        for _ in range(12):
            k = int((left(x[1:]) <= 0.0).argmax()) + 1
            if left(x[k : k + 1])[0] > 0.0:
                return None
            # Each iteration divides the interval by 64, until its ends are neighbouring floating-point numbers.
            x = np.linspace(x[k - 1], x[k], 65)
        return float(x[0])

    def back_swing(self, x0: float, x1: float, samples: int = 240) -> tuple[float, float, float]:
        """The fastest back-swing that is found, with the torques `-down`, `up`, `-down`: duration, first switch, last switch."""
        grid = x0 - 2 * np.pi * (np.arange(1, samples + 1) / samples) ** 2
        values = np.array([self.swing(x0, x1, float(first), exact=False)[0] for first in grid])
        if not np.isfinite(values).any():
            return np.inf, np.nan, np.nan
        k = int(np.argmin(values))
        low, high = float(grid[min(k + 1, samples - 1)]), float(grid[k - 1]) if k else x0
        # T has a minimum here, so an error of 1e-6 of the switch changes T by about 1e-12.
        first, _ = golden(lambda x: self.swing(x0, x1, x, exact=True)[0], low, high, width=1e-7)
        T, _, last = self.swing(x0, x1, first, exact=True)
        return T, first, last


def torque_optimal_time(
    theta0: float,
    thetaf: float,
    inertia: float,
    gravity_moment: float,
    tau_max: float,
    *,
    tau_min: float | None = None,
    viscous: float = 0.0,
    coulomb: float = 0.0,
) -> Optimum:
    """The fastest monotone motion, and the fastest motion of the families monotone, back-swing and overshoot."""
    bottom = -tau_max if tau_min is None else tau_min
    # If both ends are equal, the direction of the motion is against gravity.
    sg = 1.0 if thetaf > theta0 or (thetaf == theta0 and gravity_moment * np.sin(theta0) >= 0.0) else -1.0
    x0, x1, G = sg * theta0, sg * thetaf, abs(gravity_moment)
    up, down = (tau_max, -bottom) if sg > 0.0 else (-bottom, tau_max)
    # The adjoint psi, with psi'' = (d^2/(4 I^2) - G cos/I) psi and the viscous friction d, is zero at each switch of the torque. By Sturm's
    # theorem, the time between two zeros is at least `bound`.
    rate = G / inertia - (viscous / (2.0 * inertia)) ** 2
    bound = np.pi / np.sqrt(rate) if rate > 0.0 else np.inf
    load, slack = gravity_moment * np.sin(x0), coulomb + SLACK * max(up, down)
    if x0 == x1 and -down - slack <= load <= up + slack:
        return Optimum(True, 0.0, theta0, 0.0, 0.0, True, bound, Best(0.0, (), "monotone"))
    rubs = viscous != 0.0 or coulomb != 0.0
    link = Link(inertia, gravity_moment, up, down)
    rough = friction.Link(inertia, gravity_moment, up, down, viscous, coulomb)
    leg = friction.monotone(rough, x0, x1) if rubs else link.monotone(x0, x1)
    feasible = bool(np.isfinite(leg.t))
    overdamped = rubs and bool(np.isinf(bound))
    certified = feasible and (overdamped or bool(coulomb == 0.0 and min(up, down) >= G and leg.t <= bound))
    choices = [Best(leg.t, (sg * leg.switch,), "monotone")] if feasible else []
    if not (certified or overdamped):
        choices += _swings(rough, x0, x1, sg) if rubs else _free_swings(link, x0, x1, sg)
    best = min(choices, key=lambda choice: choice.t, default=Best(np.nan, (), "none found"))
    return Optimum(feasible, leg.t, sg * leg.switch, leg.t_switch, sg * leg.v_peak, certified, float(bound), best)


def _free_swings(link: Link, x0: float, x1: float, sg: float) -> list[Best]:
    T, first, last = link.back_swing(x0, x1)
    # In the mirrored motion in reverse time, the torque limits `up` and `down` exchange their roles.
    U, late, early = Link(link.I, link.G, link.down, link.up).back_swing(-x1, -x0)
    both = [Best(T, (sg * first, sg * last), "back-swing"), Best(U, (-sg * early, -sg * late), "overshoot")]
    return [best for best in both if np.isfinite(best.t)]


def _swings(link: friction.Link, x0: float, x1: float, sg: float) -> list[Best]:
    found = []
    for kind, side in (("back-swing", -1.0), ("overshoot", 1.0)):
        T, (first, last) = friction.swing(link, x0, x1, side)
        if np.isfinite(T):
            found.append(Best(T, (sg * first, sg * last), kind))
    return found
