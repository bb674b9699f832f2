"""v = J1# v1 + (J2 P1)# (v2 - J2 J1# v1) + .. from joint angles, kinematics included: time of armlet, numpy, numba and Pinocchio.

Every result is compared with that of numpy before any time is measured. benches/README.md explains the comparison.

    python benches/bench_priority.py                  the table, and benches/results/priority.json
    python benches/bench_priority.py --markdown       the table as Markdown
    python benches/bench_priority.py --readme         the table, written into benches/README.md
"""

from __future__ import annotations

import functools
import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))  # `python -P` does not add this folder
import priority_kernels
import priority_peers
import reporting
import timing
from timing import Case

import armlet as al

HERE = Path(__file__).parent
CALLS, ROWS = 2_000, 100_000
LINKS = np.array([1.0, 1.0, 0.25, 0.25])
ARM = al.planar_arm(LINKS)
SEVEN = al.load_urdf(al.example_urdf("seven_axis"))
TOOL = SEVEN.frame_names[-1]
# In this configuration, sin q4 = 0. So the second task loses one direction.
SINGULAR = np.array([0.0, np.pi / 2, np.pi / 2, 0.0])
Q4, Q7 = np.array([0.1, 1.2, 0.9, 1.4]), np.array([0.3, -0.5, 0.2, -1.5, 0.1, 1.2, 0.4])
V4 = [np.array([0.3, -0.2]), np.array([0.1, 0.4])]
V7 = [np.array([0.1, -0.2, 0.3]), np.array([0.2, 0.1, -0.1]), np.linspace(-0.2, 0.2, 7)]
# Tolerance of equal algorithms. The condition number is below 100 at the configurations below, so two correct results differ only by
# rounding.
ROUNDING = 1e-11
# Tolerances of other libraries. `STEP`: they reach targets by finite steps, not velocities. `WEIGHTED`: a weighted QP replaces the last
# priority.
STEP, WEIGHTED = 1e-5, 1e-3
# Goals when all libraries run in one benchmark: ns per Python call, ns per row of a batch.
TARGETS = [
    ("4R, two tasks: one call", "armlet, for_arm", 400.0),
    ("seven axes, three tasks: one call", "armlet, for_arm, seven axes", 1300.0),
    ("4R, two tasks: four small arrays", "armlet, solve_priority", 1000.0),
    ("4R, two tasks: row of a batch", "armlet, batch, 2 threads", 38.0),
]
# Goals: the largest allowed ratios of armlet's time to that of hand-written C, both on one thread.
RATIOS = {"four small arrays": 2.0, "at the singularity": 2.0, "batch of 4R": 1.5, "three tasks": 1.5, "batch of three tasks": 1.5}


def say(text: str) -> None:
    print(f"bench_priority: {text}", file=sys.stderr, flush=True)


def levels(blocks: list[Any], velocities: list[Any]) -> Any:
    """The recursion with pseudo-inverses. A singular value is zero if it is below 1e-10 times the norm of the unprojected Jacobian."""
    n = blocks[0].shape[1]
    v, P = np.zeros(n), np.eye(n)
    for J, wanted in zip(blocks, velocities, strict=True):
        A = J @ P
        U, s, Vt = np.linalg.svd(A, full_matrices=False)
        keep = s > 1e-10 * np.linalg.norm(J)
        inverse = (Vt[keep].T / s[keep]) @ U[:, keep].T
        v = v + inverse @ (wanted - J @ v)
        P = P - inverse @ A
    return v


def clamped(blocks: list[Any], velocities: list[Any]) -> Any:
    """The recursion with the clamped inverse `s / max(s, eps)^2`, also valid at singularities.

    `eps` is 0.02 times the norm of J's longest row.
    """
    n = blocks[0].shape[1]
    v, P = np.zeros(n), np.eye(n)
    for J, wanted in zip(blocks, velocities, strict=True):
        U, s, Vt = np.linalg.svd(J @ P, full_matrices=False)
        inverse = (Vt.T * (s / np.maximum(s, 0.02 * np.linalg.norm(J, axis=1).max()) ** 2)) @ U.T
        v = v + inverse @ (wanted - J @ v)
        P = P - inverse @ (J @ P)
    return v


def planar(q: Any) -> list[Any]:
    angles = np.cumsum(q)
    x, y = LINKS * np.cos(angles), LINKS * np.sin(angles)
    J = np.zeros((2, 2, 4))
    for k, tip in enumerate((4, 2)):
        J[k, 0, :tip] = -np.cumsum(y[:tip][::-1])[::-1]
        J[k, 1, :tip] = np.cumsum(x[:tip][::-1])[::-1]
    return list(J)


