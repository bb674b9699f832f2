"""Joint positions at which tasks are reached, by least squares from many starts.

    q_j = middle_j + half_j sin z_j for joints with two limits, q_j = z_j for other joints, so that z has no bounds
    level i:  min |e_i(q)|^2 + W sum_(k<i) |e_k(q) - e_k*|^2,  e_k* the errors reached by the levels above        (Levenberg and Marquardt)
    best start:         the start with the smallest error at the first level that is not reached
    several solutions:  first solutions that reach every level, ordered by |q - q0|; then the others, the best first

The core uses prioritised steps with an active set of limits.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .arm import Arm
from .lagrange import Array
from .motion import Hold
from .tasks import Task

WEIGHT = 1e3  # square root of the weight W, which multiplies the errors of the levels above
STEPS = 100
SAME = 1e-3  # solutions whose joints differ by less, rad or m, apart from full rotations, are equal


class InverseKinematics(NamedTuple):
    """Joint positions q (n,), the error of each task, and whether each task is reached.

    In a batch q is (..., n), and `reached` is whether all tasks of a row are reached.
    """

    q: Array
    errors: list[Array]
    reached: Any


def _least_squares(residual: Callable[[Array], tuple[Array, Array]], z: Array) -> Array:
    """A minimum of |r(z)|^2, searched from the start z. `residual(z)` returns r and -dr/dz."""
    damping = 1e-2
    r, J = residual(z)
    for _ in range(STEPS):
        step = np.linalg.lstsq(np.vstack([J, np.sqrt(damping) * np.eye(z.size)]), np.append(r, np.zeros(z.size)), rcond=None)[0]
        new, slope = residual(z + step)
        if new @ new < r @ r:
            z, r, J, damping = z + step, new, slope, 0.2 * damping
        else:
            damping = 5.0 * damping
        if np.abs(step).max() < 1e-14 or np.abs(r).max() < 1e-14 or damping > 1e12:
            break
    return z


def inverse_kinematics(
    arm: Arm,
    tasks: Sequence[Task],
    q0: ArrayLike,
    *,
    tolerance: float = 1e-9,
    restarts: int = 20,
    seed: int = 0,
    limits: bool = True,
    solutions: int | None = None,
) -> InverseKinematics:
    """Search for joint positions at which tasks with constant targets are reached: no entry of their errors exceeds the tolerance.

    The first task has the highest priority. Leading axes of q0 and of the targets broadcast. `solutions=k` adds an axis with k solutions,
    which are NaN if fewer are found.
    """
    aims = [np.asarray(task.motion(0.0)[0], dtype=np.float64) for task in tasks]
    starts = np.asarray(q0, dtype=np.float64)
    lead = np.broadcast_shapes(starts.shape[:-1], *(aim.shape[:-1] for aim in aims))
    most = solutions or 1
    rows = []
    for index in np.ndindex(*lead):
        own = [copy.copy(task) for task in tasks]
        for task, aim in zip(own, aims, strict=True):
            task.motion = Hold(np.broadcast_to(aim, (*lead, aim.shape[-1]))[index])
        start = np.broadcast_to(starts, (*lead, arm.n))[index]
        rows.append(_solutions(arm, own, start, most, tolerance=tolerance, restarts=restarts, seed=seed, limits=limits))
    if not lead and solutions is None:
        q, errors, reached = rows[0][0]
        return InverseKinematics(q, errors, reached)
    shape = (*lead, *([solutions] if solutions else []))
    empty = (np.full(arm.n, np.nan), [np.full(e.size, np.nan) for e in rows[0][0][1]], [False]) if rows else None
    flat = [(each + most * [empty])[:most] for each in rows]
    found = [one for each in flat for one in each if one is not None]
    errors = [np.array([one[1][i] for one in found]).reshape(*shape, -1) for i in range(len(tasks))]
    q = np.array([one[0] for one in found]).reshape(*shape, arm.n)
    return InverseKinematics(q, errors, np.array([all(one[2]) for one in found]).reshape(shape))


def _apart(arm: Arm, a: Array, b: Array) -> float:
    gap = a - b
    turns = arm.angles
    return float(np.abs(np.where(turns, gap - 2 * np.pi * np.round(gap / (2 * np.pi)), gap)).max())


def _solutions(
    arm: Arm, tasks: Sequence[Task], q0: Array, most: int, *, tolerance: float, restarts: int, seed: int, limits: bool
) -> list[tuple[Array, list[Array], list[bool]]]:
    """At most `most` solutions for one target, the best first: positions, errors, and whether each task is reached."""
    bounded = limits & np.isfinite(arm.limits["upper"] - arm.limits["lower"])
    lower, upper = (np.where(bounded, arm.limits[name], side) for name, side in (("lower", -1.0), ("upper", 1.0)))
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)

    def place(z: Array) -> tuple[Array, Array]:
        """The joint positions q, and the diagonal of dq/dz."""
        return np.where(bounded, middle + half * np.sin(z), z), np.where(bounded, half * np.cos(z), 1.0)

    def error(task: Task, q: Array) -> Array:
        if not task.has_bounds:
            return task.error(arm, q, task.motion(0.0)[0])
        x = -task.error(arm, q, np.zeros(len(task.jacobian(arm, q))))
        lower, upper = task.within(arm, x.size) or (x, x)
        return np.clip(x, lower, upper) - x

    def slope_of(task: Task, q: Array) -> Array:
        # Coordinates within their bounds are free.
        free = (error(task, q) == 0.0) & task.has_bounds
        return np.where(free[:, None], 0.0, task.jacobian(arm, q))

    def search(z: Array) -> tuple[Array, list[Array]]:
        above: list[Array] = []
        for level in range(len(tasks)):

            def residual(z: Array, level: int = level) -> tuple[Array, Array]:
                q, slope = place(z)
                rows = [WEIGHT * (error(task, q) - kept) for task, kept in zip(tasks[:level], above, strict=True)]
                jacobians = [WEIGHT * slope_of(task, q) * slope for task in tasks[:level]]
                return np.concatenate([*rows, error(tasks[level], q)]), np.vstack([*jacobians, slope_of(tasks[level], q) * slope])

            z = _least_squares(residual, z)
            above.append(error(tasks[level], place(z)[0]))
        return place(z)[0], above

    def misses(errors: list[Array]) -> list[float]:
        sizes = [float(np.abs(e).max()) for e in errors]
        return [size if size > tolerance else 0.0 for size in sizes]

    rng = np.random.default_rng(seed)
    start = np.clip((np.asarray(q0, dtype=np.float64) - middle) / half, -1.0, 1.0)
    z: Array = np.where(bounded, np.arcsin(start), q0)
    found: list[tuple[Array, list[Array]]] = []
    for _ in range(1 + restarts):
        new = search(z)
        same = next((i for i, old in enumerate(found) if _apart(arm, old[0], new[0]) <= SAME), None)
        if same is None:
            found.append(new)
        elif misses(new[1]) < misses(found[same][1]):
            found[same] = new
        found.sort(key=lambda one: (misses(one[1]), np.linalg.norm(one[0] - q0) if not any(misses(one[1])) else 0.0))
        del found[most:]
        if len(found) == most and not any(misses(found[-1][1])):
            break
        z = rng.uniform(-np.pi / 2, np.pi / 2, arm.n)
    return [(q, errors, [miss == 0.0 for miss in misses(errors)]) for q, errors in found]
