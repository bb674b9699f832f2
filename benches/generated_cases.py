"""Closed loops and functions of an arm that `bench_generated_c.py` times, in armlet and in generated C. Results are compared first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import casadi as ca
import numpy as np
import timing
from compiling import WIDEST
from generated_c import Array, Loop, Rows, from_lanes
from generated_model import Expressions
from generated_tree import Tree
from timing import Case

import armlet as al

H, BATCHES, ROWS, CALLS = 1e-3, (256, 1024), 4096, 500
CHECKED, SHORT, SHORTS, REPEATS = 200, 20, 50, 5
TWO = f"batch of {max(BATCHES):,}, two threads"
LAWS = ("computed torque", "PD", "impedance", "adaptive", "elastic impedance")


@dataclass
class Pair:
    """Two timed cases of the same computation: armlet's (`ours`) and the C's (`theirs`)."""

    ours: Case
    theirs: Case

    @staticmethod
    def of(group: str, name: str, ours: Callable[[], Any], theirs: Callable[[], Any], per: int, threads: int = 1) -> Pair:
        runs = zip(("armlet", "C"), (ours, theirs), strict=True)
        return Pair(*(Case(group, f"{whose}, {name}, {group}", run, per, threads=threads) for whose, run in runs))

    @property
    def ratio(self) -> float:
        return timing.ratio(self.ours, self.theirs)


def gains(one: Pair, two: Pair) -> tuple[float, float]:
    """Speed-up of two threads over one thread: of armlet, and of the C."""
    return timing.ratio(one.ours, two.ours), timing.ratio(one.theirs, two.theirs)


@dataclass
class Row:
    """A row of the table: arm, law or function, number of operations of the C, and the timed cases."""

    arm: str
    what: str
    operations: int
    tree: Tree
    pairs: dict[str, Pair]


def require_equal(what: str, ours: Any, theirs: Any, tolerance: float = 1e-9) -> None:
    off = float(np.abs(ours - theirs).max()) / max(1.0, float(np.abs(theirs).max()))
    if not off <= tolerance:
        raise SystemExit(f"bench_generated_c: {what}: armlet and the C differ by {off:.1e}")


class Laws:
    """The laws of an arm, for armlet and as expressions. u = [q_d, v_d, a_d]; x = [q, v], [q, v, estimate] or [q, v, theta, theta_dot]."""

    def __init__(self, arm: al.Arm, steps: int) -> None:
        n = self.n = arm.n
        self.arm, self.tree = arm, Tree(arm)
        self.rest, self.frame = np.full(n, 0.1), arm.tip_frame or arm.frame_names[-1]
        inertia = np.diag(arm.mass_matrix(self.rest))
        self.kp, self.kd, self.gamma = 50.0 * inertia, 10.0 * inertia, 0.01 * float(inertia.min())
        moves = np.abs(arm.jacobian(self.rest, self.frame)[:3]).max(axis=1) > 1e-9
        self.axes = np.flatnonzero(moves)[:n]
        self.target = arm.position(self.rest, self.frame)[self.axes]
        # Springs and motors with natural frequency sqrt(K_J / B_0) = 200 1/s, which the step size resolves.
        self.spring, self.motor, self.reduced, self.friction = 4e3 * inertia, 0.5 * inertia, 0.1 * inertia, 20.0 * inertia
        motion = al.Sinusoid([0.1] * n, [0.2] * n, [1.0 + 0.1 * i for i in range(n)], [0.0] * n)
        samples = [np.array(part) for part in zip(*(motion(0.5 * H * k) for k in range(2 * steps + 1)), strict=True)]
        self.motion, self.table = al.Table(0.5 * H, *samples), np.ascontiguousarray(np.hstack(samples))

    def armlet(self, law: str) -> Any:
        if law == "computed torque":
            return al.ComputedTorque(self.arm, self.motion, kp=50.0, kd=10.0)
        if law == "PD":
            return al.PDGravity(self.arm, self.rest, kp=self.kp, kd=self.kd)
        if law == "adaptive":
            return al.Adaptive(self.arm, self.motion, kp=self.kp, kd=self.kd, gamma=self.gamma)
        names, rows = "".join("xyz"[k] for k in self.axes), len(self.axes)
        asked = self.arm, self.target, [300.0] * rows, [60.0] * rows
        if law == "elastic impedance":
            motors = self.spring, self.motor, self.reduced
            return al.ElasticImpedance(*asked, *motors, frame=self.frame, axes=names, motor_damping=self.friction)
        return al.CartesianImpedance(*asked, frame=self.frame, axes=names)

    def fill(self, law: str, found: Array) -> None:
        """Write initial states of the law that are not zero into the rows of `found`, which begin with q. Here all of them are zero."""

    def plant(self, law: str) -> Any:
        return al.ElasticArm(self.arm, self.spring, self.motor) if law == "elastic impedance" else al.RigidArm(self.arm)

    def expressions(self, law: str) -> tuple[Any, Any, Any]:
        """State x, input u and rate x' of the closed loop."""
        n = self.n
        x, u = ca.SX.sym("x", {"adaptive": 12 * n, "elastic impedance": 4 * n}.get(law, 2 * n)), ca.SX.sym("u", 3 * n)
        q, v, (q_d, v_d, a_d) = x[:n], x[n : 2 * n], ca.vertsplit(u, n)
        arm, kp, kd, still = Expressions(self.tree, q), ca.DM(self.kp), ca.DM(self.kd), ca.SX(n, 1)
        rate = still[:0]
        if law == "computed torque":
            tau = arm.inverse_dynamics(v, a_d + 50.0 * (q_d - q) + 10.0 * (v_d - v))
        elif law == "PD":
            tau = kp * (ca.DM(self.rest) - q) - kd * v + arm.inverse_dynamics(still, still)
        elif law == "adaptive":
            estimate, lag = x[2 * n :], v_d + kp / kd * (q_d - q)
            s, a_r = lag - v, a_d + kp / kd * (v_d - v)
            modelled = arm.slotine_li(v, lag, a_r, ca.vertsplit(estimate, 10))
            tau = modelled + kd * s + ca.DM(self.tree.armature) * a_r
            rate = self.gamma * ca.gradient(ca.dot(s, modelled), estimate)
        else:
            p, jacobian = arm.position(self.frame)[0], arm.jacobian(self.frame)
            p, jacobian = p[self.axes.tolist()], jacobian[self.axes.tolist(), :]
            force = 300.0 * (ca.DM(self.target) - p) - 60.0 * (jacobian @ v)
            tau = jacobian.T @ force + arm.inverse_dynamics(still, still)
        if law == "elastic impedance":
            # tau acts on the motors: tau_m = (1 - B / B_0) tau_J + B / B_0 (tau - D_0 theta_dot), B theta_ddot = tau_m - tau_J.
            theta, theta_dot = x[2 * n : 3 * n], x[3 * n :]
            share, asked, tau = ca.DM(self.motor / self.reduced), tau - ca.DM(self.friction) * theta_dot, ca.DM(self.spring) * (theta - q)
            rate = ca.vertcat(theta_dot, ((1 - share) * tau + share * asked - tau) / ca.DM(self.motor))
        return x, u, ca.vertcat(v, arm.forward_dynamics(v, tau), rate)


