"""The momentum observer (De Luca et al. 2006), written from its equations.

    p = M v,   b = tau + dM/dt v - C v - g - tau_f,   dp/dt = b + tau_ext
    r_k = (1 + K dt)^-1 (r_(k-1) + K (p_k - p_(k-1) - b_(k-1) dt)),   with the tau since sample k-1 in b
    motors of elastic joints   M = B, the motor inertia,  b = tau, the motor torque minus the joint torque
    wrench                     F = (J')# r with singular values below eps clamped;  unexplained r - J'F
    contact                    the outermost joint with |r_i| above its threshold

K is the gain, r the residual, dt the time since sample k-1, tau_f the friction torque and tau_ext the external torque. J is the Jacobian of
a frame, J' its transpose and A# the pseudo-inverse of A.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array
from .law import gain
from .priority import clamp_inverse


class MomentumObserver:
    """An observer of the external torque, from positions, velocities and torques, (n,) or (B, n)."""

    def __init__(
        self,
        arm: Any,
        K: ArrayLike,
        *,
        friction: bool = False,
        motor_inertia: ArrayLike | None = None,
        threshold: ArrayLike | None = None,
    ) -> None:
        if friction and motor_inertia is not None:
            raise ValueError("friction goes with no motor_inertia: expected False, since the model's friction is that of its joints")
        self.arm, self.friction = arm, friction
        self.gain = gain(K, arm.n)
        self.inertia = None if motor_inertia is None else gain(motor_inertia, arm.n)
        self.threshold = None if threshold is None else np.broadcast_to(np.asarray(threshold, dtype=np.float64), (arm.n,))
        self.residual: Array | None = None
        self.momentum: Array = np.zeros(arm.n)
        self.drift: Array = np.zeros(arm.n)

    def _momentum_and_drift(self, q: Array, v: Array) -> tuple[Array, Array]:
        """The momentum p, and b without tau."""
        if self.inertia is not None:
            return v @ self.inertia.T, np.zeros_like(v)
        rate = self.arm.mass_matrix_rate(q, v)
        drift = np.einsum("...ij,...j->...i", rate, v) - self.arm.bias(q, v)
        if self.friction:
            drift = drift - self.arm.friction_torque(v)
        return np.einsum("...ij,...j->...i", self.arm.mass_matrix(q), v), drift

    def reset(self, q: ArrayLike, v: ArrayLike) -> None:
        """Restart the observer at q and v with r = 0."""
        q, v = np.asarray(q, dtype=np.float64), np.asarray(v, dtype=np.float64)
        self.momentum, self.drift = self._momentum_and_drift(q, v)
        self.residual = np.zeros_like(q)

    def update(self, q: ArrayLike, v: ArrayLike, tau: ArrayLike, dt: float) -> Array:
        """The residual r of the next sample. The first call starts the observer and returns zeros."""
        q, v = np.asarray(q, dtype=np.float64), np.asarray(v, dtype=np.float64)
        if self.residual is None:
            self.reset(q, v)
            return np.zeros_like(q)
        before, known = self.momentum, np.asarray(tau, dtype=np.float64) + self.drift
        self.momentum, self.drift = self._momentum_and_drift(q, v)
        gained = self.residual + (self.momentum - before - known * dt) @ self.gain.T
        r = np.asarray(np.linalg.solve(np.eye(self.arm.n) + self.gain * dt, gained[..., None])[..., 0], dtype=np.float64)
        self.residual = r
        return r.copy()

    def wrench(self, q: ArrayLike, frame: str, eps: float | None = None) -> Array:
        """The wrench [f; m] (..., 6) at a frame that explains the residual best."""
        assert self.residual is not None
        q = np.asarray(q, dtype=np.float64)
        found = []
        for row, r in zip(q.reshape(-1, self.arm.n), self.residual.reshape(-1, self.arm.n), strict=True):
            transposed = self.arm.jacobian(row, frame).T
            bound = 0.02 * float(np.linalg.norm(transposed, axis=1).max()) if eps is None else eps
            # `clamp_inverse` computes with A A', which must not have eigenvalues that are zero for every q. So A is J' or J, whichever does
            # not have more rows than columns.
            wide = transposed.shape[0] <= 6
            inverse = clamp_inverse(transposed, bound) if wide else clamp_inverse(transposed.T, bound).T
            found.append(inverse @ r)
        return np.reshape(found, (*q.shape[:-1], 6))

    def unexplained(self, q: ArrayLike, frame: str, eps: float | None = None) -> Array:
        """The part r - J'F of the residual that the wrench does not explain, of the shape of q."""
        assert self.residual is not None
        J = self.arm.jacobian(q, frame)
        return np.asarray(self.residual - np.einsum("...ki,...k->...i", J, self.wrench(q, frame, eps)))

    def calibrate(self, residuals: ArrayLike, sigmas: float = 5.0) -> None:
        """Set the thresholds to |mean| + sigmas * standard deviation of residuals (K, n)."""
        r = np.asarray(residuals, dtype=np.float64)
        self.threshold = np.abs(r.mean(axis=0)) + sigmas * r.std(axis=0, ddof=1)

    def contact(self) -> int:
        """The largest index of a joint with |r_i| above its threshold; -1 if there is none."""
        assert self.residual is not None and self.threshold is not None
        above = np.flatnonzero(np.abs(self.residual) > self.threshold)
        return int(above[-1]) if above.size else -1
