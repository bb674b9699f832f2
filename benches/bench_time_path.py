"""Time parametrisation of a path of a seven-axis arm by armlet and toppra, with equal spline, limits and grid. Results are compared first.

python -P benches/bench_time_path.py              the table
python -P benches/bench_time_path.py --readme     the table, written into benches/README.md
"""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from typing import Any

import numpy as np

import armlet as al

sys.path.insert(0, str(Path(__file__).parent))
import reporting
import timing
from timing import Case

ARM = al.load_urdf(al.example_urdf("seven_axis"))
TAU_MAX = np.array([174.0, 174.0, 174.0, 174.0, 24.0, 24.0, 24.0])
KNOTS = np.linspace(0.0, 1.0, 5)
TARGETS = {101: 0.12, 1001: 0.95}


def ours(q: np.ndarray, points: int) -> al.TimedPath:
    # `refine=False` keeps exactly this grid, as toppra does.
    return al.time_path(ARM, q, tau_max=TAU_MAX, v_max=2.0, knots=KNOTS, grid=points, refine=False)


def theirs(q: np.ndarray, points: int) -> Any:
    """A function that times the path by toppra. As in `ours`, its time includes the construction of the path and the limits."""
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
    options = reporting.arguments("armlet's timing of paths beside toppra").parse_args()
    reporting.require_release("bench_time_path")
    share = timing.busy()
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
        # The durations agree up to the grid errors. Compared with toppra's finest grid, a grid of 100 points may err by 2 %.
        assert abs(p.duration / theirs(q, 1001)() - 1.0) < (3e-2 if points < 1000 else 2e-3)
        cases.append(Case(group, f"toppra, {points}", peer, per=1, unit="ms", scale=1e3, against=mine.name))
    limits = {"tau_max": TAU_MAX, "v_max": 2.0, "knots": KNOTS}
    cases.append(Case("automatic grid: ms per timing", "armlet, automatic grid", lambda: al.time_path(ARM, q, **limits), 1, "ms", 1e3))
    timing.measure(cases, options.rounds, options.core, lambda text: None)
    by_name = {case.name: case.median for case in cases}
    goals = [(f"{n} grid points", f"<= {goal:g} ms", by_name[f"armlet, {n}"], goal) for n, goal in TARGETS.items()]
    verdicts = [(what, shown, f"{got:.3g} ms", got <= goal) for what, shown, got, goal in goals]
    reporting.finish("time_path", reporting.report(cases, verdicts, share, options.markdown or options.readme), options.readme)


if __name__ == "__main__":
    main()