class Ours:
    """armlet's runs of an arm under a law, single and in batches. They store only the final state and evaluate no monitors."""

    def __init__(self, laws: Laws, law: str) -> None:
        n = laws.n
        self.plant, self.law = laws.plant(law), laws.armlet(law)
        self.fill = partial(laws.fill, law)
        self.starts = 0.1 + np.random.default_rng(1).uniform(-0.05, 0.05, (max(BATCHES), n))
        self.elastic = isinstance(self.plant, al.ElasticArm)

    def states(self, size: int) -> Array:
        """Initial states (runs, size): at rest, springs relaxed, estimates zero."""
        found, n = np.zeros((len(self.starts), size)), self.starts.shape[1]
        found[:, :n] = self.starts
        if self.elastic:
            found[:, 2 * n : 3 * n] = self.starts
        self.fill(found)
        return found

    def _from(self, q0: Array) -> dict[str, Any]:
        return {"q0": q0, "theta0": q0} if self.elastic else {"q0": q0}

    def one(self, steps: int) -> Any:
        given = self._from(self.starts[0])
        return al.simulate(self.plant, self.law, **given, t_end=steps * H, dt=H, monitors=False, record_every=steps)

    def batch(self, runs: int, steps: int, threads: int = 1) -> Any:
        given = self._from(self.starts[:runs])
        return al.simulate_batch(self.plant, self.law, **given, t_end=steps * H, dt=H, monitors=False, keep="final", threads=threads)


def batch_steps(steps: int) -> int:
    return steps // 25


def alone(name: str, laws: Laws, law: str, steps: int) -> list[Case]:
    """Cases of armlet without C, for arms whose C takes too long to compile."""
    ours, runs, count = Ours(laws, law), BATCHES[0], batch_steps(steps)
    label = f"armlet, {name}, {law}"
    return [
        Case("One run, armlet only: ns per step", label, partial(ours.one, steps), steps),
        Case(f"Batch of {runs}, armlet only: ns per run and step", f"{label}, {runs} runs", partial(ours.batch, runs, count), runs * count),
    ]


