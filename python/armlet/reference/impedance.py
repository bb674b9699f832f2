"""Impedance, Cartesian or of the joints, for rigid arms and through elastic joints.

rigid    tau = J'[K_m (x_d - x) + D_m (x_d' - J v)] + g(q)
elastic  u = that, or K (q_d - q) - D v + g(q);   B0 theta_ddot + D0 w + tau_J = u,  tau_J = K_J (theta - q)
         B theta_ddot + tau_J = tau: the motor of inertia B that moves as one of B0 would
         w = theta_dot, or theta_dot - v with relative damping       (Ott, Albu-Schaeffer, Kugi and Hirzinger 2008)
D0 = 2 zeta B0^1/2 (B0^-1/2 K_J B0^-1/2)^1/2 B0^1/2
E  = v'Mv/2 + (theta-q)'K_J(theta-q)/2 + theta_dot'B0 theta_dot/2 + e'K_m e/2
P  = F.x_dot - theta_dot'D0 w + x_dot.D_m (x_d' - x_dot) + x_d'.K_m e + (theta_dot - v).u
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .arm import Arm
from .lagrange import Array, Mechanism, solve
from .law import Law, PDGravity, Terms, gain
from .motion import Hold, Motion
from .task import Coordinates


def power(A: Array, exponent: float) -> Array:
    """A^exponent of a symmetric positive definite matrix by its eigenvalues."""
    values, U = np.linalg.eigh(A)
    if values.min() <= 0.0:
        raise ValueError(f"matrix is not positive definite: smallest eigenvalue {values.min()!r}")
    raised: Array = (U * values**exponent) @ U.T
    return raised


def ratio_damping(inertia: Array, stiffness: Array, ratio: float) -> Array:
    """D with every mode of inertia, D, stiffness at the damping ratio."""
    root, inverse = power(inertia, 0.5), power(inertia, -0.5)
    damping: Array = 2.0 * ratio * root @ power(inverse @ stiffness @ inverse, 0.5) @ root
    return damping


class CartesianImpedance(Law):
    """Spring and damper between a frame and its target, gravity compensated."""

    def __init__(self, arm: Arm, target: ArrayLike, stiffness: ArrayLike, damping: ArrayLike, *, frame: str, axes: str = "xyz") -> None:
        self.arm = arm
        self.motion: Motion = Hold(target)
        self.coordinates = Coordinates(arm, target, frame, axes)
        rows = len(self.coordinates.rows)
        self.stiffness, self.damping = gain(stiffness, rows), gain(damping, rows)
        self.load = self.coordinates.load

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        x_d, rate, _ = self.motion(t)
        e, J = self.coordinates.error(q, x_d), self.coordinates.jacobian(q)
        u = J.T @ (self.stiffness @ e + self.damping @ (rate - J @ v)) + self.arm.gravity(q)
        return {"tau": u, "state_rate": np.zeros(0), "u": u, "e": e, "J": J, "x_d": x_d, "x_dot": J @ v, "rate": rate}


class Reduction:
    """The inner loop: motors of inertia B answer like B0; None for `motor_damping`: by the damping ratio."""

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
        """The motor torque that makes the motors answer `u`."""
        if theta is None or theta_dot is None:
            raise ValueError("ElasticImpedance: theta and theta_dot are missing: the law belongs to an elastic arm")
        spring = self.joint_stiffness @ (theta - q)
        w = theta_dot - v if self.relative_damping else theta_dot
        # tau = spring + B theta_ddot with theta_ddot taken from the reduced motor (6).
        reduced = solve(self.reduced_inertia, u - self.motor_damping @ w - spring)
        return {"tau": spring + self.motor_inertia @ reduced, "tau_J": spring, "w": w, "u": u}


class ElasticImpedance(CartesianImpedance, Reduction):
    """Motor-inertia reduction inside, impedance outside."""

    def __init__(
        self,
        arm: Arm,
        target: ArrayLike,
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
    ) -> None:
        CartesianImpedance.__init__(self, arm, target, stiffness, damping, frame=frame, axes=axes)
        inner = (joint_stiffness, motor_inertia, reduced_inertia, motor_damping, damping_ratio, relative_damping)
        Reduction.__init__(self, arm.n, *inner)

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        parts = super().terms(t, q, v)
        return parts | self.reduce(parts["u"], q, v, theta, theta_dot)

    def energy(self, plant: Any, x: Array, terms: Terms) -> float:
        """E above at the plant state x = (q, v, theta, theta_dot)."""
        q, v, theta, theta_dot = np.split(x, 4)
        stretch, e = theta - q, terms["e"]
        stored = v @ plant.arm.mass_matrix(q) @ v + stretch @ self.joint_stiffness @ stretch
        return float(0.5 * (stored + theta_dot @ self.reduced_inertia @ theta_dot + e @ self.stiffness @ e))

    def power(self, x: Array, terms: Terms, load: Array) -> float:
        """P above: the rate of E."""
        _, v, _, theta_dot = np.split(x, 4)
        x_dot, rate = terms["x_dot"], terms["rate"]
        fed = x_dot @ self.damping @ (rate - x_dot) + rate @ self.stiffness @ terms["e"]
        return float(load @ v - theta_dot @ self.motor_damping @ terms["w"] + fed + (theta_dot - v) @ terms["u"])


class ElasticTracking(ElasticImpedance):
    """The same about a moving target, a motion of one coordinate per row."""

    def __init__(self, arm: Arm, target: Motion, stiffness: ArrayLike, damping: ArrayLike, *inner: ArrayLike, **keywords: Any) -> None:
        super().__init__(arm, target(0.0)[0], stiffness, damping, *inner, **keywords)
        self.motion, self.breaks = target, getattr(target, "breaks", ())


class JointImpedance(Law, Reduction):
    """Spring and damper of each joint outside, gravity compensated; motor-inertia reduction inside."""

    def __init__(
        self,
        arm: Mechanism,
        target: ArrayLike,
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
        self.arm, self.target, self.stiffness, self.damping = arm, self.outer.target, self.outer.kp, self.outer.kd

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        parts = self.outer.terms(t, q, v)
        return parts | self.reduce(parts["tau"], q, v, theta, theta_dot)
