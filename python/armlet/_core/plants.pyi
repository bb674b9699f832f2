"""Types of plants."""

from typing import Any, Self, final

from numpy.typing import ArrayLike
from typing_extensions import disjoint_base

from ..friction_models import LuGre, StickSlip
from ..run.events import JointStops
from .arms import Arm

@disjoint_base
class Plant:
    """A controlled system. This is the base class of all plants."""
    @property
    def arm(self) -> Arm:
        """The arm of the plant."""
    @property
    def _parts(self) -> tuple[str, ...]: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...

@final
class Wall:
    """A compliant wall that the origin of a frame may touch.

    At the depth `d > 0` in the wall, the force on the frame is `f = n max(0, k d + c d_dot)` with the unit normal `n`. The wall never
    pulls.

    Args:
        frame: name of the frame that touches the wall.
        point: a point of the surface, `(3,)`, world axes, m.
        normal: direction out of the wall, `(3,)`, world axes, of any length > 0.
        stiffness: `k`, N/m, > 0 (keyword only).
        damping: `c`, N s/m, >= 0; zero if None (keyword only).

    Raises:
        InputError: a shape is wrong, or a number is not finite or has the wrong sign.

    Source: docs/plants_and_laws.md.

    >>> import armlet as al
    >>> al.Wall("link2", [0.7, 0.0, 0.0], [-1.0, 0.0, 0.0], stiffness=1e4, damping=10.0)
    Wall('link2', point=[0.7, 0.0, 0.0], normal=[-1.0, 0.0, 0.0], stiffness=10000.0, damping=10.0)
    """
    def __new__(cls, frame: str, point: ArrayLike, normal: ArrayLike, *, stiffness: float, damping: float | None = None) -> Self: ...
    def __getnewargs_ex__(self) -> tuple[tuple[str, list[float], list[float]], dict[str, Any]]: ...

@final
class RigidArm(Plant):
    """A rigid arm whose input is the joint torques: `M(q) a + C(q, v) v + g(q) + tau_f = tau + J'F`.

    `tau_f` is the friction torque, and `F` an external force on a frame with the Jacobian `J`. A wall and joint stops add their forces. The
    state is `[q, v]`, and then the deflections of the bristles of `LuGre` friction.

    Args:
        arm: the arm of the plant. The arm of a law may differ from it, to simulate an error of the model.
        friction: True: `tau_f` is the viscous and Coulomb friction of the arm, which `planar_pr` does not have. Under an adaptive method,
            Coulomb friction can hold joints at rest; with fixed steps it is `F sign(v)`, which chatters at rest. "stick_slip": the
            friction of the arm can hold joints at rest under every method. A `StickSlip` or a `LuGre`: `tau_f` is this friction. False: no
            friction (keyword only).
        wall: a `Wall` that the arm may touch (keyword only).
        stops: `JointStops` at the limits of the joints (keyword only).

    Raises:
        InputError: an argument has the wrong type, a frame is unknown, or a number has the wrong sign or shape.

    Source: [SicilianoEtAl2009], chapter 7; docs/plants_and_laws.md.

    >>> import armlet as al
    >>> al.RigidArm(al.planar_pr(2.0, 0.5, 0.5))
    RigidArm(planar_pr(A=2, B=0.5, C=0.5))
    """
    def __new__(
        cls, arm: Arm, *, friction: bool | str | LuGre | StickSlip = False, wall: Wall | None = None, stops: JointStops | None = None
    ) -> Self: ...

@final
class VelocityArm(Plant):
    """An arm whose input `u` is the joint velocities, rad/s or m/s: `q_dot = u`, with the state `q`.

    >>> import armlet as al
    >>> al.VelocityArm(al.planar_arm([0.5, 0.4]))
    VelocityArm(Arm "planar": 2 joints, 2 frames, gravity [0.0, -9.81, 0.0])
    """
    def __new__(cls, arm: Arm) -> Self: ...

@final
class ElasticArm(Plant):
    """An arm with elastic joints, whose input is the motor torques: springs couple the links and the motors.

    The links follow `M(q) a + C(q, v) v + g(q) = tau_J + J'F` with the external force `F`. The motors follow
    `B theta_ddot + tau_f + tau_J = tau` with the friction `tau_f`. The springs have the torque `tau_J = K (theta - q) + D (theta_dot - v)`
    with the joint damping `D`. A wall and joint stops add their forces to the links. Motor positions, inertias and torques are converted to
    the joint side of the gears. The state is `[q, v, theta, theta_dot]`, and then the deflections of the bristles of `LuGre` friction.

    Args:
        arm: the arm of the links.
        stiffness: `K`, N m/rad or N/m, positive definite: scalar, `(n,)` or `(n, n)`.
        motor_inertia: `B`, kg m^2 or kg, positive definite: scalar, `(n,)` or `(n, n)`.
        joint_damping: `D`, damping in parallel with the springs, N m s/rad or N s/m, `(n,)`, >= 0; zero if None (keyword only).
        motor_friction: `tau_f`: a `StickSlip`, a `LuGre`, or coefficients of viscous friction, N m s/rad or N s/m, `(n,)`, >= 0; no
            friction if None (keyword only).
        wall: a `Wall` that the arm may touch (keyword only).
        stops: `JointStops` at the limits of the links (keyword only).

    Raises:
        InputError: a shape is wrong, a number is not finite or has the wrong sign, a matrix is not positive definite, or a frame is
            unknown.

    Source: Spong, Modeling and control of elastic joint robots, J. Dyn. Sys. Meas. Control 109, 1987.

    >>> import armlet as al
    >>> plant = al.ElasticArm(al.planar_arm([0.5, 0.4]), [800.0, 500.0], [0.4, 0.25])
    """
    def __new__(
        cls,
        arm: Arm,
        stiffness: ArrayLike,
        motor_inertia: ArrayLike,
        *,
        joint_damping: ArrayLike | None = None,
        motor_friction: ArrayLike | LuGre | StickSlip | None = None,
        wall: Wall | None = None,
        stops: JointStops | None = None,
    ) -> Self: ...
