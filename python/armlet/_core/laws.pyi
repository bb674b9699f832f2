"""Types of control laws."""

from collections.abc import Sequence
from typing import Any, Literal, Self, final

from numpy.typing import ArrayLike
from typing_extensions import disjoint_base

from ..identification import BaseParameters
from ..null_space import NullSpace
from ..samples import Samples
from ._types import _Array
from .arms import Arm
from .motions import Motion
from .simulation import MomentumObserver

@disjoint_base
class Law:
    @property
    def arm(self) -> Arm: ...
    @property
    def motion(self) -> Motion | None: ...
    @property
    def _state_count(self) -> int: ...
    @property
    def _joint_motion(self) -> Motion | None: ...
    @property
    def _joint_target(self) -> _Array | None: ...
    def __call__(
        self,
        /,
        t: float,
        q: ArrayLike,
        v: ArrayLike,
        *,
        theta: ArrayLike | None = None,
        theta_dot: ArrayLike | None = None,
        state: ArrayLike | None = None,
    ) -> _Array: ...
    def terms(
        self,
        t: float,
        q: ArrayLike,
        v: ArrayLike,
        *,
        theta: ArrayLike | None = None,
        theta_dot: ArrayLike | None = None,
        state: ArrayLike | None = None,
    ) -> dict[str, Any]: ...  # values are arrays; for laws of prioritised tasks, also lists with one entry per level of priority
    def replace(self, **changes: Any) -> Self: ...
    def _slope(
        self,
        t: float,
        q: ArrayLike,
        v: ArrayLike,
        *,
        theta: ArrayLike | None = None,
        theta_dot: ArrayLike | None = None,
        state: ArrayLike | None = None,
    ) -> _Array | None: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...

@final
class Adaptive(Law):
    @property
    def motion(self) -> Motion: ...
    def __new__(
        cls,
        arm: Arm,
        motion: Motion,
        kp: ArrayLike,
        kd: ArrayLike,
        gamma: ArrayLike,
        *,
        estimate: ArrayLike | None = None,
        base: BaseParameters | None = None,
        natural: bool = False,
        projection: ArrayLike | None = None,
        friction: bool | str | Sequence[str] = False,
        armature: bool = False,
        friction_speed: ArrayLike | None = None,
        leakage: float = 0.0,
        leakage_form: str = "sigma",
        leakage_centre: ArrayLike | None = None,
        dead_zone: float = 0.0,
        composite: ArrayLike | None = None,
        composite_rate: float = 10.0,
        concurrent: Samples | None = None,
        concurrent_weight: ArrayLike = 1.0,
        offset: bool = False,
    ) -> Self: ...
    @property
    def parameter_names(self) -> tuple[str, ...]: ...

@final
class ComputedTorque(Law):
    @property
    def motion(self) -> Motion: ...
    def __new__(cls, arm: Arm, motion: Motion, kp: ArrayLike, kd: ArrayLike) -> Self: ...

@final
class PDGravity(Law):
    def __new__(cls, arm: Arm, target: ArrayLike, kp: ArrayLike, kd: ArrayLike) -> Self: ...

@final
class PID(Law):
    def __new__(
        cls,
        arm: Arm,
        target: ArrayLike | Motion,
        kp: ArrayLike,
        ki: ArrayLike | None,
        kd: ArrayLike,
        tau_max: ArrayLike | None = None,
        *,
        derivative_filter: ArrayLike | None = None,
        friction: bool = False,
        friction_speed: ArrayLike | None = None,
        observer_bandwidth: ArrayLike | None = None,
        nominal_inertia: ArrayLike | None = None,
    ) -> Self: ...

