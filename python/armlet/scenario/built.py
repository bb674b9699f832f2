"""The objects of a scenario: a plant, a law, and the arguments of the run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from .. import _core

__all__ = ["Built", "summary"]


class Built(NamedTuple):
    """The objects of a scenario: `al.simulate(built.plant, built.law, **built.arguments)`.

    Attributes:
        plant: the plant.
        law: the law.
        arguments: keyword arguments of `simulate`, including `q0`.
    """

    plant: _core.Plant
    law: _core.Law
    arguments: dict[str, Any]


def summary(built: Built, data: Mapping[str, Any]) -> str:
    """A text with law, plant and duration, the names of the joints, and the parts of the robot file that the loop ignores."""
    arm, run = built.plant.arm, data["run"]
    length = f"{run['t_end']:g} s by {run.get('method', 'rk4')}"
    first = f"{type(built.law).__name__} on {type(built.plant).__name__}, {arm.n} joints, {length}"
    units = ["m" if kind == "prismatic" else "rad" for kind in arm.joint_types]
    lines = [first, "joints: " + ", ".join(f"{name} ({unit})" for name, unit in zip(arm.joint_names, units, strict=True))]
    lines += arm.report
    if type(built.plant).__name__ == "RigidArm" and not data.get("plant", {}).get("friction", False) and _has_friction(arm):
        lines.append("left out: the friction of the robot's file (friction = true in [plant] adds it)")
    return "\n".join(lines)


def _has_friction(arm: Any) -> bool:
    """Whether a joint of the arm has friction."""
    if not arm.frame_names:
        return False  # closed-form arms have no friction
    q, v, a = np.zeros(arm.n), np.ones(arm.n), np.zeros(arm.n)
    return bool(np.any(arm.inverse_dynamics(q, v, a, friction=True) != arm.inverse_dynamics(q, v, a)))
