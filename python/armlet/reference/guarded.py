"""A law with a momentum observer and a reaction to contact (De Luca et al. 2006), written from its equations. M and g come from
Lagrange's equations.

r           (1 + K T) r = K (p - w),  K the gain of the observer, T the period of a sampled loop, 0 in a continuous loop
w           p = M v,  dw/dt = tau + dM/dt v - C v - g - tau_f + r, with K_J (theta - q) for tau if joints are elastic
contact     the first sample with some |r_i| above its threshold
reaction    tau = g + K_c (y_d - y) + D_c (dy_d/dt - dy/dt),   y_d = y_c, or y_c + V r_c/max|r_c| min(s, duration) for "retract"
stored      dc/dt = 1, d(y_c c)/dt = y, d(r_c c)/dt = r in the period after the sample of contact, ds/dt = 1 from then on
            y_c = (y_c c) / c,   r_c = (r_c c) / c

y is q, or the motor positions theta for elastic joints, and r is the residual. y_c and r_c are their values at contact. c is the duration
of the period after the sample of contact, s the time since contact, and V the argument `speed`. K_c and D_c are stiffness and damping of
the reaction, and K_J is the joint stiffness. tau_f is the friction torque, or zero if the observer excludes friction.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array, solve
from .law import Law, Terms, gain


class Guarded(Law):
    """A law that is replaced by a reaction at contact. `law` is the law before contact."""

    def __init__(
        self,
        law: Any,
        observer: Any,
        reaction: str | None = None,
        *,
        stiffness: ArrayLike | None = None,
        damping: ArrayLike | None = None,
        speed: float = 0.3,
        duration: float = 0.5,
        joint_stiffness: ArrayLike | None = None,
    ) -> None:
        self.law, self.observer, self.reaction = law, observer, reaction
        n = observer.arm.n
        self.arm, self.breaks = law.arm, law.breaks
        self.stiffness = np.zeros((n, n)) if stiffness is None else gain(stiffness, n)
        self.damping = np.zeros((n, n)) if damping is None else gain(damping, n)
        self.speed, self.duration = speed, duration
        own = getattr(law, "joint_stiffness", None) if joint_stiffness is None else gain(joint_stiffness, n)
        self.joint_stiffness = own
        self.load = getattr(law, "load", None)
        self.period, self.limit = 0.0, np.full(n, np.inf)
        self.state0 = np.concatenate([law.state0, np.zeros(2 * n + (2 + 2 * n if reaction else 0))])

    def start(self, q: Array, v: Array) -> Array:
        state = self.state0.copy()
        first, n = self.law.state0.size, self.observer.arm.n
        state[:first] = self.law.start(q, v)
        state[first : first + n] = self.observer.arm.mass_matrix(q) @ v
        return state

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        state = self.start(q, v) if state is None else state
        first, arm = self.law.state0.size, self.observer.arm
        n = arm.n
        inner = self.law.terms(t, q, v, theta, theta_dot, state[:first])
        tau, rates = inner["tau"], inner["state_rate"]
        w, latched = state[first : first + n], state[first + 2 * n :]
        K = self.observer.gain
        r = solve(np.eye(n) + K * self.period, K @ (arm.mass_matrix(q) @ v - w))
        g, reacting = arm.gravity(q), 0.0
        latch = np.zeros(latched.size)
        if self.reaction is not None:
            before = latched[0] > 0.0
            found = not before and bool(np.any(np.abs(r) > self.observer.threshold))
            y, y_dot = (q, v) if theta is None or theta_dot is None else (theta, theta_dot)
            if found:
                latch = np.concatenate([[1.0, 1.0], y, r])
            if before:
                latch[1] = 1.0
            if before or found:
                reacting = 1.0
                tau = self._react(g, r, y, y_dot, latched, before)
                rates = np.zeros_like(rates)
        tau = np.clip(tau, -self.limit, self.limit)
        known = tau
        if theta is not None:
            assert self.joint_stiffness is not None
            known = self.joint_stiffness @ (theta - q)
        drift = arm.mass_matrix_rate(q, v) @ v - arm.bias(q, v)
        if self.observer.friction:
            drift = drift - arm.friction_torque(v)
        rates = np.concatenate([rates, known + drift + r, r, latch])
        parts: Terms = inner | {"tau": tau, "state_rate": rates, "residual": r, "reacting": np.array([reacting])}
        return parts

    def _react(self, g: Array, r: Array, y: Array, y_dot: Array, latched: Array, before: bool) -> Array:
        """The torque of the reaction. `r` is the residual, which is r_c at the sample of contact."""
        n = y.size
        y_c, r_c = (latched[2 : 2 + n] / latched[0], latched[2 + n :]) if before else (y, r)
        y_c_dot = np.zeros_like(y)
        if self.reaction == "retract":
            away = self.speed * r_c / np.max(np.abs(r_c))
            y_c = y_c + away * min(latched[1], self.duration)
            y_c_dot = away if latched[1] < self.duration else y_c_dot
        return np.asarray(g + self.stiffness @ (y_c - y) + self.damping @ (y_c_dot - y_dot))