def repeated(call: Callable[[], Any], times: int) -> Callable[[], Any]:
    def run() -> Any:
        for _ in range(times):
            answer = call()
        return answer

    return run


class Suite:
    """The list of cases. `add` accepts a case only if its result is correct."""

    def __init__(self) -> None:
        self.cases: list[Case] = []

    def add(self, group: str, name: str, call: Callable[[], Any], expected: Any, times: int, within: float = ROUNDING, **more: Any) -> None:
        worst = float(np.max(np.abs(call() - expected)))
        if not worst <= within * (1 + np.abs(expected).max()):
            raise SystemExit(f"bench_priority: {name} differs from numpy by {worst:.1e}")
        say(f"equal (worst {worst:.1e}): {name}")
        per = more.pop("per", times)
        self.cases.append(Case(group, name, repeated(call, times), per, **more))

    def peers(self, problem: priority_peers.Problem) -> list[tuple[str, Callable[[], Any]]]:
        """Callables of the other installed libraries, prepared for this problem."""
        made = priority_peers.installed()
        for name in priority_peers.PEERS.keys() - made.keys():
            say(f"skipped: {name}: not installed")
        return [(name, make(problem)) for name, make in made.items()]

    def planar(self) -> None:
        expected = levels(planar(Q4), V4)
        add = functools.partial(self.add, "4R, two tasks (2 + 2), one Python call: ns", expected=expected, times=CALLS)
        tasks = [al.Task("link4", "xy"), al.Task("link2", "xy")]
        clamp, exact = (al.PrioritySolver.for_arm(ARM, tasks, method=method) for method in ("clamp", "exact"))
        out, blocks = np.empty(4), planar(Q4)
        add("armlet, for_arm", lambda: clamp.solve(Q4, V4, out=out))
        add("armlet, for_arm, exact", lambda: exact.solve(Q4, V4, out=out), against="armlet, for_arm")
        add("armlet, for_arm, a new array", lambda: clamp.solve(Q4, V4), against="armlet, for_arm")
        add("armlet, solve_priority", lambda: al.solve_priority(blocks, V4).v, against="armlet, for_arm")
        law = al.PriorityVelocity(ARM, [al.Task("link4", "xy", [1.0, 1.0], 1.0), al.Task("link2", "xy", [1.0, 1.0], 1.0)])
        zero = np.zeros(4)
        e = [np.ones(2) - ARM.position(Q4, frame)[:2] for frame in ("link4", "link2")]
        add("armlet, law(t, q, v)", lambda: law(0.0, Q4, zero), expected=levels(planar(Q4), e), against="armlet, for_arm")
        self.add(add.args[0], "numpy", lambda: levels(planar(Q4), V4), expected, 100, against="armlet, for_arm")
        problem = priority_peers.Problem(priority_peers.planar_urdf(LINKS), Q4, [("link4", "xy", V4[0]), ("link2", "xy", V4[1])])
        for name, call in self.peers(problem):
            self.add(add.args[0], name, call, expected, 100, STEP, against="armlet, for_arm")
        rng = np.random.default_rng(0)
        q = Q4 + rng.uniform(-0.3, 0.3, (ROWS, 4))
        group, wanted = "4R, two tasks, 100,000 rows: ns per row", np.array([levels(planar(row), V4) for row in q[:2000]])
        answer = np.empty_like(q)

        def rows(solve: Callable[[], Any]) -> Callable[[], Any]:
            return lambda: (solve(), answer[:2000])[1]

        more = {"times": 1, "per": ROWS, "expected": wanted}
        self.add(group, "armlet, batch, 2 threads", rows(lambda: clamp.solve(q, V4, out=answer)), threads=2, **more)
        stack = [np.array(blocks) for blocks in zip(*(planar(row) for row in q), strict=True)]
        command = [np.tile(v, (ROWS, 1)) for v in V4]
        solved = lambda: al.solve_priority(stack, command).v[:2000]  # noqa: E731
        self.add(group, "armlet, solve_priority, 2 threads", solved, threads=2, against="armlet, batch, 2 threads", **more)
        self.yardsticks("four small arrays", "pairs", blocks, V4, expected)
        singular = planar(SINGULAR)
        self.yardsticks("at the singularity", "pairs", singular, V4, clamped(singular, V4))
        self.yardsticks("batch of 4R", "pairs", stack, command, wanted)

    def yardsticks(self, what: str, kernel: str, blocks: list[Any], velocities: list[Any], expected: Any) -> None:
        """Time of `solve_priority` from arrays on one thread, and of the same stack in hand-written C and, if a kernel exists, in numba."""
        batch = blocks[0].ndim == 3
        group = f"{what}, Jacobians given: ns per {'row' if batch else 'stack'}"
        times, per = (1, len(blocks[0])) if batch else (CALLS, CALLS)
        front = (lambda v: v[: len(expected)]) if batch else (lambda v: v)
        more = {"expected": expected, "per": per}
        in_c = priority_kernels.in_c(kernel, blocks, velocities, CALLS)
        self.add(group, f"C by hand, {what}", lambda: front(in_c()), times=1, **more)
        yard = {"against": f"C by hand, {what}"}
        self.add(group, f"armlet, {what}", lambda: front(al.solve_priority(blocks, velocities).v), times=times, **more, **yard)
        if kernel != "pairs":
            return
        if importlib.util.find_spec("numba") is None:
            return say("skipped: numba: not installed")
        solve = priority_kernels.in_numba()[batch]
        self.add(group, f"numba, {what}", lambda: front(solve(*blocks, *velocities)), times=times, **more, **yard)

    def seven(self) -> None:
        J = SEVEN.jacobian(Q7, TOOL)
        expected = levels([J[:3], J[3:], np.eye(7)], V7)
        blocks = [np.ascontiguousarray(J[:3]), np.ascontiguousarray(J[3:]), np.eye(7)]
        self.yardsticks("three tasks", "three", blocks, V7, expected)
        many = SEVEN.jacobian(Q7 + np.random.default_rng(1).uniform(-0.1, 0.1, (ROWS, 7)), TOOL)
        stack = [np.ascontiguousarray(many[:, :3]), np.ascontiguousarray(many[:, 3:]), np.tile(np.eye(7), (ROWS, 1, 1))]
        wanted = np.array([levels([row[:3], row[3:], np.eye(7)], V7) for row in many[:2000]])
        self.yardsticks("batch of three tasks", "three", stack, [np.tile(v, (ROWS, 1)) for v in V7], wanted)
        group = "seven axes, three tasks (3 + 3 + 7), one Python call: ns"
        tasks = [al.Task(TOOL, "xyz"), al.Task(TOOL, "rx ry rz"), al.PostureTask()]
        solver, out, eye = al.PrioritySolver.for_arm(SEVEN, tasks), np.empty(7), np.eye(7)
        self.add(group, "armlet, for_arm, seven axes", lambda: solver.solve(Q7, V7, out=out), expected, CALLS)
        yard = {"against": "armlet, for_arm, seven axes"}
        tasks_of_tool = [(TOOL, "xyz", V7[0]), (TOOL, "rx ry rz", V7[1])]
        for name, call in self.peers(priority_peers.Problem(al.example_urdf("seven_axis"), Q7, tasks_of_tool, V7[2])):
            self.add(group, f"{name}, seven axes", call, expected, 100, WEIGHTED, **yard)
        if importlib.util.find_spec("pinocchio") is None:
            return say("skipped: Pinocchio: not installed")
        import pinocchio as pin

        model = pin.buildModelFromXML(al.example_urdf("seven_axis"))
        data, frame = model.createData(), model.getFrameId(TOOL)

        def jacobian() -> Any:
            return pin.computeFrameJacobian(model, data, Q7, frame, pin.LOCAL_WORLD_ALIGNED)

        def call() -> Any:
            J = jacobian()
            return levels([J[:3], J[3:], eye], V7)

        self.add(group, "Pinocchio + numpy", call, expected, 100, **yard)


