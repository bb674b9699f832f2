"""Error against time of the implicit methods on arms with elastic joints, along six tolerances.

    python -P benches/elastic_precision.py             the table
    python -P benches/elastic_precision.py --readme    the table, written into benches/README.md

The arms are the planar 2R arm of `elastic_peers.py` with three levels of stiffness, and an arm with seven elastic joints.
The error is the largest one of all joint and motor positions at the end of the run, rad.
"""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))  # `python -P` does not add this folder
import elastic_peers as peers
import reporting
import timing
from bench_elastic import loop

import armlet as al

METHODS = ("rodas4", "radau5")
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
#: Tolerance of the reference, and the ratio of the absolute to the relative tolerance of all runs.
FINE, ABSOLUTE = 1e-11, 1e-3
Run = Callable[[str, float], Any]


def planar(level: str, t_end: float) -> Run:
    plant, law = loop(level)
    given: dict[str, Any] = {"theta0": peers.Q0, "force": peers.FORCE, "t_end": t_end}
    return functools.partial(simulated, plant, law, peers.Q0, given)


def seven_axes(t_end: float, sample_time: float | None) -> Run:
    arm = al.load_urdf(al.example_urdf("seven_axis"))
    q0, frame = np.array([0.0, 0.6, 0.0, -1.4, 0.0, 0.9, 0.0]), arm.frame_names[-1]
    law = al.ElasticImpedance(arm, arm.position(q0, frame), 800.0, 90.0, 8e3, 0.8, 0.2, frame=frame)
    given: dict[str, Any] = {"force": [10.0, -5.0, 8.0], "t_end": t_end, "sample_time": sample_time}
    return functools.partial(simulated, al.ElasticArm(arm, 8e3, 0.8), law, q0, given)


def simulated(plant: Any, law: Any, q0: Any, given: dict[str, Any], method: str, rtol: float) -> Any:
    options: dict[str, Any] = {"method": method, "rtol": rtol, "atol": ABSOLUTE * rtol, "t_eval": [given["t_end"]], "monitors": False}
    return al.simulate(plant, law, q0, **given, **options)


def problems() -> dict[str, Run]:
    runs = {f"2R, {level}, {t:g} s": planar(level, t) for level in peers.LEVELS for t in (0.2, 2.0)}
    return runs | {"seven axes, 1 s": seven_axes(1.0, None), "seven axes, sampled at 1 ms, 0.3 s": seven_axes(0.3, 1e-3)}


def positions(run: Any) -> Any:
    return np.concatenate([run.q[-1], run.theta[-1]])


def measured(run: Run, rounds: int) -> dict[str, list[str]]:
    """For each method and tolerance: milliseconds, error and evaluations of the state rates."""
    exact = positions(run("radau5", FINE))
    cases = [(method, tolerance) for method in METHODS for tolerance in TOLERANCES]
    answers = {case: run(*case) for case in cases}
    least = dict.fromkeys(cases, np.inf)
    for _ in range(rounds):
        for case in cases:
            least[case] = min(least[case], timing.clocked(lambda case=case: run(*case))[1])
    cells: dict[str, list[str]] = {method: [] for method in METHODS}
    for case in cases:
        error = np.abs(positions(answers[case]) - exact).max()
        cells[case[0]].append(f"{1e3 * least[case]:.2f}, {error:.0e}, {answers[case].stats['evaluations']}")
    return cells


def main() -> None:
    options = reporting.arguments("implicit methods on elastic arms, along six tolerances").parse_args()
    reporting.require_release("elastic_precision")
    timing.pin([options.core])
    machine, busy = timing.machine(), timing.busy()
    lines = [
        f"{machine['cpu']}, {machine['cores']} cores, {machine['simd']}; other programs used {busy:.0%} of them at the start.",
        f"The smallest processor time of {options.rounds} interleaved rounds, ms; the error, rad; evaluations of the state rates.",
        "",
        "| arm | method | " + " | ".join(f"{tolerance:g}" for tolerance in TOLERANCES) + " |",
        "|---|---|" + "---:|" * len(TOLERANCES),
    ]
    for name, run in problems().items():
        lines += [f"| {name} | `{method}` | " + " | ".join(cells) + " |" for method, cells in measured(run, options.rounds).items()]
    reporting.finish("precision", "\n".join(lines), options.readme)


if __name__ == "__main__":
    main()
