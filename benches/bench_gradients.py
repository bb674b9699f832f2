"""Gradients of runs of a seven-axis arm under adaptive control: their time as a multiple of the time of one run.

python -P benches/bench_gradients.py              the table
python -P benches/bench_gradients.py --readme     the table, written into benches/README.md
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import armlet as al

sys.path.insert(0, str(Path(__file__).parent))
import reporting
import timing

ARM = al.load_urdf(al.example_urdf("seven_axis"))
TERMS: tuple[Any, ...] = (al.Quintic(np.zeros(7), np.full(7, 0.5), 1.0), np.full(7, 40.0), np.full(7, 20.0), np.full(70, 0.2))
LAW = al.Adaptive(ARM, *TERMS)
#: A law whose loop has another recorded code: leakage of the estimate is on.
LEAKING = al.Adaptive(ARM, *TERMS, leakage=0.1)
PLANT, Q0 = al.RigidArm(ARM), np.zeros(7)
OPTIONS: dict[str, Any] = {"t_end": 2.0, "dt": 1e-3, "monitors": False}
#: Options of the batch: 16 initial positions, one thread, every hundredth step recorded.
STARTS = np.random.default_rng(0).uniform(-0.3, 0.3, (16, 7))
ROWS: dict[str, Any] = OPTIONS | {"threads": 1, "check_limits": False, "record_every": 100}


def seconds(work: Callable[[], object]) -> float:
    """The shortest of five times, after one untimed call in which armlet compiles the loop to machine code."""
    work()
    times = []
    for _ in range(5):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


def main() -> None:
    options = reporting.arguments("armlet's gradients of runs").parse_args()
    reporting.require_release("bench_gradients")
    share = timing.busy()
    run = seconds(lambda: al.simulate(PLANT, LAW, Q0, **OPTIONS))
    cases: dict[str, Callable[[], object]] = {
        "tangents, 7 parameters (kp)": lambda: al.simulate(PLANT, LAW, Q0, sensitivity="law.kp", **OPTIONS),
        "tangents, 14 parameters (kp, kd)": lambda: al.simulate(PLANT, LAW, Q0, sensitivity=["law.kp", "law.kd"], **OPTIONS),
        "tangents, 70 parameters (estimate)": lambda: al.simulate(PLANT, LAW, Q0, sensitivity="law.estimate", **OPTIONS),
        "adjoint, 7 parameters (kp)": lambda: al.gradient("error_rms", PLANT, LAW, Q0, "law.kp", **OPTIONS),
        "adjoint, 70 parameters (estimate)": lambda: al.gradient("error_rms", PLANT, LAW, Q0, "law.estimate", **OPTIONS),
        "adjoint, 70 parameters, 1 MiB": lambda: al.gradient("error_rms", PLANT, LAW, Q0, "law.estimate", memory=1 << 20, **OPTIONS),
    }
    lines = ["| computation | time | time / run |", "|---|---:|---:|", f"| run of 2000 steps | {1e3 * run:.1f} ms | 1 |"]
    for name, work in cases.items():
        took = seconds(work)
        lines.append(f"| {name} | {1e3 * took:.1f} ms | {took / run:.1f} |")
        print(lines[-1], flush=True)
    rows = seconds(lambda: al.simulate_batch(PLANT, LAW, STARTS, **ROWS))
    lines.append(f"| batch of 16 runs, one thread | {1e3 * rows:.1f} ms | 1 batch |")
    took = seconds(lambda: al.simulate_batch(PLANT, LAW, STARTS, sensitivity="law.kp", **ROWS))
    batches = took / rows
    lines.append(f"| its tangents, 7 parameters (kp) | {1e3 * took:.1f} ms | {batches:.1f} batches, {batches / 7:.1f} per parameter |")
    laws = [LAW, LEAKING] * (len(STARTS) // 2)
    mixed = seconds(lambda: al.simulate_batch(PLANT, laws, STARTS, sensitivity="law.kp", **ROWS))
    lines.append(f"| its tangents with two structures, 7 parameters (kp) | {1e3 * mixed:.1f} ms | {mixed / rows:.1f} batches |")
    print("\n".join(lines[-3:]), flush=True)
    machine = timing.machine()
    head = f"{machine['cpu']}, {machine['cores']} cores, {machine['simd']}; other programs used {share:.0%} of them. Minimum of 5 rounds."
    reporting.finish("gradients", "\n".join([head, "", *lines]), options.readme)


if __name__ == "__main__":
    main()
