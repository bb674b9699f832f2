"""The control laws that `bench_control_laws.py` times, each twice: as a law of armlet, and as CasADi expressions that become C.

`CONTROL` lists the cases. The laws are null-space control, PID with all its options, adaptation of friction and composite adaptation. Two
more cases have a momentum observer (`Guarded`) and a plant with LuGre friction. The C uses armlet's algorithms. It inverts matrices with
clamped eigenvalues by Jacobi sweeps. It computes tanh and exp from a rational approximation by repeated doubling of the argument.
Composite adaptation has filters that stay zero; armlet and the C omit them. The function `beside` returns loops with an option and loops
without it.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from generated_c import Array
from generated_cases import Laws
from generated_model import Expressions

import armlet as al

CONTROL = (
    "null space",
    "static null space",
    "compensated coupling",
    "PID, all options",
    "adaptive, friction",
    "composite",
    "guarded",
    "LuGre",
)
EPS, SLOW, FILTER, WATCH, RATE = 0.02, 0.1, 200.0, 20.0, 10.0
# Friction per unit of joint inertia: Coulomb and static friction; stiffness, damping and viscous friction of the bristles. The step size
# resolves the bristles.
COULOMB, STATIC, BRISTLES, DAMPED, VISCOUS = 0.5, 0.8, 50.0, 5.0, 0.2
SWEEPS = (0, 0, 1, 4, 5, 6, 7)
SHARE, DOUBLINGS = 1.0 / 64.0, 6


def larger(a: Any, b: Any) -> Any:
    return ca.fmax(a, b)


def near_zero(x: Any) -> Any:
    """tanh(x) near zero by a rational approximation."""
    z = x * x
    return x * (((z + 378.0) * z + 17325.0) * z + 135135.0) / (((28.0 * z + 3150.0) * z + 62370.0) * z + 135135.0)


def tanh(x: Any) -> Any:
    """tanh(x) by `near_zero` of x / 64 and six doublings, as armlet computes it. Vectors have no tanh of the C library."""
    t = near_zero(ca.fmin(ca.fmax(x, -20.0), 20.0) * SHARE)
    for _ in range(DOUBLINGS):
        t = (t + t) / (t * t + 1.0)
    return t


def decay(x: Any) -> Any:
    """exp(-x) for x >= 0, by `near_zero` of a fraction of x and six doublings."""
    t = near_zero(ca.fmin(x, 40.0) * (0.5 * SHARE))
    u = (t + t) / (1.0 + t)
    for _ in range(DOUBLINGS):
        u = u * (2.0 - u)
    return 1.0 - u


def clamped_inverse(a: Any, floor: float) -> Any:
    """Inverse of a symmetric matrix after each eigenvalue below `floor` is replaced by `floor`.

    Jacobi sweeps compute the eigenvalues. Off-diagonal entries that remain after the sweeps count to first order.
    """
    m = a.shape[0]
    v, least = ca.SX.eye(m), 1e-14 * ca.sumsqr(a)
    a = ca.SX(a)
    for _ in range(SWEEPS[m]):
        for p in range(m):
            for q in range(p + 1, m):
                twice, d = 2.0 * a[p, q], a[q, q] - a[p, p]
                square = d * d + twice * twice
                there = least < square
                root = ca.sqrt(ca.if_else(there, square, 1.0))
                t = ca.if_else(there, twice / (d + ca.if_else(d < 0, -root, root)), 0.0)
                c = 1.0 / ca.sqrt(t * t + 1.0)
                s = t * c
                turned, between = ca.SX(a), a[p, q]
                turned[p, p], turned[q, q] = a[p, p] - t * between, a[q, q] + t * between
                turned[p, q] = turned[q, p] = ca.if_else(there, 0.0, between)
                for k in range(m):
                    if k not in (p, q):
                        x, y = c * a[k, p] - s * a[k, q], s * a[k, p] + c * a[k, q]
                        turned[k, p], turned[p, k], turned[k, q], turned[q, k] = x, x, y, y
                a = turned
                v_p, v_q = c * v[:, p] - s * v[:, q], s * v[:, p] + c * v[:, q]
                v[:, p], v[:, q] = v_p, v_q
    f = ca.SX(m, m)
    for i in range(m):
        f[i, i] = 1.0 / larger(a[i, i], floor)
        for j in range(i):
            low, high = ca.fmin(a[i, i], a[j, j]), ca.fmax(a[i, i], a[j, j])
            some, both = low < floor, high < floor
            apart = ca.if_else(both, 1.0, ca.if_else(some, high - low, 1.0))
            share = ca.if_else(both, 0.0, ca.if_else(some, (high - floor) / apart, 1.0))
            f[i, j] = f[j, i] = -(share * a[i, j] * f[i, i] * f[j, j])
    return v @ f @ v.T


class Factored:
    """The factors L and D of M = L' D L, computed once per configuration."""

    def __init__(self, arm: Expressions) -> None:
        self.arm, self.factor = arm, arm.mass_entries()
        self.above = [arm.ancestors(i) for i in range(arm.n)]
        for k in reversed(range(arm.n)):
            inverse = 1 / self.factor[k, k]
            for i in self.above[k]:
                ratio = self.factor[k, i] * inverse
                for j in [i, *self.above[i]]:
                    self.factor[i, j] = self.factor[i, j] - ratio * self.factor[k, j]
                self.factor[k, i] = ratio

    def half(self, b: Any) -> Any:
        """Compute D^-1/2 L'^-1 b for a vector b (n,)."""
        x = ca.vertsplit(b)
        for k in reversed(range(self.arm.n)):
            for i in self.above[k]:
                x[i] = x[i] - self.factor[k, i] * x[k]
        return ca.vertcat(*(x[k] / ca.sqrt(self.factor[k, k]) for k in range(self.arm.n)))


