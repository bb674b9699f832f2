"""Contacts: a wall and joint stops. Each has a penetration depth d(q), an analytic function, and pushes only outwards.

    f = max(0, k d + c d_dot) where d > 0, else 0
    tau = -f dd/dq,   stored energy k d^2 / 2,   power lost (f - k d) d_dot
    wall: d = n . (p_wall - p(q)) of the origin p of a frame;   stop: d = q_i - upper_i or lower_i - q_i

The gradient of the depth is a complex step. No Jacobian is needed.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import STEP, Analytic, Array, complex_steps


class Wall(NamedTuple):
    """A plane through `point` (3,) with the outward `normal` (3,), world axes, that stops the origin of `frame`."""

    frame: str
    point: ArrayLike
    normal: ArrayLike
    stiffness: float
    damping: float = 0.0


class JointStops(NamedTuple):
    """Limits of the joints, scalar or (n,), infinite for none, None for those of the arm; stiffness and damping scalar or (n,)."""

    stiffness: ArrayLike
    damping: ArrayLike = 0.0
    lower: ArrayLike | None = None
    upper: ArrayLike | None = None


class Contact(NamedTuple):
    """One depth d(q), a number for q (n,) and (K,) for (K, n), with its spring and damper."""

    name: tuple[Any, ...]
    depth: Callable[[Analytic], Analytic]
    stiffness: float
    damping: float


def contacts(arm: Any, wall: Wall | None, stops: JointStops | None) -> list[Contact]:
    """The wall, then the stops of each joint, lower before upper."""
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
    """The depth of a joint beyond its limit on one side."""
    return lambda q: side * (q[..., joint] - limit)


def push(contact: Contact, q: Array, v: Array) -> tuple[Array, float, float]:
    """Joint torques (n,), stored energy and power lost of one contact."""
    d = float(contact.depth(q))
    if d <= 0.0:
        return np.zeros_like(q), 0.0, 0.0
    slope = contact.depth(complex_steps(q)).imag / STEP
    rate = float(slope @ v)
    f = max(0.0, contact.stiffness * d + contact.damping * rate)
    return -f * slope, 0.5 * contact.stiffness * d**2, (f - contact.stiffness * d) * rate


def pushes(found: list[Contact], q: Array, v: Array) -> tuple[Array, float, float]:
    """The sums over all contacts."""
    torque, stored, lost = np.zeros_like(q), 0.0, 0.0
    for contact in found:
        each = push(contact, q, v)
        torque, stored, lost = torque + each[0], stored + each[1], lost + each[2]
    return torque, stored, lost
