"""armlet's runs that `bench_adaptive.py` times. Each is a callable that returns the final state: (7,) of one run, (RUNS, 7) of a batch.

`python adaptive_cases.py` is also a worker process that answers one command per line. armlet selects its instruction set once per
process, from `ARMLET_ISA`. So each forced instruction set has one worker process, and every worker takes part in every round.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))  # `python -P` does not add this folder
import adaptive_peers as peers

import armlet as al


def final(run: Any) -> Any:
    return np.concatenate([run.q[..., -1, :], run.v[..., -1, :], run.estimate[..., -1, :]], axis=-1)


def sinusoid() -> Any:
    return al.Sinusoid([0.0, 0.0], [0.5, 0.8], [1.0, 2.0], [0.0, 0.0])


def tabulated(steps: int) -> Any:
    return al.Table(peers.H / 2, *peers.desired(np.arange(2 * steps + 1) * (peers.H / 2)))


def single(motion: Any, full: bool = False, **options: Any) -> Callable[[], Any]:
    arm = al.planar_pr(*peers.PLANT)
    gains = (peers.FULL_KP, peers.FULL_KD, peers.FULL_GAMMA) if full else (peers.KP, peers.KD, peers.GAMMA)
    law, plant = al.Adaptive(arm, motion, *gains), al.RigidArm(arm)
    options = {"dt": peers.H, "record_every": peers.STEPS, "monitors": False} | options
    return lambda: final(al.simulate(plant, law, peers.Q0, t_end=peers.T, **options))


def adaptive_method(rtol: float, atol: float) -> Callable[[], Any]:
    return single(sinusoid(), method="dop853", dt=None, t_eval=[peers.T], record_every=1, rtol=rtol, atol=atol)


def batch(threads: int, steps: int = peers.BATCH_STEPS, motion: Any = None, **options: Any) -> Callable[[], Any]:
    parameters, q0 = peers.batch_inputs()
    law = al.Adaptive(al.planar_pr(*peers.PLANT), motion or tabulated(steps), peers.KP, peers.KD, peers.GAMMA)
    plants = [al.RigidArm(al.planar_pr(*row)) for row in parameters]
    chosen: dict[str, Any] = {"dt": peers.H, "monitors": False, "keep": "final"} | options

    def run() -> Any:
        done = al.simulate_batch(plants, law, q0, t_end=steps * peers.H, threads=threads, **chosen)
        return done if chosen["keep"] == "all" else final(done)

    return run


def calls(count: int) -> list[tuple[str, Callable[[], None]]]:
    """Calls from Python with arrays (n,), `count` in a row. The empty loop takes less than 20 ns per call."""
    q, v, a = np.array([0.3, -0.4]), np.array([0.5, 0.6]), np.array([-0.7, 0.8])
    pr = al.planar_pr(*peers.PLANT)
    law = al.Adaptive(pr, sinusoid(), peers.KP, peers.KD, peers.GAMMA)
    six = al.load_urdf(al.example_urdf("six_axis"))
    zero = np.zeros(6)

    def repeat(function: Callable[..., Any], *arguments: Any) -> Callable[[], None]:
        def loop() -> None:
            for _ in range(count):
                function(*arguments)

        return loop

    return [
        ("np.negative(q), for comparison", repeat(np.negative, q)),
        ("arm.mass_matrix(q), PR", repeat(pr.mass_matrix, q)),
        ("arm.inverse_dynamics(q, v, a), PR", repeat(pr.inverse_dynamics, q, v, a)),
        ("law(t, q, v), Adaptive, PR", repeat(law, 0.5, q, v)),
        ("arm.inverse_dynamics(q, v, a), six axes", repeat(six.inverse_dynamics, zero, zero, zero)),
    ]


def rows_of_calls(count: int) -> list[tuple[str, Callable[[], Any]]]:
    """The computing time of the functions of `calls` without the cost of a Python call: one call computes `count` rows."""
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (count, 6))
    pr, six = al.planar_pr(*peers.PLANT), al.load_urdf(al.example_urdf("six_axis"))
    two, mass, torque, torques = np.ascontiguousarray(q[:, :2]), np.empty((count, 2, 2)), np.empty((count, 2)), np.empty((count, 6))
    return [
        ("mass_matrix per row of a batch, PR", lambda: pr.mass_matrix(two, out=mass)),
        ("inverse_dynamics per row of a batch, PR", lambda: pr.inverse_dynamics(two, two, two, out=torque)),
        ("inverse_dynamics per row of a batch, six axes", lambda: six.inverse_dynamics(q, q, q, out=torques)),
    ]


IMPORT = "import time, numpy; w, p = time.perf_counter(), time.process_time(); import armlet; "
IMPORT += "print(time.perf_counter() - w, time.process_time() - p)"


def import_seconds() -> tuple[float, float]:
    """Wall and processor seconds of `import armlet` in a fresh process that has already imported numpy."""
    wall, processor = subprocess.run([sys.executable, "-P", "-c", IMPORT], check=True, capture_output=True, text=True).stdout.split()
    return float(wall), float(processor)


class Route:
    """A worker process that runs with one forced instruction set (`ARMLET_ISA`)."""

    def __init__(self, isa: str) -> None:
        self._worker = subprocess.Popen(
            [sys.executable, "-P", __file__], env=os.environ | {"ARMLET_ISA": isa}, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        if self.ask("isa") != isa:
            raise RuntimeError(f"ARMLET_ISA={isa} gives {self.ask('isa')}")

    def ask(self, what: str, core: int = -1) -> Any:
        assert self._worker.stdin is not None and self._worker.stdout is not None
        self._worker.stdin.write(f"{what} {core}\n")
        self._worker.stdin.flush()
        answer = self._worker.stdout.readline()
        if not answer:
            raise RuntimeError("the worker ended")
        return json.loads(answer)

    def close(self) -> None:
        if self._worker.stdin is not None:
            self._worker.stdin.close()
        self._worker.wait()


def work() -> None:
    import timing

    runs = {"single": single(tabulated(peers.STEPS)), "batch": batch(1)}
    for line in sys.stdin:
        what, core = line.split()
        if int(core) >= 0:
            timing.pin([int(core)])
        answer: Any = None
        if what == "isa":
            answer = al.build_info()["instruction_set"]
        elif what.startswith("state:"):
            answer = runs[what.removeprefix("state:")]().tolist()
        else:
            answer = timing.clocked(runs[what])
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    work()
