"""How a run ended. A status is data: a diverged run is a result with a time, not a misuse."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["Status"]


class Status(IntEnum):
    """The outcome of a run or a solve; `status.advice` says what can be done about it.

    The numbers are stable: arrays of statuses (one per row of a batch) hold them as integers.
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

    @property
    def advice(self) -> str:
        """What the caller can do about it, in one sentence."""
        return _ADVICE[self]


# The texts of rust/core/src/status.rs; a test compares the two.
_ADVICE = {
    Status.SUCCESS: "the run reached its end",
    Status.DIVERGED: "the state stopped being finite: reduce dt or the gains, or use an adaptive method",
    Status.STEP_UNDERFLOW: (
        "the step fell below the resolution of time: the problem is singular or stiff here; try a stiff method or looser tolerances"
    ),
    Status.MAX_STEPS: "the cap on steps was reached: the problem may be stiff; try a stiff method, looser tolerances or a shorter span",
    Status.INTERRUPTED: "the run was interrupted by the caller",
    Status.EVENT: "an event ended the run",
    Status.DEGRADED: "part of the command was given up: see the residuals",
    Status.INFEASIBLE: "no answer exists: see the reason",
    Status.STALLED: (
        "the steps collapsed and would never reach the end: where the input switches (a target out of reach, a bound) take a fixed step "
        "or a sample time; where the problem is stiff a stiff method"
    ),
}