class ControlLaws(Laws):
    """The laws of `CONTROL` for one arm. The state is x = [q, v], followed by the state of the law."""

    def __init__(self, arm: al.Arm, steps: int) -> None:
        super().__init__(arm.with_drives(damping=[1.0] * arm.n, friction=[0.5] * arm.n), steps)
        self.posture = self.rest + 0.2

    def armlet(self, law: str) -> Any:
        arm, rows = self.arm, len(self.axes)
        if law == "PID, all options":
            return al.PID(
                arm, self.motion, self.kp, self.kp, self.kd, 1e3, derivative_filter=FILTER, friction=True, friction_speed=SLOW,
                observer_bandwidth=WATCH, nominal_inertia=self.kp / 50.0,
            )  # fmt: skip
        if law in ("adaptive, friction", "composite"):
            more = {"friction": True, "friction_speed": SLOW} if law != "composite" else {"composite": self.gamma, "composite_rate": RATE}
            return al.Adaptive(arm, self.motion, kp=self.kp, kd=self.kd, gamma=self.gamma, **more)
        if law in ("guarded", "LuGre"):
            tracking = al.ComputedTorque(arm, self.motion, kp=50.0, kd=10.0)
            return tracking if law == "LuGre" else al.Guarded(tracking, al.MomentumObserver(arm, WATCH))
        names = "".join("xyz"[k] for k in self.axes)
        null_space = al.NullSpace(self.posture, self.kp, self.kd, projection="static" if law.startswith("static") else "consistent")
        return al.CartesianImpedance(
            arm, self.target, [300.0] * rows, [60.0] * rows, frame=self.frame, axes=names, nullspace=null_space,
            compensate_coupling=law == "compensated coupling", eps=EPS,
        )  # fmt: skip

    def plant(self, law: str) -> Any:
        if law != "LuGre":
            return al.RigidArm(self.arm)
        inertia = self.kp / 50.0
        curve = {"coulomb": COULOMB * inertia, "static": STATIC * inertia, "stribeck_speed": SLOW, "viscous": VISCOUS * inertia}
        return al.RigidArm(self.arm, friction=al.LuGre(**curve, stiffness=BRISTLES * inertia, damping=DAMPED * inertia))

    def fill(self, law: str, found: Array) -> None:
        if law == "PID, all options":
            found[:, 3 * self.n : 4 * self.n] = found[:, : self.n]

    def expressions(self, law: str) -> tuple[Any, Any, Any]:
        n = self.n
        sizes = {
            "PID, all options": 5 * n,
            "adaptive, friction": 14 * n,
            "composite": 13 * n + 10 * n * n,
            "guarded": 4 * n,
            "LuGre": 3 * n,
        }
        x, u = ca.SX.sym("x", sizes.get(law, 2 * n)), ca.SX.sym("u", 3 * n)
        q, v, z, motion = x[:n], x[n : 2 * n], x[2 * n :], ca.vertsplit(u, n)
        arm = Expressions(self.tree, q)
        drag: Any = 0
        if law in ("guarded", "LuGre"):
            q_d, v_d, a_d = motion
            tau = arm.inverse_dynamics(v, a_d + 50.0 * (q_d - q) + 10.0 * (v_d - v))
            if law == "guarded":
                rate = self._observer(arm, q, v, z[:n], tau)
            else:
                drag, rate = self._bristles(v, z)
        elif law == "PID, all options":
            tau, rate = self._pid(arm, q, v, z, motion)
        elif law in ("adaptive, friction", "composite"):
            tau, rate = self._adaptive(arm, q, v, z, motion, law)
        else:
            tau, rate = self._impedance(arm, q, v, law), z
        return x, u, ca.vertcat(v, arm.forward_dynamics(v, tau - drag), rate)

    def _observer(self, arm: Expressions, q: Any, v: Any, w: Any, tau: Any) -> Any:
        """The momentum observer's rate w_dot and residual r.

        The momentum is p = M v. C'v, with the transpose C', is the gradient of the kinetic energy.
        """
        still = ca.SX(self.n, 1)
        gravity = arm.inverse_dynamics(still, still)
        momentum = arm.inverse_dynamics(still, v) - gravity
        r = WATCH * (momentum - w)
        return ca.vertcat(tau + ca.gradient(0.5 * ca.dot(v, momentum), q) - gravity + r, r)

    def _bristles(self, v: Any, z: Any) -> tuple[Any, Any]:
        """LuGre friction torque tau_f and rate z_dot of the bristles, from velocity v and deflection z."""
        inertia = self.kp / 50.0
        level = ca.vertcat(*(inertia[i] * (COULOMB + (STATIC - COULOMB) * decay((v[i] / SLOW) ** 2)) for i in range(self.n)))
        spring = ca.DM(BRISTLES * inertia) * z
        slips = v - larger(v, -v) * spring / level
        return spring + ca.DM(DAMPED * inertia) * slips + ca.DM(VISCOUS * inertia) * v, slips

    def _impedance(self, arm: Expressions, q: Any, v: Any, law: str) -> Any:
        still, rows = ca.SX(self.n, 1), self.axes.tolist()
        p, jacobian = arm.position(self.frame)[0][rows], arm.jacobian(self.frame)[rows, :]
        force = 300.0 * (ca.DM(self.target) - p) - 60.0 * (jacobian @ v)
        gravity = arm.inverse_dynamics(still, still)
        asked = ca.DM(self.kp) * (ca.DM(self.posture) - q) - ca.DM(self.kd) * v
        if law.startswith("static"):
            spread, pushed = jacobian, asked
        else:
            factored = Factored(arm)
            spread = ca.horzcat(*(factored.half(jacobian[k, :].T) for k in range(len(rows)))).T
            pushed = factored.half(asked)
        square = spread @ spread.T
        scale = 1.0 / ca.sqrt(ca.trace(square) / len(rows))
        inverse = clamped_inverse(square * (scale * scale), EPS * EPS) * (scale * scale)
        tau = gravity + asked - jacobian.T @ (inverse @ (spread @ pushed))
        if law == "compensated coupling":
            moving = ca.jtimes(jacobian @ v, q, v)
            force = force - inverse @ moving
            tau = tau + arm.inverse_dynamics(v, still) - gravity
        return tau + jacobian.T @ force

    def _pid(self, arm: Expressions, q: Any, v: Any, z: Any, motion: list[Any]) -> tuple[Any, Any]:
        n, still, (q_d, v_d, a_d) = self.n, ca.SX(self.n, 1), motion
        w, filtered, s = z[:n], z[n : 2 * n], z[2 * n :]
        kp, kd, m, limit = ca.DM(self.kp), ca.DM(self.kd), ca.DM(self.kp / 50.0), 1e3
        e, speed = q_d - q, FILTER * (q - filtered)
        drag = ca.vertcat(*(1.0 * v_d[i] + 0.5 * tanh(v_d[i] / SLOW) for i in range(n)))
        nominal = arm.inverse_dynamics(still, still) + drag
        seen = WATCH * (m * speed - s)
        free = nominal + kp * e + kd * (v_d - speed) + w + m * a_d - seen
        rates, held = ca.vertsplit(kp * e), ca.vertsplit(free)
        for i in range(n):
            down = ca.if_else(held[i] < -limit, ca.fmax(rates[i], 0.0), rates[i])
            rates[i] = ca.if_else(limit < held[i], ca.fmin(rates[i], 0.0), down)
            held[i] = ca.fmin(ca.fmax(held[i], -limit), limit)
        tau = ca.vertcat(*held)
        return tau, ca.vertcat(*rates, speed, tau - nominal + seen)

    def _adaptive(self, arm: Expressions, q: Any, v: Any, z: Any, motion: list[Any], law: str) -> tuple[Any, Any]:
        n, still, (q_d, v_d, a_d) = self.n, ca.SX(self.n, 1), motion
        kp, kd, armature = ca.DM(self.kp), ca.DM(self.kd), ca.DM(self.tree.armature)
        estimate = z[: 10 * n]
        bodies, lag = ca.vertsplit(estimate, 10), v_d + kp / kd * (q_d - q)
        s, a_r = lag - v, a_d + kp / kd * (v_d - v)
        modelled = arm.slotine_li(v, lag, a_r, bodies)
        tau, follows = modelled + kd * s + armature * a_r, ca.gradient(ca.dot(s, modelled), estimate)
        if law == "adaptive, friction":
            smooth = ca.vertcat(*(tanh(lag[i] / SLOW) for i in range(n)))
            viscous, coulomb = z[10 * n : 11 * n], z[11 * n :]
            return tau + viscous * lag + coulomb * smooth, self.gamma * ca.vertcat(follows, lag * s, smooth * s)

        def regressor(v: Any, v_r: Any, a_r: Any) -> Any:
            return ca.jacobian(arm.slotine_li(v, v_r, a_r, bodies), estimate)

        resting = regressor(still, still, still)
        momentum = regressor(still, still, v) - resting
        units = (ca.DM.eye(n)[:, i] for i in range(n))
        drift = ca.vertcat(*(resting[i, :] - v.T @ (regressor(v, ca.SX(e_i), still) - resting) for i, e_i in enumerate(units)))
        kept, torque = ca.reshape(z[10 * n : -n], 10 * n, n).T, z[-n:]
        # Filters of regressor entries that are zero in every state stay zero, so `project` omits them.
        seen = momentum + ca.project(kept, (momentum + drift).sparsity())
        error = torque - armature * v - seen @ estimate
        rates = self.gamma * (follows + seen.T @ (self.gamma * error))
        return tau, ca.vertcat(rates, ca.vec((drift - RATE * seen).T), tau - RATE * torque + RATE * armature * v)


