"""Minimum time of one link: the symmetric profile, in single calls and in a batch, and the torque optimum, certified or by a search.

python -P benches/bench_mintime.py              the table
python -P benches/bench_mintime.py --readme     the table, written into benches/README.md
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

import armlet as al

sys.path.insert(0, str(Path(__file__).parent))
import mintime_kernel
import reporting
import timing
from timing import Case

COUNT = 200_000


def problems() -> list[np.ndarray]:
    """Arrays theta0, thetaf, inertia, gravity_moment, tau_max, tau_min.

    Torque limits are from 1/15 to 4/3 of the largest gravity moment.
    """
    rng = np.random.default_rng(0)
    high, low = rng.uniform(0.1, 2.0, (2, COUNT))
    return [*rng.uniform(-4.0, 4.0, (2, COUNT)), 10.0 ** rng.uniform(-1.0, 1.0, COUNT), rng.uniform(-1.5, 1.5, COUNT), high, -low]


def main() -> None:
    options = reporting.arguments("armlet's minimum-time planners of one link").parse_args()
    reporting.require_release("bench_mintime")
    share = timing.busy()
    *five, low = problems()
    batch = al.bang_bang_time(*five, tau_min=low)
    rows = np.stack([*five, low], axis=1).tolist()
    singles = [al.bang_bang_time(*row[:5], tau_min=row[5]) for row in rows[:1000]]
    np.testing.assert_array_equal(
        [(r.feasible, r.t_min, r.t_max) for r in singles], np.stack([batch.feasible, batch.t_min, batch.t_max], axis=1)[:1000]
    )
    optima = [(row, al.torque_optimal_time(*row[:5], tau_min=row[5])) for row in rows[:1500]]
    certified = [row for row, o in optima if o.certified_global][:400]
    searched = [row for row, o in optima if not o.certified_global][:400]
    few = rows[:1000]
    # Problems with friction: viscous damping of one tenth of the critical value, Coulomb friction of one tenth of the torque limit.
    rough = [[*row, 0.2 * (row[2] * abs(row[3])) ** 0.5, 0.1 * row[4]] for row in rows[:100]]

    def each(planner: Any, some: list[list[float]]) -> Any:
        return lambda: [planner(a, b, i, g, high, tau_min=low) for a, b, i, g, high, low in some]

    def with_friction() -> list[Any]:
        return [al.torque_optimal_time(*row[:5], tau_min=row[5], viscous=row[6], coulomb=row[7]) for row in rough]

    one, many, optimum = "bang_bang_time: ns", "bang_bang_time in batch: ns per problem", "torque_optimal_time: us"
    cases = [
        Case(one, "one call", each(al.bang_bang_time, few), per=len(few)),
        Case(many, "arrays of 200,000", lambda: al.bang_bang_time(*five, tau_min=low), per=COUNT),
        Case(optimum, "certified", each(al.torque_optimal_time, certified), per=len(certified), unit="us", scale=1e6),
        Case(optimum, "swings searched", each(al.torque_optimal_time, searched), per=len(searched), unit="us", scale=1e6),
        Case(optimum, "mixture of both", each(al.torque_optimal_time, few), per=len(few), unit="us", scale=1e6),
        Case(optimum, "with friction", with_friction, per=len(rough), unit="us", scale=1e6),
    ]
    in_c = mintime_kernel.in_c([*five, low])
    np.testing.assert_allclose(in_c(), [batch.t_min, batch.t_max, batch.a_min, batch.a_max], rtol=1e-9, atol=1e-12)
    cases.insert(1, Case(many, "C by hand", in_c, per=COUNT))
    cases[2].against = "C by hand"
    timing.measure(cases, options.rounds, options.core, lambda text: None)
    goals = [("one call", 500.0, "ns"), ("arrays of 200,000", 20.0, "ns")]
    goals += [(name, 3.0, "us") for name in ("certified", "swings searched", "mixture of both")]
    got = {case.name: case.median for case in cases}
    verdicts = [(name, f"<= {goal:g} {unit}", f"{got[name]:.3g} {unit}", got[name] <= goal) for name, goal, unit in goals]
    found = got["arrays of 200,000"] / got["C by hand"]
    verdicts.append(("arrays of 200,000 / C by hand", "<= 1.5", f"{found:.2f}", found <= 1.5))
    reporting.finish("mintime", reporting.report(cases, verdicts, share, options.markdown or options.readme), options.readme)


if __name__ == "__main__":
    main()
