"""Elastic joints under Cartesian impedance: time of armlet, numpy, scipy, numba, numbalsoda and hand-written C in one run.

Every result is compared before any time is measured. benches/README.md explains the comparison.

    python benches/bench_elastic.py                  the table, and benches/results/elastic.json
    python benches/bench_elastic.py --markdown       the table as Markdown
    python benches/bench_elastic.py --readme         the table, written into benches/README.md
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
import elastic_peers as peers
import reporting
import timing
from timing import Case

import armlet as al

HERE = Path(__file__).parent
C, C_BATCH, NUMBA = "C, by hand", "C with AVX-512, by hand", "numba, scalars"
ONE, BATCH = "armlet", "armlet, batch"
MIDDLE, ERROR = 0.2, 2e-7  # time of the comparison in the transient, s; largest allowed error there, rad
STEP = "RK4, 10,000 steps of 0.2 ms: ns per step"
MANY = "1,024 runs, 1,000 steps: ns per run and step"


def say(text: str) -> None:
    print(f"bench_elastic: {text}", file=sys.stderr, flush=True)


def compare(name: str, answer: Any, reference: Any, tolerance: float) -> None:
    worst = float(np.max(np.abs(np.asarray(answer) - reference)))
    if not worst <= tolerance:
        raise SystemExit(f"bench_elastic: {name} differs from the reference by {worst:.1e}: expected at most {tolerance:.0e}")
    say(f"equal within {tolerance:.0e} (worst {worst:.1e}): {name}")


def loop(level: str) -> tuple[al.ElasticArm, al.ElasticImpedance]:
    arm = al.planar_arm(list(peers.L), **peers.LINKS)
    k, b0 = peers.LEVELS[level]
    law = al.ElasticImpedance(
        arm, peers.TARGET, peers.K_M, peers.D_M, k, peers.B, b0, frame="link2", axes="xy", motor_damping=peers.damping(level)
    )
    return al.ElasticArm(arm, k, peers.B), law


def state(run: Any) -> Any:
    return np.concatenate([run.q, run.v, run.theta, run.theta_dot], axis=-1)[..., -1, :]


def single(level: str = "mild", steps: int = peers.STEPS, q0: Any = peers.Q0, **options: Any) -> Callable[[], Any]:
    plant, law = loop(level)
    given: dict[str, Any] = {"dt": peers.H, "t_eval": [steps * peers.H], "monitors": False} | options
    return lambda: state(al.simulate(plant, law, q0, theta0=q0, t_end=steps * peers.H, force=peers.FORCE, **given))


def batch(threads: int = 1, **options: Any) -> Callable[[], Any]:
    plant, law = loop("mild")
    q0, t_end = peers.batch_start(), peers.BATCH_STEPS * peers.H
    given: dict[str, Any] = {"dt": peers.H, "monitors": False, "keep": "final", "threads": threads} | options
    return lambda: state(al.simulate_batch(plant, law, q0, theta0=q0, t_end=t_end, force=peers.FORCE, **given))


def stiff(level: str, method: str, t: float = peers.T, rtol: float = 1e-6, atol: float = 1e-9) -> Callable[[], Any]:
    plant, law = loop(level)
    given: dict[str, Any] = {"method": method, "rtol": rtol, "atol": atol, "t_eval": [t], "monitors": False}
    return lambda: state(al.simulate(plant, law, peers.Q0, theta0=peers.Q0, t_end=t, force=peers.FORCE, **given))


def stiff_run(level: str, method: str, t: float) -> Any:
    return stiff(level, method, t)()


def rosenbrock(c: peers.LimitKernels, level: str, wide: bool, t: float) -> Any:
    return c.rosenbrock(level, wide, t)


def seven_axes() -> Callable[[], Any]:
    """A function that runs one second of a 7-axis elastic arm; the controller's sample time is 1 ms."""
    arm = al.load_urdf(al.example_urdf("seven_axis"))
    q0, frame = np.array([0.0, 0.6, 0.0, -1.4, 0.0, 0.9, 0.0]), arm.frame_names[-1]
    law = al.ElasticImpedance(arm, arm.position(q0, frame), 800.0, 90.0, 8e3, 0.8, 0.2, frame=frame)
    plant = al.ElasticArm(arm, 8e3, 0.8)
    given: dict[str, Any] = {"t_end": 1.0, "dt": 1e-3, "sample_time": 1e-3, "force": [10.0, -5.0, 8.0], "monitors": False}
    return lambda: al.simulate(plant, law, q0, **given)


