"""Timing of a path of a seven-axis arm: armlet beside toppra, on the same spline, limits and grid; answers compared first.

Run: `python -P benches/bench_time_path.py [--rounds 9] [--markdown]`
"""

from __future__ import annotations

import argparse
import logging
import sys
from pathlib import Path
from typing import Any

import numpy as np

import armlet as al

sys.path.insert(0, str(Path(__file__).parent))
from timing import Case, busy, cores, machine, markdown, measure, plain, rows

ARM = al.load_urdf(al.example_urdf("seven_axis"))
TAU_MAX = np.array([174.0, 174.0, 174.0, 174.0, 24.0, 24.0, 24.0])
KNOTS = np.linspace(0.0, 1.0, 5)
TARGETS = {101: 0.12, 1001: 0.95}


def ours(q: np.ndarray, points: int) -> al.TimedPath:
    # The grid asked for and no other, as toppra's.
    return al.time_path(ARM, q, tau_max=TAU_MAX, v_max=2.0, knots=KNOTS, grid=points, refine=False)


def theirs(q: np.ndarray, points: int) -> Any:
    """A function that times the path by toppra, the set-up of path and limits included, as in ours."""
    import toppra
    from toppra.algorithm import TOPPRA
    from toppra.constraint import DiscretizationType, JointTorqueConstraint, JointVelocityConstraint

    logging.getLogger("toppra").setLevel(logging.CRITICAL)
    grid = np.linspace(0.0, 1.0, points)

    def run() -> float:
        path = toppra.SplineInterpolator(KNOTS, q, bc_type="natural")
        torque = JointTorqueConstraint(
            lambda q, v, a: ARM.inverse_dynamics(q, v, a),
            np.stack([-TAU_MAX, TAU_MAX], axis=1),
            np.zeros(7),
            discretization_scheme=DiscretizationType.Interpolation,
        )
        speed = JointVelocityConstraint(np.stack([-np.full(7, 2.0), np.full(7, 2.0)], axis=1))
        s_dot = TOPPRA([torque, speed], path, gridpoints=grid, solver_wrapper="seidel").compute_parameterization(0.0, 0.0)[1]
        return float(np.sum(2 * np.diff(grid) / (s_dot[1:] + s_dot[:-1])))

    return run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--core", type=int, default=cores()[0])
    parser.add_argument("--markdown", action="store_true")
    options = parser.parse_args()
    share = busy()
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (5, 7))
    cases = []
    for points in TARGETS:
        p = ours(q, points)
        assert p.feasible and p.margin >= -1e-9, p.reason
        group = f"{points} grid points: ms per timing"
        mine = Case(group, f"armlet, {points}", lambda n=points: [ours(q, n) for _ in range(20)], per=20, unit="ms", scale=1e3)
        cases.append(mine)
        try:
            peer = theirs(q, points)
        except ImportError:
            print("toppra is not installed: left out")
            continue
        # Equal to the error of the grids: against toppra's finest here, at 100 points either may be two per cent off.
        assert abs(p.duration / theirs(q, 1001)() - 1.0) < (3e-2 if points < 1000 else 2e-3)
        cases.append(Case(group, f"toppra, {points}", peer, per=1, unit="ms", scale=1e3, against=mine.name))
    limits = {"tau_max": TAU_MAX, "v_max": 2.0, "knots": KNOTS}
    cases.append(Case("grid chosen by armlet: ms per timing", "armlet, settled", lambda: al.time_path(ARM, q, **limits), 1, "ms", 1e3))
    measure(cases, options.rounds, options.core, lambda text: None)
    facts = machine()
    print(f"{facts['cpu']}, {facts['cores']} cores, {facts['simd']}; other programs took {share:.0%} of them at the start.")
    for case in cases:
        points = next((n for n in TARGETS if case.name == f"armlet, {n}"), None)
        if points is not None:
            verdict = "met" if case.median <= TARGETS[points] else "missed"
            print(f"{case.name}: {case.median:.3g} ms, target {TARGETS[points]} ms: {verdict}; grid used: {len(ours(q, points).s)} points")
    print((markdown if options.markdown else plain)(rows(cases)))


if __name__ == "__main__":
    main()