def beside(arm: al.Arm, motion: Any) -> dict[str, tuple[tuple[Any, Any], tuple[Any, Any], dict[str, Any]]]:
    """For each option: a loop with the option, the same loop without it, and keyword arguments of `simulate` for both.

    The results of both loops are equal: the friction is below rounding, and the arm touches nothing.
    """
    tracking = al.ComputedTorque(arm, motion, kp=50.0, kd=10.0)
    watch = al.MomentumObserver(arm, WATCH, threshold=1e6)
    smooth, inertia = al.RigidArm(arm), np.diag(arm.mass_matrix(np.zeros(arm.n)))
    rubbing = al.RigidArm(arm, friction=al.StickSlip(coulomb=1e-12 * inertia, static=2e-12 * inertia, stribeck_speed=SLOW))
    reacts = {"stiffness": 50.0 * inertia, "damping": 10.0 * inertia}
    sampled = {"sample_time": 1e-3}
    return {
        "stick-slip": ((rubbing, tracking), (smooth, tracking), {}),
        "guarded, stop": ((smooth, al.Guarded(tracking, watch, "stop", **reacts)), (smooth, tracking), sampled),
        "guarded, retract": ((smooth, al.Guarded(tracking, watch, "retract", **reacts)), (smooth, tracking), sampled),
    }
