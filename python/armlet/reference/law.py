"""Control laws of rigid arms, written from their equations. e = q_d - q, and C is the Coriolis matrix of the Christoffel symbols.

    ComputedTorque      tau = M (a_d + Kd e_dot + Kp e) + C v + g
    PDGravity           tau = Kp (q_d - q) + Kd (v_d - v) + g(q)

M, C v and g are mass matrix, Coriolis torque and gravity torque, and Kp and Kd gains. `terms` evaluates the law once and returns a dict of
its quantities, which include `tau` and `state_rate`.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array, Mechanism
from .motion import Hold, Motion

Terms = dict[str, Array]


def gain(value: ArrayLike, n: int) -> Array:
    """Convert a scalar, (n,) or (n, n) gain to a matrix (n, n)."""
    array = np.asarray(value, dtype=np.float64)
    if array.ndim < 2:
        return np.diag(np.broadcast_to(array, (n,)))
    if array.shape != (n, n):
        raise ValueError(f"gain is misshapen: expected a scalar, ({n},) or ({n}, {n}), got shape {array.shape}")
    return array.copy()


class Law:
    """The base class of laws. One evaluation computes tau and the time derivative of the law's state."""

    state0: Array = np.zeros(0)
    breaks: tuple[float, ...] = ()

    def start(self, q: Array, v: Array) -> Array:
        """The initial state of the law for a run that starts at q and v, (n,) each."""
        return self.state0

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        """A dict of the quantities of the law at one instant."""
        raise NotImplementedError

    def __call__(
        self,
        t: float,
        q: ArrayLike,
        v: ArrayLike,
        theta: ArrayLike | None = None,
        theta_dot: ArrayLike | None = None,
        state: ArrayLike | None = None,
    ) -> Array:
        """The torque tau (n,)."""
        given: list[Any] = [None if x is None else np.asarray(x, dtype=np.float64) for x in (q, v, theta, theta_dot, state)]
        return self.terms(t, *given)["tau"]


class ComputedTorque(Law):
    """Computed torque: feedback linearisation with PD control of the error."""

    def __init__(self, arm: Mechanism, motion: Motion, kp: ArrayLike, kd: ArrayLike) -> None:
        self.arm, self.motion = arm, motion
        self.kp, self.kd = gain(kp, arm.n), gain(kd, arm.n)
        self.breaks = getattr(motion, "breaks", ())

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        q_d, v_d, a_d = self.motion(t)
        e, e_dot = q_d - q, v_d - v
        command = a_d + self.kd @ e_dot + self.kp @ e
        return {"tau": self.arm.inverse_dynamics(q, v, command), "state_rate": np.zeros(0), "e": e, "e_dot": e_dot, "a": command}


class PDGravity(Law):
    """PD control with gravity compensation, to a constant target (n,) or along a motion."""

    def __init__(self, arm: Mechanism, target: Any, kp: ArrayLike, kd: ArrayLike) -> None:
        self.motion: Motion = target if callable(target) else Hold(target)
        self.breaks = getattr(target, "breaks", ())
        self.arm, self.target = arm, self.motion(0.0)[0]
        self.kp, self.kd = gain(kp, arm.n), gain(kd, arm.n)

    def terms(
        self, t: float, q: Array, v: Array, theta: Array | None = None, theta_dot: Array | None = None, state: Array | None = None
    ) -> Terms:
        q_d, v_d, _ = self.motion(t)
        e = q_d - q
        tau = self.kp @ e + self.kd @ (v_d - v) + self.arm.gravity(q)
        return {"tau": tau, "state_rate": np.zeros(0), "e": e, "q_d": q_d, "v_d": v_d}
