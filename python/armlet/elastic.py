"""Equilibria of an arm under a force, and stability limits of the control of elastic joints.

Symbols: q are the link positions, theta the motor positions, and g(q) the gravity torque. F is the external force or wrench, J the Jacobian
of its frame, and ' the transpose. An impedance law has the controlled coordinates x, their target x_d and the stiffness K. An elastic joint
has the stiffness K_J. B0 is the reduced motor inertia of the law.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from .border import border, bordered
from .pickling import sealed

__all__ = ["ElasticLimits", "Equilibrium", "elastic_limits", "equilibrium"]

Array: TypeAlias = NDArray[np.float64]


@bordered
@sealed
@dataclass(frozen=True, eq=False)
class Equilibrium:
    """An equilibrium under a constant force F: the positions and torques at rest, and whether the loop is stable there.

    Attributes:
        q: joint positions, (n,), rad or m.
        tau: input of the plant at the equilibrium, (n,), N m or N. It is g(q) - J'F minus the torques of a wall and of joint stops. g is
            the gravity torque, and J the Jacobian of the frame of F.
        x: the controlled coordinates, (m,), m or rad; joint positions for a law of joints.
        theta: motor positions of elastic joints, (n,), rad or m; None for a rigid arm.
        estimate: the law's integral wrench, (m,), N and N m; None without `integral_gain`.
        residual: unbalanced torque, (n,), N m or N: the output of the law minus `tau`. It is zero up to rounding. If it is not, the search
            found no equilibrium, for example because no torque opposes a force along a free motion. Then the arm moves from this state, and
            `reachable`, `spurious` and `stable` are False. A residual counts as zero if a change of the positions by 1e-10 could cause it.
        reachable: whether the arm can reach x_d + K^-1 F, or x_d if the law has an integral. x_d is the law's target and K its stiffness.
            False if a wall, a joint stop or a limit of the law holds the arm.
        spurious: for an impedance law, whether the spring force does not balance F, although the joint torques are balanced. Then
            J'(K (x_d - x) + F) = 0 with K (x_d - x) + F != 0, which requires a singular J. For `MotorPD` and `StateFeedback` with exact
            plant parameters, whether the equilibrium is not the target although no force and no contact acts.
        wall_force: force of the plant's wall on its frame, (3,), world axes, N; None without a wall.
        stable: whether the residual is zero and all eigenvalues, except those of free motions, have negative real parts, up to rounding.
        eigenvalues: eigenvalues of the closed loop, linearised at the equilibrium, complex, 1/s, sorted by real part.
        free_motions: the number of free motions, which have eigenvalue zero and no restoring force. Without a posture task, the null-space
            motions of a redundant arm are free. With bristle friction at rest, every joint is free.
    """

    q: Array
    tau: Array
    x: Array
    residual: Array
    reachable: bool
    spurious: bool
    stable: bool
    eigenvalues: NDArray[np.complex128]
    theta: Array | None = None
    wall_force: Array | None = None
    estimate: Array | None = None
    free_motions: int = 0


@bordered
@sealed
@dataclass(frozen=True, eq=False)
class ElasticLimits:
    """Stability limits of the control of elastic joints at one equilibrium.

    Attributes:
        sample_time_max: the sample time at which the motor loop becomes unstable if the links are locked, s.
        stiffness_max: largest stable stiffness of a spring at each joint if the other joints are locked (Routh), (n,), N m/rad.
        stiffness: the stiffness of the law that `stiffness_max` bounds, (n,), N m/rad. It is the diagonal of J'K J for a Cartesian
            stiffness K with the Jacobian J, or of the law's joint stiffness.
        stiffness_scale_max: largest factor of the law's stiffness for which the linearised loop is stable. It is infinite if no factor up
            to 1e6 is unstable, and 0 if the loop with the factor 1 is unstable.
        eigenvalues: eigenvalues of the closed loop, linearised at the equilibrium, complex, 1/s, sorted by real part.
        reduced_inertia_min: smallest reduced inertia B0 of each motor at `sample_time`, (n,), kg m^2; None without a sample time.
    """

    sample_time_max: float
    stiffness_max: Array
    stiffness: Array
    stiffness_scale_max: float
    eigenvalues: NDArray[np.complex128]
    reduced_inertia_min: Array | None = None


@border
def equilibrium(
    plant: _core.Plant, law: _core.Law, force: ArrayLike | None = None, *, q0: ArrayLike, force_frame: str | None = None
) -> Equilibrium:
    """Find the equilibrium near `q0` under a constant force F: u(q) + J'F = g(q), tau = g(q) - J'F, theta = q + K_J^-1 tau.

    Here u is the torque of the law, J the Jacobian of the frame of F, and g the gravity torque. tau is the input of the plant, theta are
    the motor positions, and K_J is the stiffness of elastic joints. The forces of a wall and of joint stops act in addition to F.

    The equilibrium of an impedance law with the target x_d and the stiffness K is x_d + K^-1 F if that pose is reachable and regular. At a
    singular pose with an unbalanced spring, `spurious` is true. If small deviations from the equilibrium grow, `stable` is false. If the
    search ends at a state that is not at rest, the residual is not zero, and all flags are false. For a law
    with a null space, an integral or limits, u(q) is not the gradient of a potential. The search then follows a slow motion of the loop,
    M dq/dt = u(q) + J'F - g(q), with the mass matrix M.

    A redundant arm without a posture task can move without moving its frame. `free_motions` counts these motions, and `stable` ignores
    them.

    Args:
        plant: `RigidArm` or `ElasticArm`, with its wall and its joint stops.
        law: an impedance law, a PD law of links or of motors, or state feedback, with a fixed target.
        force: constant force in the law's axes at its frame, N or N m; None: no force.
        q0: start of the search, (n,), rad or m.
        force_frame: another frame at which the force acts. The force is then (3,), or (6,) as [f; m], in world axes.

    Returns:
        An `Equilibrium`: positions of links and motors, (n,), rad or m, torque, tip position, eigenvalues, 1/s, and flags.

    Raises:
        InputError: an argument is not valid; the message names it.
        SolveError: the search did not converge.

    Source: [Spong1987, Ott2008]; docs/elastic.md.

    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> plant = al.ElasticArm(arm, [800.0, 500.0], [0.4, 0.25])
    >>> given = [0.4, 0.5], [300.0, 200.0], [40.0, 30.0], [800.0, 500.0], [0.4, 0.25], 0.02
    >>> law = al.ElasticImpedance(arm, *given, frame="link2", axes="xy")
    >>> rest = al.equilibrium(plant, law, [30.0, -20.0], q0=[0.3, 1.2])
    >>> rest.x.round(6), rest.stable, rest.spurious
    (array([0.5, 0.4]), True, False)
    """
    return Equilibrium(**_core.equilibrium(plant, law, force, q0, force_frame))


@border
def elastic_limits(
    plant: _core.ElasticArm,
    law: _core.Law,
    *,
    q0: ArrayLike,
    force: ArrayLike | None = None,
    force_frame: str | None = None,
    sample_time: float | None = None,
    sensor_bandwidth: float | None = None,
) -> ElasticLimits:
    """Compute the limits of a motor-inertia reduction at an equilibrium: sample time, reduced inertia B0 and stiffness.

    `smallest_reduced_inertia` computes maps of the smallest B0 over sample time, sensor bandwidth and damping ratio.

    Args:
        plant: the elastic arm.
        law: `ElasticImpedance` or `JointImpedance`.
        q0, force, force_frame: start of the search, and external force, as for `equilibrium`.
        sample_time: period of the controller, s. It is required for `reduced_inertia_min`, which uses the law's damping ratio.
        sensor_bandwidth: bandwidth of a first-order joint-torque sensor, rad/s; None: a sensor without lag.

    Returns:
        An `ElasticLimits`: the largest sample time, s, the smallest B0, (n,), kg m^2, and the largest stable factor of the stiffness.

    Raises:
        InputError: an argument is not valid; the message names it.
        SolveError: the search did not converge.

    Source: [Ott2008] for the reduction; docs/elastic.md.

    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> plant = al.ElasticArm(arm, [800.0, 500.0], [0.4, 0.25])
    >>> given = [0.4, 0.5], [300.0, 200.0], [40.0, 30.0], [800.0, 500.0], [0.4, 0.25], 0.02
    >>> law = al.ElasticImpedance(arm, *given, frame="link2", axes="xy")
    >>> limits = al.elastic_limits(plant, law, q0=[0.3, 1.2], sample_time=1e-3)
    >>> round(limits.sample_time_max * 1e3, 2), limits.reduced_inertia_min.round(5)
    (4.98, array([0.0008, 0.0005]))
    """
    return ElasticLimits(**_core.elastic_limits(plant, law, force, q0, force_frame, sample_time, sensor_bandwidth))
