"""PID control with gravity compensation and its options, written from the equations. M and g come from Lagrange's equations.

u  = g + f + ahead + Kp e + Kd (v_d - v_f) + w - d,  tau = u, clipped to the limits        (Arimoto and Miyazaki 1984)
dw/dt = Ki e, but 0 if u exceeds a limit and Ki e has the sign of the excess
dy/dt = v_f = N (q - y), or v_f = v without a filter;   f = damping v_d + friction tanh(v_d / v_s)
ds/dt = tau - g - f + d;   d = h (m v_f - s)
ahead = M a_d, or m a_d with a disturbance observer

Kp, Ki and Kd are gains, M is the mass matrix and g the gravity torque. e = q_d - q is the error, w the integral torque, v_f the filtered
velocity, and f the friction torque, zero unless `friction`. d is the estimated disturbance, zero without an observer. ahead is the
feedforward torque. y and s are the states of the filter and the observer. N is the rate of the filter, h the bandwidth of the disturbance
observer, m the nominal inertia, and v_s the friction speed.
"""

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array, Mechanism
from .law import Law, Terms, gain
from .motion import Hold, Motion


class PID(Law):
    """The PID law for a target (n,) or a motion.

    Its state is the integral torque w, then the states y of the velocity filter and s of the disturbance observer, (n,) each, if used.
    """

    def __init__(
        self,
        arm: Mechanism,
        target: ArrayLike | Motion,
        kp: ArrayLike,
        ki: ArrayLike | None,
        kd: ArrayLike,
        tau_max: ArrayLike | None = None,
        *,
        derivative_filter: ArrayLike | None = None,
        friction: bool = False,
        friction_speed: ArrayLike = 0.1,
        observer_bandwidth: ArrayLike | None = None,
        nominal_inertia: ArrayLike | None = None,
    ) -> None:
        n = arm.n
        self.arm, self.motion = arm, target if callable(target) else Hold(target)
        self.breaks = getattr(self.motion, "breaks", ())
        self.kp, self.ki, self.kd = gain(kp, n), None if ki is None else gain(ki, n), gain(kd, n)
        self.limit = np.broadcast_to(np.inf if tau_max is None else np.asarray(tau_max, dtype=np.float64), (n,))
        self.friction, self.v_s = friction, np.asarray(friction_speed, dtype=np.float64)
        self.rate = None if derivative_filter is None else np.asarray(derivative_filter, dtype=np.float64)
        self.bandwidth = None if observer_bandwidth is None else np.asarray(observer_bandwidth, dtype=np.float64)
        first = arm.mass_matrix(self.motion(0.0)[0])
        self.inertia = np.diag(first) if nominal_inertia is None else np.asarray(nominal_inertia, dtype=np.float64)
        self.state0 = np.zeros(n * sum(part is not None for part in (self.ki, self.rate, self.bandwidth)))

    def start(self, q: Array, v: Array) -> Array:
        state = self.state0.copy()
        first = 0 if self.ki is None else self.arm.n
        if self.rate is not None:
            state[first : first + self.arm.n] = q
        elif self.bandwidth is not None:
            state[first:] = self.inertia * v
        return state

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        z = self.start(q, v) if state is None else state
        parts = list(z.reshape(-1, self.arm.n))
        w = np.zeros_like(q) if self.ki is None else parts.pop(0)
        q_d, v_d, a_d = self.motion(t)
        e = q_d - q
        v_f = v if self.rate is None else self.rate * (q - parts[0])
        nominal = self.arm.gravity(q)
        if self.friction:
            nominal = nominal + np.asarray(self.arm.damping) * v_d + np.asarray(self.arm.friction) * np.tanh(v_d / self.v_s)
        ahead, d = self.arm.mass_matrix(q) @ a_d, np.zeros_like(q)
        if self.bandwidth is not None:
            ahead, d = self.inertia * a_d, self.bandwidth * (self.inertia * v_f - parts[-1])
        u = nominal + ahead + self.kp @ e + self.kd @ (v_d - v_f) + w - d
        tau = np.clip(u, -self.limit, self.limit)
        rates = []
        if self.ki is not None:
            rate = self.ki @ e
            winds_up = (np.abs(u) > self.limit) & (np.sign(u) == np.sign(rate))
            rates.append(np.where(winds_up, 0.0, rate))
        if self.rate is not None:
            rates.append(v_f)
        if self.bandwidth is not None:
            rates.append(tau - nominal + d)
        state_rate = np.concatenate([np.zeros(0), *rates])
        return {"tau": tau, "state_rate": state_rate, "e": e, "u": u, "integral": w, "disturbance": d, "v_f": v_f}
