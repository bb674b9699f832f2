"""System 4: one link under gravity, minimum time rest to rest under a torque limit.

    I theta_ddot + G sin theta = tau,   |tau| <= tau_max,   theta from -pi/2 to pi/2 in the exam of `armlet demo`

The checks compare armlet with these results of the theory. The symmetric bang-bang profile has constant acceleration and then the opposite
acceleration. For this motion, its shortest duration is T = sqrt(4 pi I / tau_max) for every G <= 2 tau_max. For larger G no T is feasible.
The fastest monotone motion under full torque is shorter, and its advantage grows with gravity. If it is not certified as the global optimum
(`certified_global`), a motion that swings back first or overshoots can be faster.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

import armlet as al

from ..figures.minimum_time import MinimumTime
from . import pictures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .report import Report

TITLE = "System 4: minimum time of one link under gravity, rest to rest"

START, END = -math.pi / 2, math.pi / 2
# For each G / tau_max: the shortest duration of the profile divided by the duration of the fastest monotone motion. The values have the
# digits of the exam's corrected solution.
RATIOS = {0.5: 1.2084, 1.0: 1.3853, 2.0: 1.6837}
# Tolerance: a few rounding errors of square roots and quotients of order one.
ROUNDING = 4e-15


def run(report: Report) -> None:
    profile(report)
    impossible(report)
    erratum(report)
    optimum(report)
    swings(report)
    from_mass(report)
    opposition(report)
    report.draw_figure("exam_figures", draw)
    report.figure("mintime", MinimumTime(START, END, 1.0, 1.5, 1.0))


def profile(report: Report) -> None:
    """Check the motion from -pi/2 to pi/2: it is feasible iff G <= 2 tau_max, and then its shortest T does not depend on G."""
    rng = np.random.default_rng(40)
    inertia, tau_max = 10.0 ** rng.uniform(-2.0, 2.0, (2, 10_000))
    ratio = rng.uniform(0.0, 2.0, 10_000)
    r = al.bang_bang_time(START, END, inertia, ratio * tau_max, tau_max)
    report.equal("exam motion, 10000 random links with G <= 2 tau_max: feasible", 10_000, int(r.feasible.sum()))
    t_min = np.sqrt(4 * np.pi * inertia / tau_max)
    report.bound("T_min / sqrt(4 pi I / tau_max) - 1, largest", np.abs(r.t_min / t_min - 1).max(), ROUNDING)
    heavy = ratio > 1.001
    t_max = np.sqrt(4 * np.pi * inertia[heavy] / ((ratio[heavy] - 1) * tau_max[heavy]))
    # At G = 1.001 tau_max the difference G - tau_max loses three digits.
    report.bound("T_max / sqrt(4 pi I / (G - tau_max)) - 1 where G > tau_max, largest", np.abs(r.t_max[heavy] / t_max - 1).max(), 1e-12)
    report.equal("T_max is infinite where G <= tau_max", True, bool(np.isinf(r.t_max[ratio <= 1.0]).all()))
    one = al.bang_bang_time(START, END, 1.0, 1.5, 1.0)
    report.near("the limit decides T_min at (rad)", 0.0, one.active_upper.theta, 0.0)
    u = np.linspace(0.0, 1.0, 4001)
    q = np.where(u < 0.5, START + 2 * np.pi * u**2, END - 2 * np.pi * (1 - u) ** 2)
    tau = np.where(u < 0.5, 1.0, -1.0) * 4 * np.pi / one.t_min**2 + 1.5 * np.sin(q)
    report.near("largest |tau| along that motion, G = 1.5 tau_max", 1.0, np.abs(tau).max(), 1e-12)


def impossible(report: Report) -> None:
    """Check that no duration is feasible for G > 2 tau_max, and the reported missing torque for G = 2.5 tau_max."""
    ratio = 2.0 + np.geomspace(1e-9, 1e3, 1000)
    r = al.bang_bang_time(START, END, 1.0, ratio, 1.0)
    report.equal("1000 links with G > 2 tau_max: number of feasible links", 0, int(r.feasible.sum()))
    report.equal("1000 links with G > 2 tau_max: all shortest durations are NaN", True, bool(np.isnan(r.t_min).all()))
    one = al.bang_bang_time(START, END, 1.0, 2.5, 1.0)
    report.near("G = 2.5 tau_max, torque missing on both limits (N m)", 0.25, (one.a_min - one.a_max) / 2, ROUNDING)
    report.equal("G = 2.5 tau_max: the reason names this torque", True, "2.500000e-1 N m are missing" in one.reason)
    report.equal("G = 2.5 N m: feasible with a limit of 1.25 N m", True, al.bang_bang_time(START, END, 1.0, 2.5, 1.25).feasible)
    report.equal("G = 2.5 tau_max: the link can rest at the start or at the end", False, one.hold_start or one.hold_end)


def erratum(report: Report) -> None:
    """Erratum E13: the largest torque is max(I A, |G - I A|), with the acceleration A of the profile.

    In a slow motion of a heavy link the second term is larger.
    """
    r = al.bang_bang_time(START, END, 1.0, 1.5, 1.0)
    for a in (0.6, 0.9):
        t = math.sqrt(4 * math.pi / a)
        largest = max(abs(tau) for tau in r.torques(t))
        printed, name = (f"I A = {a:g}", "E13") if a < 0.75 else ("", "")
        report.near(f"max |tau| at I A = {a:g}, G = 1.5: max(I A, |G - I A|)", max(a, 1.5 - a), largest, 2e-15, printed, name)


def optimum(report: Report) -> None:
    """Check the fastest monotone motion from -pi/2 to pi/2, and that it is certified as the global optimum for G = tau_max."""
    ratios = {g: al.bang_bang_time(START, END, 1.0, g, 1.0).t_min / al.torque_optimal_time(START, END, 1.0, g, 1.0).t for g in RATIOS}
    # The tolerance is half a unit of the last printed digit.
    report.near("T_profile / T_optimum at G / tau_max = 0.5, 1, 2", tuple(RATIOS.values()), tuple(ratios.values()), 5e-5)
    o = al.torque_optimal_time(START, END, 1.0, 1.0, 1.0)
    report.equal("certified as the global optimum at G / tau_max = 1", True, o.certified_global)
    t = np.nextafter(o.t, 0.0)
    q, v, _, _ = o.profile(t)
    report.near("optimal motion just before its end: theta, theta_dot", (END, 0.0), (q, v), 1e-12)
    before, after = np.array(o.profile(np.nextafter(o.t_switch, 0.0))), np.array(o.profile(o.t_switch))
    # The phases of full torque before and after the switch are integrated from opposite ends of the motion.
    report.bound("optimal motion at the switch of the torque: jump of theta, theta_dot", np.abs(after - before)[:2].max(), 1e-12)
    report.near("optimal torque before and after its switch: tau_max, -tau_max", (1.0, -1.0), (before[3], after[3]), 0.0)


def swings(report: Report) -> None:
    """Check motions that swing back first or overshoot, where the fastest monotone motion is not certified as the global optimum."""
    o = al.torque_optimal_time(math.pi / 2, 3.0, 1.0, 1.0, 1.02)
    report.equal("pi/2 -> 3 at tau_max = 1.02 G: certified", False, o.certified_global)
    report.near("pi/2 -> 3 at tau_max = 1.02 G: duration of the monotone motion (s)", 8.419, o.t, 5e-4)
    report.near(f"pi/2 -> 3 at tau_max = 1.02 G: shortest duration (s), {o.best.kind}", 5.702, o.best.t, 5e-4)
    report.equal("pi/2 -> 3 at tau_max = 1.02 G: family of the fastest motion", "back-swing", o.best.kind)
    back = al.torque_optimal_time(3.0, math.pi / 2, 1.0, 1.0, 1.02)
    report.equal("3 -> pi/2 at tau_max = 1.02 G: family of the fastest motion", "overshoot", back.best.kind)
    report.bound("duration of 3 -> pi/2 minus duration of pi/2 -> 3 (s)", back.best.t - o.best.t, 1e-9)
    weak = al.torque_optimal_time(math.pi / 2, math.pi, 1.0, 1.0, 0.9)
    report.equal("pi/2 -> pi at tau_max = 0.9 G: a monotone motion is feasible", False, weak.feasible)
    report.equal("pi/2 -> pi at tau_max = 0.9 G: family of the fastest motion", "back-swing", weak.best.kind)


def from_mass(report: Report) -> None:
    """Check I = I_c + m d^2 and G = m g0 d. The link has mass m, its centre of mass at d, and inertia I_c about this centre."""
    m, d, I_c = 3.0, 0.25, 0.06
    link = al.planar_arm([0.5], masses=[m], coms=[d], inertias=[I_c])
    # The exam measures angles from the downward vertical, the arm from the x axis.
    theta = np.linspace(-3.0, 3.0, 25)[:, None]
    q, zeros = theta - math.pi / 2, np.zeros((25, 1))
    inertia = float(link.mass_matrix([0.0])[0, 0])
    report.near("link of 3 kg, d = 0.25 m, I_c = 0.06 kg m^2: I = I_c + m d^2 (kg m^2)", I_c + m * d**2, inertia, 1e-15)
    # G is 7.4 N m, and the tolerance is a few rounding errors of this value.
    report.bound(
        "link of 3 kg: gravity torque minus G sin theta, G = m g0 d, largest (N m)",
        np.abs(link.gravity(q) - m * 9.81 * d * np.sin(theta)).max(),
        1e-14,
    )
    same = al.pendulum(I_c + m * d**2, m * 9.81 * d)
    a = np.linspace(-5.0, 5.0, 25)[:, None]
    difference = link.inverse_dynamics(q, zeros, a) - same.inverse_dynamics(theta, zeros, a)
    report.bound("link of 3 kg: torque minus the torque of al.pendulum(I, G), largest (N m)", np.abs(difference).max(), 1e-13)


def opposes(start: float, end: float) -> bool:
    """Whether gravity torque and inertial torque never have equal signs along the symmetric bang-bang profile."""
    motion = al.BangBang([start], [end], 1.0)
    t = np.linspace(0.0, 1.0, 2002)[:-1]
    states = [motion(x) for x in t]
    product = np.array([a[0] * math.sin(q[0]) for q, _, a in states])
    # Where the motion crosses the vertical, the sine is zero up to rounding.
    return bool(product.max() < 1e-9)


def opposition(report: Report) -> None:
    """Check for which motions gravity opposes the inertial torque at every instant.

    These are the motions that are symmetric about the downward vertical and at most 2 pi long.
    """
    report.equal("from -pi/2 to pi/2: gravity always opposes the inertial torque", True, opposes(START, END))
    report.equal("from 0 to pi/2: gravity always opposes the inertial torque", False, opposes(0.0, END))
    report.equal("from pi/2 to 3 pi/2, through the top: gravity always opposes the inertial torque", False, opposes(END, 3 * END))
    rng = np.random.default_rng(44)
    halves = rng.uniform(0.1, 2.0 * math.pi, 50)
    turns = 2.0 * math.pi * rng.integers(-1, 2, 50)
    answers = [opposes(turn - half, turn + half) == (half <= math.pi) for half, turn in zip(halves, turns, strict=True)]
    report.equal(
        "50 motions symmetric about the downward vertical: gravity always opposes iff the motion is at most 2 pi long", 50, sum(answers)
    )
    others = [
        opposes(turn - half + shift, turn + half + shift)
        for half, turn, shift in zip(halves, turns, rng.uniform(0.2, 6.0, 50), strict=True)
    ]
    report.equal("50 motions symmetric about other angles: number with gravity that always opposes", 0, sum(others))


def draw(figure: Figure) -> None:
    figure.set_size_inches(9.0, 6.0)
    figure.set_layout_engine("constrained")
    pictures.exam_figures(figure)
