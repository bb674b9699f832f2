"""Stability limits of the control of elastic joints at an equilibrium.

sampled loop  links locked, torque constant for dt: the motors are a linear system with the state y = [theta, theta_dot] or, with a torque
              sensor, [.., tau_f],   dtau_f/dt = w_c (K_J theta - tau_f),   tau = (1 - B B0^-1) tau_J - B B0^-1 D0 theta_dot.
              The loop is stable while the map of y over one sample under tau(y) has a spectral radius below 1.
1-DoF limit   the largest k for which (M s^2 + K)(B0 s^2 + D0 s + K) - K^2 + K (k + d s) has no root in the right half-plane
stiffness     the multiple of the law's stiffness at which the largest real part of the eigenvalues of the linear model is zero

theta are motor positions. B, B0 and D0 are motor inertia, reduced inertia and its damping. K_J or K is the joint stiffness. tau_J is the
joint torque K_J theta, or with a sensor its reading tau_f. w_c is the bandwidth of the sensor, and s the Laplace variable. M and d are
inertia and damping of the link, and k is the stiffness of the spring at the link.
"""

from collections.abc import Callable
from copy import copy
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .impedance import ratio_damping
from .lagrange import Analytic, Array, solve
from .plant import ElasticArm
from .static_equilibrium import equilibrium


class ElasticLimits(NamedTuple):
    """The limits at one equilibrium, with the fields of `armlet.ElasticLimits`."""

    sample_time_max: float
    stiffness_max: Array
    stiffness: Array
    stiffness_scale_max: float
    eigenvalues: Analytic
    reduced_inertia_min: Array | None


def damping_from_ratio(inertia: ArrayLike, stiffness: ArrayLike, ratio: float) -> Array:
    """The damping matrix D (n, n) with which every mode of inertia, D and stiffness has the damping ratio `ratio`."""
    return ratio_damping(np.asarray(inertia, dtype=np.float64), np.asarray(stiffness, dtype=np.float64), ratio)


def sampled_radius(B: Array, K: Array, B0: Array, D0: Array, dt: float, bandwidth: float = np.inf, friction: Array | float = 0.0) -> float:
    """The spectral radius of the map of the motor state over one sample of `dt` s, with constant torque and locked links.

    B, B0, D0 and K, (n, n), are motor inertia, reduced inertia, motor damping and joint stiffness. `bandwidth` is that of the torque
    sensors, rad/s, and `friction` the damping of joints and motors, N m s/rad. The loop is stable if the result is below 1.
    """
    n, slow = len(B), np.isfinite(bandwidth)
    size = 3 * n if slow else 2 * n
    A = np.zeros((size + n, size + n))
    motors, one = slice(n, 2 * n), np.eye(n)
    A[:n, motors], A[motors, :n], A[motors, motors], A[motors, size:] = one, -solve(B, K), -solve(B, one * friction), solve(B, one)
    share = one - B @ solve(B0, one)
    law = np.zeros((n, size))
    law[:, motors] = -B @ solve(B0, D0)
    if slow:
        A[2 * n : size, :n], A[2 * n : size, 2 * n : size] = bandwidth * K, -bandwidth * one
        law[:, 2 * n : size] = share
    else:
        law[:, :n] = share @ K
    # The matrix exponential by scaling and squaring: a Taylor series of the scaled matrix, which is then squared repeatedly.
    halvings = max(0, int(np.ceil(np.log2(np.abs(A * dt).sum() + 1e-300))) + 3)
    term = total = np.eye(size + n)
    for k in range(1, 20):
        term = term @ A * (dt / (k * 2.0**halvings))
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return float(np.abs(np.linalg.eigvals(total[:size, :size] + total[:size, size:] @ law)).max())


def smallest_reduced_inertia(
    motor_inertia: float, joint_stiffness: float, sample_time: float, *, damping_ratio: float = 1.0, sensor_bandwidth: float = np.inf
) -> float:
    """The B0 at which the sampled loop with D0 = 2 zeta sqrt(B0 K_J) becomes unstable. The search decreases B0 from B.

    NaN if the loop with B0 = B is unstable.
    """
    B, K = (np.array([[float(x)]]) for x in (motor_inertia, joint_stiffness))

    def stable(log_b0: float) -> bool:
        B0 = np.array([[np.exp(log_b0)]])
        D0 = 2.0 * damping_ratio * np.sqrt(B0 * K)
        # The loop must also be stable for shorter samples. Otherwise B0 is in an isolated stable interval, which does not count.
        return all(sampled_radius(B, K, B0, D0, sample_time * part, sensor_bandwidth) < 1.0 for part in (1.0, 0.75, 0.5, 0.25))

    top = float(np.log(motor_inertia))
    if not stable(top):
        return float("nan")
    low = next(x for x in top - 0.1 * np.arange(1, 400) if not stable(x))
    return float(np.exp(-bisect(lambda x: stable(-x), -low - 0.1, -low)))


