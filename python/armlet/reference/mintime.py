"""One link under gravity, rest to rest under a torque limit, by sampling and quadrature.

    I theta_ddot + G sin theta = tau,  |tau| <= tau_max;   x = sg theta with sg the direction of motion

Profile: symmetric bang-bang acceleration, a = I |theta_ddot|. Its torque is a + G sin x up to the middle and -a + G sin x after;
the extremes of the gravity torque are found on a dense grid and refined by golden section.
Optimum: every leg starts or ends at rest at r under a constant torque, I x_dot^2/2 = (x - r) (tau - G mean sin on [r, x]), so

    t(r -> p) = integral_0^1  2 sqrt(|h|) du / sqrt(2 |tau - G mean sin| / I),   x = r + h u^2,  h = p - r

which has a smooth integrand. The families are made of such legs: monotone (+,-), back-swing (-,+,-), and overshoot (+,-,+),
which is the back-swing of the mirrored motion run backwards in time.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .lagrange import Array

SLACK = 1e-12
GAUSS = np.polynomial.legendre.leggauss(24)


class Profile(NamedTuple):
    """The feasible durations of the symmetric profile and the interval of a = inertia * acceleration."""

    feasible: bool
    t_min: float
    t_max: float
    a_min: float
    a_max: float
    hold_start: bool
    hold_end: bool


class Best(NamedTuple):
    """The fastest of the three families and its switching angles."""

    t: float
    switches: tuple[float, ...]
    kind: str


class Optimum(NamedTuple):
    """The monotone optimum (NaN if there is none) and the best of the three families."""

    feasible: bool
    t: float
    theta_switch: float
    t_switch: float
    certified_global: bool
    best: Best


def golden(f: Callable[[float], float], low: float, high: float, width: float = 1e-9) -> tuple[float, float]:
    """The minimum of a function with one valley: (argument, value)."""
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


def lowest(f: Callable[[Array], Array], low: float, high: float) -> tuple[float, float]:
    """The minimum over an interval by a grid of at least 256 points per turn, refined around the best point."""
    grid = np.linspace(low, high, 1025 + int(256 * (high - low) / (2 * np.pi)))
    values = f(grid)
    k = int(np.argmin(values))
    best = (float(grid[k]), float(values[k]))
    around = golden(lambda x: float(f(np.array([x]))[0]), float(grid[max(k - 1, 0)]), float(grid[min(k + 1, grid.size - 1)]))
    return min(best, around, key=lambda pair: pair[1])


def bang_bang_time(theta0: float, thetaf: float, inertia: float, gravity_moment: float, tau_max: float) -> Profile:
    """Which durations the symmetric bang-bang profile may take."""
    sg = 1.0 if thetaf >= theta0 else -1.0
    x0, x1 = sg * theta0, sg * thetaf
    middle, D, G = 0.5 * (x0 + x1), abs(thetaf - theta0), gravity_moment

    def gravity(x: Array) -> Array:
        return G * np.sin(x)

    def most(low: float, high: float) -> float:
        return -lowest(lambda x: -gravity(x), low, high)[1]

    def least(low: float, high: float) -> float:
        return lowest(gravity, low, high)[1]

    a_max = min(tau_max - most(x0, middle), tau_max + least(middle, x1))
    a_min = max(0.0, -tau_max - least(x0, middle), most(middle, x1) - tau_max)
    slack = SLACK * tau_max
    hold_start, hold_end = (bool(abs(G * np.sin(x)) <= tau_max + slack) for x in (x0, x1))
    if D == 0.0:
        return Profile(hold_start, 0.0 if hold_start else np.nan, 0.0 if hold_start else np.nan, a_min, a_max, hold_start, hold_end)
    if not (a_max > 0.0 and a_max >= a_min - slack):
        return Profile(False, np.nan, np.nan, a_min, a_max, hold_start, hold_end)
    t_max = float(np.sqrt(4 * inertia * D / a_min)) if a_min > 0.0 else np.inf
    return Profile(True, float(np.sqrt(4 * inertia * D / a_max)), t_max, a_min, a_max, hold_start, hold_end)


def quad(f: Callable[[Array], Array], low: float, high: float, tol: float = 1e-14, depth: int = 40) -> float:
    """Adaptive Gauss-Legendre: an interval is halved until its halves agree with it."""
    nodes, weights = GAUSS

    def rule(a: float, b: float) -> float:
        half = 0.5 * (b - a)
        return float(half * (weights @ f(a + half * (nodes + 1.0))))

    def refine(a: float, b: float, whole: float, left_depth: int) -> float:
        c = 0.5 * (a + b)
        left, right = rule(a, c), rule(c, b)
        if left_depth == 0 or not np.isfinite(left + right) or abs(left + right - whole) <= tol * abs(total):
            return left + right
        return refine(a, c, left, left_depth - 1) + refine(c, b, right, left_depth - 1)

    total = rule(low, high)
    return refine(low, high, total, depth)


class Link:
    """Legs of constant torque from or to rest, in the direction coordinate x."""

    def __init__(self, inertia: float, gravity_moment: float, tau_max: float) -> None:
        self.I, self.G, self.tau = inertia, gravity_moment, tau_max

    def push(self, r: float, x: Array, tau: float) -> Array:
        """Mean torque tau - G mean sin on [r, x]; the mean of sin is exact at any distance as sin(middle) sinc(half)."""
        half = 0.5 * (x - r)
        mean: Array = tau - self.G * np.sin(r + half) * np.sinc(half / np.pi)
        return mean

    def possible(self, r: float, p: float, tau: float) -> bool:
        """Kinetic energy stays positive on the open leg."""
        side = 1.0 if p >= r else -1.0
        low, high = min(r, p), max(r, p)
        grid = np.linspace(low, high, 65 + int(64 * (high - low)))
        least = float((side * self.push(r, grid, tau)).min())
        # Between grid points 1/64 apart the curve sinks by at most G/64^2/8; only a closer call needs refinement.
        if p == r or least <= 0.0 or least > 1e-4 * abs(self.G):
            return p == r or least > 0.0
        return lowest(lambda x: side * self.push(r, x, tau), low, high)[1] > 0.0

    def time(self, r: float, p: float, tau: float, exact: bool = True) -> float:
        """Duration of the leg."""
        h = p - r

        def rate(u: Array) -> Array:
            integrand: Array = 2.0 * np.sqrt(abs(h)) / np.sqrt(2.0 * np.abs(self.push(r, r + h * u * u, tau)) / self.I)
            return integrand

        return quad(rate, 0.0, 1.0, depth=40 if exact else 0)

    def energy(self, r: float, x: float, tau: float) -> float:
        """Work of torque and gravity from r to x."""
        return (x - r) * float(self.push(r, np.array([x]), tau)[0])

    def monotone(self, x0: float, x1: float) -> tuple[float, float, float]:
        """T, switch and switching time of (+,-); NaN if the path cannot be done. The switch equates the two energies."""
        tau = self.tau

        def gap(x: float) -> float:
            """Energy gained less energy still to be lost; its slope is 2 tau."""
            return self.energy(x0, x, tau) - self.energy(x1, x, -tau)

        if gap(x0) >= 0.0 or gap(x1) <= 0.0:
            return np.nan, np.nan, np.nan
        low, high = x0, x1
        for _ in range(200):
            middle = 0.5 * (low + high)
            if middle in (low, high):
                break
            low, high = (middle, high) if gap(middle) < 0.0 else (low, middle)
        if not (self.possible(x0, low, tau) and self.possible(x1, low, -tau)):
            return np.nan, np.nan, np.nan
        first = self.time(x0, low, tau)
        return first + self.time(x1, low, -tau), low, first

    def swing(self, x0: float, x1: float, first: float, exact: bool) -> tuple[float, float, float]:
        """T, turning point and last switch of (-,+,-) with the first switch at `first` < x0; NaN if it cannot be done."""
        tau, none = self.tau, (np.inf, np.nan, np.nan)
        if not self.possible(x0, first, -tau):
            return none
        speed = self.energy(x0, first, -tau)
        turn = self._turn(first, speed)
        if turn is None:
            return none
        # The last switch equates the energies gained from the turn and lost to the end; their difference has slope 2 tau.
        last = turn - (self.energy(turn, turn, tau) - self.energy(x1, turn, -tau)) / (2.0 * tau)
        if not (turn < last < x1 and self.possible(turn, last, tau) and self.possible(x1, last, -tau)):
            return none
        legs = ((x0, first, -tau), (turn, first, tau), (turn, last, tau), (x1, last, -tau))
        return sum(self.time(*leg, exact=exact) for leg in legs), turn, last

    def _turn(self, first: float, energy: float) -> float | None:
        """Where the braking torque +tau stops the backward motion: the first zero of the energy below `first`."""
        step, x = 1e-2, first
        for _ in range(2000):
            if energy + self.energy(first, x - step, self.tau) <= 0.0:
                low, high = x - step, x
                for _ in range(200):
                    middle = 0.5 * (low + high)
                    if middle in (low, high):
                        break
                    low, high = (middle, high) if energy + self.energy(first, middle, self.tau) <= 0.0 else (low, middle)
                return high
            x -= step
        return None

    def back_swing(self, x0: float, x1: float, samples: int = 240) -> tuple[float, float, float]:
        """The fastest (-,+,-): T, first and last switch."""
        grid = x0 - 2 * np.pi * (np.arange(1, samples + 1) / samples) ** 2
        values = np.array([self.swing(x0, x1, float(first), exact=False)[0] for first in grid])
        if not np.isfinite(values).any():
            return np.inf, np.nan, np.nan
        k = int(np.argmin(values))
        low, high = float(grid[min(k + 1, samples - 1)]), float(grid[k - 1]) if k else x0
        # 1e-6 in the switch is 1e-12 in T at the valley's floor.
        first, _ = golden(lambda x: self.swing(x0, x1, x, exact=True)[0], low, high, width=1e-7)
        T, _, last = self.swing(x0, x1, first, exact=True)
        return T, first, last


def torque_optimal_time(theta0: float, thetaf: float, inertia: float, gravity_moment: float, tau_max: float) -> Optimum:
    """The monotone optimum and the best of the monotone, back-swing and overshoot families."""
    sg = 1.0 if thetaf >= theta0 else -1.0
    x0, x1 = sg * theta0, sg * thetaf
    link = Link(inertia, gravity_moment, tau_max)
    if x0 == x1:
        held = bool(abs(gravity_moment * np.sin(x0)) <= tau_max * (1 + SLACK))
        if held:
            return Optimum(True, 0.0, theta0, 0.0, True, Best(0.0, (), "monotone"))
    T, switch, t_switch = link.monotone(x0, x1)
    feasible = bool(np.isfinite(T))
    bound = np.pi * np.sqrt(inertia / abs(gravity_moment)) if gravity_moment else np.inf
    certified = bool(feasible and tau_max >= abs(gravity_moment) and bound >= T)
    choices = [Best(T, (sg * switch,), "monotone")] if feasible else []
    if not certified:
        back = link.back_swing(x0, x1)
        over = link.back_swing(-x1, -x0)
        if np.isfinite(back[0]):
            choices.append(Best(back[0], (sg * back[1], sg * back[2]), "back-swing"))
        if np.isfinite(over[0]):
            choices.append(Best(over[0], (-sg * over[2], -sg * over[1]), "overshoot"))
    best = min(choices, key=lambda choice: choice.t, default=Best(np.nan, (), "none found"))
    return Optimum(feasible, T, sg * switch, t_switch, certified, best)
