"""Where an arm rests under a force, and how far the control of elastic joints can be taken."""

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
    """A pose of rest under a constant force.

    Attributes:
        q: joint positions, (n,), rad or m.
        tau: the plant's input there, (n,), N m or N: g(q) - J'F.
        x: the controlled coordinates, (m,), m or rad; joint positions for a law of joints.
        theta: motor positions of elastic joints, (n,), rad or m; None for a rigid arm.
        reachable: whether x_d + K^-1 F can be reached at all; False where a wall or a joint stop holds the arm back.
        spurious: at rest with the spring unbalanced: J'(K (x_d - x) + F) = 0 with K (x_d - x) + F != 0, det J ~ 0; of `MotorPD` and
            `StateFeedback` that know the plant, away from the target with nothing that pushes.
        wall_force: of the plant's wall on its frame, (3,), world axes, N; None without a wall.
        stable: whether no eigenvalue lies to the right; free motions of a redundant arm have eigenvalues at zero.
        eigenvalues: of the closed loop linearised at rest, complex, 1/s, by real part.
    """

    q: Array
    tau: Array
    x: Array
    reachable: bool
    spurious: bool
    stable: bool
    eigenvalues: NDArray[np.complex128]
    theta: Array | None = None
    wall_force: Array | None = None


@bordered
@sealed
@dataclass(frozen=True, eq=False)
class ElasticLimits:
    """How far the control of elastic joints can be taken at one rest.

    Attributes:
        sample_time_max: the sample time at which the motor loop becomes unstable, links locked, s.
        stiffness_max: largest stiffness of a spring at each joint, the others held (Routh), (n,), N m/rad.
        stiffness: what it bounds: the diagonal of J'K J, (n,), N m/rad.
        stiffness_scale_max: by how much K may be multiplied before the linearised loop becomes unstable.
        eigenvalues: of the closed loop linearised at rest, complex, 1/s, by real part.
        reduced_inertia_min: smallest B0 of each motor at the sample time asked about, (n,), kg m^2; None without one.
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
    """The rest that `q0` descends to under a constant force: u(q) + J'F = g(q), tau = g(q) - J'F, theta = q + K^-1 tau.

    An impedance law rests at x_d + K^-1 F where that pose is reachable and regular. Rest at a singular pose with the spring
    unbalanced is flagged as spurious, a rest that the loop leaves as not stable.

    Args:
        plant: `RigidArm` or `ElasticArm`; its wall and its joint stops push back.
        law: an impedance law, a PD law of links or of motors, or state feedback, with a fixed target.
        force: constant force in the law's axes at its frame, N or N m; none if None.
        q0: where the search starts, (n,), rad or m.
        force_frame: the frame at which the force acts instead; then it is (3,), or (6,) as [f; m], in world axes.

    Raises:
        InputError: an argument is not what it should be.
        SolveError: the descent did not end.

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
    """The limits of a motor-inertia reduction at the rest that `q0` descends to: sample time, B0 and stiffness.

    Maps of the smallest B0 over sample time, sensor bandwidth and damping ratio: `smallest_reduced_inertia`.

    Args:
        plant: the elastic arm.
        law: `ElasticImpedance` or `JointImpedance`.
        q0, force, force_frame: as for `equilibrium`.
        sample_time: the controller's, s; asks for `reduced_inertia_min`, at the law's own damping ratio.
        sensor_bandwidth: of a first-order joint-torque sensor, rad/s; no lag if None.

    Raises:
        InputError: an argument is not what it should be.
        SolveError: the descent did not end.

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
