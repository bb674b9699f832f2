"""Types of desired motions and timed paths."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Self, final

from numpy.typing import ArrayLike
from typing_extensions import disjoint_base

from ._types import _Array, _Number
from .arms import Arm

@disjoint_base
class Motion:
    @property
    def n(self) -> int: ...
    def __call__(self, /, t: ArrayLike) -> tuple[_Array, _Array, _Array]: ...
    def derivatives(self, t: ArrayLike, order: int) -> _Array: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...
    def __eq__(self, other: object, /) -> bool: ...

@final
class Hold(Motion):
    def __new__(cls, q: ArrayLike) -> Self: ...

@disjoint_base
class Sinusoid(Motion):
    def __new__(cls, offset: ArrayLike, amplitude: ArrayLike, frequency: ArrayLike, phase: ArrayLike) -> Self: ...

@final
class Quintic(Motion):
    def __new__(cls, q0: ArrayLike, q1: ArrayLike, duration: float) -> Self: ...

@final
class BangBang(Motion):
    def __new__(cls, q0: ArrayLike, q1: ArrayLike, duration: float) -> Self: ...

@final
class Table(Motion):
    def __new__(cls, dt: float, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, start: float | None = None) -> Self: ...
    @staticmethod
    def at(t: ArrayLike, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None, *, spline: str | None = None) -> Spline: ...

@final
class Spline(Motion):
    def __new__(
        cls, t: ArrayLike, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None, *, spline: str | None = None
    ) -> Self: ...

def time_path(
    arm: Arm,
    path: ArrayLike | Callable[[float], Any],
    *,
    tau_max: ArrayLike | Callable[[float], ArrayLike] | None = None,
    v_max: ArrayLike | Callable[[float], ArrayLike] | None = None,
    a_max: ArrayLike | Callable[[float], ArrayLike] | None = None,
    knots: ArrayLike | None = None,
    spline: str | None = None,
    stops: Iterable[int] | None = None,
    start_speed: _Number | None = None,
    end_speed: _Number | None = None,
    friction: ArrayLike | None = None,
    grid: int | None = None,
    refine: bool = True,
    samples: int | None = None,
    torque_rate: ArrayLike | None = None,
    q_min: ArrayLike | None = None,
    q_max: ArrayLike | None = None,
    tip_speed: ArrayLike | Callable[[float], ArrayLike] | None = None,
    tip_acceleration: ArrayLike | Callable[[float], ArrayLike] | None = None,
    frame: str | None = None,
    check_limits: bool | None = None,
) -> TimedPath: ...
def _restore_time_path(parts: Sequence[_Array], margin: float, why: tuple[Any, ...] | None) -> TimedPath: ...
def _spline_slopes(s: ArrayLike, q: ArrayLike, spline: str) -> _Array: ...

@final
class TimedPath(Motion):
    def __call__(self, /, t: ArrayLike) -> tuple[_Array, _Array, _Array]: ...
    def path(self, s: ArrayLike) -> tuple[_Array, _Array, _Array]: ...
    @property
    def duration(self) -> float: ...
    @property
    def feasible(self) -> bool: ...
    @property
    def margin(self) -> float: ...
    @property
    def reason(self) -> str | None: ...
    @property
    def shortfall(self) -> dict[str, Any] | None: ...
    @property
    def s(self) -> _Array: ...
    @property
    def s_dot(self) -> _Array: ...
    @property
    def t(self) -> _Array: ...