class Suite:
    """The list of cases. `add` accepts a case only if its result is correct."""

    def __init__(self) -> None:
        self.cases: list[Case] = []
        self.busy = timing.busy()
        self.errors: dict[str, float] = {}
        self.exact = {level: stiff(level, "radau5", MIDDLE, 1e-9, 1e-12)() for level in peers.LEVELS}

    def add(self, group: str, name: str, run: Callable[[], Any], per: float, check: tuple[Any, float] | None = None, **more: Any) -> None:
        if check is not None:
            compare(name, run(), *check)
        self.cases.append(Case(group, name, run, per, **more))

    def steps(self, c: peers.LimitKernels | None, numba: dict[str, Callable[..., Any]] | None) -> None:
        exact = (stiff("mild", "dop853", peers.T, 1e-13, 1e-14)(), 1e-7)
        compare("numpy, 200 steps", peers.numpy_rk4(200), single(steps=200)(), 1e-11)
        yard = C if c else NUMBA if numba else None
        add = functools.partial(self.add, STEP, per=peers.STEPS)
        if c:
            add(C, c.single, check=exact)
        add(ONE, single(), check=exact, against=yard)
        add("armlet, monitors", single(monitors=True), check=exact, against=ONE)
        if numba:
            inputs = (peers.start(), peers.STEPS, peers.H, *peers.LEVELS["mild"], peers.damping("mild"))
            add(NUMBA, lambda: numba["single"](*inputs), check=exact, against=ONE)
        self.add(STEP, "numpy", lambda: peers.numpy_rk4(200), 200, against=ONE)

    def many(self, c: peers.LimitKernels | None, numba: dict[str, Callable[..., Any]] | None) -> None:
        per, inputs = peers.RUNS * peers.BATCH_STEPS, peers.start(peers.batch_start())
        answer = batch()()
        compare("row 7 of a batch is a run", answer[7], single(steps=peers.BATCH_STEPS, q0=peers.batch_start()[7])(), 1e-12)
        if c:
            self.add(MANY, C_BATCH, c.batch, per, (answer, 1e-11))
        self.add(MANY, BATCH, batch(), per, against=C_BATCH if c else None)
        self.add(MANY, "armlet, batch, monitors", batch(monitors=True), per, (answer, 1e-11), against=BATCH)
        if len(timing.cores()) > 1:
            self.add(MANY, "armlet, batch, 2 threads", batch(2), per, threads=2, against=BATCH)
        if numba:
            given = (inputs, peers.BATCH_STEPS, peers.H, *peers.LEVELS["mild"], peers.damping("mild"))
            self.add(MANY, "numba, batch", lambda: numba["batch"](*given), per, (answer, 1e-11), against=BATCH)

    def solver(self, level: str, name: str, run: Callable[[float], Any], **more: Any) -> None:
        """Store the solver's error at `MIDDLE` s, rad; then add the case that times its run of two seconds."""
        error = float(np.max(np.abs((np.asarray(run(MIDDLE)) - self.exact[level])[[0, 1, 4, 5]])))
        self.errors[f"{name}, {level}"] = error
        say(f"error {error:.1e} at {MIDDLE} s: {name}, {level}")
        group = f"2 s, rtol 1e-6, K_J = {peers.LEVELS[level][0]:g}: ms per run"
        self.cases.append(Case(group, f"{name}, {level}", functools.partial(run, peers.T), 1.0, unit="ms", scale=1e3, **more))

    def stiffness(self, c: peers.LimitKernels | None) -> None:
        for level in peers.LEVELS:
            yard = f"C Rosenbrock, by hand, {level}" if c else None
            if c:
                check = c.rosenbrock(level, True, MIDDLE, 1e-9, 1e-12)
                compare(f"C at rtol 1e-9, {level}", check[[0, 1, 4, 5]], self.exact[level][[0, 1, 4, 5]], 1e-8)
                self.solver(level, "C Rosenbrock, by hand", functools.partial(rosenbrock, c, level, True))
                self.solver(level, "C Rosenbrock, plain", functools.partial(rosenbrock, c, level, False), against=yard)
            for method in ("rodas4", "radau5"):
                self.solver(level, f"armlet, {method}", functools.partial(stiff_run, level, method), against=yard)
            if importlib.util.find_spec("numbalsoda") is not None:
                self.solver(level, "numbalsoda", peers_numbalsoda(level), against=yard)
            if importlib.util.find_spec("scipy") is not None:
                for method in ("Radau", "LSODA"):
                    self.solver(level, f"scipy, {method}", functools.partial(peers.scipy_run, level, method), against=yard, rounds=3)

    def targets(self) -> list[tuple[str, str, str, bool]]:
        by_name, lines = {case.name: case for case in self.cases}, []

        def ratio(what: str, name: str, yard: str, limit: float) -> None:
            if name in by_name and yard in by_name:
                value = timing.ratio(by_name[name], by_name[yard])
                lines.append((what, f"<= {limit}", f"{value:.2f}", value <= limit))

        ratio("one step / C by hand", ONE, C, 1.15)
        ratio("batch / C with AVX-512", BATCH, C_BATCH, 1.35)
        for level in peers.LEVELS:
            ratio(f"rodas4 / C Rosenbrock, {level}", f"armlet, rodas4, {level}", f"C Rosenbrock, by hand, {level}", 1.2)
            ratio(f"rodas4 / numbalsoda, {level}", f"armlet, rodas4, {level}", f"numbalsoda, {level}", 1.0)
            error = self.errors[f"armlet, rodas4, {level}"]
            lines.append((f"rodas4, error at 0.2 s, {level}", f"<= {ERROR:g} rad", f"{error:.1e} rad", error <= ERROR))
        if "armlet, 7 axes" in by_name:
            factor = 1e3 / by_name["armlet, 7 axes"].median
            lines.append(("7 axes, 1 ms sample time, faster than real time", ">= 20", f"{factor:.0f}", factor >= 20.0))
        return lines


