"""Cartesian impedance and joint impedance, for rigid arms and for arms with elastic joints.

rigid    tau = J'[K_m e + D_m (x_d_dot - J v) + F_ff + w] + N' tau_0 + g(q),   e = x_d - x,   w_dot = K_i e
         `null_space` computes N' tau_0 and the coupling;   limits clip the wrench and tau
         a row of w_dot is 0   if it would increase the excess over a limit
elastic  u = the torque above, or K (q_d - q) + D (v_d - v) + g(q);   B0 theta_ddot + D0 z + tau_J = u,  tau_J = K_J (theta - q)
         B theta_ddot + tau_J = tau:   the motor of inertia B behaves like a motor of inertia B0
         z = theta_dot, or theta_dot - v with relative damping            (Ott, Albu-Schaeffer, Kugi and Hirzinger 2008)
D0       = 2 zeta B0^1/2 (B0^-1/2 K_J B0^-1/2)^1/2 B0^1/2
E        = v'Mv/2 + (theta-q)'K_J(theta-q)/2 + theta_dot'B0 theta_dot/2 + e'K_m e/2
P = dE/dt = F.x_dot - theta_dot'D0 z + x_dot.F_law + (x_d_dot - x_dot).K_m e + v.(u - J'F_law - g) + (theta_dot - v).u

x are the controlled coordinates with the Jacobian J and the target x_d. K_m, D_m and K_i are stiffness, damping and integral gain, and w is
the integral wrench. F_ff is the feedforward wrench, F_law the wrench in the bracket with the coupling wrench, and F the external force on
the tip. K and D are the stiffness and the damping of a joint impedance with the target q_d and its velocity v_d. K_J is the joint
stiffness, and zeta the damping ratio. E and P are for elastic joints. The formula of P holds without torque limits and contact, and if the
plant has no damping and no friction. ' is the transpose, and _dot the time derivative.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .arm import Arm
from .lagrange import Array, Mechanism, solve
from .law import Law, PDGravity, Terms, gain
from .motion import Hold, Motion
from .null_space import EPS, NullSpace, clamped, coupling, held, row_rates
from .task import Coordinates, parse_axes, rotation_vector


def power(A: Array, exponent: float) -> Array:
    """The power A^exponent of a symmetric positive definite matrix, from its eigenvalues."""
    values, U = np.linalg.eigh(A)
    if values.min() <= 0.0:
        raise ValueError(f"matrix is not positive definite: smallest eigenvalue {values.min()!r}")
    raised: Array = (U * values**exponent) @ U.T
    return raised


def ratio_damping(inertia: Array, stiffness: Array, ratio: float) -> Array:
    """The damping matrix D with which every mode of inertia, D and stiffness has the damping ratio `ratio`."""
    root, inverse = power(inertia, 0.5), power(inertia, -0.5)
    damping: Array = 2.0 * ratio * root @ power(inverse @ stiffness @ inverse, 0.5) @ root
    return damping


class CartesianImpedance(Law):
    """A spring and a damper between a frame and its target, with gravity compensation.

    With an integral gain, the state is the integral wrench w (m,).
    """

    def __init__(
        self,
        arm: Arm,
        target: Any,
        stiffness: ArrayLike,
        damping: ArrayLike,
        *,
        frame: str,
        axes: str = "xyz",
        nullspace: NullSpace | None = None,
        feedforward: ArrayLike | None = None,
        compensate_coupling: bool = False,
        eps: float | None = None,
        integral_gain: ArrayLike | None = None,
        wrench_max: ArrayLike = np.inf,
        tau_max: ArrayLike = np.inf,
    ) -> None:
        self.arm, self.nullspace, self.compensates = arm, nullspace, compensate_coupling
        self.eps = EPS if eps is None else eps
        if not callable(target) and np.shape(target) == (4, 4):
            target = np.concatenate([np.asarray(target)[:3, 3], rotation_vector(np.asarray(target)[:3, :3])])[parse_axes(axes)]
        self.motion: Motion = target if callable(target) else Hold(target)
        self.breaks = getattr(target, "breaks", ())
        self.coordinates = Coordinates(arm, self.motion(0.0)[0], frame, axes)
        rows = len(self.coordinates.rows)
        self.stiffness, self.damping = gain(stiffness, rows), gain(damping, rows)
        self.feedforward = np.zeros(rows) if feedforward is None else np.asarray(feedforward, dtype=np.float64)
        self.integral_gain = None if integral_gain is None else gain(integral_gain, rows)
        self.state0 = np.zeros(0 if integral_gain is None else rows)
        self.wrench_max: Array = np.broadcast_to(np.asarray(wrench_max, dtype=np.float64), (rows,))
        self.tau_max: Array = np.broadcast_to(np.asarray(tau_max, dtype=np.float64), (arm.n,))
        self.load = self.coordinates.load

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        x_d, rate, acceleration = self.motion(t)
        rate, acceleration = row_rates(self.coordinates.rows, x_d, rate, acceleration)
        e, J = self.coordinates.error(q, x_d), self.coordinates.jacobian(q)
        F = self.stiffness @ e + self.damping @ (rate - J @ v) + self.feedforward
        w = self.state0 if state is None else state
        free = F + w if w.size else F
        F = np.clip(free, -self.wrench_max, self.wrench_max)
        more = np.zeros(self.arm.n)
        if self.compensates:
            more, added = coupling(self.arm, self.coordinates, q, v, acceleration, self.eps)
            F = F + added
        parts = {"e": e, "J": J, "x_d": x_d, "x_dot": J @ v, "rate": rate, "force": F}
        if self.nullspace is not None:
            W = self.arm.mass_matrix(q) if self.nullspace.projection == "consistent" else np.eye(q.size)
            N, L, loss = clamped(J, W, self.coordinates.rows, self.eps)
            tau_0 = self.nullspace.torque(t, q, v)
            more = more + N @ tau_0
            parts |= {"tau_0": tau_0, "null_torque": N @ tau_0, "L": L, "loss": np.array(loss)}
        u = J.T @ F + self.arm.gravity(q) + more
        w_rate = np.zeros(0) if self.integral_gain is None else self.integral_gain @ e
        for k in range(w_rate.size):
            if held(free[k], self.wrench_max[k], w_rate[k]) or held(u, self.tau_max, J[k] * w_rate[k]):
                w_rate[k] = 0.0
        tau = np.clip(u, -self.tau_max, self.tau_max)
        return parts | {"tau": tau, "state_rate": w_rate, "u": tau, "beside": more}


class Reduction:
    """The inner loop: motors of inertia B behave like motors of inertia B0. If `motor_damping` is None, the damping ratio determines it."""

    def __init__(
        self,
        n: int,
        joint_stiffness: ArrayLike,
        motor_inertia: ArrayLike,
        reduced_inertia: ArrayLike,
        motor_damping: ArrayLike | None,
        damping_ratio: float,
        relative_damping: bool,
    ) -> None:
        self.joint_stiffness = gain(joint_stiffness, n)
        self.motor_inertia, self.reduced_inertia = gain(motor_inertia, n), gain(reduced_inertia, n)
        self.motor_damping = (
            ratio_damping(self.reduced_inertia, self.joint_stiffness, damping_ratio) if motor_damping is None else gain(motor_damping, n)
        )
        self.relative_damping = relative_damping

    def reduce(self, u: Array, q: Array, v: Array, theta: Array | None, theta_dot: Array | None) -> Terms:
        """The motor torque with which the motors behave like motors of inertia B0 under the torque `u`, and related terms."""
        if theta is None or theta_dot is None:
            raise ValueError("ElasticImpedance: theta and theta_dot are missing: the law belongs to an elastic arm")
        spring = self.joint_stiffness @ (theta - q)
        w = theta_dot - v if self.relative_damping else theta_dot
        # tau = spring + B theta_ddot, where theta_ddot is the acceleration of the reduced motor.
        reduced = solve(self.reduced_inertia, u - self.motor_damping @ w - spring)
        return {"tau": spring + self.motor_inertia @ reduced, "tau_J": spring, "w": w, "u": u}


class ElasticImpedance(CartesianImpedance, Reduction):
    """Cartesian impedance as the outer loop, and motor-inertia reduction as the inner one. `tau_max` limits the motor torques, not u."""

    def __init__(
        self,
        arm: Arm,
        target: Any,
        stiffness: ArrayLike,
        damping: ArrayLike,
        joint_stiffness: ArrayLike,
        motor_inertia: ArrayLike,
        reduced_inertia: ArrayLike,
        *,
        frame: str,
        axes: str = "xyz",
        motor_damping: ArrayLike | None = None,
        damping_ratio: float = 1.0,
        relative_damping: bool = False,
        **options: Any,
    ) -> None:
        CartesianImpedance.__init__(self, arm, target, stiffness, damping, frame=frame, axes=axes, **options)
        inner = (joint_stiffness, motor_inertia, reduced_inertia, motor_damping, damping_ratio, relative_damping)
        Reduction.__init__(self, arm.n, *inner)
        self.motor_max, self.tau_max = self.tau_max, np.full(arm.n, np.inf)

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        parts = super().terms(t, q, v, state=state)
        parts |= self.reduce(parts["u"], q, v, theta, theta_dot)
        free, rate = parts["tau"], parts["state_rate"]
        for k in range(rate.size):
            if held(free, self.motor_max, self.motor_inertia @ solve(self.reduced_inertia, parts["J"][k] * rate[k])):
                rate[k] = 0.0
        return parts | {"tau": np.clip(free, -self.motor_max, self.motor_max)}

    def energy(self, plant: Any, x: Array, terms: Terms) -> float:
        """The stored energy E, J, at the plant state x = (q, v, theta, theta_dot)."""
        q, v, theta, theta_dot = np.split(x, 4)
        stretch, e = theta - q, terms["e"]
        stored = v @ plant.arm.mass_matrix(q) @ v + stretch @ self.joint_stiffness @ stretch
        return float(0.5 * (stored + theta_dot @ self.reduced_inertia @ theta_dot + e @ self.stiffness @ e))

    def power(self, x: Array, terms: Terms, load: Array) -> float:
        """The power P = dE/dt, W."""
        _, v, _, theta_dot = np.split(x, 4)
        x_dot, rate = terms["x_dot"], terms["rate"]
        # The potential energy of the spring changes at the rate (x_d_dot - x_dot).K_m e. In addition to the power of gravity compensation,
        # the law supplies the powers x_dot.F_law and v.(N' tau_0 + C v).
        fed = x_dot @ terms["force"] + (rate - x_dot) @ self.stiffness @ terms["e"] + v @ terms["beside"]
        return float(load @ v - theta_dot @ self.motor_damping @ terms["w"] + fed + (theta_dot - v) @ terms["u"])


class ElasticTracking(ElasticImpedance):
    """The law `ElasticImpedance` with a moving target: a motion with one coordinate per row."""

    def __init__(self, arm: Arm, target: Motion, stiffness: ArrayLike, damping: ArrayLike, *inner: ArrayLike, **keywords: Any) -> None:
        super().__init__(arm, target, stiffness, damping, *inner, **keywords)


class JointImpedance(Law, Reduction):
    """A spring and a damper at the joints with gravity compensation as the outer loop, and motor-inertia reduction as the inner one."""

    def __init__(
        self,
        arm: Mechanism,
        target: Any,
        stiffness: ArrayLike,
        damping: ArrayLike,
        joint_stiffness: ArrayLike,
        motor_inertia: ArrayLike,
        reduced_inertia: ArrayLike,
        *,
        motor_damping: ArrayLike | None = None,
        damping_ratio: float = 1.0,
        relative_damping: bool = False,
    ) -> None:
        self.outer = PDGravity(arm, target, stiffness, damping)
        inner = (joint_stiffness, motor_inertia, reduced_inertia, motor_damping, damping_ratio, relative_damping)
        Reduction.__init__(self, arm.n, *inner)
        self.breaks = self.outer.breaks
        self.arm, self.target, self.stiffness, self.damping = arm, self.outer.target, self.outer.kp, self.outer.kd

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        parts = self.outer.terms(t, q, v)
        return parts | self.reduce(parts["tau"], q, v, theta, theta_dot)
