"""The page `docs/my_robot.md` with public arms of different makers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import robots
from test_my_robot import follow

import armlet as al

#: File in the package, and the chain of one arm, if the robot has more joints.
ARMS = {
    "Universal Robots UR5": ("ur_description/urdf/ur5_robot.urdf", ""),
    "Universal Robots UR10": ("ur_description/urdf/ur10_robot.urdf", ""),
    "Franka Panda": ("panda_description/urdf/panda.urdf", ""),
    "Kinova j2s6s200": ("kinova_description/robots/kinova.urdf", ""),
    "UFactory xArm 7": ("xarm_description/urdf/xarm7.urdf", ""),
    "Unitree Z1": ("z1_description/urdf/z1.urdf", ""),
    "SO-101": ("so_arm_description/urdf/so101.urdf", ""),
    "IHMC Alex": ("alex_description/urdf/alex_nub_hands.urdf", ', root="Torso", tip="LeftGripperYawLink"'),
    "Aldebaran Romeo": ("romeo_description/urdf/romeo.urdf", ', root="torso", tip="l_wrist"'),
    "PAL Tiago": ("tiago_description/robots/tiago.urdf", ', root="torso_lift_link", tip="arm_tool_link"'),
}


@pytest.mark.parametrize("name", ARMS)
def test_the_page_holds_for_a_public_arm(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    file, chain = ARMS[name]
    follow((robots.folder() / file).read_text(), tmp_path, monkeypatch, capsys, chain)


@pytest.mark.parametrize(
    ("file", "chain", "advice"),
    [
        # The effort limits of these files cannot hold the outstretched arm. The springs of the second robot are not in its file.
        (
            "baxter_description/urdf/baxter.urdf",
            ', root="torso", tip="left_wrist"',
            r"simulate: law\.motion has no timing: .* tau_min of joint 1 \(left_s1\)",
        ),
        (
            "pr2_description/urdf/pr2.urdf",
            ', root="torso_lift_link", tip="r_wrist_roll_link"',
            "exciting_motion: limits leave joint r_shoulder_lift_joint no torque .* expected an effort above 36.5, to hold the arm",
        ),
    ],
)
def test_a_motor_that_is_too_weak_is_named(
    file: str, chain: str, advice: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    with pytest.raises(al.InputError, match=advice):
        follow((robots.folder() / file).read_text(), tmp_path, monkeypatch, capsys, chain)
