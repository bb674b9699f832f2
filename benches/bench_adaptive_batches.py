"""1,024 runs with adaptive steps in one call: time of armlet and heyoka.py at equal achieved errors, in one run.

    python -P benches/bench_adaptive_batches.py                  the table, and benches/results/adaptive_batches.json
    python -P benches/bench_adaptive_batches.py --readme         the table, written into benches/README.md

Every method runs with the largest tolerance that achieves the error. benches/README.md explains the comparison.
"""

from __future__ import annotations

import functools
import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parent))  # `python -P` does not add this folder
import reporting
import timing
from timing import Case

import armlet as al

Array = NDArray[np.float64]

HERE = Path(__file__).parent
RUNS, T_END = 1024, 2.0
ERRORS = (1e-6, 1e-9, 1e-12)
TOLERANCES = [10.0 ** (-k / 2) for k in range(6, 31)]
METHODS = ("dop853", "dopri5")
GENERATED, SYMBOLIC = "heyoka.py, generated expressions", "heyoka.py, arm.symbolic()"


def arms() -> dict[str, al.Arm]:
    planar = {f"planar {n}R": al.planar_arm([0.5] * n) for n in (2, 3, 4)}
    return planar | {name: al.load_urdf(al.example_urdf(file)) for name, file in (("six axes", "six_axis"), ("seven axes", "seven_axis"))}


def say(text: str) -> None:
    print(f"bench_adaptive_batches: {text}", file=sys.stderr, flush=True)


class Batch:
    """The runs of one arm: random initial states, and the reference of their final states. `peers` is the module `adaptive_batch_peers`."""

    def __init__(self, peers: Any, loop: Any) -> None:
        rng, n = np.random.default_rng(1), loop.arm.n
        self.peers, self.loop = peers, loop
        self.q0, self.v0 = loop.target + rng.uniform(-1.0, 1.0, (RUNS, n)), rng.uniform(-1.0, 1.0, (RUNS, n))
        self.starts = np.hstack([self.q0, self.v0])
        self.exact = peers.Taylor(loop.generated(), 1e-16, T_END).run(self.starts)
        off = float(np.abs(self.ours("dop853", 1e-15)() - self.exact).max())
        if not off <= 3e-13:
            raise SystemExit(f"bench_adaptive_batches: the references of armlet and heyoka.py differ by {off:.1e}")

    def ours(self, method: str, tolerance: float, threads: int = 1) -> Callable[[], Array]:
        """Final states (RUNS, 2 n) by armlet."""
        given: dict[str, Any] = {
            "t_end": T_END,
            "method": method,
            "rtol": tolerance,
            "atol": tolerance,
            "monitors": False,
            "threads": threads,
        }

        def run() -> Array:
            batch = al.simulate_batch(self.loop.plant, self.loop.law, self.q0, v0=self.v0, keep="final", **given)
            return np.concatenate([batch.q, batch.v], axis=-1)[:, -1]

        return run

    def theirs(self, system: list[tuple[Any, Any]], tolerance: float) -> Callable[[], Array]:
        """Final states (RUNS, 2 n) by heyoka.py."""
        method = self.peers.Taylor(system, tolerance, T_END)
        return lambda: np.asarray(method.run(self.starts))

    def achieving(self, error: float, of: Callable[[float], Callable[[], Array]]) -> tuple[Callable[[], Array], float, float] | None:
        """The run with the largest tolerance that achieves the error, with the tolerance and its error."""
        for tolerance in TOLERANCES:
            run = of(tolerance)
            found = float(np.abs(run() - self.exact).max())
            if found <= error:
                return run, tolerance, found
        return None


def cases_of(peers: Any, name: str, arm: al.Arm) -> tuple[list[Case], list[tuple[str, float, float]]]:
    """The cases of one arm, and the tolerance and the achieved error of each case."""
    loop = peers.Loop(arm)
    batch, cases, accuracies = Batch(peers, loop), [], []
    contenders: dict[str, Callable[[float], Callable[[], Array]]] = {}
    systems = {GENERATED: loop.generated()} | ({SYMBOLIC: loop.symbolic()} if arm.n <= 4 else {})
    for peer, system in systems.items():
        contenders[peer] = functools.partial(batch.theirs, system)
    for method in METHODS:
        contenders[f"armlet, {method}"] = functools.partial(batch.ours, method)
    for error in ERRORS:
        group = f"{name}, error {error:.0e}: ms per batch"
        for who, of in contenders.items():
            found = batch.achieving(error, of)
            if found is None:
                say(f"skipped: {who} does not achieve an error of {error:.0e}: {name}")
                continue
            run, tolerance, achieved = found
            case = f"{who}, {name}, {error:.0e}"
            say(f"tolerance {tolerance:.1e}, error {achieved:.1e}: {case}")
            accuracies.append((case, tolerance, achieved))
            yard = f"{GENERATED}, {name}, {error:.0e}"
            cases.append(Case(group, case, run, 1.0, unit="ms", scale=1e3, against=None if who == GENERATED else yard))
    return cases, accuracies


def targets(cases: list[Case]) -> list[tuple[str, str, str, bool]]:
    """The time of the fastest method of armlet divided by that of each right-hand side of heyoka.py."""
    by_name, lines = {case.name: case for case in cases}, []
    for error in ERRORS:
        for name in arms():
            ours = [by_name[key] for method in METHODS if (key := f"armlet, {method}, {name}, {error:.0e}") in by_name]
            for peer in (SYMBOLIC, GENERATED):
                theirs = by_name.get(f"{peer}, {name}, {error:.0e}")
                if ours and theirs:
                    value = min(timing.ratio(case, theirs) for case in ours)
                    lines.append((f"{name}, error {error:.0e} / {peer}", "<= 1.0", f"{value:.2f}", value <= 1.0))
    return lines


def main() -> None:
    parser = reporting.arguments("adaptive batches of armlet beside heyoka.py at equal achieved errors")
    parser.add_argument("--arms", nargs="+", default=list(arms()), help="names of arms")
    options = parser.parse_args()
    reporting.require_release("bench_adaptive_batches")
    peers = timing.if_there("heyoka.py", lambda: importlib.import_module("adaptive_batch_peers"), say)
    if peers is None:
        return
    busy = timing.busy()
    cases: list[Case] = []
    accuracies: list[tuple[str, float, float]] = []
    for name in options.arms:
        more, found = cases_of(peers, name, arms()[name])
        cases, accuracies = cases + more, accuracies + found
    timing.measure(cases, options.rounds, options.core, say)
    about = {"machine": timing.machine(), "busy": busy, "build": al.build_info(), "targets": targets(cases), "accuracies": accuracies}
    timing.save(HERE / "results" / "adaptive_batches.json", cases, about)
    text = reporting.report(cases, targets(cases), busy, options.markdown or options.readme)
    reporting.finish("adaptive_batches", text, options.readme)


if __name__ == "__main__":
    main()
