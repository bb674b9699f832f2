"""ns per call = median over rounds of t(calls) / calls: armlet and Pinocchio on robots with 32 to 101 joints, one configuration per call.

    python -P benches/bench_large_arms.py [--markdown | --readme] [--rounds N] [--core N]

The robots come from the package `example-robot-data`. The results are compared before any time is measured. The time to make the programs
of armlet, in its first calls, is listed apart.
"""

from __future__ import annotations

import functools
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
import reporting
import timing
from bench_arms import close, robot_file, states

import armlet as al

ROBOTS = {
    "TIAGo": "tiago_description/robots/tiago.urdf",
    "TIAGo with two arms": "tiago_description/robots/tiago_dual.urdf",
    "Talos": "talos_data/robots/talos_reduced.urdf",
}
CALLS = 200
# The goal is the time of armlet divided by that of Pinocchio.
GOAL = 0.5
# The number of calls after which every function of these robots has its program.
WARM = 4000
Functions = dict[str, Callable[[], Any]]


def robot(path: str) -> al.Arm:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return al.load_urdf(robot_file(path))


def ours(arm: al.Arm, q: Any, v: Any, a: Any) -> Functions:
    tau, frame = arm.inverse_dynamics(q, v, a), arm.frame_names[-1]
    return {
        "RNEA": lambda: arm.inverse_dynamics(q, v, a),
        "gravity": lambda: arm.gravity(q),
        "mass matrix": lambda: arm.mass_matrix(q),
        "ABA": lambda: arm.forward_dynamics(q, v, tau),
        "frame Jacobian": lambda: arm.jacobian(q, frame),
        "Coriolis": lambda: arm.coriolis_matrix(q, v),
        "regressor": lambda: arm.regressor(q, v, v, a),
    }


def pinocchio(arm: al.Arm, q: Any, v: Any, a: Any) -> Functions:
    """The same functions of Pinocchio. It orders the joints by name, and stores a continuous joint as cosine and sine."""
    import pinocchio as pin

    model = pin.buildModelFromXML(arm.to_urdf()[0])
    data, order = model.createData(), [arm.joint_names.index(name) for name in list(model.names)[1:]]
    there = pin.integrate(model, pin.neutral(model), q[order])
    v, a, tau = v[order], a[order], arm.inverse_dynamics(q, v, a)[order]
    frame, axes = model.getFrameId(arm.frame_names[-1], pin.FrameType.BODY), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    columns = np.argsort(order)  # the columns of Pinocchio in the order of armlet
    upper = np.triu(pin.crba(model, data, there))
    close("Pinocchio's mass matrix", (upper + np.triu(upper, 1).T)[np.ix_(columns, columns)], arm.mass_matrix(q))
    close("Pinocchio's rnea", pin.rnea(model, data, there, v, a), tau)
    close("Pinocchio's aba", pin.aba(model, data, there, v, tau), a, 1e-8)
    close(
        "Pinocchio's Jacobian", pin.computeFrameJacobian(model, data, there, frame, axes)[:, columns], arm.jacobian(q, arm.frame_names[-1])
    )
    close(
        "Pinocchio's C v", (pin.computeCoriolisMatrix(model, data, there, v) @ v)[columns], arm.coriolis_matrix(q, v[columns]) @ v[columns]
    )
    parameters = np.concatenate([inertia.toDynamicParameters() for inertia in list(model.inertias)[1:]])
    close("Pinocchio's regressor", pin.computeJointTorqueRegressor(model, data, there, v, a) @ parameters, tau)
    return {
        "RNEA": lambda: pin.rnea(model, data, there, v, a),
        "gravity": lambda: pin.computeGeneralizedGravity(model, data, there),
        "mass matrix": lambda: pin.crba(model, data, there),
        "ABA": lambda: pin.aba(model, data, there, v, tau),
        "frame Jacobian": lambda: pin.computeFrameJacobian(model, data, there, frame, axes),
        "Coriolis": lambda: pin.computeCoriolisMatrix(model, data, there, v),
        "regressor": lambda: pin.computeJointTorqueRegressor(model, data, there, v, a),
    }


def repeated(call: Callable[[], Any]) -> None:
    for _ in range(CALLS):
        call()


def slowest(call: Callable[[], Any]) -> float:
    """Call often enough that a program is made. Return the longest processor time of a call, s: the one that made it."""
    longest = 0.0
    for _ in range(WARM):
        start = time.thread_time()
        call()
        longest = max(longest, time.thread_time() - start)
    return longest


def main() -> None:
    options = reporting.arguments("functions of large arms beside Pinocchio").parse_args()
    reporting.require_release("bench_large_arms")
    busy, cases, making = timing.busy(), [], []
    for name, path in ROBOTS.items():
        arm = robot(path)
        q, v, a = (x[0] for x in states(arm, 1)[:3])
        group = f"{name}, {arm.n} joints: ns per call"
        own, peer = ours(arm, q, v, a), pinocchio(arm, q, v, a)
        made = {what: slowest(call) for what, call in own.items()}
        if not making:
            making += [f"| robot | {' | '.join(made)} |", "|---|" + "---:|" * len(made)]
        making.append(f"| {name} | {' | '.join(f'{1e3 * seconds:.1f}' for seconds in made.values())} |")
        for what, call in peer.items():
            cases.append(timing.Case(group, f"Pinocchio, {what} ({name})", functools.partial(repeated, call), CALLS))
        for what, call in own.items():
            other = f"Pinocchio, {what} ({name})"
            cases.append(timing.Case(group, f"armlet, {what} ({name})", functools.partial(repeated, call), CALLS, against=other))
    timing.measure(cases, options.rounds, options.core, lambda text: None)
    verdicts, by_name = [], {case.name: case for case in cases}
    for case in cases:
        if case.against:
            ratio = timing.ratio(case, by_name[case.against])
            verdicts.append((f"{case.name[8:]} / Pinocchio", f"<= {GOAL}", f"{ratio:.2f}", ratio <= GOAL))
    about = ("Processor time of the longest of the first 4,000 calls, which makes the program, ms:", "", *making)
    reporting.finish("large_arms", reporting.report(cases, verdicts, busy, options.markdown or options.readme, about), options.readme)


if __name__ == "__main__":
    main()
