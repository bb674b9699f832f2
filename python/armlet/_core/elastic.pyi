"""Types of the analysis of elastic joints: equilibria, stability limits and damping."""

from typing import Any

from numpy.typing import ArrayLike

from ._types import _Array
from .laws import Law
from .plants import Plant

def equilibrium(plant: Plant, law: Law, force: ArrayLike | None, q0: ArrayLike, force_frame: str | None) -> dict[str, Any]: ...
def elastic_limits(
    plant: Plant,
    law: Law,
    force: ArrayLike | None,
    q0: ArrayLike,
    force_frame: str | None,
    sample_time: float | None,
    sensor_bandwidth: float | None,
) -> dict[str, Any]: ...
def smallest_reduced_inertia(
    motor_inertia: ArrayLike,
    joint_stiffness: ArrayLike,
    sample_time: ArrayLike,
    *,
    damping_ratio: ArrayLike | None = None,
    sensor_bandwidth: ArrayLike | None = None,
) -> _Array: ...
def stiffness_limit(
    mass: ArrayLike,
    joint_stiffness: ArrayLike,
    reduced_inertia: ArrayLike,
    damping: ArrayLike,
    *,
    motor_damping: ArrayLike | None = None,
) -> _Array: ...
def damping_from_ratio(inertia: ArrayLike, stiffness: ArrayLike, ratio: float) -> _Array: ...
