"""The page `docs/my_robot.md` with public arms of different makers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import robots
from test_my_robot import follow

#: File in the package, and the chain of one arm, if the robot has more joints.
ARMS = {
    "Universal Robots UR5": ("ur_description/urdf/ur5_robot.urdf", ""),
    "Universal Robots UR10": ("ur_description/urdf/ur10_robot.urdf", ""),
    "Franka Panda": ("panda_description/urdf/panda.urdf", ""),
    "Kinova j2s6s200": ("kinova_description/robots/kinova.urdf", ""),
    "UFactory xArm 7": ("xarm_description/urdf/xarm7.urdf", ""),
    "Unitree Z1": ("z1_description/urdf/z1.urdf", ""),
    "SO-101": ("so_arm_description/urdf/so101.urdf", ""),
    "PAL Tiago": ("tiago_description/robots/tiago.urdf", ', root="torso_lift_link", tip="arm_tool_link"'),
}


@pytest.mark.parametrize("name", ARMS)
def test_the_page_holds_for_a_public_arm(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    file, chain = ARMS[name]
    follow((robots.folder() / file).read_text(), tmp_path, monkeypatch, capsys, chain)
