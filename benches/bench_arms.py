"""ns per configuration = median over rounds of t(call) / configurations: armlet, Pinocchio, dynibo and MuJoCo on the Panda arm.

    python -P benches/bench_arms.py [--markdown | --readme] [--rounds N] [--core N]

A library that is not installed is skipped with a message. All results are compared before any time is measured. Each instruction set
has a separate process for the batches, which starts with `ARMLET_ISA` and `ARMLET_NUM_THREADS=1`.
"""

from __future__ import annotations

import argparse
import functools
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))  # `python -P` does not add this folder
import reporting
import timing

import armlet as al

HERE = Path(__file__).resolve().parent
ROWS, CALLS, BATCHES = 4096, 2000, 20
FRAME = "panda_hand"
ISAS = ("baseline", "avx2", "avx512")
# Goals, ns per configuration: `ONE` is one call from Python, `BATCH` is one row of a batch with AVX-512. With AVX2 the goal of a batch is
# 2.2 times as long.
ONE = {"RNEA": 450, "mass matrix": 400, "ABA": 800, "frame Jacobian": 330, "Coriolis": 800, "Slotine-Li regressor": 1100}
BATCH = {"RNEA": 50, "mass matrix": 45, "ABA": 120, "frame Jacobian": 32, "Slotine-Li regressor": 160}
WIDER = 2.2


def say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def robot_file(path: str) -> str:
    """The file `path` in the folder of robots of the package `example-robot-data`."""
    for place in sys.path:
        file = Path(place) / "cmeel.prefix/share/example-robot-data/robots" / path
        if file.exists():
            return str(file)
    raise SystemExit(f"{Path(sys.argv[0]).stem}: example-robot-data is not installed: pip install -r requirements/peers.txt")


def panda() -> tuple[str, dict[str, float]]:
    """The Panda's URDF, and the positions (m) at which its finger joints are fixed."""
    return robot_file("panda_description/urdf/panda.urdf"), {"panda_finger_joint1": 0.02, "panda_finger_joint2": 0.02}


def our_arm() -> al.Arm:
    path, fingers = panda()
    return al.load_urdf(path).locked(fingers)


def states(arm: al.Arm, count: int) -> tuple[Any, ...]:
    """Random q, v, a and v_r, each (count, n)."""
    return tuple(np.random.default_rng(1).uniform(-1.0, 1.0, (4, count, arm.n)))


def ours(arm: al.Arm, q: Any, v: Any, a: Any, v_r: Any, outs: dict[str, Any] | None = None) -> dict[str, Callable[[], Any]]:
    tau = arm.inverse_dynamics(q, v, a)
    if outs is None:
        return {
            "RNEA": lambda: arm.inverse_dynamics(q, v, a),
            "mass matrix": lambda: arm.mass_matrix(q),
            "ABA": lambda: arm.forward_dynamics(q, v, tau),
            "frame Jacobian": lambda: arm.jacobian(q, FRAME),
            "Coriolis": lambda: arm.coriolis_matrix(q, v),
            "Slotine-Li regressor": lambda: arm.regressor(q, v, v_r, a),
        }
    return {
        "RNEA": lambda: arm.inverse_dynamics(q, v, a, out=outs["RNEA"]),
        "mass matrix": lambda: arm.mass_matrix(q, out=outs["mass matrix"]),
        "ABA": lambda: arm.forward_dynamics(q, v, tau, out=outs["ABA"]),
        "frame Jacobian": lambda: arm.jacobian(q, FRAME, out=outs["frame Jacobian"]),
        "Coriolis": lambda: arm.coriolis_matrix(q, v, out=outs["Coriolis"]),
        "Slotine-Li regressor": lambda: arm.regressor(q, v, v_r, a, out=outs["Slotine-Li regressor"]),
    }


def close(what: str, got: Any, want: Any, tolerance: float = 1e-10) -> None:
    off = float(np.abs(got - want).max()) / max(1.0, float(np.abs(want).max()))
    if not off <= tolerance:
        raise SystemExit(f"bench_arms: {what} is wrong: off by {off:.1e}")


