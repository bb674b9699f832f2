"""Plants: the equations of motion of arms under the torque of a law.

    RigidArm    M a + C v + g + tau_f(v) = tau + J'F + tau_c
    ElasticArm  M a + C v + g = tau_J + J'F + tau_c,   B theta_ddot + F_m theta_dot + tau_J = tau
                tau_J = K (theta - q) + D (theta_dot - v),   D and F_m the damping of the joints and the viscous friction of the motors
    friction    tau_f = d v + c sign(v) with the damping d and the Coulomb friction c of the arm, zero unless `friction=True`
    contact     tau_c of the wall and the stops (see `contact`)
    LuGre       friction of the joints of a RigidArm or of the motors of an ElasticArm; its state is last (see `bristles`)

M, C and g are mass matrix, Coriolis matrix and gravity torque, B is the motor inertia and K the joint stiffness. tau is the input of the
law. `rates` returns the time derivative of the state, `energy` the stored energy, and `power` the power of the inputs minus the lost power.
F is an external force at a frame with the Jacobian J, and ' the transpose.
"""

from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from .bristles import LuGre
from .contact import JointStops, Wall, contacts, pushes
from .lagrange import Array, Mechanism, solve
from .law import gain


class RigidArm:
    """A rigid arm with the state (q, v), and then the torques of the bristles of LuGre friction."""

    elastic = False

    def __init__(self, arm: Any, *, friction: bool | LuGre = False, wall: Wall | None = None, stops: JointStops | None = None) -> None:
        self.arm, self.friction = arm, friction is True
        self.dry = friction if isinstance(friction, LuGre) else None
        self.contacts = contacts(arm, wall, stops)
        self.size = (2 if self.dry is None else 3) * arm.n

    def initial(self, q0: Array, v0: Array, theta0: ArrayLike | None, theta_dot0: ArrayLike | None) -> Array:
        return np.concatenate([q0, v0, np.zeros(self.size - 2 * self.arm.n)])

    def split(self, y: Array) -> tuple[Array, Array, Array | None, Array | None]:
        n = self.arm.n
        return y[:n], y[n : 2 * n], None, None

    def _lost(self, v: Array) -> Array:
        return np.asarray(self.arm.friction_torque(v)) if self.friction else np.zeros_like(v)

    def rates(self, y: Array, tau: Array, load: Array) -> Array:
        q, v, _, _ = self.split(y)
        effort = tau + load + pushes(self.contacts, q, v)[0] - self._lost(v)
        torque, rate, _ = self.rub(y, tau)
        return np.concatenate([v, self.arm.forward_dynamics(q, v, effort - torque), rate])

    def rub(self, y: Array, tau: Array) -> tuple[Array, Array, float]:
        """The torque of LuGre friction (n,), the derivative of its state, (n,) or empty without LuGre, and the lost power, W."""
        n = self.arm.n
        if self.dry is None:
            return np.zeros(n), np.zeros(0), 0.0
        w = y[2 * n : 3 * n]
        return self.dry.rub(y[n : 2 * n], w, tau - w)

    def energy(self, y: Array) -> float:
        q, v, _, _ = self.split(y)
        kinetic, potential = self.arm.energy(q, v)
        bristles = 0.0 if self.dry is None else self.dry.energy(y[2 * self.arm.n :])
        return float(kinetic + potential) + pushes(self.contacts, q, v)[1] + bristles

    def power(self, y: Array, tau: Array, load: Array) -> float:
        q, v, _, _ = self.split(y)
        return float(v @ (tau + load - self._lost(v))) - pushes(self.contacts, q, v)[2] - self.rub(y, tau)[2]


