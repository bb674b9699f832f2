"""Paths of the robots in the package example-robot-data, and the robots that the tests use."""

from __future__ import annotations

import sys
from pathlib import Path

# Several kinds of robots: Baxter and Tiago have two arms, ANYmal four legs on a fixed base. PR2 and Talos are large with many branches.
ROBOTS = {
    "panda": "panda_description/urdf/panda.urdf",
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "kinova": "kinova_description/robots/kinova.urdf",
    "xarm7": "xarm_description/urdf/xarm7.urdf",
    "z1": "z1_description/urdf/z1.urdf",
    "baxter": "baxter_description/urdf/baxter.urdf",
    "tiago_dual": "tiago_description/robots/tiago_dual.urdf",
    "anymal": "anymal_b_simple_description/robots/anymal.urdf",
    "solo12": "solo_description/robots/solo12.urdf",
    "pr2": "pr2_description/urdf/pr2.urdf",
    "talos": "talos_data/robots/talos_reduced.urdf",
}


def folder() -> Path:
    """Return the folder `robots` of the installed package."""
    for place in sys.path:
        robots = Path(place) / "cmeel.prefix" / "share" / "example-robot-data" / "robots"
        if robots.is_dir():
            return robots
    raise FileNotFoundError("example-robot-data is not installed: make test-peers installs it")


def path(name: str) -> Path:
    return folder() / ROBOTS[name]