def pinocchio(arm: al.Arm, q: Any, v: Any, a: Any, v_r: Any) -> dict[str, Callable[[], Any]]:
    import pinocchio as pin

    model = pin.buildModelFromXML(arm.to_urdf()[0])
    data = model.createData()
    frame, axes = model.getFrameId(FRAME, pin.FrameType.BODY), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    tau = arm.inverse_dynamics(q, v, a)
    upper = np.triu(pin.crba(model, data, q))
    close("Pinocchio's mass matrix", upper + np.triu(upper, 1).T, arm.mass_matrix(q))
    close("Pinocchio's rnea", pin.rnea(model, data, q, v, a), tau)
    close("Pinocchio's aba", pin.aba(model, data, q, v, tau), a)
    close("Pinocchio's Jacobian", pin.computeFrameJacobian(model, data, q, frame, axes), arm.jacobian(q, FRAME))
    close("Pinocchio's C v", pin.computeCoriolisMatrix(model, data, q, v) @ v, arm.coriolis_matrix(q, v) @ v)
    close("Pinocchio's regressor", pin.computeJointTorqueRegressor(model, data, q, v, a), arm.regressor(q, v, v, a))
    return {
        "RNEA": lambda: pin.rnea(model, data, q, v, a),
        "mass matrix": lambda: pin.crba(model, data, q),
        "ABA": lambda: pin.aba(model, data, q, v, tau),
        "frame Jacobian": lambda: pin.computeFrameJacobian(model, data, q, frame, axes),
        "Coriolis": lambda: pin.computeCoriolisMatrix(model, data, q, v),
        # This is the classical regressor, which equals the Slotine-Li regressor at v_r = v. Pinocchio has no Slotine-Li regressor.
        "Slotine-Li regressor": lambda: pin.computeJointTorqueRegressor(model, data, q, v, a),
    }


def mujoco(arm: al.Arm, q: Any, v: Any, a: Any, v_r: Any) -> dict[str, Callable[[], Any]]:
    import mujoco as mj

    options = '<mujoco><compiler fusestatic="false" balanceinertia="false"/></mujoco>'
    text = arm.to_urdf()[0].replace("</robot>", f"{options}</robot>")
    model = mj.MjModel.from_xml_string(text)
    data = mj.MjData(model)
    data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
    mj.mj_forward(model, data)
    data.qacc[:] = a
    result, full, jacobian = np.zeros(7), np.zeros((7, 7)), np.zeros((6, 7))
    body = model.body(FRAME).id

    def place() -> None:
        mj.mj_kinematics(model, data)
        mj.mj_comPos(model, data)

    def rnea() -> None:
        place()
        mj.mj_comVel(model, data)
        mj.mj_rne(model, data, 1, result)

    def crb() -> None:
        place()
        mj.mj_crb(model, data)
        mj.mj_fullM(model, data, full)

    def jac() -> None:
        place()
        mj.mj_jacBody(model, data, jacobian[:3], jacobian[3:], body)

    # MuJoCo stores principal axes and quaternions, which rounds the inertias in more places. So the tolerance is 1e-7.
    jac()
    close("MuJoCo's Jacobian", jacobian, arm.jacobian(q, FRAME), 1e-7)
    crb()
    close("MuJoCo's mass matrix", full, arm.mass_matrix(q), 1e-7)
    rnea()
    close("MuJoCo's rne", result, arm.inverse_dynamics(q, v, a), 1e-7)
    return {"RNEA": rnea, "mass matrix": crb, "frame Jacobian": jac}


def dynibo(arm: al.Arm, q: Any, v: Any, a: Any, v_r: Any) -> dict[str, Callable[[], Any]]:
    import dynibo as peer

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "panda.urdf"
        path.write_text(arm.to_urdf()[0])
        robot = peer.Robot.from_urdf(str(path))
    link = robot.link_id(FRAME)
    arm = arm.with_gravity([0.0, 0.0, -9.80665])  # dynibo always uses standard gravity, 9.80665 m/s^2
    tau = arm.inverse_dynamics(q, v, a)
    close("dynibo's inverse dynamics", np.asarray(robot.inverse_dynamics(q, v, a)), tau)
    close("dynibo's mass matrix", np.asarray(robot.mass_matrix(q)), arm.mass_matrix(q).ravel())
    close("dynibo's forward dynamics", np.asarray(robot.forward_dynamics(q, v, tau)), a)
    # dynibo's Jacobian is stored by columns and has its three angular rows first.
    close("dynibo's Jacobian", np.asarray(robot.jacobian(q, link)), np.roll(arm.jacobian(q, FRAME), 3, axis=0).ravel(order="F"))
    return {
        "RNEA": lambda: robot.inverse_dynamics(q, v, a),
        "mass matrix": lambda: robot.mass_matrix(q),
        "ABA": lambda: robot.forward_dynamics(q, v, tau),
        "frame Jacobian": lambda: robot.jacobian(q, link),
    }


PEERS = {"Pinocchio": pinocchio, "MuJoCo": mujoco, "dynibo": dynibo}


def repeated(call: Callable[[], Any]) -> None:
    for _ in range(CALLS):
        call()


def several(call: Callable[[], Any]) -> None:
    for _ in range(BATCHES):
        call()


