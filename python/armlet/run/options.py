"""The options of runs. They are built once from the keyword arguments of a function, and the core reads them by name.

`simulate` and `simulate_batch` document the options. A missing option and None mean the default. The functions of the core require
`t_end`, `method`, `record_every` and `monitors`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypedDict

from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from .events import Event
    from .sampling import Sampling

__all__ = [
    "BatchForce",
    "BatchOptions",
    "Force",
    "LoopOptions",
    "PieceOptions",
    "ProgramOptions",
    "RunOptions",
    "Starts",
    "Steps",
    "starts",
]

#: A piecewise constant force: pairs `(t_start, F)`.
Steps: TypeAlias = Sequence[tuple[float, ArrayLike]]
Force: TypeAlias = ArrayLike | Steps | Callable[[float], ArrayLike] | None
BatchForce: TypeAlias = ArrayLike | Steps | Sequence[Steps] | None


class Starts(TypedDict, total=False):
    """The initial velocities, and the initial positions and velocities of the motors."""

    v0: ArrayLike | None
    theta0: ArrayLike | None
    theta_dot0: ArrayLike | None


class LoopOptions(Starts, total=False):
    """The options of all runs, without their forces."""

    t_end: float
    dt: float | None
    method: str
    rtol: float | None
    atol: float | None
    max_step: float | None
    sample_time: float | Sampling | None
    record_every: int
    t_eval: ArrayLike | None
    force_frame: str | None
    tau_max: ArrayLike | None
    monitors: bool
    state_limit: float
    check_limits: bool | None


class RunOptions(LoopOptions, total=False):
    """The options of `simulate`."""

    force: Force
    events: Event | Callable[..., float] | Sequence[Event | Callable[..., float]] | None
    dense: bool


class ProgramOptions(LoopOptions, total=False):
    """The options of `loop_program`."""

    force: Force
    batch: bool
    part: str | None


class BatchOptions(LoopOptions, total=False):
    """The options of `simulate_batch`."""

    force: BatchForce
    threads: int | None
    keep: Literal["all", "final", "metrics"]
    metrics: Mapping[str, Any]


class PieceOptions(BatchOptions, total=False):
    """The options of a piece of a batch.

    `check_sampling` is False if the piece does not check its sample time. `check_monitors` is True if all runs of the piece must have the
    same monitors.
    """

    check_sampling: bool
    check_monitors: bool


def starts(options: LoopOptions) -> dict[str, ArrayLike | None]:
    """Return the starts in the options by name; None where the loop has its default."""
    return {"v0": options.get("v0"), "theta0": options.get("theta0"), "theta_dot0": options.get("theta_dot0")}
