"""Stick-slip friction as a complementarity problem, for the impulses of a time step and for the torques at one state.

    A (v+ - v) = h (b - d v) - p,   |p_i| <= h F_i;   v+_i = 0 if |p_i| < h F_i, v+_i > 0 only at h F_i, v+_i < 0 only at -h F_i
    F_i = F_s + mu |L| at rest, F_c + (F_s - F_c) exp(-(v/v_s)^2) + mu |L| in motion

v and v+ are the velocities before and after a step of length h. A is the inertia of the joints or motors with friction, b their torque
without friction, and d the viscous friction. F_c and F_s are Coulomb and static friction, v_s is the Stribeck speed and mu the load ratio.
The load L of an ElasticArm is its joint torque. The load of a RigidArm is tau - tau_f, with the friction of the previous step. Projected
Gauss-Seidel iterations compute the impulses p. The method locates no events, and has first order.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array, solve
from .plant import ElasticArm, RigidArm

# CONVERGED: the iterations end when no impulse changes by more than this fraction of the largest impulse. SWEEPS: the largest number of
# iterations.
CONVERGED, SWEEPS = 1e-15, 20_000


class StickSlip(NamedTuple):
    """The arguments of `armlet.StickSlip`, scalar or (n,) each."""

    coulomb: ArrayLike
    static: ArrayLike | None = None
    stribeck_speed: ArrayLike | None = None
    viscous: ArrayLike = 0.0
    load_ratio: ArrayLike = 0.0

    def level(self, v: Array) -> Array:
        """The friction limits F_i at zero load, (n,), N m or N: static friction for v = 0, otherwise the Stribeck curve."""
        coulomb = np.asarray(self.coulomb, dtype=np.float64)
        static = np.asarray(coulomb if self.static is None else self.static, dtype=np.float64)
        speed = np.asarray(0.0 if self.stribeck_speed is None else self.stribeck_speed, dtype=np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            part = np.where(v == 0.0, 1.0, np.exp(-((v / speed) ** 2)))
        return np.broadcast_to(coulomb + (static - coulomb) * part, v.shape)


def complementary(W: Any, free: Any, bound: Any) -> tuple[Array, Array]:
    """The impulses p and the speeds v+ = free - W p with |p_i| <= bound_i.

    For each i, v+_i is zero, or p_i opposes v+_i and |p_i| = bound_i.
    """
    p = np.zeros_like(free)
    if not p.size:
        return p, p
    for _ in range(SWEEPS):
        before = p.copy()
        for i in range(len(p)):
            p[i] = np.clip(p[i] + (free[i] - W[i] @ p) / W[i, i], -bound[i], bound[i])
        if np.abs(p - before).max() <= CONVERGED * max(1e-300, float(np.abs(p).max())):
            break
    left = free - W @ p
    left[np.abs(p) < bound] = 0.0
    return p, left


def _inertia(plant: RigidArm | ElasticArm, q: Array) -> Array:
    return np.asarray(plant.motor_inertia if isinstance(plant, ElasticArm) else plant.arm.mass_matrix(q))


def friction_torque(plant: RigidArm | ElasticArm, friction: StickSlip, y: Array, tau: Array, load: Array) -> Array:
    """The friction torque tau_f (n,) at the state y of a plant without friction. Joints with v = 0 are at rest.

    With a load ratio, the friction depends on the load and the load on the friction, so the result is found by iteration.
    """
    n = plant.arm.n
    which = slice(3 * n, 4 * n) if plant.elastic else slice(n, 2 * n)
    v, W = y[which], np.linalg.inv(_inertia(plant, y[:n]))
    a = plant.rates(y, tau, load)[which]
    moving, ratio = v != 0.0, np.broadcast_to(np.asarray(friction.load_ratio, dtype=np.float64), (n,))
    torque = np.zeros(n)
    for _ in range(500):
        passed = plant._joint(y) if isinstance(plant, ElasticArm) else tau - torque
        bound = friction.level(v) + ratio * np.abs(passed)
        known = np.where(moving, np.sign(v) * bound + np.asarray(friction.viscous) * v, 0.0)
        held = complementary(W[np.ix_(~moving, ~moving)], (a - W @ known)[~moving], bound[~moving])[0]
        before, torque = torque, known.copy()
        torque[~moving] = held
        if np.abs(torque - before).max() <= 1e-14 * max(1.0, float(np.abs(torque).max())):
            break
    return torque


def stick_slip_run(
    plant: RigidArm | ElasticArm,
    friction: StickSlip,
    law: Any,
    q0: ArrayLike,
    *,
    t_end: float,
    dt: float,
    v0: ArrayLike | None = None,
    record_every: int = 1,
) -> dict[str, Array]:
    """A run of a plant with this friction as its only friction: t, q and v at every record_every-th step and at the last step."""
    n = plant.arm.n
    start = np.array(q0, dtype=np.float64)
    y = plant.initial(start, np.zeros(n) if v0 is None else np.array(v0, dtype=np.float64), None, None)
    place, which = (slice(2 * n, 3 * n), slice(3 * n, 4 * n)) if plant.elastic else (slice(0, n), slice(n, 2 * n))
    ratio, torque, rows = np.asarray(friction.load_ratio, dtype=np.float64), np.zeros(n), []
    state = law.start(start, y[n : 2 * n])
    steps = round(t_end / dt)
    for k in range(steps + 1):
        if k % record_every == 0 or k == steps:
            rows.append((k * dt, y.copy()))
        q, v, theta, theta_dot = plant.split(y)
        terms = law.terms(k * dt, q, v, theta, theta_dot, state)
        tau, rate = terms["tau"], y[which]
        W = np.linalg.inv(_inertia(plant, q))
        passed = plant._joint(y) if isinstance(plant, ElasticArm) else tau - torque
        bound = friction.level(rate) + ratio * np.abs(passed)
        f = plant.rates(y, tau, np.zeros(n))
        free = rate + dt * (f[which] - solve(_inertia(plant, q), np.asarray(friction.viscous) * rate))
        p, after = complementary(W, free, dt * bound)
        torque = p / dt
        state = state + dt * terms["state_rate"]
        y = y + dt * f
        y[which] = after
        y[place] += dt * (after - rate)
    return {"t": np.array([t for t, _ in rows]), "q": np.array([y[:n] for _, y in rows]), "v": np.array([y[n : 2 * n] for _, y in rows])}
