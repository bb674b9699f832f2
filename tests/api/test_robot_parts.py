"""`root` and `tip`: the direction of gravity in a part of a robot, and faults outside of this part."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import armlet as al

G = 9.81
BODY = '<inertial><origin xyz="0 0 {c}"/><mass value="{m}"/><inertia ixx="0.02" iyy="0.02" izz="0.01"/></inertial>'


def link(name: str, mass: float = 0.0, centre: float = 0.0) -> str:
    return f'<link name="{name}">{BODY.format(m=mass, c=centre) if mass else ""}</link>\n'


def joint(name: str, kind: str, parent: str, child: str, more: str = "") -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{more}</joint>\n'


def mounted(tilt: float, between: str = "") -> str:
    """An arm of two links on a mount that is tilted about x, between a lifting torso and a second arm."""
    return f"""<robot name="two">
{link("torso")}{link("lift", 5.0)}{link("mount")}{link("upper", 2.0, 0.2)}{link("fore", 1.0, 0.15)}{link("other", 3.0, 0.1)}
{between or joint("lifting", "prismatic", "torso", "lift", '<axis xyz="0 0 1"/>')}
{joint("mounting", "fixed", "lift", "mount", f'<origin xyz="0 0.2 0.5" rpy="{tilt} 0 0"/>')}
{joint("shoulder", "revolute", "mount", "upper", '<axis xyz="1 0 0"/>')}
{joint("elbow", "revolute", "upper", "fore", '<origin xyz="0 0 0.4"/><axis xyz="1 0 0"/>')}
{joint("free", "revolute", "lift", "other", '<axis xyz="1 0 0"/>')}</robot>"""


def torques(tilt: float, q: Any) -> list[float]:
    """The gravity torques of the two links, whose centres of mass are at the heights `r cos(angle from the vertical)`."""
    first, second = tilt + q[0], tilt + q[0] + q[1]
    last = -G * 1.0 * 0.15 * np.sin(second)
    return [-G * (2.0 * 0.2 + 1.0 * 0.4) * np.sin(first) + last, last]


SRDF = """<robot name="two"><group name="chain"><chain base_link="mount" tip_link="fore"/></group>
<group name="joints"><joint name="shoulder"/><joint name="elbow"/></group></robot>"""
Q = np.array([0.3, 0.5])


class TestGravity:
    @pytest.mark.parametrize("tilt", [-np.pi / 4, 0.0, 1.1, np.pi / 2])
    @pytest.mark.parametrize("tip", [None, "fore"])
    def test_a_tilted_mount_tilts_gravity(self, tilt: float, tip: str | None) -> None:
        arm = al.load_urdf(mounted(tilt), root="mount", tip=tip)
        # The tolerance is rounding of numbers of order 10.
        np.testing.assert_allclose(arm.gravity(Q), torques(tilt, Q), rtol=0.0, atol=1e-14)
        assert any("gravity in the axes of mount" in line and "joints between at zero: lifting" in line for line in arm.report)
        assert any("links that mount does not carry" in line and "torso, lift, other" in line for line in arm.report)

    @pytest.mark.parametrize("group", ["chain", "joints"])
    def test_groups_of_an_srdf(self, group: str) -> None:
        arm = al.load_srdf(SRDF).arm(mounted(-0.7), group)
        np.testing.assert_allclose(arm.gravity(Q), torques(-0.7, Q), rtol=0.0, atol=1e-14)

    def test_gravity_that_is_given_is_in_the_axes_of_the_root(self) -> None:
        arm = al.load_urdf(mounted(-0.7), root="mount", gravity=[0.0, 0.0, -G])
        np.testing.assert_allclose(arm.gravity(Q), torques(0.0, Q), rtol=0.0, atol=1e-14)
        assert arm.gravity_vector.tolist() == [0.0, 0.0, -G] and any("m/s^2, as given" in line for line in arm.report)
        whole = al.load_urdf(mounted(-0.7))
        assert whole.gravity_vector.tolist() == [0.0, 0.0, -G] and not any("gravity" in line for line in whole.report)

    def test_moving_joints_above_the_root_are_at_zero(self) -> None:
        turning = joint("lifting", "revolute", "torso", "lift", '<origin rpy="0.2 0 0"/><axis xyz="1 0 0"/>')
        arm = al.load_urdf(mounted(0.3, turning), root="mount")
        np.testing.assert_allclose(arm.gravity(Q), torques(0.5, Q), rtol=0.0, atol=1e-14)
        # A locked joint changes the whole robot, so its position counts there.
        locked = al.load_urdf(mounted(0.3, turning)).locked({"lifting": 0.4, "free": 0.0})
        np.testing.assert_allclose(locked.gravity(Q), torques(0.9, Q), rtol=0.0, atol=1e-14)

    def test_a_follower_above_the_root_is_at_its_offset(self) -> None:
        follower = joint("lifting", "revolute", "torso", "lift", '<axis xyz="1 0 0"/><mimic joint="free" multiplier="2" offset="0.25"/>')
        arm = al.load_urdf(mounted(0.3, follower), root="mount")
        np.testing.assert_allclose(arm.gravity(Q), torques(0.55, Q), rtol=0.0, atol=1e-14)
        arm = al.load_urdf(mounted(0.3, follower), root="mount", mimic="independent")
        np.testing.assert_allclose(arm.gravity(Q), torques(0.3, Q), rtol=0.0, atol=1e-14)

    def test_scenarios(self) -> None:
        law = {"kind": "PDGravity", "target": [0.1, 0.2], "kp": 10.0, "kd": 5.0}
        table = {"kind": "urdf", "xml": mounted(-0.7), "root": "mount"}
        built = al.Scenario({"arm": table, "law": law, "run": {"q0": [0.0, 0.0], "t_end": 0.1, "dt": 0.01}}).build()
        np.testing.assert_allclose(built.plant.arm.gravity(Q), torques(-0.7, Q), rtol=0.0, atol=1e-14)


HINGE = joint("hinge", "continuous", "cart", "pole", '<axis xyz="1 0 0"/>')
GOOD = link("base") + link("cart", 1.0) + link("pole", 1.22, 0.46) + HINGE
SLIDE = joint("slide", "prismatic", "base", "cart")
BAD_BODY = '<link name="wheel"><inertial><mass value="-1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
OUTSIDE = {
    "planar": GOOD + joint("slide", "planar", "base", "cart"),
    "floating": GOOD + joint("slide", "floating", "base", "cart"),
    "screw": GOOD + joint("slide", "screw", "base", "cart"),
    "ball": GOOD + joint("slide", "ball", "base", "cart"),
    "no type": GOOD + SLIDE.replace('type="prismatic"', ""),
    "axis zero": GOOD + joint("slide", "prismatic", "base", "cart", '<axis xyz="0 0 0"/>'),
    "limit": GOOD + joint("slide", "prismatic", "base", "cart", '<limit lower="a"/>'),
    "origin": GOOD + joint("slide", "prismatic", "base", "cart", '<origin xyz="0 nan 0"/>'),
    "negative mass": GOOD + SLIDE + BAD_BODY + joint("rolling", "continuous", "base", "wheel"),
    "second root": GOOD + SLIDE + link("camera"),
    "no root": GOOD + SLIDE + joint("back", "continuous", "cart", "base"),
    "missing leader": GOOD + SLIDE + link("wheel") + joint("rolling", "continuous", "base", "wheel", '<mimic joint="none"/>'),
    "own leader": GOOD + SLIDE + link("wheel") + joint("rolling", "continuous", "base", "wheel", '<mimic joint="rolling"/>'),
    "slide follows itself": GOOD + joint("slide", "prismatic", "base", "cart", '<mimic joint="slide"/>'),
    "duplicate links": GOOD + SLIDE + link("wheel") + link("wheel") + joint("rolling", "continuous", "base", "wheel"),
    "duplicate joints": GOOD + SLIDE + link("wheel") + link("w") + joint("r", "fixed", "base", "wheel") + joint("r", "fixed", "base", "w"),
    "two parents": GOOD + SLIDE + link("wheel") + joint("r", "fixed", "base", "wheel") + joint("s", "continuous", "cart", "wheel"),
    "two joints to the root": GOOD + SLIDE + link("wheel") + joint("r", "fixed", "base", "wheel") + joint("s", "fixed", "wheel", "cart"),
    "no link": GOOD + SLIDE + joint("rolling", "continuous", "base", "wheel"),
    "no child": GOOD + SLIDE + '<joint name="rolling" type="continuous"><parent link="base"/></joint>',
    "no name": GOOD + SLIDE + '<link><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>',
    "cycle": GOOD + SLIDE + link("a") + link("b") + joint("r", "fixed", "a", "b") + joint("s", "fixed", "b", "a"),
    "xacro": GOOD + SLIDE + '<link name="wheel"><xacro:if value="1"/></link>' + joint("rolling", "continuous", "base", "wheel"),
}


@pytest.mark.parametrize("name", OUTSIDE)
def test_faults_outside_of_a_chain_are_reported(name: str) -> None:
    text = f'<robot name="r">\n{OUTSIDE[name]}</robot>'
    with pytest.raises(al.ModelError):
        al.load_urdf(text)
    # Without a tip, the second joint of these two robots is a part of the arm.
    joined = name in ("no root", "two parents")
    for given in [{"root": "cart", "tip": "pole"}] + [{"root": "cart"}] * (not joined):
        arm = al.load_urdf(text, **given)
        assert arm.joint_names == ("hinge",)
        # A pendulum about x with its centre of mass at 0.46 m. The tolerance is rounding.
        np.testing.assert_allclose(arm.mass_matrix([0.7]), [[0.02 + 1.22 * 0.46**2]], rtol=1e-14)
        np.testing.assert_allclose(arm.gravity([0.7]), [-1.22 * G * 0.46 * np.sin(0.7)], rtol=1e-14)
        if name == "origin":
            assert any("origin of joint slide above cart cannot be read" in line for line in arm.report)
        if name == "planar":
            assert any("a fault outside of the arm: line " in line and "joint slide has the type planar" in line for line in arm.report)


INSIDE = {
    "two joints of one name": (GOOD + SLIDE + link("end") + joint("hinge", "continuous", "pole", "end"), {}, "duplicate"),
    "a fixed camera with a bad mass": (GOOD + SLIDE + BAD_BODY + joint("r", "fixed", "pole", "wheel"), {"tip": "pole"}, "negative"),
    "a joint that is off the path of no tip": (GOOD + SLIDE + link("wheel") + joint("r", "ball", "cart", "wheel"), {}, "has the type ball"),
    "two links of one name": (GOOD + SLIDE + link("pole"), {"tip": "pole"}, "duplicate"),
    "a fixed joint back to the root": (GOOD + joint("back", "fixed", "pole", "cart"), {}, "cycle"),
    "a follower without leader": (GOOD.replace("</joint>", '<mimic joint="none"/></joint>') + SLIDE, {"tip": "pole"}, "which is no joint"),
}


@pytest.mark.parametrize("name", INSIDE)
def test_faults_inside_of_a_chain_are_errors(name: str) -> None:
    text, ends, words = INSIDE[name]
    with pytest.raises(al.ModelError, match=words):
        al.load_urdf(f'<robot name="r">\n{text}</robot>', root="cart", **ends)  # type: ignore[arg-type]


def test_a_leader_outside_that_cannot_be_read() -> None:
    """The follower keeps its own limits."""
    follower = joint("hinge", "continuous", "cart", "pole", '<limit effort="3"/><mimic joint="slide"/>')
    text = link("base") + link("cart") + link("pole", 1.0, 0.3) + joint("slide", "planar", "base", "cart") + follower
    arm = al.load_urdf(f"<robot>{text}</robot>", root="cart")
    assert arm.joint_names == ("hinge",) and arm.limits["effort"].tolist() == [3.0]
    assert any("hinge mimics slide, which has a fault and is no part of the arm" in line for line in arm.report)


def test_a_tip_selects_its_root() -> None:
    text = f'<robot name="r">{GOOD}{SLIDE}{link("camera")}</robot>'
    assert al.load_urdf(text, tip="cart").joint_names == ("slide",)
    with pytest.raises(al.InputError, match="links base, cart, pole, camera, got wheel"):
        al.load_urdf(text, tip="wheel")
    loop = link("a") + link("b") + joint("r", "fixed", "a", "b") + joint("s", "fixed", "b", "a")
    with pytest.raises(al.ModelError, match="cycle"):
        al.load_urdf(f"<robot>{text[16:-8]}{loop}</robot>", tip="b")
