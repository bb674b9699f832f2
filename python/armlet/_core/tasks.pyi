"""Types of tasks of arms, of the laws for prioritised tasks, and of inverse kinematics."""

from collections.abc import Iterable, Sequence
from typing import Any, Self, final

from numpy.typing import ArrayLike
from typing_extensions import disjoint_base

from ..priority import PriorityDiagnosis
from ..status import Status
from ._types import _Array
from .arms import Arm
from .laws import Law
from .motions import Motion

@disjoint_base
class Task:
    def __new__(
        cls,
        frame: str,
        axes: str,
        target: Motion | ArrayLike | None = None,
        gain: ArrayLike | None = None,
        *,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
    ) -> Self: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...

@final
class PostureTask(Task):
    def __new__(
        cls,
        target: Motion | ArrayLike | None = None,
        gain: ArrayLike | None = None,
        *,
        joints: Iterable[str] | None = None,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
    ) -> Self: ...

@final
class CentreOfMassTask(Task):
    def __new__(
        cls,
        axes: str,
        target: Motion | ArrayLike | None = None,
        gain: ArrayLike | None = None,
        *,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
    ) -> Self: ...

@final
class AxisTask(Task):
    def __new__(
        cls,
        frame: str,
        axis: ArrayLike,
        target: Motion | ArrayLike | None = None,
        gain: ArrayLike | None = None,
        *,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
    ) -> Self: ...

@final
class RelativeTask(Task):
    def __new__(
        cls,
        frame: str,
        reference: str,
        axes: str,
        target: Motion | ArrayLike | None = None,
        gain: ArrayLike | None = None,
        *,
        motion: Motion | None = None,
        damping: ArrayLike | None = None,
    ) -> Self: ...

@final
class JointLimitTask(Task):
    def __new__(
        cls,
        gain: ArrayLike | None = None,
        margin: float | None = None,
        *,
        joints: Iterable[str] | None = None,
        damping: ArrayLike | None = None,
    ) -> Self: ...

@final
class PriorityVelocity(Law):
    def __new__(
        cls,
        arm: Arm,
        tasks: Iterable[Task],
        method: str = "clamp",
        eps: ArrayLike | None = None,
        *,
        v_min: ArrayLike | None = None,
        v_max: ArrayLike | None = None,
        q_min: ArrayLike | None = None,
        q_max: ArrayLike | None = None,
        a_max: ArrayLike | None = None,
        horizon: float | None = None,
        limits: bool | None = None,
    ) -> Self: ...

@final
class PriorityAcceleration(Law):
    def __new__(
        cls,
        arm: Arm,
        tasks: Iterable[Task],
        method: str = "clamp",
        eps: ArrayLike | None = None,
        *,
        joint_damping: float | None = None,
        a_max: ArrayLike | None = None,
        v_min: ArrayLike | None = None,
        v_max: ArrayLike | None = None,
        q_min: ArrayLike | None = None,
        q_max: ArrayLike | None = None,
        horizon: float | None = None,
        limits: bool | None = None,
    ) -> Self: ...

@final
class ArmPrioritySolver:
    @property
    def arm(self) -> Arm: ...
    @property
    def tasks(self) -> tuple[Task, ...]: ...
    def solve(self, q: ArrayLike, velocities: Sequence[ArrayLike], *, out: _Array | None = None) -> _Array: ...
    def diagnose(self, q: ArrayLike, velocities: Sequence[ArrayLike] | None = None) -> PriorityDiagnosis: ...
    def _diagnose(self, q: ArrayLike, velocities: Sequence[ArrayLike] | None = None) -> dict[str, Any]: ...
    def jacobians(self, q: ArrayLike) -> list[_Array]: ...
    def set_bounds(self, v_min: ArrayLike, v_max: ArrayLike) -> None: ...
    @property
    def n(self) -> int: ...
    @property
    def rows(self) -> tuple[int, ...]: ...
    @property
    def method(self) -> str: ...
    @property
    def residuals(self) -> list[_Array]: ...
    @property
    def ranks(self) -> list[int]: ...
    @property
    def status(self) -> Status: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

def _restore_arm_solver(arm: Arm, tasks: Iterable[Task], keywords: dict[str, Any]) -> ArmPrioritySolver: ...
def inverse_kinematics(
    arm: Arm,
    tasks: Iterable[Task],
    q0: ArrayLike,
    *,
    method: str | None = None,
    eps: ArrayLike | None = None,
    tolerance: float | None = None,
    max_iterations: int | None = None,
    restarts: int | None = None,
    seed: int | None = None,
    step_max: float | None = None,
    limits: bool = True,
    check_limits: bool | None = None,
    solutions: int | None = None,
    threads: int | None = None,
) -> InverseKinematics: ...

@final
class InverseKinematics:
    def __new__(cls, q: _Array, errors: list[_Array], reached: Any, iterations: Any, restarts: Any, status: Any) -> Self: ...
    @property
    def q(self) -> _Array: ...
    @property
    def errors(self) -> list[_Array]: ...
    # For one target, the next four properties are a list of flags, two integers and a Status. For a batch they are arrays.
    @property
    def reached(self) -> Any: ...
    @property
    def iterations(self) -> Any: ...
    @property
    def restarts(self) -> Any: ...
    @property
    def status(self) -> Any: ...
    def __bool__(self) -> bool: ...
    def __reduce__(self) -> tuple[Any, ...]: ...
