"""Sampled loops beside the continuous loops of the same arm and law: ns per step (and run), with equal answers asserted first.

Every sampled loop is first compared with a loop in numpy, which calls the law at its samples and integrates the arm with the held input.
numba computes the loop of the PR robot with the adaptive law, sampled at every step; it is skipped if it is not installed.

    python -P benches/bench_sampled.py                      every loop
    python -P benches/bench_sampled.py --arms panda.urdf    arms from files, beside the arms of `ARMS`
    python -P benches/bench_sampled.py --readme             the tables, written into benches/README.md
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import armlet as al

sys.path.insert(0, str(Path(__file__).parent))  # `python -P` does not add this folder
import reporting
import timing
from timing import Case

H, RUNS, CHECKED = 1e-3, 1024, 40
# Goals: the largest ratios of the time of a sampled loop to the time of the continuous loop, and to numba's time.
SMALL, LARGE, EULER, LONG, NUMBA = 0.8, 0.7, 1.1, 0.6, 0.8
ARMS: dict[str, Callable[[], al.Arm]] = {
    "planar 2R": lambda: al.planar_arm([0.5, 0.4], masses=[3.0, 2.0]),
    "six axes": lambda: al.load_urdf(al.example_urdf("six_axis")),
    "seven axes": lambda: al.load_urdf(al.example_urdf("seven_axis")),
}
# Controllers that do more than hold the law's output.
CONTROLLERS: dict[str, dict[str, Any]] = {
    "plain": {},
    "delay of a step": {"delay": H},
    "resolution": {"resolution": {"q": 1e-4, "v": 1e-3}},
    "noise": {"noise": {"q": 1e-4, "v": 1e-3}},
    "rate limit": {"rate_limit": 1e5},
    "late sensors": {"sensor_delay": 2},
}
CONTROLLED = ("planar 2R, computed torque", "six axes, computed torque")


@dataclass
class Loop:
    """A plant with a law, its start, and the number of steps of one run."""

    name: str
    arm: al.Arm
    law: Any
    motion: Any
    q0: Any
    steps: int

    def options(self, method: str, period: Any, steps: int) -> dict[str, Any]:
        given = {"t_end": steps * H, "dt": H, "method": method, "monitors": False, "check_limits": False}
        return given | ({"sample_time": period} if period else {})

    def run(self, method: str, period: Any, steps: int) -> Any:
        return al.simulate(al.RigidArm(self.arm), self.law, self.q0, record_every=steps, **self.options(method, period, steps))

    def batch(self, method: str, period: Any, steps: int) -> Any:
        q0 = np.asarray(self.q0) + np.linspace(0.0, 0.1, RUNS)[:, None]
        options = self.options(method, period, steps) | {"keep": "final", "threads": 1}
        return al.simulate_batch(al.RigidArm(self.arm), self.law, q0, **options)

    def by_hand(self, method: str, hold: int) -> Any:
        """The final positions after `CHECKED` steps, with calls of the law at its samples. The law has no state."""
        n = self.arm.n
        x, tau = np.concatenate([self.q0, np.zeros(n)]), np.zeros(n)

        def rate(x: Any) -> Any:
            return np.concatenate([x[n:], self.arm.forward_dynamics(x[:n], x[n:], tau)])

        for k in range(CHECKED):
            if k % hold == 0:
                tau = self.law(k * H, x[:n], x[n:])
            k1 = rate(x)
            if method == "euler":
                x = x + H * k1
                continue
            k2 = rate(x + 0.5 * H * k1)
            k3 = rate(x + 0.5 * H * k2)
            x = x + H / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rate(x + H * k3))
        return x[:n]


def table(motion: Any, steps: int) -> Any:
    """The motion as a table at the half steps."""
    return al.Table(0.5 * H, *(np.array(part) for part in zip(*(motion(0.5 * H * k) for k in range(2 * steps + 1)), strict=True)))


def printed() -> Loop:
    """The PR robot with the adaptive law, as in `bench_adaptive.py`."""
    arm = al.planar_pr(2.0, 0.5, 1.0)
    motion = table(al.Sinusoid([0.0, 0.0], [0.5, 0.8], [1.0, 2.0], [0.0, 0.0]), 4000)
    law = al.Adaptive(arm, motion, kp=[50.0, 50.0], kd=[10.0, 10.0], gamma=[2.0, 1.0, 1.0])
    return Loop("PR, adaptive", arm, law, motion, [0.1, -0.2], 4000)


def loops(arms: dict[str, Callable[[], al.Arm]]) -> Iterator[Loop]:
    yield printed()
    for name, make in arms.items():
        arm = make()
        n, rest = arm.n, np.full(arm.n, 0.1)
        steps = 4000 if n < 4 else 800
        motion = table(al.Sinusoid(rest, [0.2] * n, [1.0 + 0.1 * i for i in range(n)], [0.0] * n), steps)
        inertia = np.diag(arm.mass_matrix(rest))
        yield Loop(f"{name}, computed torque", arm, al.ComputedTorque(arm, motion, kp=50.0, kd=10.0), motion, rest, steps)
        adaptive = al.Adaptive(arm, motion, kp=50.0 * inertia, kd=10.0 * inertia, gamma=0.01 * float(inertia.min()))
        yield Loop(f"{name}, adaptive", arm, adaptive, motion, rest, steps)


def require_equal(what: str, ours: Any, theirs: Any) -> None:
    np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-11, err_msg=f"bench_sampled: {what}")


def numpy_pr(steps: int) -> Any:
    """The final state of the PR robot under the adaptive law, sampled at every step, from its closed form."""
    A, B, C = 2.0, 0.5, 1.0
    x, z = np.array([0.1, -0.2, 0.0, 0.0]), np.zeros(3)
    amplitude, frequency = np.array([0.5, 0.8]), np.array([1.0, 2.0])
    for k in range(steps):
        phase = frequency * (k * H)
        q_d, v_d, a_d = amplitude * np.sin(phase), amplitude * frequency * np.cos(phase), -amplitude * frequency**2 * np.sin(phase)
        v_r, a_r = v_d + 5.0 * (q_d - x[:2]), a_d + 5.0 * (v_d - x[2:])
        s, c, sn = v_r - x[2:], np.cos(x[1]), np.sin(x[1])
        Y = np.array([[a_r[0], a_r[1] * c - x[3] * v_r[1] * sn, 0.0], [0.0, a_r[0] * c, a_r[1]]])
        tau = Y @ z + 10.0 * s

        def rate(x: Any, tau: Any = tau) -> Any:
            M = np.array([[A, B * np.cos(x[1])], [B * np.cos(x[1]), C]])
            return np.concatenate([x[2:], np.linalg.solve(M, tau - np.array([-B * np.sin(x[1]) * x[3] ** 2, 0.0]))])

        k1 = rate(x)
        k2 = rate(x + 0.5 * H * k1)
        k3 = rate(x + 0.5 * H * k2)
        x = x + H / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rate(x + H * k3))
        z = z + H * np.array([2.0, 1.0, 1.0]) * (Y.T @ s)
    return x[:2]


def numba_pr(loop: Loop) -> Callable[[], Any]:
    """The loop of `numpy_pr` with scalars in numba."""
    import math

    import numba

    @numba.njit(fastmath=False)
    def plant(sn: float, c: float, v2: float, t1: float, t2: float) -> tuple[float, float]:
        b = 0.5 * c
        r1 = t1 + 0.5 * sn * v2 * v2
        inverse = 1.0 / (2.0 - b * b)
        return (r1 - b * t2) * inverse, (2.0 * t2 - b * r1) * inverse

    @numba.njit(fastmath=False)
    def run(rows: Any, steps: int, h: float) -> tuple[float, float]:
        q1, q2, v1, v2, a, b, c = 0.1, -0.2, 0.0, 0.0, 0.0, 0.0, 0.0
        g = 0.5 * h
        for k in range(steps):
            r = rows[2 * k]
            sn, cs = math.sin(q2), math.cos(q2)
            e1, e2, d1, d2 = r[0] - q1, r[1] - q2, r[2] - v1, r[3] - v2
            s1, s2, a1, a2 = d1 + 5.0 * e1, d2 + 5.0 * e2, r[4] + 5.0 * d1, r[5] + 5.0 * d2
            y12, y22 = a2 * cs - v2 * (r[3] + 5.0 * e2) * sn, a1 * cs
            t1, t2 = a1 * a + y12 * b + 10.0 * s1, y22 * b + a2 * c + 10.0 * s2
            k1, l1 = plant(sn, cs, v2, t1, t2)
            m1, m2, p = v1 + g * k1, v2 + g * l1, q2 + g * v2
            k2, l2 = plant(math.sin(p), math.cos(p), m2, t1, t2)
            n1, n2, p = v1 + g * k2, v2 + g * l2, q2 + g * m2
            k3, l3 = plant(math.sin(p), math.cos(p), n2, t1, t2)
            o1, o2, p = v1 + h * k3, v2 + h * l3, q2 + h * n2
            k4, l4 = plant(math.sin(p), math.cos(p), o2, t1, t2)
            q1 += h / 6.0 * (v1 + 2.0 * (m1 + n1) + o1)
            q2 += h / 6.0 * (v2 + 2.0 * (m2 + n2) + o2)
            v1 += h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
            v2 += h / 6.0 * (l1 + 2.0 * (l2 + l3) + l4)
            a, b, c = a + 2.0 * h * a1 * s1, b + h * (y12 * s1 + y22 * s2), c + h * a2 * s2
        return q1, q2

    samples = [loop.motion(0.5 * H * k) for k in range(2 * loop.steps + 1)]
    rows = np.ascontiguousarray(np.hstack([np.array(part) for part in zip(*samples, strict=True)]))
    require_equal("numba", run(rows, CHECKED, H), numpy_pr(CHECKED))
    return partial(run, rows, loop.steps, H)


@dataclass
class Row:
    """The times of one loop: continuous, sampled at every step, and at every tenth step."""

    loop: Loop
    what: str
    cases: dict[int, Case]

    def ratio(self, hold: int) -> float:
        return timing.ratio(self.cases[hold], self.cases[0])


def rows_of(loop: Loop) -> Iterator[Row]:
    for what, method in (("one run", "rk4"), ("one run", "euler"), ("batch", "rk4")):
        cases = {}
        for hold in (0, 1, 10):
            if hold and "computed torque" in loop.name:
                require_equal(f"{loop.name}, {method}", loop.run(method, hold * H, CHECKED).q[-1], loop.by_hand(method, hold))
            steps = loop.steps if what == "one run" else min(loop.steps, 200)
            run, runs = (loop.run, 1) if what == "one run" else (loop.batch, RUNS)
            cases[hold] = Case(what, f"{loop.name}, {what}, {method}, {hold}", partial(run, method, hold * H, steps), steps * runs)
        yield Row(loop, f"{what}, {method}", cases)


def verdicts(rows: list[Row], beside: list[tuple[str, float]]) -> list[reporting.Verdict]:
    def verdict(name: str, goal: float, ratios: list[tuple[float, str]]) -> reporting.Verdict:
        met = sum(ratio <= goal for ratio, _ in ratios)
        worst = max(ratios)
        return name, f"at most {goal}", f"{met} of {len(ratios)}; largest {worst[0]:.2f} ({worst[1]})", met == len(ratios)

    rk4 = [row for row in rows if "rk4" in row.what]
    each = {
        f"every step, at most {5} joints": (SMALL, 1, [row for row in rk4 if row.loop.arm.n < 6]),
        "every step, six joints and more": (LARGE, 1, [row for row in rk4 if row.loop.arm.n >= 6]),
        "every step, Euler": (EULER, 1, [row for row in rows if "euler" in row.what]),
        "every tenth step": (LONG, 10, rk4),
    }
    found = []
    for name, (goal, hold, those) in each.items():
        found.append(verdict(name, goal, [(row.ratio(hold), f"{row.loop.name}, {row.what}") for row in those]))
    return found + [(f"PR, adaptive / {name}", f"at most {NUMBA}", f"{ratio:.2f}", ratio <= NUMBA) for name, ratio in beside]


def controllers(loop: Loop) -> list[Case]:
    def case(name: str, sampling: Any) -> Case:
        run, against = partial(loop.run, "rk4", sampling, loop.steps), f"{loop.name}, plain"
        return Case(loop.name, f"{loop.name}, {name}", run, loop.steps, against=against)

    return [case(name, al.Sampling(H, **given)) for name, given in CONTROLLERS.items()]


def main() -> None:
    parser = reporting.arguments("sampled loops beside continuous loops")
    parser.add_argument("--arms", nargs="*", default=[], help="files of URDF")
    options = parser.parse_args()
    reporting.require_release("bench_sampled")
    share = timing.busy()
    made = list(loops(ARMS | {Path(path).stem: partial(al.load_urdf, path) for path in options.arms}))
    require_equal("PR, adaptive", made[0].run("rk4", H, CHECKED).q[-1], numpy_pr(CHECKED))
    rows = [row for loop in made for row in rows_of(loop)]
    peer = timing.if_there("numba", partial(numba_pr, made[0]), print)
    peers = [Case("one run", "numba", peer, made[0].steps)] if peer else []
    others = [case for loop in made if loop.name in CONTROLLED for case in controllers(loop)]
    cases = [case for row in rows for case in row.cases.values()] + peers + others
    timing.measure(cases, options.rounds, options.core, lambda text: print(text, flush=True))
    ours = rows[0].cases[1]
    table = reporting.target_table(verdicts(rows, [(case.name, timing.ratio(ours, case)) for case in peers]))
    lines = ["| loop | case | continuous | every step | ratio | every tenth step | ratio |", "|---|---|---:|---:|---:|---:|---:|"]
    for row in rows:
        times = [f"{row.cases[0].median:.3g}", *(cell for k in (1, 10) for cell in (f"{row.cases[k].median:.3g}", f"{row.ratio(k):.2f}"))]
        lines.append(f"| {row.loop.name} | {row.what} | {' | '.join(times)} |")
    text = [reporting.heading(cases, share), "", *table, "", "**ns per step and run**", "", *lines]
    text += [f"| PR, adaptive | numba | | {case.median:.3g} | | | |" for case in peers]
    text += ["", "**Controllers, one run, RK4, sampled at every step**", ""]
    text += ["| controller | ns per step | ratio to plain |", "|---|---:|---:|"]
    plain = {case.name: case for case in others}
    text += [f"| {case.name} | {case.median:.3g} | {timing.ratio(case, plain[case.against or '']):.2f} |" for case in others]
    reporting.finish("sampled", "\n".join(text), options.readme)


if __name__ == "__main__":
    main()
