"""Regulation of elastic joints by feedback of their motors.

theta_d = q_d + K_J^-1 g(q_d): the motor positions at which the links are at rest at q_d
MotorPD         tau = Kp (theta_d - theta) + Kd (dtheta_d/dt - dtheta/dt) + g(q_d)                             (Tomei 1991)
       online   g(theta - K_J^-1 g(q_d)) replaces g(q_d)                              (De Luca, Siciliano and Zollo 2005)
StateFeedback   adds Kt (g(q_d) - tau_J) + Ks (dg(q_d)/dt - dtau_J/dt),   tau_J = K_J (theta - q)
                                                                                  (Albu-Schaeffer and Hirzinger 2001)

Kp, Kd, Kt and Ks are gains. q_d is the target of the links, theta are the motor positions, K_J is the joint stiffness, and g the gravity
torque. Along a motion, dg/dt is the five-point difference of g on the line q_d + h v_d. The derivatives of a constant target are zero.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array, Mechanism, solve
from .law import Law, Terms, gain
from .motion import Hold, Motion

#: Step h of the five-point difference, s. Its error is h^4 times the fifth derivative of gravity, and the rounding error is eps / h.
STEP = 1e-3


class MotorPD(Law):
    """PD control of the motors with gravity compensation. `target` is the target q_d of the links, (n,), or a motion."""

    def __init__(
        self, arm: Mechanism, target: Any, kp: ArrayLike, kd: ArrayLike, joint_stiffness: ArrayLike, *, online: bool = False
    ) -> None:
        self.arm, self.online = arm, online
        self.motion: Motion = target if callable(target) else Hold(target)
        self.breaks = getattr(target, "breaks", ())
        self.target = self.motion(0.0)[0]
        self.kp, self.kd, self.joint_stiffness = gain(kp, arm.n), gain(kd, arm.n), gain(joint_stiffness, arm.n)

    def gravity_rate(self, q: Array, v: Array) -> Array:
        """The derivative of g(q) with respect to time if q has the velocity v."""
        f = [self.arm.gravity(q + k * STEP * v) for k in (-2, -1, 1, 2)]
        return np.asarray((f[0] - 8.0 * f[1] + 8.0 * f[2] - f[3]) / (12.0 * STEP))

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        if theta is None or theta_dot is None:
            raise ValueError(f"{type(self).__name__}: theta and theta_dot are missing: the law belongs to an elastic arm")
        q_d, v_d, _ = self.motion(t)
        g_d, g_d_dot = self.arm.gravity(q_d), self.gravity_rate(q_d, v_d)
        sag = solve(self.joint_stiffness, g_d)
        theta_d, theta_d_dot = q_d + sag, v_d + solve(self.joint_stiffness, g_d_dot)
        e = theta_d - theta
        g = self.arm.gravity(theta - sag) if self.online else g_d
        spring = self.joint_stiffness @ (theta - q)
        tau = self.kp @ e + self.kd @ (theta_d_dot - theta_dot) + g
        desired = {"q_d": q_d, "v_d": v_d, "theta_d": theta_d, "theta_d_dot": theta_d_dot, "g_d": g_d, "g_d_dot": g_d_dot}
        return desired | {"tau": tau, "state_rate": np.zeros(0), "e": e, "g": g, "tau_J": spring}


class StateFeedback(MotorPD):
    """State feedback: `MotorPD` with additional feedback of the joint torque and its time derivative."""

    def __init__(
        self,
        arm: Mechanism,
        target: Any,
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
        pull = self.kt @ (parts["g_d"] - parts["tau_J"]) + self.ks @ (parts["g_d_dot"] - spring_rate)
        return parts | {"tau": parts["tau"] + pull}
