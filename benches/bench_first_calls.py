"""First calls of a new structure: simulations of 10, 20 and 1,000 steps, `law(t, q, v)` and `mass_matrix`.

armlet records a loop when it first runs, and compiles it to a *program* if that repays. So the first call with a new arm takes longer than
later calls. Every figure is the processor time of one call in a fresh process. A loop of another arm, a pendulum, runs before in this
process, so that the figure has no cost of the start of the process.

    python -P benches/bench_first_calls.py               the table
    python -P benches/bench_first_calls.py --readme      the table, written into benches/README.md
    python -P benches/bench_first_calls.py --rounds 5    fewer processes per figure
"""

from __future__ import annotations

import statistics
import subprocess
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
from large_arms import branched, chain

DT = 1e-3
ARMS: dict[str, Callable[[], al.Arm]] = {
    "planar 2R": lambda: al.planar_arm([0.5] * 2),
    "six axes": lambda: al.load_urdf(al.example_urdf("six_axis")),
    "seven axes": lambda: al.load_urdf(al.example_urdf("seven_axis")),
    "chain of 20": lambda: chain(20),
    "tree of 48": lambda: branched(8, (4, 10)),
}


def law(arm: al.Arm) -> al.ComputedTorque:
    n = arm.n
    motion = al.Sinusoid([0.1] * n, [0.2] * n, [1.0 + 0.02 * i for i in range(n)], [0.0] * n)
    return al.ComputedTorque(arm, motion, kp=50.0, kd=10.0)


def simulated(steps: int) -> Callable[[al.Arm], Callable[[], Any]]:
    """Return a function that prepares a run of this many steps of an arm with computed torque."""

    def prepared(arm: al.Arm) -> Callable[[], Any]:
        plant, made, q0 = al.RigidArm(arm), law(arm), np.full(arm.n, 0.15)
        return lambda: al.simulate(plant, made, q0, t_end=steps * DT, dt=DT, monitors=False, record_every=steps)

    return prepared


def law_called(arm: al.Arm) -> Callable[[], Any]:
    made, q, v = law(arm), np.full(arm.n, 0.15), np.zeros(arm.n)
    return lambda: made(0.1, q, v)


def mass_matrix(arm: al.Arm) -> Callable[[], Any]:
    q = np.full(arm.n, 0.15)
    return lambda: arm.mass_matrix(q)


CALLS: dict[str, Callable[[al.Arm], Callable[[], Any]]] = {
    "10 steps": simulated(10),
    "20 steps": simulated(20),
    "1,000 steps": simulated(1000),
    "law(t, q, v)": law_called,
    "mass_matrix": mass_matrix,
}


def first_call(arm: str, call: str) -> float:
    """Processor time of the first call in this process, s."""
    pendulum = al.pendulum(2.0, 5.0)
    for prepared in CALLS.values():
        prepared(pendulum)()
    run = CALLS[call](ARMS[arm]())
    start = time.process_time()
    run()
    return time.process_time() - start


def measured(arm: str, call: str) -> float:
    """Run this file in a fresh process, which measures one first call. Processor time, s."""
    done = subprocess.run([sys.executable, "-P", __file__, "--one", arm, call], capture_output=True, text=True, check=True)
    return float(done.stdout)


def table(rounds: int) -> list[str]:
    """The medians in ms as lines of Markdown. Every round measures every figure once."""
    pairs = [(arm, call) for arm in ARMS for call in CALLS]
    times: dict[tuple[str, str], list[float]] = {pair: [] for pair in pairs}
    for _ in range(rounds):
        for pair in pairs:
            times[pair].append(measured(*pair))
    lines = ["| ms | " + " | ".join(CALLS) + " |", "|---|" + "---:|" * len(CALLS)]
    return lines + [f"| {arm} | " + " | ".join(f"{1e3 * statistics.median(times[arm, call]):.3g}" for call in CALLS) + " |" for arm in ARMS]


def main() -> None:
    if sys.argv[1:2] == ["--one"]:
        print(first_call(*sys.argv[2:4]))
        return
    options = reporting.arguments("first calls of a new structure").parse_args()
    reporting.require_release("bench_first_calls")
    machine, info, share = timing.machine(), al.build_info(), timing.busy()
    head = (
        f"{machine['cpu']}, {machine['cores']} cores, {machine['simd']}; other programs used {share:.0%} of them at the start. "
        f"armlet {info['version']}, {info['profile']} build. Medians of {options.rounds} fresh processes per figure."
    )
    reporting.finish("first_calls", "\n".join([head, "", *table(options.rounds)]), options.readme)


if __name__ == "__main__":
    main()
