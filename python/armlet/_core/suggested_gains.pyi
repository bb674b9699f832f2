"""Types of suggested gains for a bandwidth."""

from typing import Any, Self, final

from numpy.typing import ArrayLike

from ._types import _Array
from .arms import Arm

@final
class SuggestedGains:
    """Gains for a bandwidth and a damping ratio, from `suggest_gains`. `str(g)` explains them.

    - `kp`, `kd`: `(n,)`, N m/rad and N m s/rad (N/m, N s/m), for `PDGravity`, `PID`, `JointImpedance` and `Adaptive`.
    - `computed_torque`: the numbers `kp` in 1/s^2 and `kd` in 1/s, for `ComputedTorque`.
    - `inertia`: `m`, `(n,)`, kg m^2 or kg.
    - `lightest`: the smallest eigenvalue of `diag(m)^-1 M(q)` at the configurations at which `suggest_gains` computed the mass matrix `M`.
    - `limit`: the bandwidth, rad/s, below which the sampled loop with `kp` and `kd` is stable; None without a sample time.
    - `computed_torque_limit`: the same bandwidth for the loop with `ComputedTorque`, rad/s; None without a sample time.
    - `step`: a step `dt`, s, for fixed-step methods and a continuous law with `kp` and `kd`: the inverse of the fastest pole.
    - `bandwidth`, `damping_ratio`, `sample_time`: the arguments of `suggest_gains`.
    """
    def __new__(cls, bandwidth: float, damping_ratio: float, sample_time: float | None, inertia: ArrayLike, lightest: float) -> Self: ...
    @property
    def kp(self) -> _Array:
        """`(n,)`, N m/rad and N m s/rad (N/m, N s/m), for `PDGravity`, `PID`, `JointImpedance` and `Adaptive`."""
    @property
    def kd(self) -> _Array:
        """`(n,)`, N m/rad and N m s/rad (N/m, N s/m), for `PDGravity`, `PID`, `JointImpedance` and `Adaptive`."""
    @property
    def computed_torque(self) -> tuple[float, float]:
        """The numbers `kp` in 1/s^2 and `kd` in 1/s, for `ComputedTorque`."""
    @property
    def inertia(self) -> _Array:
        """`m`, `(n,)`, kg m^2 or kg."""
    @property
    def lightest(self) -> float:
        """The smallest eigenvalue of `diag(m)^-1 M(q)` at the configurations at which `suggest_gains` computed the mass matrix `M`."""
    @property
    def limit(self) -> float | None:
        """The bandwidth, rad/s, below which the sampled loop with `kp` and `kd` is stable; None without a sample time."""
    @property
    def computed_torque_limit(self) -> float | None:
        """The same bandwidth for the loop with `ComputedTorque`, rad/s; None without a sample time."""
    @property
    def step(self) -> float:
        """A step `dt`, s, for fixed-step methods and a continuous law with `kp` and `kd`: the inverse of the fastest pole."""
    @property
    def bandwidth(self) -> float:
        """The arguments of `suggest_gains`."""
    @property
    def damping_ratio(self) -> float:
        """The arguments of `suggest_gains`."""
    @property
    def sample_time(self) -> float | None:
        """The arguments of `suggest_gains`."""
    def __reduce__(self) -> tuple[Any, ...]: ...

def suggest_gains(arm: Arm, bandwidth: float, damping_ratio: float = 1.0, sample_time: float | None = None) -> SuggestedGains:
    """Compute gains of an arm for a bandwidth `w` and a damping ratio `zeta`, from its mass matrix over the workspace.

    `PDGravity`, `PID`, `JointImpedance` and `Adaptive` have *gains that are torques* (N m per rad and per rad/s of the error): `kp = m w^2`
    and `kd = 2 zeta m w`. For `ComputedTorque`, `.computed_torque` has `kp = w^2` and `kd = 2 zeta w`.

    `m` is the largest `diag M(q)` of 512 configurations within the joint limits, times a factor. It is the smallest factor for which
    `diag(m) - M(q)` is positive semidefinite at all of them. So, with `M` constant at one of these configurations, every mode has at least
    the natural frequency `w` and the damping ratio `zeta`. Joints without limits are sampled from -pi to pi rad, or from -1 to 1 m. Equal
    calls return equal gains.

    With `sample_time=h` the law's input is constant for `h`. The loop is then stable for bandwidths below `min(4 zeta, l/zeta)/h` rad/s.
    For `ComputedTorque`, `l = 1`; for gains that are torques, `l` is the smallest eigenvalue of `diag(m)^-1 M(q)` at these configurations.
    This limit assumes that the law compensates gravity, and that the mass matrix is constant at one of these configurations.

    Args:
        arm: the arm; its inertia includes the armature.
        bandwidth: `w`, rad/s, > 0.
        damping_ratio: `zeta`, > 0; 1 is critical damping.
        sample_time: the time `h` between two samples of the law, s, > 0; None: a continuous law.

    Returns:
        A `SuggestedGains`: `.kp`, `.kd`, and `str(g)` with bandwidths, poles and limits.

    Raises:
        InputError: a number is not positive, `bandwidth` is not below the limit for `ComputedTorque` at this sample time, or the mass
            matrix is not positive definite.

    Warns:
        UserWarning: `bandwidth` is not below the limit for gains that are torques.

    Source: Siciliano, Sciavicco, Villani and Oriolo, Robotics: Modelling, Planning and Control, section 8.5, 2009.

    >>> import armlet as al
    >>> g = al.suggest_gains(al.pendulum(2.0, 5.0), 10.0, sample_time=1e-3)
    >>> g.kp, g.kd, g.limit
    (array([200.]), array([40.]), 1000.0)
    """
