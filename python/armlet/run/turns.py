"""Checks of the motion and the target of a law. A motion needs a timing, and continuous joints start within half a turn of the target."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import _core
from ..callers import level_of_caller
from ..errors import InputError

__all__ = ["require_timing", "warn_of_turns"]


def require_timing(caller: str, law: Any) -> None:
    """Refuse a law whose motion is a `TimedPath` without a timing. Its positions are not numbers."""
    motion = getattr(law, "motion", None)
    if isinstance(motion, _core.TimedPath) and not motion.feasible:
        raise InputError(f"{caller}: law.motion has no timing: {motion.reason}; higher limits or another path of time_path give one")


def warn_of_turns(caller: str, plant: Any, law: Any, q0: ArrayLike) -> None:
    """Warn of continuous joints that are more than half a turn from the target, or from the start of the motion, of `law`.

    A law does not wrap angles, so such a joint turns through the larger angle. A batch has one warning, for the first row.
    """
    arm, motion = getattr(plant, "arm", None), getattr(law, "_joint_motion", None)
    target = getattr(law, "_joint_target", None) if motion is None else motion(0.0)[0]
    if arm is None or target is None or "continuous" not in arm.joint_types:
        return
    q = _core.numbers(caller, "q0", q0)
    far = np.abs(target - q) > np.pi * (1.0 + 1e-9)
    far &= arm.nearest(target, q) != target
    far &= np.array([kind == "continuous" for kind in arm.joint_types])
    if not far.any():
        return
    *row, joint = np.argwhere(far)[0]
    angle, place = float(np.abs(target - q)[(*row, joint)]), f" in row {row[0]}" if row else ""
    warnings.warn(
        f"{caller}: the continuous joint {arm.joint_names[joint]!r} starts {angle:.3g} rad from its target{place}. Angles are not wrapped. "
        "The target arm.nearest(target, q0) is the same pose within half a turn.",
        stacklevel=level_of_caller(),
    )
