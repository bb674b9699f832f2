"""Types of plants."""

from typing import Any, Self, final

from numpy.typing import ArrayLike
from typing_extensions import disjoint_base

from ..friction_models import LuGre, StickSlip
from ..run.events import JointStops
from .arms import Arm

@disjoint_base
class Plant:
    @property
    def arm(self) -> Arm: ...
    @property
    def _parts(self) -> tuple[str, ...]: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...

@final
class Wall:
    def __new__(cls, frame: str, point: ArrayLike, normal: ArrayLike, *, stiffness: float, damping: float | None = None) -> Self: ...
    def __getnewargs_ex__(self) -> tuple[tuple[str, list[float], list[float]], dict[str, Any]]: ...

@final
class RigidArm(Plant):
    def __new__(
        cls, arm: Arm, *, friction: bool | str | LuGre | StickSlip = False, wall: Wall | None = None, stops: JointStops | None = None
    ) -> Self: ...

@final
class VelocityArm(Plant):
    def __new__(cls, arm: Arm) -> Self: ...

@final
class ElasticArm(Plant):
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