def peers_numbalsoda(level: str) -> Callable[[float], Any]:
    import numba
    import numbalsoda

    (k, b0), d0 = peers.LEVELS[level], peers.damping(level)
    slope = numba.njit(peers.components)
    sin, cos = numba.njit(lambda x: np.sin(x)), numba.njit(lambda x: np.cos(x))

    @numba.cfunc(numbalsoda.lsoda_sig)
    def rhs(t, x, dx, p):  # type: ignore[no-untyped-def]
        rates = slope((x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7]), p[0], p[1], p[2], sin, cos)
        for i in range(8):
            dx[i] = rates[i]

    data, address = np.array([k, b0, d0]), rhs.address

    def run(t: float, kept: Any = rhs) -> Any:
        return numbalsoda.lsoda(address, peers.start(), np.array([0.0, t]), data=data, rtol=1e-6, atol=1e-9)[0][-1]

    return run


def main() -> None:
    parser = reporting.arguments("armlet beside its peers on the elastic 2R arm")
    options = parser.parse_args()
    reporting.require_release("bench_elastic")
    suite = Suite()
    c = timing.if_there("hand-written C", peers.LimitKernels, say)
    numba = timing.if_there("numba", peers.numba_kernels, say)
    suite.steps(c, numba)
    suite.many(c, numba)
    suite.stiffness(c)
    suite.add("7 axes, elastic, sampled at 1 ms", "armlet, 7 axes", seven_axes(), 1.0, unit="ms per s", scale=1e3)
    timing.measure(suite.cases, options.rounds, options.core, say)
    about = {"machine": timing.machine(), "busy": suite.busy, "build": al.build_info(), "errors": suite.errors, "targets": suite.targets()}
    timing.save(HERE / "results" / "elastic.json", suite.cases, about)
    errors = [f"| {name} | {e:.1e} |" for name, e in suite.errors.items()]
    more = ("| solver | error of q and theta at 0.2 s, rad |", "|---|---:|", *errors)
    text = reporting.report(suite.cases, suite.targets(), suite.busy, options.markdown or options.readme, more)
    reporting.finish("elastic", text, options.readme)


if __name__ == "__main__":
    main()
