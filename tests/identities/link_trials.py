"""Random one-link problems for `bang_bang_time` and `torque_optimal_time`, checked by numpy.

bang-bang:   the torques of the profile are within the limits at t_min and t_max. With a shorter t_min or a longer t_max, they are not
optimum:     time = sum of int 2 sqrt(L) ds / sqrt(2 w(L s^2) / I) over the legs, w the mean net torque from the rest point. Gauss
             rules have 32 and 64 nodes. Energies agree at the switches and are positive. No random swing is faster
possible:    if the energy of each phase, a straight line over the angle, exceeds the potential at samples, some motion is found

A *swing* is a motion that first moves back by some angle, or overshoots the end. A *leg* is a motion between two rest points.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]
STRATA = ("nominal", "tiny", "limits", "on the edge", "turns")
SIZE = 1000
RULES = [np.polynomial.legendre.leggauss(k) for k in (32, 64)]
#: Number of random swings per problem and kind (back-swing, overshoot), none of which may be faster. If armlet does not certify its
#: optimum, the first swing turns at an angle from `turning_points`, if there is one.
SWINGS = 2
#: Number of angles, from 2 pi behind the start to the end, at which the test checks whether a swing can turn.
SAMPLES = 1000


def problems(stratum: str, rng: np.random.Generator) -> Array:
    """Problems (SIZE, 6): theta0, thetaf, inertia, gravity_moment, tau_max, tau_min."""
    theta0, thetaf = rng.uniform(-4.0, 4.0, (2, SIZE))
    inertia, G = 10.0 ** rng.uniform(-1.0, 1.0, SIZE), rng.uniform(-1.5, 1.5, SIZE)
    high, low = rng.uniform(0.1, 2.0, (2, SIZE))
    low = np.where(rng.random(SIZE) < 0.5, high, low)
    if stratum == "tiny":
        thetaf = theta0 + rng.choice([-1.0, 1.0], SIZE) * 10.0 ** rng.uniform(-16.0, -6.0, SIZE)
        thetaf = np.where(rng.random(SIZE) < 0.05, theta0, thetaf)
    if stratum == "limits":
        scale = 10.0 ** rng.uniform(-3.0, 8.0, (2, SIZE))
        high, low = high * scale[0], low * scale[1]
        G *= 10.0 ** rng.uniform(-3.0, 8.0, SIZE)
        inertia *= 10.0 ** rng.uniform(-3.0, 3.0, SIZE)
    if stratum == "on the edge":
        # Border cases, in which the torque can just hold the link or just not: ends at multiples of pi/4, limits equal to gravity.
        theta0, thetaf = (rng.integers(-4, 5, SIZE) * np.pi / 4 for _ in range(2))
        G = rng.choice([-1.0, 0.0, 1.0], SIZE)
        high, low = (1.0 + rng.choice([-1.0, 0.0, 1.0], SIZE) * 10.0 ** rng.uniform(-15.0, -1.0, SIZE) for _ in range(2))
    if stratum == "turns":
        theta0, thetaf = rng.uniform(-30.0, 30.0, (2, SIZE))
    return np.stack([theta0, thetaf, inertia, G, high, -low], axis=1)


def range_of_sine(a: Array, b: Array) -> tuple[Array, Array]:
    """Least and largest sine on [a, b]: at the ends, or at -pi/2 or pi/2 (mod 2 pi) inside."""
    ends = np.sin(a), np.sin(b)
    inside = [np.floor((b - at) / (2 * np.pi)) > np.floor((a - at) / (2 * np.pi)) for at in (-np.pi / 2, np.pi / 2)]
    return np.where(inside[0], -1.0, np.minimum(*ends)), np.where(inside[1], 1.0, np.maximum(*ends))


def judge_profiles(p: Array, _: np.random.Generator) -> tuple[Counter[str], list[tuple[int, str]]]:
    theta0, thetaf, inertia, G, high, low = p.T
    r = al.bang_bang_time(theta0, thetaf, inertia, G, high, tau_min=low)
    sign = np.where(thetaf >= theta0, 1.0, -1.0)
    x0, x1 = sign * theta0, sign * thetaf
    up, down = np.where(sign > 0, high, -low), np.where(sign > 0, -low, high)
    xm, D = x0 + 0.5 * (x1 - x0), np.abs(thetaf - theta0)
    scale = np.maximum(high, -low)
    # Possible effect of rounding of angles and sums on a bound.
    slack = 1e-12 * scale + 8e-16 * np.abs(G) * (1.0 + np.abs(x0) + np.abs(x1))
    (low1, high1), (low2, high2) = range_of_sine(x0, xm), range_of_sine(xm, x1)
    gravity = [pick(G * low, G * high) for low, high in ((low1, high1), (low2, high2)) for pick in (np.minimum, np.maximum)]
    failed: list[tuple[int, str]] = []

    def refuse(bad: Array, what: str) -> None:
        failed.extend((int(i), what) for i in np.flatnonzero(bad))

    moves = D > 0.0
    with np.errstate(all="ignore"):
        for name, t in (("t_min", r.t_min), ("t_max", r.t_max)):
            a = np.where(moves & np.isfinite(t), 4 * inertia * D / t**2, 0.0)
            most, least = np.maximum(gravity[1] + a, gravity[3] - a), np.minimum(gravity[0] + a, gravity[2] - a)
            allowed = slack + 4e-15 * a
            refuse(r.feasible & moves & ((most > up + allowed) | (least < -down - allowed)), f"a limit is broken at {name}")
            # A limit is reached: a slightly larger or smaller acceleration would exceed it.
            touched = np.maximum(most - up, -down - least) > -allowed - 1e-14 * np.abs(G)
            refuse(r.feasible & moves & np.isfinite(t) & ~touched, f"{name} is not the least or largest")
        a_max = np.minimum(up - gravity[1], gravity[2] + down)
        a_min = np.maximum(0.0, np.maximum(-down - gravity[0], gravity[3] - up))
        refuse(~r.feasible & moves & (a_max > slack) & (a_max > a_min + slack), "refused")
        held = np.maximum(G * np.sin(x0) - up, -down - G * np.sin(x0))
        refuse(~r.feasible & ~moves & (held < -slack), "holding refused")
        refuse(r.feasible & ~(np.isfinite(r.t_min) & (r.t_min >= 0.0) & (r.t_max >= r.t_min)), "no number")
    return Counter({"profiles feasible": int(r.feasible.sum()), "profiles not": int((~r.feasible).sum())}), failed


def leg(x: Array, L: Array, push: Array, G: Array) -> tuple[Array, Array, Array]:
    """Time divided by sqrt(I/2) of a leg from rest at `x` over the angle `L`, by two quadrature rules; and the least mean net torque."""
    times, least = [], np.full(x.shape, np.inf)
    for nodes, weights in RULES:
        y = L[:, None] * (0.5 * (nodes + 1.0)) ** 2
        w = push[:, None] - G[:, None] * np.sin(x[:, None] + 0.5 * y) * np.sinc(0.5 * y / np.pi)
        least = np.minimum(least, w.min(axis=1))
        times.append(np.sqrt(L) * (weights / np.sqrt(w)).sum(axis=1))
    return times[0], times[1], least


def monotone(x0: Array, x1: Array, G: Array, up: Array, down: Array) -> tuple[Array, Array, Array]:
    """The fastest monotone motion: time divided by sqrt(I/2), difference of two quadrature rules, margin (N m; negative if infeasible)."""
    D = x1 - x0
    work = 2 * G * np.sin(0.5 * (x0 + x1)) * np.sin(0.5 * D)
    there = (down * D + work) / (up + down)
    back = D - there
    margin = np.minimum(there, back) / D * (up + down)
    first, second = leg(x0, np.maximum(there, 0.0), up, G), leg(-x1, np.maximum(back, 0.0), down, G)
    # The first nodes are near the rest points but not on them. So the net torque at the rest points is checked here.
    rest = np.minimum(up - G * np.sin(x0), down + G * np.sin(x1))
    time = first[1] + second[1]
    return time, np.abs(first[0] - first[1]) + np.abs(second[0] - second[1]), np.minimum.reduce([margin, rest, first[2], second[2]])


def swing(x0: Array, x1: Array, G: Array, up: Array, down: Array, e: Array) -> tuple[Array, Array, Array]:
    """The three values of `monotone` for the motion that first moves back by the angle `e`."""
    away, towards = monotone(-x0, e - x0, G, down, up), monotone(x0 - e, x1, G, up, down)
    return away[0] + towards[0], away[1] + towards[1], np.minimum(away[2], towards[2])


def turning_points(x0: Array, x1: Array, G: Array, up: Array, down: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Angles back from the start, and whether a swing can certainly turn there. A margin covers maxima of energy between samples."""
    h = (x1 - x0 + 2 * np.pi)[:, None] / (SAMPLES - 1)
    x = x1[:, None] - h * np.arange(SAMPLES)
    e, V = x0[:, None] - x, -G[:, None] * np.cos(x)
    W = V - up[:, None] * x
    higher = np.full(x.shape, False)
    higher[:, 1:] = W[:, 1:] - np.maximum.accumulate(W, axis=1)[:, :-1] > 0.5 * np.abs(G)[:, None] * h**2
    for start in (x0, x1):
        way, cos = start[:, None] - x, np.cos(start)[:, None]
        above = down[:, None] * way - G[:, None] * cos - V > 0.5 * np.abs(G)[:, None] * np.minimum(way, h) * h
        higher &= np.logical_and.accumulate(above | (way <= 0.0), axis=1)
    return e, higher & (e > 0.0)


