"""Contacts: a wall and joint stops. Each has a penetration depth d(q), which is an analytic function, and a spring with a damper.

    f = max(0, k d + c d_dot) where d > 0, else 0
    tau = -f dd/dq,   stored energy k d^2 / 2,   lost power (f - k d) d_dot
    wall: d = n . (p_wall - p(q)) of the origin p of a frame;   stop: d = q_i - upper_i or lower_i - q_i

k is the stiffness and c the damping of the contact. A complex step computes the gradient of the depth, so no Jacobian is needed.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import STEP, Analytic, Array, complex_steps


class Wall(NamedTuple):
    """A wall for the origin of `frame`: a plane through `point` (3,), m, with the outward `normal` (3,), both in world axes."""

    frame: str
    point: ArrayLike
    normal: ArrayLike
    stiffness: float
    damping: float = 0.0


class JointStops(NamedTuple):
    """Stops of joints: limits, stiffness and damping, scalar or (n,). A limit may be infinite; None means the limits of the arm."""

    stiffness: ArrayLike
    damping: ArrayLike = 0.0
    lower: ArrayLike | None = None
    upper: ArrayLike | None = None


class Contact(NamedTuple):
    """A contact: its depth d(q), a number for q (n,) and (K,) for q (K, n), its stiffness k and its damping c."""

    name: tuple[Any, ...]
    depth: Callable[[Analytic], Analytic]
    stiffness: float
    damping: float


def contacts(arm: Any, wall: Wall | None, stops: JointStops | None) -> list[Contact]:
    """The contacts of an arm: the wall, and then the lower and the upper stop of each joint if its limit is finite."""
    found = []
    if wall is not None:
        normal = np.asarray(wall.normal, dtype=np.float64) / np.linalg.norm(wall.normal)
        point = np.asarray(wall.point, dtype=np.float64)

        def depth(q: Analytic) -> Analytic:
            inside: Analytic = (point - arm._frame(q, wall.frame)[0][..., :3, 3]) @ normal
            return inside

        found.append(Contact(("wall",), depth, wall.stiffness, wall.damping))
    if stops is not None:
        limits = [arm.limits[side] if given is None else given for side, given in (("lower", stops.lower), ("upper", stops.upper))]
        k, c, lower, upper = (np.broadcast_to(np.asarray(x, dtype=np.float64), (arm.n,)) for x in (*stops[:2], *limits))
        for i in range(arm.n):
            for name, side, limit in (("lower", -1.0, float(lower[i])), ("upper", 1.0, float(upper[i]))):
                if np.isfinite(limit):
                    found.append(Contact((name, i), _beyond(i, side, limit), float(k[i]), float(c[i])))
    return found


def _beyond(joint: int, side: float, limit: float) -> Callable[[Analytic], Analytic]:
    """The function d(q) of the depth of a joint beyond its limit; `side` is 1 for the upper limit and -1 for the lower one."""
    return lambda q: side * (q[..., joint] - limit)


def push(contact: Contact, q: Array, v: Array) -> tuple[Array, float, float]:
    """The joint torques (n,), the stored energy, J, and the lost power, W, of one contact."""
    d = float(contact.depth(q))
    if d <= 0.0:
        return np.zeros_like(q), 0.0, 0.0
    slope = contact.depth(complex_steps(q)).imag / STEP
    rate = float(slope @ v)
    f = max(0.0, contact.stiffness * d + contact.damping * rate)
    return -f * slope, 0.5 * contact.stiffness * d**2, (f - contact.stiffness * d) * rate


def pushes(found: list[Contact], q: Array, v: Array) -> tuple[Array, float, float]:
    """The joint torques (n,), the stored energy, J, and the lost power, W, summed over all contacts."""
    torque, stored, lost = np.zeros_like(q), 0.0, 0.0
    for contact in found:
        each = push(contact, q, v)
        torque, stored, lost = torque + each[0], stored + each[1], lost + each[2]
    return torque, stored, lost
