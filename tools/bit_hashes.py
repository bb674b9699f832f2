"""Hashes of the bits that armlet computes, per instruction set, in tests/vectors/bit_hashes.json.

    python tools/bit_hashes.py            # prints the differences from the file; exit code 1 if there are any
    python tools/bit_hashes.py --write    # rewrites the file, after a change that is meant to change results

A hash is the start of a SHA-256 over the little-endian bytes of all arrays of a case. On one instruction set, equal inputs give equal bits
for every number of threads, chunk size and order of rows. Different builds also agree, because Rust neither fuses nor reorders
floating-point operations. The C library's sine and similar functions may differ between systems. So the file contains a fingerprint of
these functions, and is compared only on systems with this fingerprint.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import armlet as al

FILE = Path(__file__).resolve().parents[1] / "tests" / "vectors" / "bit_hashes.json"
SETS = ("baseline", "avx2", "avx512")
ROWS = 37
RNG = np.random.default_rng(2022)

PR = al.planar_pr(2.0, 0.5, 0.5)
TWO = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0])
FOUR = al.planar_arm([1.0, 1.0, 0.25, 0.25])
SEVEN = al.load_urdf(al.example_urdf("seven_axis"))
SINE = al.Sinusoid([0.0, 0.3], [0.5, 0.8], [1.0, 1.7], [0.0, 0.4])
QUINTIC = al.Quintic(np.zeros(7), np.linspace(0.2, 0.8, 7), 0.1)
ADAPTIVE = al.Adaptive(PR, SINE, [40.0, 20.0], [20.0, 10.0], 5.0)
ELASTIC = al.ElasticArm(TWO, 800.0, 0.4)
SPRING = al.ElasticImpedance(TWO, [0.6, 0.4], [300.0, 200.0], [40.0, 30.0], 800.0, 0.4, 0.1, frame="link2", axes="xy")
WALL = al.Wall("link2", point=[0.75, 0.0, 0.0], normal=[-1.0, 0.0, 0.0], stiffness=1e4, damping=50.0)
PRESS = al.CartesianImpedance(TWO, [0.8, 0.2], [300.0, 300.0], [40.0, 40.0], frame="link2", axes="xy")
TASKS = [al.Task("link4", "xy", [1.2, 1.0], 5.0), al.Task("link2", "xy", [0.9, 0.8], 5.0)]
POSE = [al.Task("tcp", "xyz", [0.4, 0.2, 0.5], 40.0), al.Task("tcp", "rx ry rz", [0.1, 3.0, 0.2], 40.0)]
CLOCK = al.Sampling(5e-3, delay=2e-3, jitter=1e-3, noise={"q": 1e-3, "v": 1e-2}, resolution={"q": 1e-4}, seed=3)


@dataclass(frozen=True)
class Batch:
    """Loops that `simulate_batch` runs as one batch."""

    plant: al.Plant
    law: al.Law
    options: dict[str, Any]

    def run(self, threads: int | None, chunk: int, order: np.ndarray) -> list[np.ndarray]:
        n = self.plant.arm.n
        q0, v0 = START[:, :n], START[:, 7 : 7 + n]
        seeded = isinstance(self.options.get("sample_time"), al.Sampling)
        if seeded:
            order = np.arange(ROWS)  # the seed of a row depends on its index, so the order must not change
        parts: list[list[np.ndarray]] = []
        for first in range(0, ROWS, chunk):
            rows = order[first : first + chunk]
            own = dict(self.options)
            if seeded:
                own["sample_time"] = replace(CLOCK, seed=CLOCK.seed + first)
            if not isinstance(self.plant, al.VelocityArm):
                own["v0"] = v0[rows]
            batch = al.simulate_batch(self.plant, self.law, q0[rows], threads=threads, **own)
            named = [getattr(batch, name) for name in ("q", "v", "tau", "estimate", "theta", "theta_dot")]
            parts.append([each for each in named if each is not None] + [batch.monitors[name] for name in sorted(batch.monitors)])
        back = np.argsort(order)
        return [np.concatenate(same)[back] for same in zip(*parts, strict=True)]


START = np.concatenate([RNG.uniform(-1.0, 1.0, (ROWS, 7)), RNG.uniform(-0.5, 0.5, (ROWS, 7))], axis=1)
FIXED: dict[str, Any] = {"t_end": 0.1, "dt": 2e-3, "record_every": 10}
# This run has enough steps to be compiled to a program.
PROGRAM: dict[str, Any] = {"t_end": 0.12, "dt": 1e-3, "record_every": 40}
FREE: dict[str, Any] = {"t_end": 0.1, "t_eval": [0.0, 0.05, 0.1]}
LONG: dict[str, Any] = {"t_end": 2.0, "t_eval": [1.0, 2.0]}
BATCHES = {
    "pr adaptive rk4": Batch(al.RigidArm(PR), ADAPTIVE, FIXED),
    "pr adaptive euler": Batch(al.RigidArm(PR), ADAPTIVE, FIXED | {"method": "euler"}),
    "pr adaptive dop853": Batch(al.RigidArm(PR), ADAPTIVE, FREE | {"method": "dop853"}),
    "pr adaptive sampled": Batch(al.RigidArm(PR), ADAPTIVE, FIXED | {"sample_time": 4e-3, "tau_max": [6.0, 3.0]}),
    "pr adaptive noisy": Batch(al.RigidArm(PR), ADAPTIVE, FIXED | {"dt": 1e-3, "sample_time": CLOCK}),
    "2R adaptive rk4": Batch(al.RigidArm(TWO), al.Adaptive(TWO, SINE, 40.0, 20.0, 0.5), FIXED),
    "2R wall dopri5": Batch(al.RigidArm(TWO, wall=WALL), PRESS, FREE | {"method": "dopri5"}),
    "2R wall radau5": Batch(al.RigidArm(TWO, wall=WALL), PRESS, FREE | {"method": "radau5"}),
    "7 axes computed torque rk4": Batch(al.RigidArm(SEVEN, friction=True), al.ComputedTorque(SEVEN, QUINTIC, 100.0, 20.0), FIXED),
    "7 axes semi-implicit": Batch(al.RigidArm(SEVEN), al.PDGravity(SEVEN, np.zeros(7), 50.0, 20.0), FIXED | {"method": "semi_implicit"}),
    "2R adaptive program": Batch(al.RigidArm(TWO), al.Adaptive(TWO, SINE, 40.0, 20.0, 0.5), PROGRAM),
    "2R adaptive dop853 program": Batch(al.RigidArm(TWO), al.Adaptive(TWO, SINE, 40.0, 20.0, 0.5), LONG | {"method": "dop853"}),
    "2R adaptive rodas4 program": Batch(al.RigidArm(TWO), al.Adaptive(TWO, SINE, 40.0, 20.0, 0.5), LONG | {"method": "rodas4"}),
    "7 axes computed torque program": Batch(al.RigidArm(SEVEN, friction=True), al.ComputedTorque(SEVEN, QUINTIC, 100.0, 20.0), PROGRAM),
    "7 axes sampled program": Batch(
        al.RigidArm(SEVEN), al.PDGravity(SEVEN, np.zeros(7), 50.0, 20.0), PROGRAM | {"method": "semi_implicit", "sample_time": 2e-3}
    ),
    "elastic rk4": Batch(ELASTIC, SPRING, FIXED | {"dt": 5e-4}),
    "elastic ros2": Batch(ELASTIC, SPRING, FIXED | {"method": "ros2"}),
    "elastic rodas4": Batch(ELASTIC, SPRING, FREE | {"method": "rodas4"}),
    "4R priority velocity": Batch(al.VelocityArm(FOUR), al.PriorityVelocity(FOUR, TASKS), FIXED | {"dt": 1e-2}),
    "4R priority acceleration": Batch(
        al.RigidArm(FOUR), al.PriorityAcceleration(FOUR, [al.Task("link4", "xy", [1.2, 1.0], 100.0)]), FIXED | {"sample_time": 1e-2}
    ),
    "4R priority velocity program": Batch(al.VelocityArm(FOUR), al.PriorityVelocity(FOUR, TASKS), PROGRAM),
    "7 axes priority acceleration program": Batch(al.RigidArm(SEVEN), al.PriorityAcceleration(SEVEN, POSE), PROGRAM),
    "2R wall program": Batch(al.RigidArm(TWO, wall=WALL), PRESS, PROGRAM),
}


def one_run(plant: al.Plant, law: al.Law, **options: Any) -> list[np.ndarray]:
    run = al.simulate(plant, law, START[0, : plant.arm.n], **options)
    return [run.q, run.v, run.tau, *(run.monitors[name] for name in sorted(run.monitors))]


def functions() -> dict[str, list[np.ndarray]]:
    """Results of functions that have no choice of threads and chunks, or choose them automatically."""
    q, v = START[:, :7], START[:, 7:]
    a = v[::-1].copy()
    tau = SEVEN.inverse_dynamics(q, v, a)
    jacobians = [SEVEN.jacobian(q, "tcp")[:, :3], SEVEN.jacobian(q, "tcp")[:, 3:]]
    wanted = [v[:, :3], v[:, 3:6]]
    solved = [al.solve_priority(jacobians, wanted, method=method) for method in ("exact", "clamp", "damped", "chiaverini")]
    timed = al.time_path(TWO, START[:4, :2], tau_max=[60.0, 30.0])
    profile = al.bang_bang_time(START[:, 0], START[:, 1], 1.0, 5.0, 8.0)
    reached = [al.inverse_kinematics(FOUR, TASKS[:1], start).q for start in START[:8, :4]]
    return {
        "pr one run": one_run(al.RigidArm(PR), ADAPTIVE, t_end=0.2, dt=1e-3),
        "7 axes one run program": one_run(al.RigidArm(SEVEN), al.ComputedTorque(SEVEN, QUINTIC, 100.0, 20.0), **PROGRAM),
        "7 axes one run dop853": one_run(al.RigidArm(SEVEN), al.ComputedTorque(SEVEN, QUINTIC, 100.0, 20.0), t_end=0.1, method="dop853"),
        "elastic one run radau5": one_run(ELASTIC, SPRING, t_end=0.1, method="radau5"),
        "kinematics": [SEVEN.pose(q, "tcp"), SEVEN.jacobian(q, "tcp"), SEVEN.jacobian_dot(q, v, "tcp"), SEVEN.center_of_mass(q)],
        "dynamics": [SEVEN.mass_matrix(q), SEVEN.coriolis_matrix(q, v), SEVEN.bias(q, v), tau, SEVEN.forward_dynamics(q, v, tau)],
        "regressor": [SEVEN.regressor(q, v, v, a)],
        "derivatives": [*SEVEN.inverse_dynamics_derivatives(q, v, a), *SEVEN.linearize(q, v, tau)],
        "base parameters": [SEVEN.base_parameters().projection],
        "priority": [part for solution in solved for part in (solution.v, *solution.residuals)],
        "inverse kinematics": reached,
        "bang-bang": [profile.t_min, profile.t_max],
        "time path": [np.array([part for t in np.linspace(0.0, timed.duration, 20) for part in timed(t)])],
    }


def digest(arrays: Iterable[Any]) -> str:
    """The hash of values, shapes and order of arrays. All NaNs count as equal."""
    whole = hashlib.sha256()
    for array in arrays:
        values = np.ascontiguousarray(array, dtype="<f8")
        whole.update(str(values.shape).encode() + np.where(np.isnan(values), np.nan, values).tobytes())
    return whole.hexdigest()[:24]


def libm() -> str:
    """A fingerprint of the C library's functions, evaluated at large and small arguments."""
    x = np.random.default_rng(7).uniform(-1.0, 1.0, 500)
    names: list[Callable[[float], float]] = [math.sin, math.cos, math.tan, math.exp, math.atan, math.asin, math.acos, math.cbrt]
    values = [[f(float(t)) for t in x] for f in names] + [[f(1e3 * float(t)) for t in x] for f in names[:3]]
    values += [[math.log(2.0 + float(t)) for t in x], [(2.0 + float(t)) ** 0.2 for t in x], [math.atan2(float(t), 0.3) for t in x]]
    return digest([np.array(values)])


