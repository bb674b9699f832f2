"""Tuning of the 84 gains of a seven-axis adaptive law: number of runs until the gradient method reaches the cost of differential evolution.

python -P benches/bench_tune.py              the table
python -P benches/bench_tune.py --readme     the table, written into benches/README.md
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

import armlet as al

sys.path.insert(0, str(Path(__file__).parent))
import reporting
import timing

START, END = [0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0], [0.5, 0.6, -0.4, -1.6, 0.5, 1.4, 0.4]
SCENARIO = al.Scenario(
    {
        "arm": {"kind": "urdf", "path": str(al.example_urdf("seven_axis"))},
        "motion": {"kind": "Quintic", "q0": START, "q1": END, "duration": 0.8},
        "law": {"kind": "Adaptive", "kp": [60.0] * 7, "kd": [12.0] * 7, "gamma": [0.5] * 70},
        "run": {"q0": [0.1, *START[1:]], "t_end": 1.2, "dt": 2e-3},
    }
)
RANGES = {"kp": (7, 10.0, 120.0), "kd": (7, 4.0, 30.0), "gamma": (70, 0.05, 5.0)}
VARY = {f"law.{name}[{i}]": {"log_uniform": [low, high]} for name, (size, low, high) in RANGES.items() for i in range(size)}
CANDIDATES, GENERATIONS = 84, 60


def loss(table: al.SweepTable) -> Any:
    return sum(table[f"error_rms{i + 1}"] ** 2 for i in range(7))


def seconds(work: Any) -> tuple[Any, float]:
    began = time.perf_counter()
    return work(), time.perf_counter() - began


def main() -> None:
    options = reporting.arguments("armlet's search along the gradient").parse_args()
    reporting.require_release("bench_tune")
    share = timing.busy()
    SCENARIO.run()
    _, run = min((seconds(SCENARIO.run) for _ in range(5)), key=lambda pair: pair[1])
    evolved, long = seconds(lambda: al.tune(SCENARIO, VARY, loss, candidates=CANDIDATES, generations=GENERATIONS, tolerance=0.0, threads=1))
    found, short = seconds(lambda: al.tune(SCENARIO, VARY, "error_rms", method="gradient", starts=1, generations=40))
    as_good = np.flatnonzero(found.tried["cost"] <= evolved.cost)
    enough = int(as_good[0]) + 1 if len(as_good) else len(found.tried["cost"])
    # One evaluation of the gradient method is a run and its adjoint. `each` is its time, in multiples of the time of a run.
    each = short / found.runs / run
    rows = [
        ("gains of the scenario", 1, found.tried["cost"][0], run),
        (f"differential evolution, {CANDIDATES} candidates", evolved.runs, evolved.cost, long),
        ("gradients, until the loss is equal", enough, found.tried["cost"][:enough].min(), short * enough / found.runs),
        ("gradients, complete search", found.runs, found.cost, short),
    ]
    lines = ["| search | evaluations | loss (rad^2) | time |", "|---|---:|---:|---:|"]
    lines += [f"| {name} | {count} | {value:.4g} | {took:.2f} s |" for name, count, value, took in rows]
    part = evolved.runs / (enough * each)
    lines += [
        "",
        f"An evaluation of the loss and its gradient takes {each:.1f} runs. The search with gradients reaches the loss of differential "
        f"evolution after one {part:.0f}th of its runs.",
    ]
    machine = timing.machine()
    head = f"{machine['cpu']}, {machine['cores']} cores, {machine['simd']}; other programs used {share:.0%} of them at the start."
    reporting.finish("tune", "\n".join([head, "", *lines]), options.readme)


if __name__ == "__main__":
    main()
