"""Random one-link problems with friction for `torque_optimal_time`, checked by numpy.

motion:    along the profile the torque is on a limit. Over panels, the change of q is int v dt, and the change of v is
           int (tau - G sin q - d v - c sign v)/I dt
refused:   the planner finds a monotone motion if Runge-Kutta steps find one. It also finds one if friction dominates and the net
           torque is always positive
swings:    no motion that turns at a random angle is faster. Runge-Kutta steps give its time
"""

from __future__ import annotations

import itertools
from collections import Counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]
STRATA = ("friction", "strong friction")
SIZE = 200
#: Number of Runge-Kutta steps of a leg (a motion between two rest points), and number of random turning angles per problem.
STEPS, TURNS = 1500, 4
#: Relative accuracy of the time of a leg by these steps. Near a stall it is worse.
ROUGH = 1e-3
#: Panels of a phase, relative to its duration. They are dense at the ends, where friction can balance the torque.
PANELS = np.unique(np.concatenate([np.linspace(0.0, 1.0, 65), 2.0 ** np.arange(-80, -6), 1.0 - 2.0 ** np.arange(-80, -6)]))
NODES, WEIGHTS = np.polynomial.legendre.leggauss(10)


def problems(stratum: str, rng: np.random.Generator) -> Array:
    """Problems (SIZE, 8): theta0, thetaf, inertia, gravity_moment, tau_max, tau_min, viscous, coulomb."""
    theta0, thetaf = rng.uniform(-4.0, 4.0, (2, SIZE))
    inertia, G = 10.0 ** rng.uniform(-1.0, 1.0, SIZE), rng.uniform(-1.5, 1.5, SIZE)
    high, low = rng.uniform(0.1, 2.0, (2, SIZE))
    # The critical damping of the hanging link is 2 sqrt(I |G|).
    exponents = (-3.0, 0.5) if stratum == "friction" else (0.0, 8.0)
    viscous = np.sqrt(inertia * np.abs(G)) * 10.0 ** rng.uniform(*exponents, SIZE)
    coulomb = np.where(rng.random(SIZE) < 0.3, 0.0, rng.uniform(0.0, 0.5, SIZE) * np.minimum(high, low))
    return np.stack([theta0, thetaf, inertia, G, high, -low, viscous, coulomb], axis=1)


