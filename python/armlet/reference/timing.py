"""A check of the limits of a path's timing, which uses only samples of the motion.

    tau = d/dt dL/dv - dL/dq from the energies (see `lagrange`);   tau_min <= tau <= tau_max, |v| <= v_max, |a| <= a_max
    spline by its second derivatives:  h_(k-1) M_(k-1) + 2 (h_(k-1) + h_k) M_k + h_k M_(k+1) = 6 (D_k/h_k - D_(k-1)/h_(k-1))
    ends: natural M_0 = 0;  clamped 2 h_0 M_0 + h_0 M_1 = 6 D_0/h_0;  not-a-knot h_1 M_0 - (h_0 + h_1) M_1 + h_0 M_2 = 0

L is the kinetic minus the potential energy, M_k the second derivative at the knot s_k, h_k = s_(k+1) - s_k and D_k = q_(k+1) - q_k. The
core solves for first derivatives of the spline, and uses Newton-Euler recursions.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array, Mechanism

EPS = float(np.finfo(np.float64).eps)


def cubic_spline(s: ArrayLike, q: ArrayLike, ends: str = "natural") -> Callable[[Array], tuple[Array, Array, Array]]:
    """The function of s that returns q, dq/ds, d2q/ds2 of the cubic spline through the rows of q (K, n) at s (K,).

    `ends` is "natural", "clamped" or "not-a-knot".
    """
    s, q = np.asarray(s, dtype=np.float64), np.asarray(q, dtype=np.float64)
    h, steps = np.diff(s), np.diff(q, axis=0)
    K = s.size
    lhs, rhs = np.eye(K), np.zeros_like(q)
    for k in range(1, K - 1):
        lhs[k, k - 1 : k + 2] = h[k - 1], 2 * (h[k - 1] + h[k]), h[k]
        rhs[k] = 6 * (steps[k] / h[k] - steps[k - 1] / h[k - 1])
    if ends == "clamped":
        for row, near, far, sign in ((0, 0, 1, 1.0), (K - 1, K - 1, K - 2, -1.0)):
            step = h[min(row, K - 2)]
            lhs[row, near], lhs[row, far], rhs[row] = 2 * step, step, sign * 6 * steps[min(row, K - 2)] / step
    elif ends == "not-a-knot":
        lhs[0, :3], lhs[-1, -3:] = (h[1], -h[0] - h[1], h[0]), (h[-1], -h[-2] - h[-1], h[-2])
    M = np.linalg.solve(lhs, rhs)

    def at(x: Array) -> tuple[Array, Array, Array]:
        k = np.clip(np.searchsorted(s, x, side="right") - 1, 0, K - 2)
        w = h[k][:, None]
        a, b = s[k + 1][:, None] - x[:, None], x[:, None] - s[k][:, None]
        left, right = q[k] / w - M[k] * w / 6, q[k + 1] / w - M[k + 1] * w / 6
        value = (M[k] * a**3 + M[k + 1] * b**3) / (6 * w) + left * a + right * b
        return value, (M[k + 1] * b**2 - M[k] * a**2) / (2 * w) + right - left, (M[k] * a + M[k + 1] * b) / w

    return at


def positions(q: ArrayLike) -> Array:
    """The path positions (K,), from 0 to 1, of waypoints (K, n), in proportion to the distances between them."""
    q = np.asarray(q, dtype=np.float64)
    size = np.abs(q).max() or 1.0
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0) / size, axis=1))])
    return np.array(along / along[-1])


def torques(arm: Mechanism, q: Array, v: Array, a: Array, viscous: ArrayLike = 0.0) -> tuple[Array, Array]:
    """The torques (T, n) of a motion with viscous friction at T times, and bounds of their rounding errors."""
    tau = arm.inverse_dynamics(q, v, a) + np.asarray(viscous) * v
    mass = np.abs(arm.mass_matrix(q)).max(axis=-2)
    load = np.abs(a).sum(axis=-1) + np.square(v).sum(axis=-1)
    rounding = 64 * EPS * (mass.max(axis=-1) * load)[:, None] + 64 * EPS * np.abs(arm.gravity(q)).max(axis=-1)[:, None]
    return np.array(tau), rounding + 16 * EPS * np.abs(tau)


def excess(values: Array, limits: ArrayLike, rounding: Array | float = 0.0) -> float:
    """The largest relative excess of values (T, n) at T times over limits, which are a scalar, (n,), or (n, 2) lower and upper."""
    values, limits = np.atleast_2d(values), np.asarray(limits, dtype=np.float64)
    if limits.ndim < 2:
        limits = np.stack([-np.broadcast_to(limits, values.shape[1:]), np.broadcast_to(limits, values.shape[1:])], axis=1)
    lower, upper = limits[:, 0], limits[:, 1]
    scale_lower = np.where(lower == 0.0, np.abs(upper), np.abs(lower))
    scale_upper = np.where(upper == 0.0, np.abs(lower), np.abs(upper))
    over = (values - rounding - upper) / scale_upper
    under = (lower - values - rounding) / scale_lower
    return float(np.maximum(over, under).max())