class Route:
    """A process with `ARMLET_ISA` set. It computes batches of 4,096 configurations on one thread and writes into the caller's array."""

    def __init__(self, isa: str) -> None:
        environment = os.environ | {"ARMLET_ISA": isa, "ARMLET_NUM_THREADS": "1"}
        command = [sys.executable, "-P", str(Path(__file__).resolve()), "--route"]
        self.process = subprocess.Popen(command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def ask(self, what: str, core: int) -> Any:
        assert self.process.stdin is not None and self.process.stdout is not None
        print(json.dumps([what, core]), file=self.process.stdin, flush=True)
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"bench_arms: the process of a route ended at {what}")
        return json.loads(line)

    def close(self) -> None:
        if self.process.stdin is not None:
            self.process.stdin.close()
        self.process.wait(timeout=30)


def serve() -> None:
    """The loop of the worker process of a `Route`. It answers a command with the time of twenty calls, s, or with rows of a result."""
    arm = our_arm()
    q, v, a, v_r = states(arm, ROWS)
    fresh = ours(arm, q, v, a, v_r)
    outs = {name: call() for name, call in fresh.items()}
    calls = ours(arm, q, v, a, v_r, outs)
    room = np.zeros_like(outs["Slotine-Li regressor"])
    for line in sys.stdin:
        what, core = json.loads(line)
        timing.pin([core])
        if what.startswith("answer:"):
            print(json.dumps(np.asarray(calls[what[7:]]())[:9].ravel().tolist()), flush=True)
            continue
        call = functools.partial(room.fill, 1.0) if what == "fill" else calls[what]
        print(json.dumps(timing.clocked(functools.partial(several, call))), flush=True)


def suite(core: int) -> tuple[list[timing.Case], list[Route]]:
    arm = our_arm()
    rows = states(arm, ROWS)
    first = tuple(x[0] for x in rows)
    cases: list[timing.Case] = []
    singles = ours(arm, *first)
    group = "One configuration from Python: ns per call"
    for name, call in singles.items():
        cases.append(timing.Case(group, f"armlet, {name}", functools.partial(repeated, call), CALLS))
    for library, make in PEERS.items():
        try:
            peer = make(arm, *first)
        except ImportError as missing:
            say(f"skipped: {library}: {missing}")
            continue
        for name, call in peer.items():
            cases.append(timing.Case(group, f"{library}, {name}", functools.partial(repeated, call), CALLS, against=f"armlet, {name}"))
    routes = []
    for isa in ISAS[: ISAS.index(str(al.build_info()["best_instruction_set"])) + 1]:
        route = Route(isa)
        routes.append(route)
        group = f"Batches of {ROWS:,}, one thread, {isa}: ns per configuration, results written to an array of the caller"
        for name in singles:
            want = np.concatenate([np.asarray(ours(arm, *(x[i] for x in rows))[name]()).ravel() for i in range(9)])
            close(f"{isa}, {name}", np.array(route.ask(f"answer:{name}", core)), want, 1e-11)
            cases.append(timing.Case(group, f"{isa}, {name}", functools.partial(route.ask, name, core), ROWS * BATCHES, timed=True))
    group = "Time to fill the memory of the results: ns per configuration"
    fill = functools.partial(routes[-1].ask, "fill", core)
    cases.append(timing.Case(group, "numpy fill of the regressor's array", fill, ROWS * BATCHES, timed=True))
    return cases, routes


def targets(cases: list[timing.Case]) -> list[tuple[str, str, str, bool]]:
    by_name = {case.name: case for case in cases}
    lines = []

    def ceiling(what: str, name: str, limit: float) -> None:
        if name in by_name:
            value = by_name[name].median
            lines.append((what, f"<= {limit:g} ns", f"{timing.digits(value)} ns", value <= limit))

    for name, limit in ONE.items():
        ceiling(f"one {name}", f"armlet, {name}", limit)
        peers = [by_name[f"{library}, {name}"] for library in PEERS if f"{library}, {name}" in by_name]
        if peers:
            fastest = min(peers, key=lambda case: case.median)
            value = by_name[f"armlet, {name}"].median / fastest.median
            lines.append((f"one {name}: ratio to the fastest peer", "< 1", f"{value:.2f} of {fastest.name.split(',')[0]}", value < 1.0))
    for name, limit in BATCH.items():
        ceiling(f"batch {name}, AVX-512", f"avx512, {name}", limit)
        ceiling(f"batch {name}, AVX2", f"avx2, {name}", WIDER * limit)
    return lines


def main() -> None:
    parser = reporting.arguments("armlet's arms beside their peers on the Panda")
    parser.add_argument("--route", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.route:
        serve()
        return
    reporting.require_release("bench_arms")
    busy, start = timing.busy(), time.perf_counter()
    cases, routes = suite(options.core)
    try:
        timing.measure(cases, options.rounds, options.core, say)
    finally:
        for route in routes:
            route.close()
    about = {"machine": timing.machine(), "busy": busy, "build": al.build_info(), "targets": targets(cases)}
    timing.save(HERE / "results" / "arms.json", cases, about)
    text = reporting.report(cases, targets(cases), busy, options.markdown or options.readme)
    reporting.finish("arms", text, options.readme)
    say(f"{time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
