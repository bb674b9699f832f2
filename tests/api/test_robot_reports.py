"""Lines of `arm.report` about limits of a robot file and about elements of xacro, and the elements of xacro that are errors."""

from __future__ import annotations

import pytest

import armlet as al

LINK = '<link name="l1"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1"/></inertial></link>'
SPACE = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"'


def joint(inner: str = "", kind: str = "revolute") -> str:
    return f'<joint name="j1" type="{kind}"><parent link="base"/><child link="l1"/>{inner}</joint>\n'


def robot(body: str, link: str = LINK) -> str:
    return f'<robot name="r">\n<link name="base"/>\n{link}\n{body}</robot>'


def inside(element: str) -> str:
    """The link with another element."""
    return LINK.replace("</link>", f"{element}</link>")


REPORTED = {
    "zero limits": (robot(joint('<limit effort="0"/>')), "zero effort limit in the file, which allows no torque: j1"),
    "zero velocity": (robot(joint('<limit velocity="0.0"/>')), "zero velocity limit in the file, which allows no motion: j1"),
    "degrees": (
        robot(joint('<limit lower="-180" upper="180"/>')),
        "line 4: joint j1 has the position limits [-180, 180] rad, which is implausibly large: degrees?",
    ),
    "one end in degrees": (robot(joint('<limit lower="0" upper="90"/>')), "line 4: joint j1 has the position limits [0, 90] rad"),
    "millimetres": (
        robot(joint('<limit lower="0" upper="400"/>', "prismatic")),
        "line 4: joint j1 has the position limits [0, 400] m, which is implausibly large: millimetres?",
    ),
    "degrees per second": (robot(joint('<limit velocity="180"/>')), "line 4: joint j1 has the velocity limit 180 rad/s"),
    "xacro in a visual": (
        robot(joint(), inside("<visual><xacro:grey/><xacro:if/></visual>")),
        "dropped: xacro element grey of visual, not expanded (1, first in line 3)",
    ),
    "xacro in a link with its inertia": (
        robot(joint(), inside("<xacro:sensor/>")),
        "dropped: xacro element sensor of link, not expanded (1, first in line 3)",
    ),
    "unknown macro": (
        robot(joint() + '<xacro:sensor name="s"/><xacro:sensor/>').replace("<robot", SPACE),
        "dropped: xacro element sensor of robot, not expanded (2, first in line 5)",
    ),
    "xacro of a simulator": (robot(joint() + "<gazebo><xacro:plugin/></gazebo>"), "dropped: xacro element plugin of gazebo, not expanded"),
}


@pytest.mark.parametrize("name", REPORTED)
def test_unusual_elements_are_reported(name: str) -> None:
    text, said = REPORTED[name]
    arm = al.load_urdf(text)
    assert arm.joint_names == ("j1",) and any(line.startswith(said) for line in arm.report), arm.report


LIMITS = [("6.2831853", "revolute"), ("12.566371", "revolute"), ("1e16", "revolute"), ("9", "prismatic")]


@pytest.mark.parametrize(("limit", "kind"), LIMITS)
def test_plausible_limits_are_not_reported(limit: str, kind: str) -> None:
    element = f'<limit lower="-{limit}" upper="{limit}" effort="1" velocity="10"/>'
    assert al.load_urdf(robot(joint(element, kind))).report == ()


REFUSED = {
    "xacro in an inertial": (robot(joint(), LINK.replace("<mass", "<xacro:box/><mass")), 3, "xacro did not expand it: remove it"),
    "xacro in a link without inertia": (robot(joint(), '<link name="l1"><xacro:box/></link>'), 3, "xacro did not expand it: remove it"),
    "xacro in a joint": (robot(joint("<xacro:limits/>")), 4, "holds the xacro element limits; xacro did not expand it"),
    "directive in a joint": (robot(joint('<xacro:if value="1"/>')), 4, "xacro robot.xacro > robot.urdf"),
    "directive in a link": (robot(joint(), inside("<xacro:if/>")), 3, "xacro robot.xacro > robot.urdf"),
    "attribute": (robot(joint('<limit xacro:lower="1"/>')), 4, "holds the xacro attribute lower"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_elements_of_xacro_that_change_a_link_or_joint_are_errors(name: str) -> None:
    text, line, words = REFUSED[name]
    for given in (text, text.replace("<robot", SPACE)):
        if name == "attribute" and given is not text:
            continue  # a declared attribute of another namespace has no meaning in URDF
        with pytest.raises(al.ModelError, match=words) as caught:
            al.load_urdf(given)
        assert caught.value.line == line
