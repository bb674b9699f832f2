"""Joint positions at which tasks are reached, by least squares from many starts.

    q_j = middle_j + half_j sin z_j within limits, q_j = z_j without: a search without bounds
    level i:  min |e_i(q)|^2 + W sum_(k<i) |e_k(q) - e_k*|^2,  e_k* what the levels above reached      (Levenberg and Marquardt)
    of all starts the best:  the one whose first level that is not reached is nearest

The core takes prioritised steps with an active set of limits.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .arm import Arm
from .lagrange import Array
from .tasks import Task

WEIGHT = 1e3  # of the levels above, its root
STEPS = 100


class InverseKinematics(NamedTuple):
    """q (n,), the errors of each task, and whether each is reached."""

    q: Array
    errors: list[Array]
    reached: list[bool]


def _least_squares(residual: Callable[[Array], tuple[Array, Array]], z: Array) -> Array:
    """A minimum of |r(z)|^2 from a start; `residual` gives r and -dr/dz."""
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
    arm: Arm, tasks: Sequence[Task], q0: ArrayLike, *, tolerance: float = 1e-9, restarts: int = 20, seed: int = 0, limits: bool = True
) -> InverseKinematics:
    """Tasks with constant targets, the highest first; reached where no entry of an error exceeds the tolerance."""
    bounded = limits & np.isfinite(arm.limits["upper"] - arm.limits["lower"])
    lower, upper = (np.where(bounded, arm.limits[name], side) for name, side in (("lower", -1.0), ("upper", 1.0)))
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)

    def place(z: Array) -> tuple[Array, Array]:
        """q and dq/dz."""
        return np.where(bounded, middle + half * np.sin(z), z), np.where(bounded, half * np.cos(z), 1.0)

    def error(task: Task, q: Array) -> Array:
        return task.error(arm, q, task.motion(0.0)[0])

    def search(z: Array) -> tuple[Array, list[Array]]:
        above: list[Array] = []
        for level in range(len(tasks)):

            def residual(z: Array, level: int = level) -> tuple[Array, Array]:
                q, slope = place(z)
                rows = [WEIGHT * (error(task, q) - kept) for task, kept in zip(tasks[:level], above, strict=True)]
                jacobians = [WEIGHT * task.jacobian(arm, q) * slope for task in tasks[:level]]
                return np.concatenate([*rows, error(tasks[level], q)]), np.vstack([*jacobians, tasks[level].jacobian(arm, q) * slope])

            z = _least_squares(residual, z)
            above.append(error(tasks[level], place(z)[0]))
        return place(z)[0], above

    def misses(errors: list[Array]) -> list[float]:
        sizes = [float(np.abs(e).max()) for e in errors]
        return [size if size > tolerance else 0.0 for size in sizes]

    rng = np.random.default_rng(seed)
    start = np.clip((np.asarray(q0, dtype=np.float64) - middle) / half, -1.0, 1.0)
    z: Array = np.where(bounded, np.arcsin(start), q0)
    best: tuple[Array, list[Array]] | None = None
    for _ in range(1 + restarts):
        found = search(z)
        if best is None or misses(found[1]) < misses(best[1]):
            best = found
        if not any(misses(best[1])):
            break
        z = rng.uniform(-np.pi / 2, np.pi / 2, arm.n)
    assert best is not None
    return InverseKinematics(best[0], best[1], [miss == 0.0 for miss in misses(best[1])])