@final
class Guarded(Law):
    @property
    def law(self) -> Law: ...
    @property
    def observer(self) -> MomentumObserver: ...
    @property
    def reaction(self) -> Literal["stop", "float", "retract"] | None: ...
    @property
    def motion(self) -> Motion | None: ...
    @property
    def _gain(self) -> _Array: ...
    @property
    def _first(self) -> int: ...
    def __new__(
        cls,
        law: Law,
        observer: MomentumObserver,
        reaction: Literal["stop", "float", "retract"] | None = None,
        *,
        stiffness: ArrayLike | None = None,
        damping: ArrayLike | None = None,
        speed: float | None = None,
        duration: float | None = None,
        joint_stiffness: ArrayLike | None = None,
    ) -> Self: ...
    def touched(self, residual: ArrayLike) -> Any: ...  # the index of a joint, or an array of indices
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...

@final
class CartesianImpedance(Law):
    def __new__(
        cls,
        arm: Arm,
        target: ArrayLike | Motion,
        stiffness: ArrayLike,
        damping: ArrayLike,
        *,
        frame: str,
        axes: str | None = None,
        nullspace: NullSpace | None = None,
        feedforward: ArrayLike | None = None,
        compensate_coupling: bool = False,
        eps: float | None = None,
        integral_gain: ArrayLike | None = None,
        wrench_max: ArrayLike | None = None,
        tau_max: ArrayLike | None = None,
    ) -> Self: ...

@final
class ElasticImpedance(Law):
    def __new__(
        cls,
        arm: Arm,
        target: ArrayLike | Motion,
        stiffness: ArrayLike,
        damping: ArrayLike,
        joint_stiffness: ArrayLike,
        motor_inertia: ArrayLike,
        reduced_inertia: ArrayLike,
        *,
        frame: str,
        axes: str | None = None,
        motor_damping: ArrayLike | None = None,
        damping_ratio: float | None = None,
        relative_damping: bool = False,
        nullspace: NullSpace | None = None,
        feedforward: ArrayLike | None = None,
        compensate_coupling: bool = False,
        eps: float | None = None,
        integral_gain: ArrayLike | None = None,
        wrench_max: ArrayLike | None = None,
        tau_max: ArrayLike | None = None,
    ) -> Self: ...

@final
class ElasticTracking(Law):
    def __new__(
        cls,
        arm: Arm,
        target: Motion,
        stiffness: ArrayLike,
        damping: ArrayLike,
        joint_stiffness: ArrayLike,
        motor_inertia: ArrayLike,
        reduced_inertia: ArrayLike,
        *,
        frame: str,
        axes: str | None = None,
        motor_damping: ArrayLike | None = None,
        damping_ratio: float | None = None,
        relative_damping: bool = False,
    ) -> Self: ...

@final
class JointImpedance(Law):
    def __new__(
        cls,
        arm: Arm,
        target: ArrayLike,
        stiffness: ArrayLike,
        damping: ArrayLike,
        joint_stiffness: ArrayLike,
        motor_inertia: ArrayLike,
        reduced_inertia: ArrayLike,
        *,
        motor_damping: ArrayLike | None = None,
        damping_ratio: float | None = None,
        relative_damping: bool = False,
    ) -> Self: ...

@final
class JointTracking(Law):
    def __new__(
        cls, arm: Arm, motion: Motion, kp: ArrayLike, kd: ArrayLike, joint_stiffness: ArrayLike, motor_inertia: ArrayLike
    ) -> Self: ...

@final
class MotorPD(Law):
    def __new__(
        cls, arm: Arm, target: ArrayLike, kp: ArrayLike, kd: ArrayLike, joint_stiffness: ArrayLike, *, online: bool = False
    ) -> Self: ...

@final
class StateFeedback(Law):
    def __new__(
        cls, arm: Arm, target: ArrayLike, kp: ArrayLike, kd: ArrayLike, kt: ArrayLike, ks: ArrayLike, joint_stiffness: ArrayLike
    ) -> Self: ...

def _select_samples(
    law: Law,
    record: tuple[ArrayLike, ArrayLike, ArrayLike],
    a: ArrayLike | None,
    windows: tuple[ArrayLike | None, float | None, bool],
    count: int,
) -> dict[str, Any]: ...
