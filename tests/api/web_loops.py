"""Loops of web pages for tests, and the same steps as on a page, with wasmtime instead of a browser.

As a program, this file computes all loops with `armlet.simulate`, and saves their records and the data of their pages:
`python web_loops.py records.npz pages.json`.
"""

from __future__ import annotations

import ctypes
import json
import math
import sys
import warnings
from base64 import b64decode
from collections.abc import Callable
from typing import Any, TypeAlias

import models
import numpy as np
from numpy.typing import NDArray

import armlet as al
from armlet.web.export import page_data

Array: TypeAlias = NDArray[np.float64]

STEPS = 300
FOUR = al.planar_arm([1.0, 1.0, 0.25, 0.25])
PR, TWO, SEVEN = models.PR, models.TWO_LINKS, models.SEVEN_AXES
#: A position within the limits of all joints.
START = np.array([0.3, 0.5, -0.2, -0.9, 0.4, 1.6, 0.2])
BENT = [0.9, -1.2, 0.6, 0.7]
STIFF, MOTOR = [800.0, 500.0], [0.4, 0.25]


def quintic() -> al.Quintic:
    """A motion that ends within the run."""
    return al.Quintic([0.0, 0.0], [1.0, 1.5], 0.2)


#: For each loop: a plant, a law, and the options of its run.
LOOPS: dict[str, Callable[[], tuple[Any, Any, dict[str, Any]]]] = {
    "PR adaptive": lambda: (al.RigidArm(PR), al.Adaptive(PR, quintic(), 40.0, 20.0, 5.0), {"q0": [0.1, -0.2]}),
    "2R computed torque": lambda: (
        al.RigidArm(TWO),
        al.ComputedTorque(TWO, al.Sinusoid([0.2, 0.1], [[0.3], [0.4]], [[2.0], [3.0]], [[0.0], [0.5]]), 100.0, 20.0),
        {"q0": [0.3, 0.1], "v0": [0.5, -0.5], "tau_max": [9.0, 4.0]},
    ),
    "2R elastic": lambda: (
        al.ElasticArm(TWO, STIFF, MOTOR),
        al.JointImpedance(TWO, [0.3, 1.0], 50.0, [4.0, 2.0], STIFF, MOTOR, [0.02, 0.0125]),
        {"q0": [0.0, 0.5], "dt": 5e-4},
    ),
    "pendulum sampled": lambda: (
        al.RigidArm(al.pendulum(2.0, 9.0)),
        al.PDGravity(al.pendulum(1.9, 8.5), [1.0], 60.0, 15.0),
        {"q0": [0.2], "sample_time": 4e-3},
    ),
    "7R impedance": lambda: (
        al.RigidArm(SEVEN),
        al.CartesianImpedance(SEVEN, [0.4, 0.1, 0.7], 300.0, 40.0, frame=SEVEN.tip_frame, nullspace=al.NullSpace(START, 20.0, 5.0)),
        {"q0": START},
    ),
    # The second target is out of reach of the stretched links 3 and 4: the loop ends at a singularity of the stack.
    "4R priority": lambda: (al.VelocityArm(FOUR), al.PriorityVelocity(FOUR, far_tasks(30.0), eps=0.05), {"q0": BENT}),
    "4R damped priority": lambda: (al.VelocityArm(FOUR), al.PriorityVelocity(FOUR, far_tasks(30.0), "damped"), {"q0": BENT}),
    "4R priority of accelerations": lambda: (
        al.RigidArm(FOUR),
        al.PriorityAcceleration(FOUR, [al.Task("link4", "xy", [1.8, 0.85], 100.0), al.Task("link2", "xy", [1.5, 0.6], 100.0)]),
        {"q0": BENT, "sample_time": 2e-3},
    ),
    # Three rows have no closed form, and the arm is far from a singularity.
    "7R priority": lambda: (
        al.VelocityArm(SEVEN),
        al.PriorityVelocity(SEVEN, [tip_task(), al.PostureTask(START, 1.0)], limits=False),
        {"q0": START},
    ),
    # The integral part drives the joint through several changes between sticking and sliding.
    "2R stick-slip": lambda: (
        al.RigidArm(TWO, friction=al.StickSlip(coulomb=[2.0, 1.0], static=[4.0, 1.5], stribeck_speed=0.05, viscous=0.3, load_ratio=0.05)),
        al.PID(TWO, al.Sinusoid([0.2, 0.1], [[0.1], [0.1]], [[20.0], [30.0]], [[0.0], [0.5]]), 100.0, 50.0, 10.0),
        {"q0": [0.2, 0.1], "v0": [0.0, -0.5]},
    ),
    "2R elastic stick-slip, sampled": lambda: (
        al.ElasticArm(TWO, STIFF, MOTOR, motor_friction=al.StickSlip(coulomb=1.0, static=2.0)),
        al.MotorPD(TWO, quintic(), 60.0, [6.0, 3.0], STIFF),
        {"q0": [0.0, 0.0], "dt": 5e-4, "sample_time": 2e-3},
    ),
    "pendulum with delays": lambda: (
        al.RigidArm(al.pendulum(2.0, 9.0)),
        al.PDGravity(al.pendulum(1.9, 8.5), [1.0], 60.0, 15.0),
        {"q0": [0.2], "sample_time": al.Sampling(4e-3, delay=7e-3, sensor_delay=2, rate_limit=3000.0)},
    ),
    "2R with encoders": lambda: (
        al.RigidArm(TWO),
        al.PDGravity(TWO, [0.4, 0.9], 60.0, [12.0, 6.0]),
        {"q0": [0.0, -0.1], "sample_time": al.Sampling(2e-3, resolution={"q": 1e-3, "v": 0.02})},
    ),
    "PR adaptive with a limited rate": lambda: (
        al.RigidArm(PR),
        al.Adaptive(PR, quintic(), 40.0, 20.0, 5.0),
        {"q0": [0.1, -0.2], "sample_time": al.Sampling(2e-3, rate_limit=500.0)},
    ),
    "7R impedance with a delay": lambda: (
        al.RigidArm(SEVEN),
        al.CartesianImpedance(SEVEN, [0.4, 0.1, 0.7], 300.0, 40.0, frame=SEVEN.tip_frame, nullspace=al.NullSpace(START, 20.0, 5.0)),
        {"q0": START, "sample_time": al.Sampling(2e-3, delay=3e-3)},
    ),
    "2R elastic pushed": lambda: (
        al.ElasticArm(TWO, STIFF, MOTOR),
        al.JointImpedance(TWO, [0.3, 1.0], 50.0, [4.0, 2.0], STIFF, MOTOR, [0.02, 0.0125]),
        {"q0": [0.0, 0.5], "dt": 5e-4, "force": [4.0, -3.0, 0.0], "force_frame": TWO.tip_frame},
    ),
}