IN_ORDER, BACKWARDS = np.arange(ROWS), np.arange(ROWS)[::-1]
SHUFFLED = np.random.default_rng(32).permutation(ROWS)
#: For each kind of call: number of threads, rows per call, order of the rows.
WAYS: dict[str, tuple[int | None, int, np.ndarray]] = {
    "as it is": (1, ROWS, IN_ORDER),
    **{f"{threads} threads": (threads, ROWS, IN_ORDER) for threads in (2, 3, 5, 8)},
    **{f"{chunk} rows at a time": (2, chunk, IN_ORDER) for chunk in (1, 5, 16)},
    "backwards": (3, ROWS, BACKWARDS),
    "shuffled, 8 rows at a time": (5, 8, SHUFFLED),
}


def here(ways: Iterable[str]) -> dict[str, Any]:
    """The hashes of this process, computed with its instruction set."""
    fixed = {name: digest(arrays) for name, arrays in functions().items()}
    batches = {way: {name: digest(batch.run(*WAYS[way])) for name, batch in BATCHES.items()} for way in ways}
    info = al.build_info()
    return {"set": info["instruction_set"], "programs": info["programs"], "libm": libm(), "functions": fixed, "batches": batches}


def of(name: str, all_ways: bool, **environment: str) -> dict[str, Any]:
    """The hashes of a child process that uses the instruction set `name`. `environment`: variables of this process."""
    command = [sys.executable, "-P", __file__, "--child", "all" if all_ways else "one"]
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | environment | {"ARMLET_ISA": name}, check=False)
    if done.returncode:
        raise SystemExit(f"bit_hashes: the process for {name} failed:\n{done.stderr}")
    found: dict[str, Any] = json.loads(done.stdout)
    if found["set"] != name:
        raise SystemExit(f"bit_hashes: expected the instruction set {name}, got {found['set']}")
    return found


