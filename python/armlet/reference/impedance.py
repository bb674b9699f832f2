"""Cartesian impedance, for rigid arms and through elastic joints.

rigid    tau = J'[K_m (x_d - x) - D_m J v] + g(q)
elastic  tau = (I - B B0^-1) K_J (theta - q) + B B0^-1 (u - D0 w),   u = J'[K_m (x_d - x) - D_m J v] + g(q)
         w = theta_dot, or theta_dot - v with relative damping       (Ott, Albu-Schaeffer, Kugi and Hirzinger 2008)
D0 = 2 zeta B0^1/2 (B0^-1/2 K_J B0^-1/2)^1/2 B0^1/2
E  = v'Mv/2 + (theta-q)'K_J(theta-q)/2 + theta_dot'B0 theta_dot/2 + e'K_m e/2
P  = F.x_dot - theta_dot'D0 w - x_dot'D_m x_dot + (theta_dot - v).u
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .arm import Arm
from .lagrange import Array, solve
from .law import Law, Terms, gain
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
        self.coordinates = Coordinates(arm, target, frame, axes)
        rows = len(self.coordinates.rows)
        self.stiffness, self.damping = gain(stiffness, rows), gain(damping, rows)
        self.load = self.coordinates.load

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        e, J = self.coordinates.error(q), self.coordinates.jacobian(q)
        u = J.T @ (self.stiffness @ e - self.damping @ (J @ v)) + self.arm.gravity(q)
        return {"tau": u, "state_rate": np.zeros(0), "u": u, "e": e, "J": J, "x_dot": J @ v}


class ElasticImpedance(CartesianImpedance):
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
        super().__init__(arm, target, stiffness, damping, frame=frame, axes=axes)
        self.joint_stiffness = gain(joint_stiffness, arm.n)
        self.motor_inertia, self.reduced_inertia = gain(motor_inertia, arm.n), gain(reduced_inertia, arm.n)
        self.motor_damping = (
            ratio_damping(self.reduced_inertia, self.joint_stiffness, damping_ratio)
            if motor_damping is None
            else gain(motor_damping, arm.n)
        )
        self.relative_damping = relative_damping

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        if theta is None or theta_dot is None:
            raise ValueError("ElasticImpedance: theta and theta_dot are missing: the law belongs to an elastic arm")
        parts = super().terms(t, q, v)
        spring = self.joint_stiffness @ (theta - q)
        w = theta_dot - v if self.relative_damping else theta_dot
        # tau = spring + B theta_ddot with theta_ddot taken from the reduced motor (6).
        reduced = solve(self.reduced_inertia, parts["u"] - self.motor_damping @ w - spring)
        return parts | {"tau": spring + self.motor_inertia @ reduced, "tau_J": spring, "w": w}

    def energy(self, plant: Any, x: Array, terms: Terms) -> float:
        """E above at the plant state x = (q, v, theta, theta_dot)."""
        q, v, theta, theta_dot = np.split(x, 4)
        stretch, e = theta - q, terms["e"]
        stored = v @ plant.arm.mass_matrix(q) @ v + stretch @ self.joint_stiffness @ stretch
        return float(0.5 * (stored + theta_dot @ self.reduced_inertia @ theta_dot + e @ self.stiffness @ e))

    def power(self, x: Array, terms: Terms, load: Array) -> float:
        """P above: the rate of E."""
        _, v, _, theta_dot = np.split(x, 4)
        x_dot = terms["x_dot"]
        lost = theta_dot @ self.motor_damping @ terms["w"] + x_dot @ self.damping @ x_dot
        return float(load @ v - lost + (theta_dot - v) @ terms["u"])