def judge_optima(p: Array, rng: np.random.Generator) -> tuple[Counter[str], list[tuple[int, str]]]:
    got = [al.torque_optimal_time(*row[:5], tau_min=row[5]) for row in p.tolist()]
    kinds = [o.best.kind for o in got]
    feasible, certified = np.array([o.feasible for o in got]), np.array([o.certified_global for o in got])
    t, best = np.array([o.t for o in got]), np.array([o.best.t for o in got])
    theta0, thetaf, inertia, G, high, low = p.T
    # If start and end are equal, the positive direction is against gravity.
    sign = np.where((thetaf > theta0) | ((thetaf == theta0) & (G * np.sin(theta0) >= 0.0)), 1.0, -1.0)
    x0, x1 = sign * theta0, sign * thetaf
    up, down = np.where(sign > 0, high, -low), np.where(sign > 0, -low, high)
    unit, scale = np.sqrt(0.5 * inertia), np.maximum(high, -low) + np.abs(G)
    turn = sign * np.array([o.best.theta_turn if k in ("back-swing", "overshoot") else np.nan for o, k in zip(got, kinds, strict=True)])
    failed: list[tuple[int, str]] = []
    tally: Counter[str] = Counter(kinds)

    def refuse(bad: Array, what: str) -> None:
        failed.extend((int(i), what) for i in np.flatnonzero(bad))

    moves = thetaf != theta0
    searched = np.flatnonzero(moves & ~certified)
    with np.errstate(all="ignore"):
        time, differ, margin = monotone(x0, x1, G, up, down)
        clear = moves & (margin > 1e-6 * scale) & (differ < 1e-11 * time)
        tally["monotone, checked"] = int(clear.sum())
        refuse(clear & ~feasible, "monotone refused")
        refuse(moves & feasible & (margin < -1e-9 * scale), "monotone is not possible")
        refuse(clear & feasible & ~(np.abs(t - unit * time) <= 1e-10 * t), "monotone time")
        refuse(~(best <= t * (1 + 1e-12)) & feasible, "best is slower than monotone")
        refuse(certified & ~np.array([k == "monotone" for k in kinds]), "certified but not monotone")
        refuse(feasible & ~np.isfinite(t), "no number")
        for kind in ("back-swing", "overshoot"):
            mine = np.array([k == kind for k in kinds])
            # An overshoot is the back-swing of the mirrored motion in reversed time.
            q0, q1, a, b = (x0, x1, up, down) if kind == "back-swing" else (-x1, -x0, down, up)
            e = q0 - (turn if kind == "back-swing" else -turn)
            time, differ, margin = swing(q0, q1, G, a, b, e)
            checked = mine & (differ < 1e-11 * time)
            tally[f"{kind}, checked"] = int(checked.sum())
            refuse(mine & ~(e > 0.0), f"{kind} without a turn")
            refuse(mine & (margin < -1e-9 * scale), f"{kind} is not possible")
            refuse(checked & ~(np.abs(best - unit * time) <= 1e-9 * best), f"{kind} time")
            ways, can = turning_points(*(part[searched] for part in (q0, q1, G, a, b)))
            found, some = np.array(kinds)[searched] != "none found", can.any(axis=1)
            tally[f"{kind} possible"] = int(some.sum())
            failed.extend((int(i), f"none found, though a {kind} is possible") for i in searched[some & ~found])
            for number in range(SWINGS):
                e = 10.0 ** rng.uniform(-3.0, 1.0, e.shape)
                if number == 0:
                    chosen = np.argmax(rng.random(can.shape) * can, axis=1)
                    e[searched[some]] = ways[some, chosen[some]]
                time, differ, margin = swing(q0, q1, G, a, b, e)
                had = moves & (margin > 1e-6 * scale) & (differ < 1e-11 * time)
                refuse(had & ~(best <= unit * time * (1 + 1e-9)), f"a {kind} by some angle is faster")
    return tally, failed


JUDGES = (judge_profiles, judge_optima)