def stiffness_limit(
    mass: float, joint_stiffness: float, reduced_inertia: float, damping: float, *, motor_damping: float | None = None
) -> float:
    """The largest Cartesian stiffness k of the 1-DoF loop without a root in the right half-plane; NaN if none is positive."""
    M, K, B0, d = mass, joint_stiffness, reduced_inertia, damping
    D0 = 2.0 * float(np.sqrt(B0 * K)) if motor_damping is None else motor_damping

    def stable(k: float) -> bool:
        loop = np.polyadd(np.polymul([M, 0.0, K], [B0, D0, K]), [K * d, K * k - K * K])
        return bool(np.roots(loop).real.max() < 0.0)

    if not stable(1e-9 * K):
        return float("nan")
    high = K
    while stable(high):
        high *= 2.0
    return bisect(stable, 1e-9 * K, high)


def largest_sample_time(plant: ElasticArm, law: Any, bandwidth: float) -> float:
    """The smallest dt, s, at which the motor loop with locked links is unstable: a search in steps of 1 %, then bisection."""
    K, B, friction = plant.stiffness, plant.motor_inertia, plant.joint_damping + plant.motor_friction

    def stable(log_dt: float) -> bool:
        dt = float(np.exp(log_dt))
        return sampled_radius(B, K, law.reduced_inertia, law.motor_damping, dt, bandwidth, friction) < 1.0

    slow = float(np.log(1e-2 / np.sqrt(np.abs(solve(law.reduced_inertia, K)).sum())))
    high = next(x for x in slow + 0.01 * np.arange(1, 2000) if not stable(x))
    return float(np.exp(bisect(stable, high - 0.01, high)))


def elastic_limits(
    plant: ElasticArm,
    law: Any,
    *,
    q0: ArrayLike,
    force: ArrayLike | None = None,
    force_frame: str | None = None,
    sample_time: float | None = None,
    sensor_bandwidth: float | None = None,
) -> ElasticLimits:
    """The limits of a motor-inertia reduction at the equilibrium that the search from q0 finds.

    The joint stiffness and the motor inertia of the law must be equal to the values of the plant.
    """
    found = equilibrium(plant, law, force, q0=q0, force_frame=force_frame)
    bandwidth = np.inf if sensor_bandwidth is None else sensor_bandwidth
    task = getattr(law, "coordinates", None)
    J = np.eye(plant.arm.n) if task is None else task.jacobian(found.q)
    stiffness, damping = (np.diag(J.T @ each @ J) for each in (law.stiffness, law.damping))
    M, K, B = (np.diag(x) for x in (plant.arm.mass_matrix(found.q), plant.stiffness, plant.motor_inertia))
    B0, D0 = np.diag(law.reduced_inertia), np.diag(law.motor_damping)
    least = None
    if sample_time is not None:
        ratios = D0 / (2.0 * np.sqrt(B0 * K))
        options = [{"damping_ratio": float(zeta), "sensor_bandwidth": bandwidth} for zeta in ratios]
        least = np.array([smallest_reduced_inertia(B[i], K[i], sample_time, **options[i]) for i in range(plant.arm.n)])
    largest = [stiffness_limit(M[i], K[i], B0[i], damping[i], motor_damping=D0[i]) for i in range(plant.arm.n)]
    scale = _stiffness_scale(plant, law, force, force_frame, found.q)
    return ElasticLimits(largest_sample_time(plant, law, bandwidth), np.array(largest), stiffness, scale, found.eigenvalues, least)


def _stiffness_scale(plant: ElasticArm, law: Any, force: Any, force_frame: str | None, q: Array) -> float:
    """The scale of the stiffness at which the largest real part of the eigenvalues is zero, found with the Illinois method.

    The result is zero if the loop is unstable at the scale 1.
    """

    def lead(kappa: float) -> float:
        scaled = copy(law)
        scaled.stiffness = kappa * law.stiffness
        if hasattr(law, "outer"):
            scaled.outer = copy(law.outer)
            scaled.outer.kp = scaled.stiffness
        return float(equilibrium(plant, scaled, force, q0=q, force_frame=force_frame).eigenvalues.real.max())

    low, high = 1.0, 2.0
    below, above = lead(low), lead(high)
    if below >= 0.0:
        return 0.0
    while above < 0.0:
        (low, below), high = (high, above), 2.0 * high
        above = lead(high)
    side, kappa = 0, low
    for _ in range(60):
        last, kappa = kappa, (low * above - high * below) / (above - below)
        if abs(kappa - last) < 1e-7 * kappa:
            break
        here = lead(kappa)
        if here < 0.0:
            low, below, above, side = kappa, here, above / 2 if side == 1 else above, 1
        else:
            high, above, below, side = kappa, here, below / 2 if side == -1 else below, -1
    return kappa


def bisect(holds: Callable[[float], bool], low: float, high: float) -> float:
    """The point between `low` and `high` at which the condition `holds` changes from true at `low` to false at `high`."""
    for _ in range(200):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (middle, high) if holds(middle) else (low, middle)
    return 0.5 * (low + high)