def tip_task() -> al.Task:
    return al.Task(SEVEN.tip_frame, "xyz", [0.4, 0.1, 0.7], 2.0)


def far_tasks(gain: float) -> list[Any]:
    """The tip first, and the end of link 2 second, whose target is more than 0.5 m from that of the tip."""
    return [al.Task("link4", "xy", [1.2, 0.9], gain), al.Task("link2", "xy", [1.9, 0.3], gain)]


def run(name: str) -> Any:
    """The run of a loop with a record at each step. Its last step, whose size differs by a rounding error, is not compared."""
    plant, law, options = LOOPS[name]()
    return al.simulate(plant, law, t_end=(STEPS + 1) * options.get("dt", 1e-3), **{"dt": 1e-3, **options})


def page(name: str, controls: Any = None) -> dict[str, Any]:
    """The data of the page of a loop."""
    plant, law, options = LOOPS[name]()
    return page_data(plant, law, controls, {"dt": 1e-3, "method": "rk4", **options})


def rounded(x: float, step: float) -> float:
    """Round to a multiple of `step`, and halves away from zero. Without a step, the number remains."""
    return x if step == 0.0 else float(np.copysign(np.floor(np.abs(x / step)) + (np.abs(x / step) % 1.0 >= 0.5), x)) * step


