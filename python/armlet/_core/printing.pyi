"""Types of the functions that write laws, observers and functions of arms as C code, and loops as WebAssembly."""

from collections.abc import Sequence
from typing import Any

from numpy.typing import ArrayLike

from ..run.options import LoopOptions
from .arms import Arm
from .laws import Law
from .plants import Plant
from .simulation import MomentumObserver

def _c_of_law(
    law: Law, prefix: str, fused: bool | None, dt: float | None, method: str, sample_time: float | None, tau_max: ArrayLike | None
) -> list[tuple[str, str]]: ...
def _c_of_observer(observer: MomentumObserver, prefix: str, fused: bool | None) -> list[tuple[str, str]]: ...
def _c_of_arm(
    arm: Arm, functions: list[tuple[str, str, str | None]], prefix: str, fused: bool | None, friction: bool, armature: bool
) -> list[tuple[str, str]]: ...
def _web_loop(
    plant: Plant | Sequence[Plant],
    law: Law | Sequence[Law],
    q0: ArrayLike,
    positions: list[int],
    frames: list[int],
    options: LoopOptions,
) -> dict[str, Any]: ...
def _wasm_of_operations(operations: list[tuple[str, list[int]]], outputs: list[tuple[int, int]], reach: int) -> bytes: ...
