"""The table `[motion.path]`: a path as poses, with the arguments of `cartesian_path`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .. import _core
from ..cartesian import cartesian_path
from ..errors import InputError
from .fields import Flag, Numbers, Table, Text

__all__ = ["POSES", "timed_path"]

POSES = Table(
    {
        "poses": Numbers(depth=2, scalar=False),
        "q0": Numbers(depth=1, scalar=False),
        "frame": Text(),
        "tolerance": Numbers(depth=1, low=0.0, strict=True),
        "axes": Text(),
        "kind": Text(("lines", "spline")),
        "blend": Numbers(low=0.0),
        "arcs": Numbers(1, False, 0.0),
        "limits": Flag(),
    },
    ("poses", "q0", "frame"),
)


def timed_path(arm: _core.Arm, path: Any, stops: list[int] | None = None, **limits: Any) -> _core.TimedPath:
    """Compute the timing of waypoints, or of a table of poses. `stops` are indices of the waypoints or of the poses."""
    if not isinstance(path, Mapping):
        return _core.time_path(arm, path, stops=stops, **limits)
    found = cartesian_path(arm, **path)
    if not found.feasible:
        raise InputError(f"cartesian_path: poses is not feasible: {found.reason}")
    for i, stop in enumerate(stops or []):
        if not (stop < len(found.corners) and stop == int(stop)):
            expected = f"indices of poses below {len(found.corners)}"
            raise InputError(f"time_path: stops is out of range: expected {expected}, got {stop:g} (first bad index {i})")
    return _core.time_path(arm, found, stops=[found.corners[int(stop)] for stop in stops or []], **limits)