def legs(start: np.ndarray, end: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Times of the fastest monotone motions `start -> end` with friction; NaN if there is none. `p`: inertia, gravity, limits, friction.

    Energy and time are integrated over the square root of the distance by Runge-Kutta of order 4. The motion with full driving torque
    starts at `start`. The motion with full braking torque is integrated backwards from `end`. Their two energy curves cross once.
    """
    inertia, gravity, high, low, viscous, coulomb = p
    sign, distance = np.sign(end - start), np.abs(end - start)
    push, brake = np.where(sign > 0, high, -low), np.where(sign > 0, -low, high)
    s = np.linspace(0.0, 1.0, STEPS + 1)
    h = s[1]

    def curve(x: np.ndarray, way: np.ndarray, torque: np.ndarray, drag: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        def slope(s: float, state: np.ndarray) -> np.ndarray:
            # y = D s^2:   d(v^2/2)/ds = 2 D s a,   dt/ds = 2 D s / v
            v = np.sqrt(np.where(state[0] > 0.0, 2.0 * state[0], np.nan))
            a = (torque - gravity * way * np.sin(x + way * distance * s * s) - drag * v) / inertia
            return np.stack([2.0 * distance * s * a, 2.0 * distance * s / v])

        # The first step from rest assumes constant acceleration.
        a = (torque - gravity * way * np.sin(x)) / inertia
        v = np.sqrt(np.where(a > 0.0, 2.0 * distance * a, np.nan)) * h
        states = [np.zeros((2, len(x))), np.stack([0.5 * v**2, v / a])]
        for at in s[1:-1]:
            state = states[-1]
            k1 = slope(at, state)
            k2 = slope(at + h / 2, state + h / 2 * k1)
            k3 = slope(at + h / 2, state + h / 2 * k2)
            states.append(state + h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(at + h, state + h * k3)))
        energies, times = np.stack(states, axis=-1)
        return energies, times

    there, back = curve(start, sign, push - coulomb, viscous), curve(end, -sign, brake + coulomb, -viscous)
    found = np.full(start.shape, np.nan)
    # The grid is fine at both ends. A stalled curve is NaN after the stall, and so are interpolated values.
    way = np.sin(np.linspace(0.0, np.pi / 2, 4 * STEPS)) ** 2
    for k in range(len(start)):
        e1, t1 = (np.interp(np.sqrt(way), s, f[k]) for f in there)
        e2, t2 = (np.interp(np.sqrt(1.0 - way), s, f[k]) for f in back)
        lead, total = e1 - e2, t1 + t2
        for j in np.flatnonzero((lead[:-1] < 0.0) & (lead[1:] >= 0.0))[:1]:
            part = lead[j] / (lead[j] - lead[j + 1])
            found[k] = (1.0 - part) * total[j] + part * total[j + 1]
    return found


def motion_error(o: Any, row: list[float]) -> float:
    """Error of the motion, relative to its size and speed.

    It includes the error of the equation of motion. The link must be at rest at the ends and at the turning angle.
    """
    theta0, thetaf, inertia, G, high, low, viscous, coulomb = row
    turns = [] if np.isnan(o.best.t_turn) else [o.best.t_turn]
    times = np.sort([0.0, *o.best.t_switches, *turns, o.best.t])
    q_error, v_error = [], []
    size, speed, rounding = abs(thetaf - theta0), 0.0, 0.0
    for start, end in itertools.pairwise(times):
        # A phase that is too short for the resolution of time is skipped.
        if end - start <= 1e-11 * end:
            continue
        edges = np.unique(start + (end - start) * PANELS)
        # Panels that are too short for the resolution of time are joined.
        edges = edges[((edges == start) | (edges - start > 1e-13 * start)) & ((edges == end) | (end - edges > 1e-13 * end))]
        half = 0.5 * np.diff(edges)
        q, v, _, tau = o.profile(edges[:-1, None] + half[:, None] * (NODES + 1.0))
        if np.ptp(tau) != 0.0 or tau[0, 0] not in (high, low):
            return np.inf
        a = (tau - G * np.sin(q) - viscous * v - coulomb * np.sign(v)) / inertia
        # The last point is just before the end, because at the end the next phase begins.
        edges[-1] = np.nextafter(end, 0.0)
        q_at, v_at, _, _ = o.profile(edges)
        q_error.extend(np.diff(q_at) - half * (v @ WEIGHTS))
        # The acceleration is a difference of torques, so its error is their rounding error.
        known = 1e-13 * (abs(high) + abs(low) + abs(G) + coulomb) / inertia * 2.0 * half
        v_error.extend(np.maximum(np.abs(np.diff(v_at) - half * (a @ WEIGHTS)) - known, 0.0))
        rests = {0.0: theta0, o.best.t_turn: o.best.theta_turn, o.best.t: thetaf}
        for k, t in ((0, start), (-1, end)):
            if t in rests and np.abs(np.subtract(o.best.t_switches, t)).min() > 1e-11 * t:
                q_error.append(q_at[k] - rests[t])
                v_error.append(v_at[k])
        size, speed = max(size, float(np.ptp(q_at))), max(speed, float(np.abs(v_at).max()))
        # Rounding of the time, for a braking phase that is much shorter than the motion.
        rounding = max(rounding, 1e-15 * o.best.t * float(np.abs(a).max()))
    return max(np.abs(q_error).max() / size, max(np.abs(v_error).max() - rounding, 0.0) / speed) if speed else np.inf


def judge(p: Array, rng: np.random.Generator) -> tuple[Counter[str], list[tuple[int, str]]]:
    optima = [al.torque_optimal_time(*row[:5], tau_min=row[5], viscous=row[6], coulomb=row[7]) for row in p.tolist()]
    theta0, thetaf, inertia, G, high, low, viscous, coulomb = p.T
    sign = np.sign(thetaf - theta0)
    kinds = np.array([o.best.kind for o in optima])
    feasible, t, best = (np.array([f(o) for o in optima]) for f in (lambda o: o.feasible, lambda o: o.t, lambda o: o.best.t))
    tally: Counter[str] = Counter(kinds.tolist())
    failed: list[tuple[int, str]] = []

    def refuse(bad: Array, what: str) -> None:
        failed.extend((int(i), what) for i in np.flatnonzero(bad))

    with np.errstate(all="ignore"):
        errors = np.array([0.0 if k == "none found" else motion_error(o, row) for o, k, row in zip(optima, kinds, p.tolist(), strict=True)])
        growth = np.exp(np.minimum(best * np.sqrt(np.abs(G) / inertia), 14.0))
        refuse(~(errors <= 1e-11 * np.where(np.isnan(growth), 1.0, growth)), "the motion is another one")
        refuse(feasible & ~(np.isfinite(t) & (best <= t * (1.0 + 1e-12))), "best is slower than monotone")
        certified = np.array([o.certified_global for o in optima])
        refuse(certified & (kinds != "monotone"), "certified but not monotone")
        # If friction dominates, v = N/d, where N is the net torque.
        x = theta0[:, None] + np.linspace(0.0, 1.0, 2001) * (thetaf - theta0)[:, None]
        push, brake = np.where(sign > 0, high, -low) - coulomb, np.where(sign > 0, -low, high) + coulomb
        net = push[:, None] - (G * sign)[:, None] * np.sin(x)
        least = net.min(axis=1)
        loses = inertia * (push + brake + np.abs(G)) ** 2 / (viscous * least * np.minimum(1.0, np.abs(thetaf - theta0))) ** 2 * push
        slow = (least > 0.0) & (brake + G * sign * np.sin(thetaf) > 1e-3 * brake) & (loses < 1e-3)
        time = viscous * np.abs(thetaf - theta0) / 2000 * (0.5 / net[:, :-1] + 0.5 / net[:, 1:]).sum(axis=1)
        tally["friction rules"] = int(slow.sum())
        refuse(slow & ~(np.abs(t - time) <= (1e-2 + 10.0 * loses) * time), "not the slow motion")
        # Runge-Kutta steps are accurate if the time constant of friction spans several steps.
        steps = STEPS * np.minimum(1.0, np.abs(thetaf - theta0)) > 200.0 * viscous**2 / (inertia * np.maximum(least, 0.05))
        direct = legs(theta0, thetaf, p.T[2:])
        known = steps & np.isfinite(direct)
        tally["monotone, checked"] = int(known.sum())
        refuse(known & ~(np.abs(t - direct) <= ROUGH * direct), "monotone time, or refused")
        depth = 10.0 ** rng.uniform(-3.0, 1.0, (TURNS, len(p)))
        turns = np.where(rng.random((TURNS, len(p))) < 0.5, theta0 - sign * depth, thetaf + sign * depth)
        each, first, second = np.tile(p.T[2:], TURNS), np.tile(theta0, TURNS), np.tile(thetaf, TURNS)
        swings = (legs(first, turns.ravel(), each) + legs(turns.ravel(), second, each)).reshape(turns.shape)
        tally["swings tried"] = int(np.isfinite(swings).sum())
        refuse(np.any(steps & np.isfinite(swings) & ~(best <= swings * (1.0 + ROUGH)), axis=0), "a swing by some angle is faster")
    return tally, failed


JUDGES = (judge,)
