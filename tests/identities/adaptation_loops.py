"""An arm with friction and rotors, a motion and an initial state, for identities of adaptation."""

from __future__ import annotations

from typing import Any

import armlet as al

TIGHT: dict[str, Any] = {"method": "dop853", "rtol": 1e-11, "atol": 1e-12}
#: A joint reverses so quickly that its Coulomb friction does not hold it. Integration steps cannot resolve a joint that sticks.
MOTION = al.Sinusoid([0.1, 0.2], [0.5, 0.6], [3.0, 4.0], [0.0, 0.0])
START: dict[str, Any] = {"q0": [0.3, -0.2], "v0": [1.5, 2.4]}


def robot(damping: float = 0.6, friction: float = 0.0, armature: float = 0.2) -> al.Arm:
    """An arm with two perpendicular joints under gravity."""
    drives = {"damping": damping, "friction": friction, "armature": armature}
    bodies = [[2, 0.4, 0, 0, 0.02, 0, 0.12, 0, 0, 0.12], [1, 0.2, 0, 0, 0.02, 0, 0.06, 0, 0, 0.06]]
    axes, places = [[0, 0, 1], [0, 1, 0]], [[0, 0, 0], [0.4, 0, 0]]
    rows = zip(axes, places, bodies, strict=True)
    return al.Arm.from_chain([{"type": "R", "axis": axis, "xyz": xyz, "phi": phi} | drives for axis, xyz, phi in rows])
