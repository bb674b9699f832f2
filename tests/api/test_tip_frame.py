"""`Arm.tip_frame` is the moving frame with the longest path from the base."""

from __future__ import annotations

import models
import pytest

import armlet as al


def robot(*joints: tuple[str, str, str, float]) -> str:
    """A URDF of joints (type, parent, child, length of the offset in m)."""
    links = dict.fromkeys(name for _, parent, child, _ in joints for name in (parent, child))
    text = "".join(f'<link name="{name}"/>' for name in links)
    for kind, parent, child, length in joints:
        limit = '<limit lower="-1" upper="1" effort="1" velocity="1"/>' if kind == "revolute" else ""
        ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{length} 0 0"/>{limit}'
        text += f'<joint name="{parent}_{child}" type="{kind}">{ends}</joint>'
    return f'<robot name="r">{text}</robot>'


ARM = (("revolute", "base", "upper", 0.1), ("revolute", "upper", "wrist", 0.4))


@pytest.mark.parametrize(
    ("more", "tip"),
    [
        ((), "wrist"),
        # A frame that is fixed to the base at the end of the file, farther from the base than all others, does not count.
        ((("fixed", "wrist", "tool", 0.1), ("fixed", "base", "table", 5.0)), "tool"),
        # A frame between the fingers is farther than the joints of the fingers.
        ((("fixed", "wrist", "grasp", 0.3), ("revolute", "wrist", "finger", 0.1)), "grasp"),
        # The longer of two branches counts, independent of the order in the file.
        ((("revolute", "wrist", "long", 0.6), ("revolute", "base", "short", 0.2)), "long"),
        ((("revolute", "base", "short", 0.2), ("revolute", "wrist", "long", 0.6)), "long"),
        # Of equally distant frames, the last one counts.
        ((("fixed", "wrist", "flange", 0.1), ("fixed", "wrist", "tool", 0.1)), "tool"),
    ],
)
def test_which_frame_is_the_tip(more: tuple[tuple[str, str, str, float], ...], tip: str) -> None:
    assert al.load_urdf(robot(*ARM, *more)).tip_frame == tip


def test_arms_of_every_kind() -> None:
    assert al.planar_arm([1.0, 0.5]).tip_frame == "link2"
    assert al.planar_arm([1.0, 0.5]).with_frame("tool", "link2", xyz=[0.2, 0.0, 0.0]).tip_frame == "tool"
    assert al.Arm.from_chain([{"type": "P", "axis": [0.0, 0.0, 1.0]}, {"type": "R", "axis": [0.0, 1.0, 0.0]}]).tip_frame == "link2"
    assert models.PR.tip_frame is None
    assert al.load_urdf(robot(("fixed", "base", "table", 1.0))).tip_frame is None
    # The last frame of the file is "macro_tip".
    tips = {"planar_2r": "tool", "macro_micro_4r": "tool", "six_axis": "flange", "seven_axis": "tcp", "two_arms": "right_hand"}
    assert {name: al.load_urdf(al.example_urdf(name)).tip_frame for name in tips} == tips
