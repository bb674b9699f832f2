"""Types of task priority from matrices."""

from collections.abc import Iterable, Sequence
from typing import Any, Self, final

from numpy.typing import ArrayLike

from ..status import Status
from ._types import _Array
from .arms import Arm
from .tasks import ArmPrioritySolver, Task

def solve_priority(
    jacobians: Sequence[ArrayLike],
    velocities: Sequence[ArrayLike | Within],
    *,
    method: str = "clamp",
    eps: ArrayLike | None = None,
    rounding: float | None = None,
    weight: ArrayLike | None = None,
    v_min: ArrayLike | None = None,
    v_max: ArrayLike | None = None,
) -> PrioritySolution: ...
def _priority_reasons(levels: Sequence[Any], v: _Array, k: int) -> tuple[_Array, list[tuple[int, int, int, float]]]: ...
def diagnose_priority(
    jacobians: Sequence[ArrayLike], rhs: Sequence[ArrayLike | Within] | None, rounding: float | None
) -> dict[str, Any]: ...
def velocity_bounds(
    q: ArrayLike, q_min: ArrayLike, q_max: ArrayLike, v_max: ArrayLike, *, dt: float, a_max: ArrayLike | None = None
) -> tuple[_Array, _Array]: ...

@final
class Within:
    def __new__(cls, lower: ArrayLike, upper: ArrayLike) -> Self: ...
    @property
    def lower(self) -> _Array: ...
    @property
    def upper(self) -> _Array: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class PrioritySolution:
    def __new__(
        cls, v: _Array, residuals: list[_Array], ranks: Any, scales: _Array, status: Any, details: dict[str, Any] | None = None
    ) -> Self: ...
    @property
    def v(self) -> _Array: ...
    @property
    def residuals(self) -> list[_Array]: ...
    @property
    def ranks(self) -> Any: ...  # list[int] for one stack; an array of integers (..., levels) for a batch
    @property
    def scales(self) -> _Array: ...
    @property
    def status(self) -> Any: ...  # Status for one stack; an array of integers (...) for a batch
    @property
    def violations(self) -> list[_Array]: ...
    @property
    def active(self) -> Any: ...  # list[list[Active]] for one stack; a function of the index of a row for a batch
    @property
    def limits(self) -> Any: ...  # list[Active] for one stack; a function of the index of a row for a batch
    @property
    def changes(self) -> Any: ...  # int for one stack; an array of integers (...) for a batch
    @property
    def certificate(self) -> Any: ...  # float for one stack; an array (...) for a batch
    def why(self, k: int) -> str: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class PrioritySolver:
    def __new__(
        cls,
        n: int,
        rows: Sequence[int],
        *,
        method: str = "clamp",
        eps: ArrayLike | None = None,
        rounding: float | None = None,
        weight: ArrayLike | None = None,
        v_min: ArrayLike | None = None,
        v_max: ArrayLike | None = None,
    ) -> Self: ...
    @staticmethod
    def for_arm(
        arm: Arm,
        tasks: Iterable[Task],
        *,
        method: str = "clamp",
        eps: ArrayLike | None = None,
        weight: ArrayLike | None = None,
        v_min: ArrayLike | None = None,
        v_max: ArrayLike | None = None,
    ) -> ArmPrioritySolver: ...
    def solve(self, jacobians: Sequence[ArrayLike], velocities: Sequence[ArrayLike | Within], *, out: _Array | None = None) -> _Array: ...
    def set_rounding(self, rounding: float) -> None: ...
    def set_bounds(self, v_min: ArrayLike, v_max: ArrayLike) -> None: ...
    @property
    def n(self) -> int: ...
    @property
    def rows(self) -> tuple[int, ...]: ...
    @property
    def method(self) -> str: ...
    @property
    def solution(self) -> PrioritySolution: ...
    @property
    def residuals(self) -> list[_Array]: ...
    @property
    def ranks(self) -> list[int]: ...
    @property
    def scales(self) -> _Array: ...
    @property
    def status(self) -> Status: ...
    def __getnewargs_ex__(self) -> tuple[tuple[int, list[int]], dict[str, Any]]: ...
