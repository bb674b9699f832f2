"""The bounds that hold the levels of a priority law during a run, from the law's terms at the records.

A bound holds a level if it has at least 0.5 % of the force that stops the level (`PrioritySolution.why`). Records between two samples have
the bounds of the sample before them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..pickling import sealed

__all__ = ["LimitHold", "limit_holds"]


@sealed
class LimitHold(NamedTuple):
    """A bound that holds a level of a priority law during a part of a run.

    Attributes:
        name: the row, such as "joint 1", "torque of joint 1", or "row 1 of level 2" of a task with bounds.
        side: "lower" or "upper".
        level: the level that it holds, from 1; 0 if a torque limit contradicts another limit.
        start: time of the first record at which the bound holds the level, s.
        end: time of the first record after it, or of the last record, s.

    >>> import armlet as al
    >>> arm = al.planar_arm([1.0, 1.0])
    >>> law = al.PriorityVelocity(arm, [al.PostureTask([1.0, 0.0], 2.0)], v_max=0.5)
    >>> run = al.simulate(al.VelocityArm(arm), law, [0.0, 0.0], t_end=3.0, dt=0.01)
    >>> [(hold.name, hold.side, hold.level, round(hold.start, 2), round(hold.end, 2)) for hold in run.active]
    [('joint 1', 'upper', 1, 0.0, 1.5)]
    """

    name: str
    side: str
    level: int
    start: float
    end: float


def limit_holds(law: Any, period: float | None, t: NDArray[np.float64], q: Any, v: Any) -> list[LimitHold] | None:
    """The bounds that hold a level, in the order of their first records. None for a law without levels.

    Args:
        law: the law of the run.
        period: sample period, s; None for a continuous loop.
        t: times of the records, (K,), s.
        q, v: joint positions and velocities, (K, n).
    """
    if not isinstance(law, (_core.PriorityVelocity, _core.PriorityAcceleration)):
        return None
    holds, begun = [], dict[tuple[str, str, int], float]()
    present: list[tuple[str, str, int]] = []
    for time, at, speed in zip(t, q, v, strict=True):
        # Rounding of a time is much smaller than this fraction of a period.
        if period is None or abs(time / period - round(time / period)) < 1e-6:
            terms = law.terms(time, at, speed, sample_time=period)
            present = [(name, side, level) for name, side, level, _ in terms.get("holds", [])]
        for key in [key for key in begun if key not in present]:
            holds.append(LimitHold(*key, begun.pop(key), float(time)))
        for key in present:
            begun.setdefault(key, float(time))
    holds += [LimitHold(*key, start, float(t[-1])) for key, start in begun.items()]
    return sorted(holds, key=lambda hold: (hold.start, hold.level, hold.name))
