"""Equilibria and limits of elastic-joint impedance control.

equilibrium   J'(K_m (x_d - x) + F) = 0,   tau_E = g(q_E) - J'F,   theta_E = q_E + K_J^-1 tau_E
              found as a minimum of  W = e'K_m e/2 - F.x  by Newton's method with |eigenvalues| of the Hessian
linearisation differences of the whole closed loop, extrapolated in h^2 (Richardson)
sampled loop  one motor, link locked, torque held over dt: spectral radius of x -> Phi x + Gamma tau(x)
1-DoF limit   roots of (M s^2 + K)(B0 s^2 + D0 s + K) - K^2 + K (k + d s), the largest k with none on the right
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .impedance import ElasticImpedance
from .lagrange import Analytic, Array, solve
from .loop import ClosedLoop, as_force
from .plant import ElasticArm


class Equilibrium(NamedTuple):
    """Rest pose under a constant force; `reachable` speaks of x_d + K_m^-1 F, `spurious` of an unbalanced spring."""

    q: Array
    theta: Array
    tau: Array
    x: Array
    reachable: bool
    spurious: bool
    stable: bool
    eigenvalues: Analytic


def slope(f: Callable[[Array], Array], x: Array, h: float = 1e-2, columns: int = 6) -> Array:
    """df/dx by central differences with steps h/2^k, extrapolated in h^2."""
    out = []
    for direction in np.eye(x.size):
        table: list[Array] = []
        for k in range(columns):
            step = h / 2**k
            entries = [(f(x + step * direction) - f(x - step * direction)) / (2 * step)]
            for j in range(1, k + 1):
                entries.append(entries[j - 1] + (entries[j - 1] - table[j - 1]) / (4.0**j - 1.0))
            table = entries
        out.append(table[-1])
    return np.array(out).T


def _minimise(gradient: Callable[[Array], Array], value: Callable[[Array], float], q: Array) -> Array:
    """Newton descent; directions of negative curvature are followed downhill, flat ones left alone."""
    for _ in range(200):
        r = gradient(q)
        values, U = np.linalg.eigh((lambda H: 0.5 * (H + H.T))(slope(gradient, q)))
        bends = np.abs(values)
        wanted = (U.T @ r) * (bends > 1e-9 * bends.max()) / np.maximum(bends, 1e-300)
        move = -U @ wanted
        size, best = 1.0, value(q)
        while value(q + size * move) > best + 1e-14 * abs(best) and size > 1e-12:
            size *= 0.5
        q = q + size * move
        if np.abs(move).max() <= 1e-14 * (1.0 + np.abs(q).max()):
            break
    return q


def equilibrium(plant: ElasticArm, law: ElasticImpedance, force: ArrayLike, q0: ArrayLike) -> Equilibrium:
    """The rest pose that q0 descends to under a constant force in the law's axes."""
    F = np.asarray(force, dtype=np.float64)
    task, K_m = law.coordinates, law.stiffness

    def push(q: Array) -> Array:
        return K_m @ task.error(q) + F

    def pull(q: Array) -> Array:
        return -task.jacobian(q).T @ push(q)

    def store(q: Array) -> float:
        e = task.error(q)
        return float(0.5 * e @ K_m @ e + F @ e)

    start = np.asarray(q0, dtype=np.float64)
    q = _minimise(pull, store, start)
    tau = plant.arm.gravity(q) - task.load(q, F)
    theta = q + solve(plant.stiffness, tau)
    x = task.target - task.error(q)
    goal = task.target + solve(K_m, F)
    scale = float(np.abs(K_m @ (np.abs(goal) + 1.0)).max())
    spurious = bool(np.abs(push(q)).max() > 1e-7 * scale)
    reachable = not spurious or _reaches(law, goal, start)
    values = eigenvalues(plant, law, F, q, theta)
    return Equilibrium(q, theta, tau, x, reachable, spurious, bool(values.real.max() < 0.0), values)