def loop_row(name: str, laws: Laws, law: str, steps: int) -> Row:
    """Cases of a loop: one run of `steps`, one run of few steps, and batches. Equal states after `CHECKED` steps are asserted first."""
    n, ours, (x, u, rate) = laws.n, Ours(laws, law), laws.expressions(law)
    scalar, lanes = Loop(x, u, rate, 1), Loop(x, u, rate, WIDEST)
    starts = ours.states(x.numel())
    single = scalar.ready(starts[:1], laws.table, H)
    together = {runs: lanes.ready(starts[:runs], laws.table, H) for runs in BATCHES}

    run, many = ours.one(CHECKED), ours.batch(BATCHES[0], CHECKED)
    assert run.stats["engine"] == "machine", f"{name}, {law}: {run.stats['engine']}"
    ends = from_lanes(together[BATCHES[0]](CHECKED))[:, : 2 * n]
    require_equal(f"{name}, {law}, one run", np.hstack([run.q[-1], run.v[-1]]), single(CHECKED)[0, : 2 * n, 0])
    require_equal(f"{name}, {law}, batch", np.hstack([many.q[:, -1], many.v[:, -1]]), ends)
    assert np.isfinite(ours.one(steps).q[-1]).all() and np.isfinite(single(steps)).all(), (name, law)

    def pair(group: str, armlet: Callable[[], Any], generated: Callable[[], Any], per: int) -> Pair:
        return Pair.of(group, f"{name}, {law}", armlet, generated, per)

    few = range(SHORTS)
    pairs = {
        "one run": pair("one run", partial(ours.one, steps), partial(single, steps), steps),
        "short": pair("short", lambda: [ours.one(SHORT) for _ in few], lambda: [single(SHORT) for _ in few], SHORTS),
    }
    count = batch_steps(steps)
    for runs in BATCHES:
        group = f"batch of {runs:,}"
        pairs[group] = pair(group, partial(ours.batch, runs, count), partial(together[runs], count), runs * count)
    if len(timing.cores()) > 1:
        runs = max(BATCHES)
        both = partial(ours.batch, runs, count, 2), partial(together[runs], count, 2)
        pairs[TWO] = Pair.of(TWO, f"{name}, {law}", *both, runs * count, threads=2)
    return Row(name, law, scalar.operations, laws.tree, pairs)


@dataclass
class Function:
    """A function of an arm: armlet's callable, its arguments and value as expressions, and further arguments of the callable."""

    call: Callable[..., Array]
    parts: list[Any]
    value: Any
    more: tuple[Any, ...] = ()


def functions(arm: al.Arm) -> dict[str, Function]:
    q, v, a = (ca.SX.sym(letter, arm.n) for letter in "qva")
    known, frame = Expressions(Tree(arm), q), arm.tip_frame or arm.frame_names[-1]
    bias = known.inverse_dynamics(v, ca.SX(arm.n, 1), armature=False)
    return {
        "inverse dynamics": Function(arm.inverse_dynamics, [q, v, a], known.inverse_dynamics(v, a)),
        "mass matrix": Function(arm.mass_matrix, [q], known.mass_matrix()),
        "forward dynamics": Function(arm.forward_dynamics, [q, v, a], known.forward_dynamics(v, a)),
        "frame Jacobian": Function(arm.jacobian, [q], known.jacobian(frame), (frame,)),
        "bias": Function(arm.bias, [q, v], bias),
        "Coriolis matrix": Function(arm.coriolis_matrix, [q, v], known.coriolis_matrix(v)),
    }


def function_row(name: str, arm: al.Arm, what: str, made: Function) -> Row:
    """Cases of a function: batches of 4,096 rows, single calls, and batches of C whose rows are already arranged in lanes."""
    scalar, lanes = Rows(made.parts, made.value, 1), Rows(made.parts, made.value, WIDEST)
    given = list(np.random.default_rng(1).uniform(-1.0, 1.0, (len(made.parts), ROWS, arm.n)))
    together, arranged, single = lanes.rows(given), lanes.arranged(given), scalar.rows([part[:CALLS] for part in given])
    out = made.call(*given, *made.more)
    require_equal(f"{name}, {what}, lanes", out.reshape(ROWS, -1), together())
    require_equal(f"{name}, {what}, arranged", out.reshape(ROWS, -1), from_lanes(arranged()))
    require_equal(f"{name}, {what}, scalar", out[:CALLS].reshape(CALLS, -1), single())
    call, row = made.call, [*(part[0] for part in given), *made.more]
    require_equal(f"{name}, {what}, one call", call(*row).ravel(), out[0].ravel())
    label, repeats = f"{name}, {what}", range(REPEATS)

    def batch() -> None:
        for _ in repeats:
            call(*given, *made.more, out=out)

    def calls() -> None:
        for _ in range(CALLS):
            call(*row)

    pairs = {
        "batch": Pair.of("batch", label, batch, lambda: [together() for _ in repeats], REPEATS * ROWS),
        "arranged": Pair.of("arranged", label, batch, lambda: [arranged() for _ in repeats], REPEATS * ROWS),
        "call": Pair.of("call", label, calls, single, CALLS),
    }
    return Row(name, what, scalar.operations, Tree(arm), pairs)


def numpy_call() -> Case:
    """A call of numpy that makes an array of seven numbers, for comparison with single calls."""
    q = np.linspace(0.1, 0.7, 7)

    def calls() -> None:
        for _ in range(CALLS):
            np.negative(q)

    return Case("One call, for comparison: ns", "np.negative(q) of seven numbers", calls, CALLS)
