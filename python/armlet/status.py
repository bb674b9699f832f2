"""The status of a run. A diverged run is a valid result: it has records up to the time at which it ended."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Status", "having"]


class Status(IntEnum):
    """The outcome of a run or a solver. `status.advice` is advice for the caller.

    The numbers will not change. Arrays of statuses, with one entry per row of a batch, contain them as integers.
    """

    SUCCESS = 0
    DIVERGED = 1
    STEP_UNDERFLOW = 2
    MAX_STEPS = 3
    INTERRUPTED = 4
    EVENT = 5
    DEGRADED = 6
    INFEASIBLE = 7
    STALLED = 8
    EXCESS_ACCURACY = 9

    @property
    def advice(self) -> str:
        """Advice for the caller, as a text."""
        return _ADVICE[self]


# These texts equal the texts in rust/core/src/status.rs; a test compares them.
_ADVICE = {
    Status.SUCCESS: "the run reached its end",
    Status.DIVERGED: "the state stopped being finite or passed state_limit: reduce dt or the gains, or use an adaptive method",
    Status.STEP_UNDERFLOW: (
        "the step fell below the resolution of time. The problem is singular here, or its input switches. Try looser tolerances; for an "
        "input that switches, a fixed step or a sample time"
    ),
    Status.MAX_STEPS: "the cap on steps was reached: try looser tolerances or a shorter span",
    Status.INTERRUPTED: "the run was interrupted by the caller",
    Status.EVENT: "an event ended the run",
    Status.DEGRADED: "part of the command was given up: see the residuals",
    Status.INFEASIBLE: "no answer exists: see the reason",
    Status.STALLED: (
        "the steps became too small to reach the end. If the input switches (a target out of reach, a bound), take a fixed step or a "
        "sample time. Otherwise try looser tolerances"
    ),
    Status.EXCESS_ACCURACY: ("the tolerances are below the rounding error of the error estimate: take looser rtol and atol"),
}

# Statuses with which an explicit method may end on a stiff problem.
_MAY_BE_STIFF = {Status.STEP_UNDERFLOW, Status.MAX_STEPS, Status.STALLED}


def having(statuses: NDArray[Any], status: Status) -> NDArray[np.bool_]:
    """Whether each entry of an array of statuses equals `status`.

    The comparison uses a plain integer. If an array is compared with a member of an enumeration, numpy reads attributes of its class. Up to
    Python 3.11 this runs Python code, and numpy drops the exceptions of that code. So a Ctrl-C at that moment would be lost.
    """
    return np.asarray(statuses == int(status))


def advice_on_run(status: Status, method: str, rtol: object, atol: object, stats: Mapping[str, float]) -> str:
    """Return `status.advice`, extended by advice for the run's method and tolerances."""
    advice = status.advice
    if status in _MAY_BE_STIFF and method in ("dopri5", "dop853"):
        return f"{advice}; where the problem is stiff take radau5 or rodas4"
    coarsen = stats.get("coarsen")
    if coarsen is None:
        return advice
    if isinstance(rtol, (int, float)) and isinstance(atol, (int, float)):
        return f"{advice}: expected at least rtol = {_up(coarsen * rtol)} and atol = {_up(coarsen * atol)}, got {rtol:g} and {atol:g}"
    return f"{advice}: expected at least {_up(coarsen)} times these"


def _up(x: float) -> str:
    """Round a positive number up to one digit and return it as text."""
    digit, exponent = f"{x:.15e}".split("e")
    return f"{-(-float(digit) // 1):.0f}e{int(exponent)}" if x else "0"
