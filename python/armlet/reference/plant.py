"""Plants: what turns the law's torque into motion.

    RigidArm    M a + C v + g = tau + J'F
    ElasticArm  M a + C v + g = K (theta - q) + J'F,   B theta_ddot + K (theta - q) = tau

`rates` returns the derivative of the state's columns; `energy` what is stored and `power` what is fed in from outside.
"""

from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array, Mechanism, solve
from .law import gain


class RigidArm:
    """State (q, v)."""

    elastic = False

    def __init__(self, arm: Mechanism) -> None:
        self.arm = arm
        self.size = 2 * arm.n

    def initial(self, q0: Array, v0: Array, theta0: ArrayLike | None, theta_dot0: ArrayLike | None) -> Array:
        return np.concatenate([q0, v0])

    def split(self, y: Array) -> tuple[Array, Array, Array | None, Array | None]:
        n = self.arm.n
        return y[:n], y[n : 2 * n], None, None

    def rates(self, y: Array, tau: Array, load: Array) -> Array:
        q, v, _, _ = self.split(y)
        return np.concatenate([v, self.arm.forward_dynamics(q, v, tau + load)])

    def energy(self, y: Array) -> float:
        q, v, _, _ = self.split(y)
        kinetic, potential = self.arm.energy(q, v)
        return float(kinetic + potential)

    def power(self, y: Array, tau: Array, load: Array) -> float:
        return float(self.split(y)[1] @ (tau + load))


class ElasticArm:
    """State (q, v, theta, theta_dot); stiffness and motor inertia scalar, (n,) or (n, n)."""

    elastic = True

    def __init__(self, arm: Mechanism, stiffness: ArrayLike, motor_inertia: ArrayLike) -> None:
        self.arm = arm
        self.size = 4 * arm.n
        self.stiffness, self.motor_inertia = gain(stiffness, arm.n), gain(motor_inertia, arm.n)

    def initial(self, q0: Array, v0: Array, theta0: ArrayLike | None, theta_dot0: ArrayLike | None) -> Array:
        """The default motor state balances gravity: theta = q + K^-1 g(q), theta_dot = v."""
        theta = q0 + solve(self.stiffness, self.arm.gravity(q0)) if theta0 is None else np.asarray(theta0, dtype=np.float64)
        theta_dot = v0 if theta_dot0 is None else np.asarray(theta_dot0, dtype=np.float64)
        return np.concatenate([q0, v0, theta, theta_dot])

    def split(self, y: Array) -> tuple[Array, Array, Array | None, Array | None]:
        n = self.arm.n
        return y[:n], y[n : 2 * n], y[2 * n : 3 * n], y[3 * n : 4 * n]

    def rates(self, y: Array, tau: Array, load: Array) -> Array:
        q, v, theta, theta_dot = np.split(y, 4)
        spring = self.stiffness @ (theta - q)
        a = self.arm.forward_dynamics(q, v, spring + load)
        return np.concatenate([v, a, theta_dot, solve(self.motor_inertia, tau - spring)])

    def energy(self, y: Array) -> float:
        q, v, theta, theta_dot = np.split(y, 4)
        kinetic, potential = self.arm.energy(q, v)
        stretch = theta - q
        stored = kinetic + potential + 0.5 * stretch @ self.stiffness @ stretch + 0.5 * theta_dot @ self.motor_inertia @ theta_dot
        return float(stored)

    def power(self, y: Array, tau: Array, load: Array) -> float:
        _, v, _, theta_dot = np.split(y, 4)
        return float(v @ load + theta_dot @ tau)


class Plant(Protocol):
    """What a closed loop asks of a plant."""

    arm: Any
    size: int
    elastic: bool

    def initial(self, q0: Array, v0: Array, theta0: ArrayLike | None, theta_dot0: ArrayLike | None) -> Array: ...

    def split(self, y: Array) -> tuple[Array, Array, Array | None, Array | None]: ...

    def rates(self, y: Array, tau: Array, load: Array) -> Array: ...

    def energy(self, y: Array) -> float: ...

    def power(self, y: Array, tau: Array, load: Array) -> float: ...
