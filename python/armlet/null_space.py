"""The options of an impedance law for the null space of its task."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

from numpy.typing import ArrayLike

from . import _core
from .arguments import choice
from .border import bordered
from .pickling import sealed

__all__ = ["NullSpace"]


@bordered
@sealed
@dataclass(frozen=True)
class NullSpace:
    """A spring and a damper of the joints in the null space of an impedance law: `N' (K_n (q_n - q) + D_n (q_n_dot - v))`.

    `projection="consistent"`: `N' = I - J' L J M^-1`, `L = (J M^-1 J')^-1`. The torque does not accelerate the frame along the axes of the
    law's task (Khatib 1987). `projection="static"`: `N' = I - J' (J')#`. In general the torque accelerates the frame also along these axes.

    Here `J` is the Jacobian of the law's task, `M` the mass matrix, `'` the transpose and `#` the pseudo-inverse. With both projections,
    the motion in the null space moves the frame through the Coriolis torque and `J_dot v`, unless the law compensates the coupling. Near
    singularities, `L` and `(J')#` stay bounded, because singular values below `eps` of the law are not inverted exactly. Along such a task
    direction, the projection keeps a fraction of the torque.

    Args:
        q_d: `q_n`, the posture, (n,), rad or m, or a motion of the joints.
        stiffness: `K_n` >= 0, N m/rad or N/m: scalar, (n,), or positive definite (n, n).
        damping: `D_n` >= 0, N m s/rad or N s/m: scalar, (n,), or positive definite (n, n).
        projection: "consistent" or "static" (keyword only).

    Raises:
        InputError: the projection is unknown, or an argument is not an array of numbers. Wrong shapes and signs raise it in the law's
            constructor.

    Source: Khatib, IEEE J. Robotics and Automation 3(1), 1987; Ott, Cartesian Impedance Control of Redundant and Flexible-Joint
    Robots, 2008.

    >>> import armlet as al
    >>> arm = al.planar_arm([0.4, 0.3, 0.2])
    >>> posture = al.NullSpace([0.3, 0.4, 0.5], stiffness=20.0, damping=4.0)
    >>> law = al.CartesianImpedance(arm, [0.5, 0.4], 300.0, 40.0, frame="link3", axes="xy", nullspace=posture)
    >>> q, v = [0.3, 0.9, 0.2], [0.0, 0.0, 0.0]
    >>> parts = law.terms(0.0, q, v)
    >>> a = arm.forward_dynamics(q, v, parts["null_torque"] + arm.gravity(q))
    >>> bool(abs(parts["J"] @ a).max() < 1e-12 < abs(a).max())  # m/s^2 at the tip, rad/s^2 in the joints
    True
    """

    q_d: ArrayLike | _core.Motion
    stiffness: ArrayLike
    damping: ArrayLike
    projection: Literal["consistent", "static"] = field(default="consistent", kw_only=True)

    def __post_init__(self) -> None:
        if not isinstance(self.q_d, _core.Motion):
            object.__setattr__(self, "q_d", _plain(_core.numbers("NullSpace", "q_d", self.q_d, ("n",)).tolist()))
        n = self.q_d.n if isinstance(self.q_d, _core.Motion) else len(self.q_d)  # type: ignore[arg-type]  # a tuple after the line above
        for name in ("stiffness", "damping"):
            value = _core.numbers("NullSpace", name, getattr(self, name), (), (n,), (n, n)).tolist()
            object.__setattr__(self, name, _plain(value))
        choice("NullSpace", "projection", self.projection, ("consistent", "static"))


def _plain(values: Any) -> Any:
    """Convert nested lists to nested tuples of numbers, which can be compared, printed and pickled."""
    return tuple(_plain(value) for value in values) if isinstance(values, list) else values