def targets(cases: list[Case]) -> list[reporting.Verdict]:
    by_name = {case.name: case.median for case in cases}
    met = [(what, f"<= {goal:g} ns", f"{timing.digits(by_name[name])} ns", by_name[name] <= goal) for what, name, goal in TARGETS]
    for what, most in RATIOS.items():
        mine = by_name[f"armlet, {what}"]
        found = mine / by_name[f"C by hand, {what}"]
        met.append((f"{what} / C by hand", f"<= {most:g}", f"{found:.2f}", found <= most))
        numba = by_name.get(f"numba, {what}")
        if numba is not None:
            met.append((f"{what} / numba", "< 1", f"{mine / numba:.2f}", mine < numba))
    return met


def main() -> None:
    parser = reporting.arguments("armlet beside its peers on tasks in priority")
    options = parser.parse_args()
    reporting.require_release("bench_priority")
    suite, busy = Suite(), timing.busy()
    suite.planar()
    suite.seven()
    timing.measure(suite.cases, options.rounds, options.core, say)
    timing.save(HERE / "results" / "priority.json", suite.cases, {"machine": timing.machine(), "busy": busy, "build": al.build_info()})
    text = reporting.report(suite.cases, targets(suite.cases), busy, options.markdown or options.readme)
    reporting.finish("priority", text, options.readme)


if __name__ == "__main__":
    main()
