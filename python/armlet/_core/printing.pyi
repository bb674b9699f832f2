"""Types of the functions that write laws, observers and functions of arms as C code."""

from numpy.typing import ArrayLike

from .arms import Arm
from .laws import Law
from .simulation import MomentumObserver

def _c_of_law(
    law: Law, prefix: str, fused: bool | None, dt: float | None, method: str, sample_time: float | None, tau_max: ArrayLike | None
) -> list[tuple[str, str]]: ...
def _c_of_observer(observer: MomentumObserver, prefix: str, fused: bool | None) -> list[tuple[str, str]]: ...
def _c_of_arm(
    arm: Arm, functions: list[tuple[str, str, str | None]], prefix: str, fused: bool | None, friction: bool, armature: bool
) -> list[tuple[str, str]]: ...
