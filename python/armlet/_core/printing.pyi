"""Laws and functions of arms as C."""

from .arms import Arm
from .laws import Law

def _c_of_law(law: Law, prefix: str, fused: bool | None, dt: float | None, method: str) -> list[tuple[str, str]]: ...
def _c_of_arm(
    arm: Arm, functions: list[tuple[str, str, str | None]], prefix: str, fused: bool | None, friction: bool, armature: bool
) -> list[tuple[str, str]]: ...
