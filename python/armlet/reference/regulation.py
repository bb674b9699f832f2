"""Regulation of elastic joints by feedback of their motors.

theta_d = q_d + K_J^-1 g(q_d): the motor positions at which the links are at rest at q_d
MotorPD         tau = Kp (theta_d - theta) - Kd theta_dot + g(q_d)                                             (Tomei 1991)
       online   g(theta - K_J^-1 g(q_d)) replaces g(q_d)                              (De Luca, Siciliano and Zollo 2005)
StateFeedback   tau = Kp (theta_d - theta) - Kd theta_dot + g(q_d) + Kt (g(q_d) - tau_J) - Ks dtau_J/dt
                tau_J = K_J (theta - q)                                           (Albu-Schaeffer and Hirzinger 2001)

Kp, Kd, Kt and Ks are gains. q_d is the target of the links, theta are the motor positions, K_J is the joint stiffness, and g the gravity
torque.
"""

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array, Mechanism, solve
from .law import Law, Terms, gain


class MotorPD(Law):
    """PD control of the motors with gravity compensation. `target` is the target q_d of the links, (n,)."""

    def __init__(
        self, arm: Mechanism, target: ArrayLike, kp: ArrayLike, kd: ArrayLike, joint_stiffness: ArrayLike, *, online: bool = False
    ) -> None:
        self.arm, self.target, self.online = arm, np.array(target, dtype=np.float64), online
        self.kp, self.kd, self.joint_stiffness = gain(kp, arm.n), gain(kd, arm.n), gain(joint_stiffness, arm.n)
        self.g_d = arm.gravity(self.target)
        self.sag = solve(self.joint_stiffness, self.g_d)

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        if theta is None or theta_dot is None:
            raise ValueError(f"{type(self).__name__}: theta and theta_dot are missing: the law belongs to an elastic arm")
        e = self.target + self.sag - theta
        g = self.arm.gravity(theta - self.sag) if self.online else self.g_d
        spring = self.joint_stiffness @ (theta - q)
        tau = self.kp @ e - self.kd @ theta_dot + g
        return {"tau": tau, "state_rate": np.zeros(0), "e": e, "theta_d": theta + e, "g": g, "tau_J": spring}


class StateFeedback(MotorPD):
    """State feedback: `MotorPD` with additional feedback of the joint torque and its time derivative."""

    def __init__(
        self,
        arm: Mechanism,
        target: ArrayLike,
        kp: ArrayLike,
        kd: ArrayLike,
        kt: ArrayLike,
        ks: ArrayLike,
        joint_stiffness: ArrayLike,
    ) -> None:
        super().__init__(arm, target, kp, kd, joint_stiffness)
        self.kt, self.ks = gain(kt, arm.n), gain(ks, arm.n)

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        parts = super().terms(t, q, v, theta, theta_dot)
        spring_rate = self.joint_stiffness @ (np.asarray(theta_dot) - v)
        return parts | {"tau": parts["tau"] + self.kt @ (self.g_d - parts["tau_J"]) - self.ks @ spring_rate}
