"""Equilibria of closed loops under a constant force, computed as the limit of a slow motion.

    rigid    r(q) = tau(q) - L(q),   L = g(q) - J'F - tau_c
    elastic  r(q, theta) = [K (theta - q) - L(q), tau(q, theta) - K (theta - q)]
    dy/dt = r(y) by implicit Euler steps of lengths s that grow as r falls:   (1/s - dr/dy) dy = r       (pseudo-transient continuation)
    y = q or (q, theta), then the state of the law;   the last entries of r are the rate of this state
    tau_E = L(q_E),   theta_E = q_E + K^-1 tau_E,   tau_c the torque of wall and stops

tau(q) is the torque of the law at rest, and K the joint stiffness. F is the external force at a frame with the Jacobian J, and ' the
transpose. The Jacobian dr/dy and the linear model of the loop are central differences with the step h, extrapolated in h^2 (Richardson).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .contact import pushes
from .lagrange import Analytic, Array, solve
from .law import Law
from .loop import ClosedLoop, frame_load
from .plant import ElasticArm, RigidArm
from .regulation import MotorPD


class Equilibrium(NamedTuple):
    """An equilibrium under a constant force F, with the fields of `armlet.Equilibrium`."""

    q: Array
    theta: Array | None
    tau: Array
    x: Array
    residual: Array
    reachable: bool
    spurious: bool
    stable: bool
    eigenvalues: Analytic
    estimate: Array | None = None
    free_motions: int = 0


def slope(f: Callable[[Array], Array], x: Array, h: float = 1e-2, columns: int = 6) -> Array:
    """The Jacobian df/dx by central differences with steps h/2^k, extrapolated in h^2."""
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


def descend(r: Callable[[Array], Array], y: Array) -> Array:
    """Follow dy/dt = r(y) from y by at most 300 implicit Euler steps, until it is at rest. No entry changes by more than 0.3 in a step."""
    size = first = float(np.abs(r(y)).max())
    if size == 0.0:
        return y
    for _ in range(300):
        # An inexact dr/dy makes the convergence slower, but does not change the limit, where r = 0.
        H = slope(r, y, 1e-4, 2)
        push = r(y)
        size = float(np.abs(push).max())
        rate = 10.0 * size * min(1.0, (size / first)) ** 1.5
        move = np.linalg.lstsq(rate * np.eye(y.size) - H, push, rcond=1e-12)[0]
        y = y + move * min(1.0, 0.3 / float(np.abs(move).max() + 1e-300))
        if np.abs(move).max() <= 1e-14 * (1.0 + np.abs(y).max()):
            break
    return y


def equilibrium(
    plant: RigidArm | ElasticArm, law: Any, force: ArrayLike | None = None, *, q0: ArrayLike, force_frame: str | None = None
) -> Equilibrium:
    """The equilibrium that is reached from q0 under a constant force.

    The force is in the coordinates of the law, or with `force_frame` at this frame in world axes.
    """
    start, n = np.asarray(q0, dtype=np.float64), plant.arm.n
    task: Any = getattr(law, "coordinates", None)
    push = None if force is None else np.asarray(force, dtype=np.float64)
    load = frame_load(plant.arm, force_frame) if force_frame is not None else getattr(law, "load", None)
    still = np.zeros(n)

    def carried(q: Array) -> Array:
        """The torque L(q) that the joints must balance."""
        outside = still if push is None or load is None else load(q, push)
        return np.asarray(plant.arm.gravity(q) - outside - pushes(plant.contacts, q, still)[0])

    w0 = law.state0

    def unbalanced(y: Array) -> Array:
        q, theta, w = y[:n], y[n : y.size - w0.size], y[y.size - w0.size :]
        given = {"state": w} if w.size else {}
        if isinstance(plant, RigidArm):
            parts = law.terms(0.0, q, still, **given)
            return np.concatenate([parts["tau"] - carried(q), parts["state_rate"] if w.size else w])
        spring = plant.stiffness @ (theta - q)
        parts = law.terms(0.0, q, still, theta, still, **given)
        return np.concatenate([spring - carried(q), parts["tau"] - spring, parts["state_rate"] if w.size else w])

    elastic = isinstance(plant, ElasticArm)
    motors = start + solve(plant.stiffness, carried(start)) if isinstance(plant, ElasticArm) else np.zeros(0)
    y = descend(unbalanced, np.concatenate([start, motors, w0]))
    q, w = y[:n], y[y.size - w0.size :]
    tau = carried(q)
    theta = q + solve(plant.stiffness, tau) if isinstance(plant, ElasticArm) else None
    pressed = bool(pushes(plant.contacts, q, still)[1] > 0.0)
    reachable, spurious, x = not pressed, False, q
    if task is not None:
        x = task.target - task.error(q)
        own = np.zeros_like(x) if push is None or force_frame not in (None, task.frame) else push[task.rows] if force_frame else push
        own = own + law.feedforward + (w if w.size else 0.0)  # the wrench that the spring balances
        if force_frame in (None, task.frame) and not pressed:
            goal = task.target + solve(law.stiffness, own)
            scale = float(np.abs(law.stiffness @ (np.abs(goal) + 1.0)).max())
            spurious = bool(np.abs(law.stiffness @ task.error(q) + own).max() > 1e-7 * scale)
            reachable = not spurious or _reaches(task, goal, start)
    elif elastic and isinstance(law, MotorPD):
        # An equilibrium that is not the target is spurious if no force and no contact acts, and the law has the plant's model.
        away = bool((np.abs(q - law.target) > 1e-6 * (1.0 + np.abs(law.target))).any())
        spurious = away and not pressed and (push is None or not push.any()) and law.arm is plant.arm
    values, free = eigenvalues(plant, law, push, load, q, theta, w)
    turned: tuple[Array, ...] = () if theta is None else (theta, still)
    parts = law.terms(0.0, q, still, *turned, **({"state": w} if w.size else {}))
    residual = np.asarray(parts["tau"] - tau)
    # The descent stops at changes of 1e-14 of the positions, so the residual is a rounding error or the force along a free motion.
    balanced = bool(np.abs(residual).max() <= 1e-7 * (1.0 + np.abs(tau).max()))
    stable = balanced and bool(values.real.max() < 1e-7 * float(np.abs(values).max()))
    reachable, spurious = reachable and balanced, spurious and balanced
    return Equilibrium(q, theta, tau, x, residual, reachable, spurious, stable, values, w if w.size else None, free)


def _reaches(task: Any, goal: Array, q0: Array) -> bool:
    """Whether a search finds the pose `goal`: damped Gauss-Newton steps from several starts. It may miss a reachable pose."""
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


def eigenvalues(
    plant: RigidArm | ElasticArm,
    law: Law,
    force: Array | None,
    load: Callable[[Array, Array], Array] | None,
    q: Array,
    theta: Array | None,
    w: Array,
    columns: int = 6,
) -> tuple[Analytic, int]:
    """The eigenvalues of the linear model of the closed loop at the equilibrium, sorted by real part, and the number of free motions.

    `w` is the state of the law, and A is the matrix of the linear model. A free motion is a direction N with A N = 0. Its zero eigenvalue
    may be defective, and rounding then splits this eigenvalue. So the other eigenvalues are computed from P A P with P = I - N N#.
    """
    loop = ClosedLoop(plant, law, None if force is None else lambda t: force, load)
    still = np.zeros(plant.arm.n)
    mechanism = np.concatenate([q, still] if theta is None else [q, still, theta, still])

    state = np.concatenate([mechanism, w])

    def field(x: Array) -> Array:
        y = loop.initial(x[: mechanism.size])
        y[mechanism.size : state.size] = x[mechanism.size :]
        return loop(0.0, y)[: state.size]

    A = slope(field, state, columns=columns)
    fastest = float(np.abs(np.linalg.eigvals(A)).max())
    speeds = np.arange(state.size) // plant.arm.n % 2 * (np.arange(state.size) < mechanism.size)
    unit = np.where(speeds == 1, fastest, 1.0)
    scaled = A * unit / unit[:, None] / fastest
    for k in range(mechanism.size, state.size):
        row, column = np.abs(scaled[k]).max(), np.abs(scaled[:, k]).max()
        if row > 0.0 and column > 0.0:
            scaled[k] *= np.sqrt(column / row)
            scaled[:, k] *= np.sqrt(row / column)
    _, sizes, rows = np.linalg.svd(scaled)
    N = rows[sizes <= 1e-8 * sizes[0]]
    P = np.eye(state.size) - N.T @ N
    values = fastest * np.linalg.eigvals(P @ scaled @ P)
    return np.asarray(values[np.argsort(values.real)]), len(N)
