"""Tracking of a joint motion with an elastic arm, by the feed-forward of links and motors (De Luca and Book 2016).

tau_J,d = M(q_d) a_d + C(q_d, v_d) v_d + g(q_d),   theta_d = q_d + K_J^-1 tau_J,d
tau     = B theta_d_ddot + tau_J,d + Kp (theta_d - theta) + Kd (theta_d_dot - theta_dot)

The derivatives of tau_J,d with respect to time are those of a polynomial through its values at Chebyshev nodes around the present time. At
the nodes, the motion is its Taylor polynomial of degree four, which has the same first two derivatives of tau_J,d at the present time.
"""

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.typing import ArrayLike

from .lagrange import Array, Mechanism, solve
from .law import Law, Terms, gain
from .motion import SNAP, BangBang, Hold, Quintic, Sinusoid, Table

#: Number of nodes of the polynomial.
NODES = 17
#: The window of the nodes is this share of the time in which the motion changes.
WINDOW = 0.5


def window(rows: Array) -> float:
    """Half the width of the window, s: a share of the shortest time in which a derivative of the motion changes position or speed."""
    sizes = np.abs(rows).max(axis=1)
    rates = [float(size ** (1.0 / k)) for k, size in enumerate(sizes) if k > 0]
    return WINDOW / max(1.0, *rates)


def taylor(rows: Array, h: float) -> Array:
    """Position, velocity and acceleration (3, n) at a time h later, from the derivatives (5, n) of orders 0 to 4."""
    values = []
    for order in range(3):
        terms = [rows[order + k] * h**k / np.prod(np.arange(1, k + 1)) for k in range(SNAP - order + 1)]
        values.append(np.sum(terms, axis=0))
    return np.array(values)


class JointTracking(Law):
    """Feed-forward of links and motors along a joint motion, and PD control of the motors."""

    def __init__(
        self,
        arm: Mechanism,
        motion: Hold | Sinusoid | Quintic | BangBang | Table,
        kp: ArrayLike,
        kd: ArrayLike,
        joint_stiffness: ArrayLike,
        motor_inertia: ArrayLike,
    ) -> None:
        self.arm, self.motion, self.breaks = arm, motion, motion.breaks
        self.kp, self.kd = gain(kp, arm.n), gain(kd, arm.n)
        self.joint_stiffness, self.motor_inertia = gain(joint_stiffness, arm.n), gain(motor_inertia, arm.n)

    def desired_torque(self, rows: Array) -> Array:
        """tau_J,d and its first two derivatives with respect to time, (3, n), from the derivatives (5, n) of the motion."""
        half = window(rows)
        nodes = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
        values = np.array([self.arm.inverse_dynamics(*taylor(rows, half * x)) for x in nodes])
        fits = [Chebyshev.fit(nodes, column, NODES - 1, domain=[-1.0, 1.0]) for column in values.T]
        rates = [[fit.deriv(order)(0.0) / half**order for fit in fits] for order in (1, 2)]
        return np.array([self.arm.inverse_dynamics(*rows[:3]), *rates])

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        if theta is None or theta_dot is None:
            raise ValueError("JointTracking: theta and theta_dot are missing: the law belongs to an elastic arm")
        rows = self.motion.derivatives(t, SNAP)
        torque = self.desired_torque(rows)
        theta_d, theta_d_dot, theta_d_ddot = (rows[k] + solve(self.joint_stiffness, torque[k]) for k in range(3))
        feedforward = torque[0] + self.motor_inertia @ theta_d_ddot
        e = theta_d - theta
        return {
            "tau": feedforward + self.kp @ e + self.kd @ (theta_d_dot - theta_dot),
            "state_rate": np.zeros(0),
            "e": e,
            "q_d": rows[0],
            "v_d": rows[1],
            "a_d": rows[2],
            "theta_d": theta_d,
            "theta_d_dot": theta_d_dot,
            "tau_J": self.joint_stiffness @ (theta - q),
            "feedforward": feedforward,
        }
