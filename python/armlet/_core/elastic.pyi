"""Types of the analysis of elastic joints: equilibria, stability limits and damping."""

from typing import Any

from numpy.typing import ArrayLike

from ._types import _Array
from .laws import Law
from .plants import Plant

def equilibrium(plant: Plant, law: Law, force: ArrayLike | None, q0: ArrayLike, force_frame: str | None) -> dict[str, Any]:
    """Return a dict with the fields of an `armlet.Equilibrium`."""

def elastic_limits(
    plant: Plant,
    law: Law,
    force: ArrayLike | None,
    q0: ArrayLike,
    force_frame: str | None,
    sample_time: float | None,
    sensor_bandwidth: float | None,
) -> dict[str, Any]:
    """Return a dict with the fields of an `armlet.ElasticLimits`."""

def smallest_reduced_inertia(
    motor_inertia: ArrayLike,
    joint_stiffness: ArrayLike,
    sample_time: ArrayLike,
    *,
    damping_ratio: ArrayLike | None = None,
    sensor_bandwidth: ArrayLike | None = None,
) -> _Array:
    """The smallest reduced motor inertia `B0` for which a sampled motor loop is stable.

    The link is locked, and feedback of the joint torque makes the motor of inertia `B` behave like one of inertia `B0` (see
    `ElasticImpedance`). The motor torque is constant during a sample of length `dt`. So a linear map advances the state
    `(theta, theta_dot)` exactly. With a lag of the sensor, the state includes the sensor's output. At `B0` the spectral radius of this map
    is 1, with the damping `D0 = 2 zeta sqrt(B0 K_J)`. For `B0 << B` and a sensor without lag, the result is about
    `K_J (dt / min(4 zeta, 1/zeta))^2`.

    Args:
        motor_inertia: `B`, kg m^2 or kg, > 0. All arguments are numbers or arrays, and broadcast.
        joint_stiffness: `K_J`, N m/rad or N/m, > 0.
        sample_time: `dt`, s, > 0.
        damping_ratio: `zeta`, > 0; 1 if None (keyword only).
        sensor_bandwidth: bandwidth of a first-order torque sensor, rad/s; a sensor without lag if None (keyword only).

    Returns:
        `B0`, kg m^2 or kg, of the common shape; NaN where even `B0 = B` is unstable.

    Raises:
        InputError: a number is not positive, or the shapes do not broadcast.

    Source: [Ott2008] for the reduction; docs/elastic.md.

    >>> import armlet as al
    >>> al.smallest_reduced_inertia(0.4, 800.0, [0.0005, 0.001, 0.002]).round(6)
    array([0.0002  , 0.0008  , 0.003204])
    """

def stiffness_limit(
    mass: ArrayLike,
    joint_stiffness: ArrayLike,
    reduced_inertia: ArrayLike,
    damping: ArrayLike,
    *,
    motor_damping: ArrayLike | None = None,
) -> _Array:
    """The largest stable stiffness `k` of a spring at a link behind an elastic joint: `k = K_J (1 + d/D0)(1 - d B0/(D0 M))`.

    The Routh criterion gives this limit. With `D0 = 2 sqrt(B0 K_J)` it is `K_J (1 + d/D0)(1 - d D0/(4 M K_J))`. If the limit is negative or
    zero, no stiffness is stable.

    Args:
        mass: inertia `M` of the link, kg m^2 or kg, > 0. All arguments are numbers or arrays, and broadcast.
        joint_stiffness: `K_J`, N m/rad or N/m, > 0.
        reduced_inertia: reduced motor inertia `B0`, kg m^2 or kg, > 0.
        damping: `d` of the damper at the link, N m s/rad or N s/m, >= 0.
        motor_damping: damping `D0` of the motor, N m s/rad or N s/m, > 0; the critical damping `2 sqrt(B0 K_J)` if None (keyword only).

    Returns:
        `k`, N m/rad or N/m, of the common shape.

    Raises:
        InputError: a number has the wrong sign or is not finite, or the shapes do not broadcast.

    Source: [Ott2008] for the reduction; docs/elastic.md.

    >>> import armlet as al
    >>> float(al.stiffness_limit(1.0, 800.0, 0.02, 20.0))
    2660.0
    """

def damping_from_ratio(inertia: ArrayLike, stiffness: ArrayLike, ratio: float) -> _Array:
    """The damping matrix with which every mode of `M a + D v + K x = 0` has the damping ratio `zeta`.

    `D = 2 zeta M^1/2 (M^-1/2 K M^-1/2)^1/2 M^1/2`. If `M = Q'Q` and `K = Q' diag(k) Q`, then `D = 2 zeta Q' diag(k)^1/2 Q`. This design is
    called double diagonalisation.

    Args:
        inertia: `M`, `(n, n)` or its diagonal `(n,)`, symmetric and positive definite, kg or kg m^2, such as `M_x` of a law's terms.
        stiffness: `K`, `(n, n)` or its diagonal `(n,)`, symmetric and positive definite, N/m or N m/rad.
        ratio: the damping ratio `zeta`, > 0; 1 is critical.

    Returns:
        `D`, `(n, n)`, symmetric and positive definite, N s/m or N m s/rad.

    Raises:
        InputError: a matrix is not square, symmetric or positive definite, or the ratio is not positive.

    Source: Albu-Schaeffer, Ott, Frese and Hirzinger, Cartesian impedance control of redundant robots, ICRA 2003.

    >>> import armlet as al
    >>> al.damping_from_ratio([[2.0, 0.0], [0.0, 0.5]], [[200.0, 0.0], [0.0, 50.0]], 0.7)
    array([[28.,  0.],
           [ 0.,  7.]])
    """