class WebRun:
    """The loop of a page. `data` is the data of the page, from `armlet.web.export.page_data`."""

    def __init__(self, data: dict[str, Any]) -> None:
        from wasmtime import Instance, Memory, Module, Store

        self.data, self.step_number, self.referenced, self.passed = data, 0, False, 0
        self.outputs: dict[int, Array] = {}
        self.readings: dict[int, Array] = {}
        self.breaks = sorted({t for motion in data["motions"] for t in motion["breaks"] or [] if t > 0.0})
        self.store = Store()
        self.module = Module(self.store.engine, b64decode(data["wasm"]))
        made = Instance(self.store, self.module, [])
        self.exports = made.exports(self.store)
        memory = self.exports["memory"]
        assert isinstance(memory, Memory)
        start = np.frombuffer(b64decode(data["frame"]))
        address = ctypes.cast(memory.data_ptr(self.store), ctypes.POINTER(ctypes.c_double))
        self.frame: Array = np.ctypeslib.as_array(address, (len(start),))
        self.frame[:] = start

    def names(self) -> list[str]:
        """The names of the functions."""
        return [export.name for export in self.module.exports]

    def call(self, name: str) -> None:
        function: Any = self.exports[name]
        function(self.store)

    def group(self, name: str) -> Array:
        first, count = self.data["groups"][name]
        return self.frame[first : first + count]

    def sample(self, t: float, h: float, end: float) -> None:
        """Write the desired motion at the instants of a step of size h from t, s. The last instant reads the motion at `end`."""
        first, width = self.data["groups"]["exogenous"]
        for i, part in enumerate(self.data["instants"]):
            at = first + i * width
            for motion in self.data["motions"]:
                size = 3 * motion["dof"]
                if motion["breaks"] is not None:
                    self.group("time")[:] = time = end if part == 1.0 else t + part * h
                    self.call(motion["functions"][sum(time >= each for each in motion["breaks"])])
                    self.frame[at : at + size] = self.frame[motion["first"] : motion["first"] + size]
                at += size

    @property
    def is_sampled(self) -> bool:
        return bool(self.data["period"]) and self.step_number % self.data["period"] == 0

    def prepare(self) -> None:
        """Prepare the sampled controller: the output that acts, and what the law reads."""
        sampling = self.data["sampling"]
        if sampling is None:
            return
        period, number = sampling["period"], self.step_number // self.data["period"]
        if sampling["delay"]:
            self.group("tau")[:] = self.outputs.get((self.step_number - sampling["delay"]) // self.data["period"], 0.0)
        if not self.is_sampled:
            return
        if sampling["rate_limit"] is not None:
            self.group("output")[:] = self.outputs.get(number - 1, 0.0)
            since = number * period - (number - 1) * period if number else period
            self.group("change")[:] = sampling["rate_limit"] * since
        measured = self.group("measured")
        steps = np.repeat(sampling["resolution"], len(self.data["joints"]))[: len(measured)]
        self.readings[number] = np.array([rounded(x, step) for x, step in zip(self.group("state")[: len(measured)], steps, strict=True)])
        measured[:] = self.readings[max(0, number - sampling["sensor_delay"])]

    def record(self) -> Array:
        """The input and the monitors."""
        self.prepare()
        h = self.data["dt"]
        self.sample(self.after_jump(self.step_number * h), h, (self.step_number + 1) * h)
        if self.is_sampled or not self.data["period"]:
            self.call("law")
        self.call("notes")
        if not self.referenced:
            self.group("reference")[:] = self.group("own_reference")
            self.referenced = True
            self.call("notes")
        return self.group("record").copy()

    def after_jump(self, t: float) -> float:
        return max(t, self.breaks[self.passed - 1]) if self.passed else t

    def step(self) -> None:
        """Advance by one step. It is divided at the jumps of the motion, as in `simulate`."""
        self.prepare()
        dt, k, function = self.data["dt"], self.step_number, "sampled_step" if self.is_sampled else "step"
        t, h, end = k * dt, dt, (k + 1) * dt
        while True:
            piece, input_end, jumps = h, end, False
            if self.passed < len(self.breaks):
                jump = self.breaks[self.passed]
                last = abs(jump - end) <= 1e-9 * dt
                if jump <= end or last:
                    jumps, input_end, piece = True, math.nextafter(min(jump, end), -math.inf), end - t if last else jump - t
            self.sample(self.after_jump(t), piece, input_end)
            self.frame[self.data["groups"]["h"][0]] = piece
            self.call(function)
            function = "step"
            if not jumps:
                break
            self.passed += 1
            t += piece
            h = end - t
            if abs(t - end) <= 1e-9 * dt:
                break
        if self.data["sampling"] and self.is_sampled:
            self.outputs[k // self.data["period"]] = self.group("output").copy()
        self.step_number += 1


def main(records: str, pages: str) -> None:
    runs: dict[str, Any] = {}
    for name in LOOPS:
        done = run(name)
        speeds = None if isinstance(LOOPS[name]()[0], al.VelocityArm) else done.v
        parts = [done.q, speeds, done.theta, done.theta_dot, done.estimate]
        runs[f"{name}/x"] = np.hstack([part for part in parts if part is not None])
        runs[f"{name}/record"] = np.hstack([done.tau, np.stack(list(done.monitors.values()), axis=1)])
    np.savez(records, **runs)
    with open(pages, "w", encoding="utf-8") as file:
        json.dump({name: page(name) for name in LOOPS}, file)


if __name__ == "__main__":
    warnings.simplefilter("error")
    main(*sys.argv[1:])