def _reaches(law: ElasticImpedance, goal: Array, q0: Array) -> bool:
    """Gauss-Newton with a trust in small steps from several starts; a heuristic that errs towards "no"."""
    task = law.coordinates
    rng = np.random.default_rng(0)
    for _ in range(20):
        q = q0 + rng.uniform(-np.pi, np.pi, q0.size)
        for _ in range(200):
            miss = task.error(q) + (goal - task.target)
            J = task.jacobian(q)
            q = q + J.T @ np.linalg.solve(J @ J.T + 1e-2 * (miss @ miss) * np.eye(miss.size) + 1e-14 * np.eye(miss.size), miss)
        if np.abs(miss).max() < 1e-9:
            return True
    return False


def eigenvalues(plant: ElasticArm, law: ElasticImpedance, force: Array, q: Array, theta: Array) -> Analytic:
    """Of the closed loop linearised at rest, sorted by real part, (4 n,)."""
    loop = ClosedLoop(plant, law, as_force(force)[0])
    n = plant.arm.n
    rest = np.concatenate([q, np.zeros(n), theta, np.zeros(n)])

    def field(x: Array) -> Array:
        return loop(0.0, loop.initial(x))[: 4 * n]

    values = np.linalg.eigvals(slope(field, rest))
    return np.asarray(values[np.argsort(values.real)])


def sampled_radius(motor_inertia: float, joint_stiffness: float, reduced_inertia: float, motor_damping: float, dt: float) -> float:
    """Spectral radius over one sample with the torque held, link locked."""
    B, K, B0, D0 = motor_inertia, joint_stiffness, reduced_inertia, motor_damping
    # Columns theta, theta_dot, held torque; the exponential by Taylor series of a halved matrix, squared back.
    A = np.array([[0.0, 1.0, 0.0], [-K / B, 0.0, 1.0 / B], [0.0, 0.0, 0.0]]) * dt
    halvings = max(0, int(np.ceil(np.log2(np.abs(A).sum() + 1e-300))) + 3)
    term = total = np.eye(3)
    for k in range(1, 20):
        term = term @ A / (k * 2.0**halvings)
        total = total + term
    for _ in range(halvings):
        total = total @ total
    feedback = np.array([[(1.0 - B / B0) * K, -B / B0 * D0]])
    return float(np.abs(np.linalg.eigvals(total[:2, :2] + total[:2, 2:] @ feedback)).max())


def smallest_reduced_inertia(motor_inertia: float, joint_stiffness: float, damping_ratio: float, dt: float) -> float:
    """The B0 at which the sampled loop with D0 = 2 zeta sqrt(B0 K_J) leaves stability, by bisection in log B0."""

    def unstable(log_b0: float) -> bool:
        B0 = float(np.exp(log_b0))
        D0 = 2.0 * damping_ratio * float(np.sqrt(B0 * joint_stiffness))
        return sampled_radius(motor_inertia, joint_stiffness, B0, D0, dt) >= 1.0

    low, high = np.log(1e-3 * joint_stiffness * dt**2), np.log(motor_inertia)
    return float(np.exp(bisect(unstable, float(low), float(high))))


def stiffness_limit(mass: float, joint_stiffness: float, reduced_inertia: float, damping: float, motor_damping: float) -> float:
    """The largest Cartesian stiffness k of the 1-DoF loop without a root on the right; NaN if none is positive."""
    M, K, B0, D0, d = mass, joint_stiffness, reduced_inertia, motor_damping, damping

    def stable(k: float) -> bool:
        loop = np.polyadd(np.polymul([M, 0.0, K], [B0, D0, K]), [K * d, K * k - K * K])
        return bool(np.roots(loop).real.max() < 0.0)

    if not stable(1e-9 * K):
        return float("nan")
    high = K
    while stable(high):
        high *= 2.0
    return bisect(stable, 1e-9 * K, high)


def bisect(holds: Callable[[float], bool], low: float, high: float) -> float:
    """Where `holds` turns from true at low to false at high."""
    for _ in range(200):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (middle, high) if holds(middle) else (low, middle)
    return 0.5 * (low + high)
