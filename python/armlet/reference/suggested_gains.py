"""Gains for a bandwidth w and a damping ratio z, from mass matrices at random configurations.

    kp = m w^2,  kd = 2 z m w,  m = s max_q diag M(q),  s the largest generalised eigenvalue of (M(q), max_q diag M(q))
    limit for a sample time h: the w at which the spectral radius of exp([0 1; 0 0] h) - [h^2/2; h] [w^2 2 z w] / l is 1     (bisection)

l is the smallest eigenvalue of diag(m)^-1 M(q) over the configurations, or 1 for computed torque. The core uses the closed form of the
limit, from Jury's criterion.
"""

from typing import NamedTuple

import numpy as np

from .arm import Arm
from .lagrange import Array, Mechanism

SAMPLES = 512
MASK = (1 << 64) - 1


class SuggestedGains(NamedTuple):
    """The gains kp and kd, the inertia m, (n,) each, and two limits of the bandwidth of a sampled loop, rad/s.

    `limit` is for laws with gains in N m/rad and N m s/rad. Above it, the mode with the smallest eigenvalue of diag(m)^-1 M(q) over random
    configurations q is unstable. `computed_torque_limit` is for computed torque, where this eigenvalue is 1.
    """

    kp: Array
    kd: Array
    inertia: Array
    limit: float
    computed_torque_limit: float


def _uniform(count: int) -> Array:
    """The first `count` random numbers in [0, 1) of SplitMix64 with the seed 0 (Steele, Lea and Flood 2014)."""
    out, state = np.empty(count), 0
    for k in range(count):
        state = (state + 0x9E3779B97F4A7C15) & MASK
        z = ((state ^ (state >> 30)) * 0xBF58476D1CE4E5B9) & MASK
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK
        out[k] = ((z ^ (z >> 31)) >> 11) / 2.0**53
    return out


def _radius(w: float, zeta: float, light: float, h: float) -> float:
    """The spectral radius of one sample of `h` s, for the mode with the smallest eigenvalue of diag(m)^-1 M.

    `w` is the bandwidth, rad/s, and `zeta` the damping ratio. `light` is the eigenvalue l of the formula.
    """
    held = np.array([[1.0, h], [0.0, 1.0]]) - np.outer([h * h / 2, h], [w * w / light, 2 * zeta * w / light])
    return float(np.abs(np.linalg.eigvals(held)).max())


def _limit(zeta: float, light: float, h: float) -> float:
    low, high = 0.0, 8.0 * max(zeta, 1.0 / zeta) / h
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _radius(middle, zeta, light, h) < 1.0 else (low, middle)
    return low


def suggest_gains(arm: Mechanism, bandwidth: float, damping_ratio: float = 1.0, sample_time: float | None = None) -> SuggestedGains:
    """Compute gains. Joints of an `Arm` without limits range from -pi to pi rad or from -1 to 1 m.

    Without `sample_time` the limits of the bandwidth are infinite.
    """
    if isinstance(arm, Arm):
        half = np.where(arm.angles, np.pi, 1.0)
        lower, upper = arm.limits["lower"], arm.limits["upper"]
        low = np.where(np.isfinite(lower), lower, np.minimum(-half, upper - 2 * half))
        high = np.where(np.isfinite(upper), upper, low + 2 * half)
    else:
        low, high = np.full(arm.n, -np.pi), np.full(arm.n, np.pi)
    q = low + (high - low) * _uniform(SAMPLES * arm.n).reshape(SAMPLES, arm.n)
    masses = [arm.mass_matrix(row) for row in q]
    diagonal = np.max([np.diag(M) for M in masses], axis=0)
    values = np.array([np.linalg.eigvals(M / diagonal[:, None]).real for M in masses])
    m = values.max() * diagonal
    light = values.min() / values.max()
    if sample_time is None:
        limits = (np.inf, np.inf)
    else:
        limits = (_limit(damping_ratio, light, sample_time), _limit(damping_ratio, 1.0, sample_time))
    return SuggestedGains(m * bandwidth**2, 2 * damping_ratio * m * bandwidth, m, *limits)
