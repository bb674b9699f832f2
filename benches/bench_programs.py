"""Loops as machine code, on arms of two to seven joints, a chain of 20 and a tree of 48 joints.

The times include the start of the run. Each loop is first interpreted and then compiled, and both results are compared.

    python -P benches/bench_programs.py              the table
    python -P benches/bench_programs.py --readme     the table, written into benches/README.md
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import armlet as al

sys.path.insert(0, str(Path(__file__).parent))
import reporting
import timing
from large_arms import branched, chain
from timing import Case

DT, ROWS = 1e-3, 256
PROGRAM, BATCH = 2000, 200
LONG = 20.0
ARMS = {
    "planar 2R": al.planar_arm([0.5] * 2),
    "planar 4R": al.planar_arm([0.5] * 4),
    "six axes": al.load_urdf(al.example_urdf("six_axis")),
    "seven axes": al.load_urdf(al.example_urdf("seven_axis")),
}
# Large arms, whose loops are timed with fixed steps only.
LARGE = {"chain of 20": chain(20), "tree of 48": branched(8, (4, 10))}


def laws(arm: al.Arm) -> dict[str, Any]:
    n, frame = arm.n, arm.frame_names[-1]
    motion = al.Sinusoid([0.1] * n, [0.2] * n, [1.0 + 0.1 * i for i in range(n)], [0.0] * n)
    inertia = np.diag(arm.mass_matrix(np.full(n, 0.1)))
    target = arm.position(np.full(n, 0.1), frame)[:2]
    return {
        "computed torque": al.ComputedTorque(arm, motion, kp=50.0, kd=10.0),
        "PD": al.PDGravity(arm, np.full(n, 0.1), kp=50.0 * inertia, kd=10.0 * inertia),
        "adaptive": al.Adaptive(arm, motion, kp=50.0 * inertia, kd=10.0 * inertia, gamma=0.01 * float(inertia.min())),
        "impedance": al.CartesianImpedance(arm, target, [300.0, 300.0], [60.0, 60.0], frame=frame, axes="xy"),
    }


def loops() -> Iterator[tuple[str, al.RigidArm, Any]]:
    for name, arm in ARMS.items():
        for law, made in laws(arm).items():
            yield f"{name}, {law}", al.RigidArm(arm), made


def large_loops() -> Iterator[tuple[str, al.RigidArm, Any]]:
    """Loops with computed torque and with an adaptive law that starts at the true parameters.

    The gains are stable at this step for the lightest joint.
    """
    for name, arm in LARGE.items():
        n = arm.n
        motion = al.Sinusoid([0.1] * n, [0.2] * n, [1.0 + 0.02 * i for i in range(n)], [0.0] * n)
        least = float(np.linalg.eigvalsh(arm.mass_matrix(np.full(n, 0.1))).min())
        gains: dict[str, Any] = {"kp": 50.0 * least, "kd": 10.0 * least, "gamma": 0.01 * least}
        yield f"{name}, computed torque", al.RigidArm(arm), al.ComputedTorque(arm, motion, kp=50.0, kd=10.0)
        yield f"{name}, adaptive", al.RigidArm(arm), al.Adaptive(arm, motion, **gains, estimate=arm.parameters)


def require_equal(name: str, plant: al.RigidArm, law: Any) -> None:
    """Assert that machine code and the interpreter agree after 18 steps. The last step of a run may differ from `dt` by rounding."""
    q0 = np.full(plant.arm.n, 0.15)
    interpreted = al.simulate(plant, law, q0, t_end=0.018, dt=DT, record_every=18, monitors=False)
    program = al.simulate(plant, law, q0, t_end=0.18, dt=DT, record_every=18, monitors=False)
    assert (interpreted.stats["engine"], program.stats["engine"]) == ("interpreter", al.build_info()["programs"]), name
    assert np.abs(program.q[1] - interpreted.q[1]).max() < 1e-11, name


def cases_of(name: str, plant: al.RigidArm, law: Any) -> list[Case]:
    q0 = np.full(plant.arm.n, 0.15)
    rows = q0 + np.linspace(0.0, 0.01, ROWS)[:, None]

    def one(steps: int) -> Any:
        return al.simulate(plant, law, q0, t_end=steps * DT, dt=DT, monitors=False, record_every=steps)

    def batch(steps: int) -> Any:
        return al.simulate_batch(plant, law, rows, t_end=steps * DT, dt=DT, monitors=False, keep="final", threads=1)

    alone, many = f"{name}: ns per step of one run", f"{name}: ns per run and step, {ROWS} runs"
    return [
        Case(alone, f"program, {name}", lambda: one(PROGRAM), PROGRAM),
        Case(many, f"program in lanes, {name}", lambda: batch(BATCH), BATCH * ROWS),
        Case(many, f"one run, {name}", lambda: one(PROGRAM), PROGRAM, against=f"program in lanes, {name}"),
    ]


def free_cases(name: str, plant: al.Plant, law: Any, method: str) -> list[Case]:
    q0 = np.full(plant.arm.n, 0.15)

    def one(t_end: float) -> Any:
        return al.simulate(plant, law, q0, t_end=t_end, method=method, rtol=1e-7, atol=1e-9, t_eval=[t_end], monitors=False)

    group = f"{name}, {method}: ns per evaluation of one run"
    return [Case(group, f"program, {name}, {method}", lambda: one(LONG), one(LONG).stats["evaluations"])]


def free_loops() -> Iterator[list[Case]]:
    for name, plant, law in loops():
        if name.endswith(("computed torque", "adaptive")):
            yield free_cases(name, plant, law, "dop853")
        if name.endswith("computed torque"):
            yield free_cases(name, plant, law, "rodas4")


def main() -> None:
    options = reporting.arguments("loops as machine code").parse_args()
    reporting.require_release("bench_programs")
    share = timing.busy()
    cases: list[Case] = []
    for name, plant, law in [*loops(), *large_loops()]:
        require_equal(name, plant, law)
        cases += cases_of(name, plant, law)
    for more in free_loops():
        cases += more
    timing.measure(cases, options.rounds, options.core, lambda text: None)
    reporting.finish("programs", reporting.report(cases, [], share, options.markdown or options.readme), options.readme)


if __name__ == "__main__":
    main()