def available() -> list[str]:
    """The instruction sets that this processor supports."""
    return list(SETS[: SETS.index(al.build_info()["best_instruction_set"]) + 1])


def flat(found: dict[str, Any]) -> dict[str, str]:
    """The hash of each case, for batches in one call on one thread."""
    return dict(sorted((found["functions"] | found["batches"]["as it is"]).items()))


def differences(stored: dict[str, Any], found: dict[str, Any]) -> list[str]:
    """Differences from the file on one instruction set. There are none to report if the fingerprints of the C libraries differ."""
    if stored["libm"] != found["libm"]:
        return []
    old, new, name = stored["sets"].get(found["set"], {}), flat(found), found["set"]
    changed = [case for case in old.keys() & new.keys() if old[case] != new[case]]
    return sorted(
        [f"{name}: {case}: the bits changed" for case in changed]
        + [f"{name}: {case}: is not in the file" for case in new.keys() - old.keys()]
        + [f"{name}: {case}: is in the file alone" for case in old.keys() - new.keys()]
    )


ADVICE = "if results were meant to change, remake the hashes: python tools/bit_hashes.py --write"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="make the file anew")
    parser.add_argument("--child", choices=("one", "all"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        print(json.dumps(here(WAYS if arguments.child == "all" else ["as it is"])))
        return 0
    found = {name: of(name, False) for name in available()}
    if arguments.write:
        if "avx2" not in found:
            raise SystemExit("bit_hashes: this processor lacks AVX2: the file is for all instruction sets")
        # AVX-512 and AVX2 give equal bits in all cases. A processor with AVX-512 checks this.
        sets = {name: flat(found.get(name, found["avx2"])) for name in SETS}
        FILE.write_text(json.dumps({"libm": libm(), "sets": sets}, indent=1) + "\n")
        print(f"wrote {FILE}")
        return 0
    stored = json.loads(FILE.read_text())
    if stored["libm"] != libm():
        print("the C library's functions differ from those of the file: nothing to compare")
    wrong = [line for each in found.values() for line in differences(stored, each)]
    print("\n".join([*wrong, ADVICE] if wrong else [f"the bits of {', '.join(found)} are those of the file"]))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