class ElasticArm:
    """An arm with elastic joints and the state (q, v, theta, theta_dot), and then the torques of the bristles of LuGre friction.

    Stiffness and motor inertia are scalar, (n,) or (n, n). Damping and viscous friction are scalar or (n,).
    """

    elastic = True

    def __init__(
        self,
        arm: Mechanism,
        stiffness: ArrayLike,
        motor_inertia: ArrayLike,
        *,
        joint_damping: ArrayLike = 0.0,
        motor_friction: ArrayLike | LuGre = 0.0,
        wall: Wall | None = None,
        stops: JointStops | None = None,
    ) -> None:
        self.arm = arm
        self.dry = motor_friction if isinstance(motor_friction, LuGre) else None
        self.size = (4 if self.dry is None else 5) * arm.n
        self.stiffness, self.motor_inertia = gain(stiffness, arm.n), gain(motor_inertia, arm.n)
        self.joint_damping, self.motor_friction = (
            gain(joint_damping, arm.n),
            gain(0.0 if isinstance(motor_friction, LuGre) else motor_friction, arm.n),
        )
        self.contacts = contacts(arm, wall, stops)

    def initial(self, q0: Array, v0: Array, theta0: ArrayLike | None, theta_dot0: ArrayLike | None) -> Array:
        """The initial state. By default the springs balance gravity: theta = q + K^-1 g(q), theta_dot = v."""
        theta = q0 + solve(self.stiffness, self.arm.gravity(q0)) if theta0 is None else np.asarray(theta0, dtype=np.float64)
        theta_dot = v0 if theta_dot0 is None else np.asarray(theta_dot0, dtype=np.float64)
        return np.concatenate([q0, v0, theta, theta_dot, np.zeros(self.size - 4 * self.arm.n)])

    def split(self, y: Array) -> tuple[Array, Array, Array | None, Array | None]:
        n = self.arm.n
        return y[:n], y[n : 2 * n], y[2 * n : 3 * n], y[3 * n : 4 * n]

    def rates(self, y: Array, tau: Array, load: Array) -> Array:
        q, v, _, theta_dot = self._parts(y)
        joint = self._joint(y)
        a = self.arm.forward_dynamics(q, v, joint + load + pushes(self.contacts, q, v)[0])
        torque, rate, _ = self.rub(y, tau)
        motor = solve(self.motor_inertia, tau - joint - self.motor_friction @ theta_dot - torque)
        return np.concatenate([v, a, theta_dot, motor, rate])

    def _parts(self, y: Array) -> list[Array]:
        return np.split(y[: 4 * self.arm.n], 4)

    def _joint(self, y: Array) -> Array:
        q, v, theta, theta_dot = self._parts(y)
        return self.stiffness @ (theta - q) + self.joint_damping @ (theta_dot - v)

    def rub(self, y: Array, tau: Array) -> tuple[Array, Array, float]:
        """The torque of LuGre friction (n,), the derivative of its state, (n,) or empty without LuGre, and the lost power, W."""
        n = self.arm.n
        if self.dry is None:
            return np.zeros(n), np.zeros(0), 0.0
        return self.dry.rub(y[3 * n : 4 * n], y[4 * n :], self._joint(y))

    def energy(self, y: Array) -> float:
        q, v, theta, theta_dot = self._parts(y)
        kinetic, potential = self.arm.energy(q, v)
        stretch = theta - q
        stored = kinetic + potential + 0.5 * stretch @ self.stiffness @ stretch + 0.5 * theta_dot @ self.motor_inertia @ theta_dot
        return float(stored) + pushes(self.contacts, q, v)[1] + (0.0 if self.dry is None else self.dry.energy(y[4 * self.arm.n :]))

    def power(self, y: Array, tau: Array, load: Array) -> float:
        q, v, _, theta_dot = self._parts(y)
        slip = theta_dot - v
        damped = slip @ self.joint_damping @ slip + theta_dot @ self.motor_friction @ theta_dot
        return float(theta_dot @ tau + v @ load - damped) - pushes(self.contacts, q, v)[2] - self.rub(y, tau)[2]


class Plant(Protocol):
    """The interface of plants that a closed loop uses."""

    arm: Any
    size: int
    elastic: bool

    def initial(self, q0: Array, v0: Array, theta0: ArrayLike | None, theta_dot0: ArrayLike | None) -> Array: ...

    def split(self, y: Array) -> tuple[Array, Array, Array | None, Array | None]: ...

    def rates(self, y: Array, tau: Array, load: Array) -> Array: ...

    def energy(self, y: Array) -> float: ...

    def power(self, y: Array, tau: Array, load: Array) -> float: ...
