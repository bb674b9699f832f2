"""Arms made from MuJoCo models, and URDF files that armlet and MuJoCo both read, against MuJoCo's numbers."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import models
import mujoco
import numpy as np
import pytest
from robots import path

import armlet as al

# The model has joint anchors off the origin, reference positions, two joints on one body, branches and fixed bodies. It also has rotated
# inertias, armature and friction.
MODEL = """
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0.3 -0.2 -9.7"/>
  <worldbody>
    <body name="pillar" pos="0.1 0 0.3" euler="0 0 0.4">
      <geom type="box" size=".1 .1 .3" mass="4"/>
      <body name="upper" pos="0 0 0.3" quat="0.9 0.1 -0.3 0.2">
        <joint name="pan" axis="0 0 1" pos="0.02 0.01 0" ref="0.3" range="-2 2" limited="true" armature="0.11" damping="0.5"/>
        <joint name="tilt" axis="0.3 1 0.1" pos="0 0 0.05" frictionloss="0.2"/>
        <inertial pos="0.05 0.02 0.1" quat="0.8 0.2 0.3 -0.4" mass="2.5" diaginertia="0.03 0.02 0.025"/>
        <body name="slider" pos="0 0.1 0.3" euler="0.2 -0.1 0.5">
          <joint name="reach" type="slide" axis="1 0.2 0" ref="0.07" range="0 0.4" limited="true"/>
          <inertial pos="0.01 0 0" mass="0.8" fullinertia="0.01 0.012 0.009 0.001 -0.002 0.0005"/>
          <body name="hand" pos="0.1 0 0">
            <geom type="sphere" size=".03" mass="0.3" pos="0 0 .05"/>
            <site name="tip" pos="0 0 .1" euler="0 1 0"/>
          </body>
        </body>
        <body name="side" pos="0 -0.2 0.2">
          <joint name="swing" axis="1 0 0"/>
          <geom type="capsule" size=".02" fromto="0 0 0 0 -.2 0" mass="0.6"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="pan"/></actuator>
</mujoco>
"""


def test_a_model_with_everything() -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    arm = al.from_mujoco(model)
    assert arm.joint_names == ("pan", "tilt", "reach", "swing")
    assert arm.joint_types == ("revolute", "continuous", "prismatic", "continuous")
    np.testing.assert_array_equal(arm.limits["q_min"], [-2.0, -np.inf, 0.0, -np.inf])
    np.testing.assert_array_equal(arm.limits["armature"], [0.11, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(arm.limits["friction"], [0.0, 0.2, 0.0, 0.0])
    assert {"world", "pillar", "upper", "slider", "hand", "side", "tip"} == set(arm.frame_names)
    assert any("actuators dropped (1)" in line for line in arm.report)
    report = al.verify(arm, against=model, samples=6)
    assert report, str(report)
    q = np.array([0.4, -0.7, 0.2, 1.1])
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    site = model.site("tip").id
    # Quaternions have unit length up to one rounding.
    np.testing.assert_allclose(arm.pose(q, "tip")[:3, 3], data.site_xpos[site], rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(arm.pose(q, "tip")[:3, :3], data.site_xmat[site].reshape(3, 3), rtol=0.0, atol=1e-14)
    heavier = arm.parameters
    heavier[30] += 1e-3
    assert not al.verify(arm.with_parameters(heavier), against=model)
    again = al.load_urdf(arm.to_urdf()[0], gravity=model.opt.gravity)
    np.testing.assert_allclose(again.mass_matrix(q), arm.mass_matrix(q), rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("name", ["panda", "ur5", "z1", "solo12"])
def test_urdfs_read_by_both(name: str) -> None:
    text = re.sub(r"<(visual|collision)\b.*?</\1>", "", path(name).read_text(), flags=re.DOTALL)
    # By default MuJoCo fuses bodies, changes inertias and adds armature when it reads a URDF. These options turn this off.
    options = '<mujoco><compiler fusestatic="false" discardvisual="true" balanceinertia="false" boundmass="0" boundinertia="0"/></mujoco>'
    text = re.sub(r"(<robot\b[^>]*>)", r"\1" + options, text, count=1)
    model = mujoco.MjModel.from_xml_string(text)
    arm = al.load_urdf(str(path(name)))
    # MuJoCo stores principal axes as quaternions and rounds the numbers that it reads. So the tolerance is large.
    report = al.verify(arm, against=model, samples=3, rtol=1e-7)
    numbers = [row for row in report.rows if row.quantity not in ("gravity vector", "armature")]
    assert all(row.agrees for row in numbers), str(report)
    assert al.verify(al.from_mujoco(model), against=model, samples=3)


def test_models_that_are_not_arms_are_refused() -> None:
    free = '<mujoco><worldbody><body name="b"><freejoint name="root"/><geom type="sphere" size="1"/></body></worldbody></mujoco>'
    with pytest.raises(al.InputError, match=r"expected hinge or slide, got free \(joint root\)"):
        al.from_mujoco(mujoco.MjModel.from_xml_string(free))
    with pytest.raises(al.InputError, match="against is of the wrong type"):
        al.verify(al.pendulum(1.0, 1.0), against=3)


EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "mujoco_loop.py"


def test_a_law_drives_a_model(tmp_path: Path) -> None:
    """The example runs: its two loops agree to 1e-10. With an extra gram in one of them, its assertion fails."""
    code = EXAMPLE.read_text()
    assert subprocess.run([sys.executable, "-P", "-c", code, str(tmp_path / "figure.png")], check=False).returncode == 0
    assert (tmp_path / "figure.png").stat().st_size > 0
    planted = code.replace("arm = al.from_mujoco(model)", "arm = al.from_mujoco(model).with_payload('fore', 1e-3)")
    assert planted != code
    done = subprocess.run([sys.executable, "-P", "-c", planted], capture_output=True, text=True, check=False)
    assert done.returncode == 1 and "AssertionError" in done.stderr


def two_links(joint: str = "", option: str = "", rest: str = "", site: str = "tip", top: str = "") -> mujoco.MjModel:
    geom = '<geom type="capsule" size=".05" fromto="0 0 0 0 0 .4" density="800"/>'
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><compiler angle="radian"/>{option}{top}<worldbody><body name="one"><joint name="a" axis="0 1 0" {joint}/>{geom}
        <body name="two" pos="0 0 .4"><joint name="b" axis="1 0.3 0"/>{geom}<site name="{site}" pos="0 0 .4"/></body></body></worldbody>
        {rest}</mujoco>"""
    )


def agrees(model: mujoco.MjModel) -> al.Arm:
    arm = al.from_mujoco(model)
    report = al.verify(arm, against=model)
    assert report, str(report)
    return arm


def test_gravity_that_is_switched_off() -> None:
    arm = agrees(two_links(option='<option><flag gravity="disable"/></option>'))
    np.testing.assert_array_equal(arm.gravity([0.3, 0.4]), [0.0, 0.0])
    assert np.any(agrees(two_links()).gravity([0.3, 0.4]) != 0.0)


def test_rotors_of_actuators_are_on_the_joints_side_of_the_gear() -> None:
    motors = '<actuator><motor joint="a" gear="3" armature="0.2" damping="0.5"/><motor jointinparent="a" armature="0.1"/></actuator>'
    model = two_links(joint='armature="0.3" damping="0.1" actuatorfrcrange="-20 30"', rest=motors)
    arm = agrees(model)
    np.testing.assert_allclose(arm.limits["armature"], [0.3 + 9 * 0.2 + 0.1, 0.0], rtol=1e-15)
    np.testing.assert_allclose(arm.limits["damping"], [0.1 + 9 * 0.5, 0.0], rtol=1e-15)
    np.testing.assert_array_equal(arm.limits["effort"], [20.0, np.inf])
    data = mujoco.MjData(model)
    data.qvel[:] = 1.0
    mujoco.mj_forward(model, data)
    friction = arm.bias([0.0, 0.0], [1.0, 1.0], friction=True) - arm.bias([0.0, 0.0], [1.0, 1.0])
    np.testing.assert_allclose(friction, -data.qfrc_passive, rtol=1e-12)


def test_defaults_of_classes_are_read() -> None:
    top = '<default><joint armature=".1" frictionloss=".2"/><default class="k"><joint armature=".5" range="-1 1"/></default></default>'
    arm = agrees(two_links(joint='class="k"', top=top))
    np.testing.assert_array_equal(arm.limits["armature"], [0.5, 0.1])
    np.testing.assert_array_equal(arm.limits["friction"], [0.2, 0.2])
    np.testing.assert_array_equal(arm.limits["q_max"], [1.0, np.inf])


def test_dropped_parts_are_reported() -> None:
    joints = '<joint joint="a" coef="1"/><joint joint="b" coef="-1"/>'
    for given, said in (
        ({"option": '<option density="1000"/>'}, "fluid forces dropped (1)"),
        ({"joint": 'damping="1 2 3"'}, "joints' damping beyond the linear dropped (1)"),
        ({"site": "two"}, "sites of a body's name dropped (1)"),
        ({"joint": 'stiffness="3"'}, "joint springs dropped (1)"),
        ({"rest": f'<tendon><fixed name="t" stiffness="5">{joints}</fixed></tendon>'}, "tendons dropped (1)"),
    ):
        assert agrees(two_links(**given)).report == (said,)
    with pytest.warns(UserWarning, match="the arm lacks active constraints of model, so it moves in another way: joint 0"):
        arm = al.from_mujoco(two_links(rest='<equality><joint joint1="a" joint2="b" polycoef="0 1 1 0 0"/></equality>'))
    assert arm.report == ("equality constraints dropped (1)",)
    # The armature of a tendon couples the joints, which `al.Arm` cannot represent. `al.verify` reports the difference.
    coupled = two_links(rest=f'<tendon><fixed name="t" armature="0.7">{joints}</fixed></tendon>')
    report = al.verify(al.from_mujoco(coupled), against=coupled)
    assert not report and "mass_matrix" in {row.quantity for row in report.rows if not row.agrees}


def test_a_world_without_joints_is_compared() -> None:
    model = mujoco.MjModel.from_xml_string('<mujoco><worldbody><body name="b" pos="1 2 3"><geom size="1"/></body></worldbody></mujoco>')
    arm = agrees(model)
    assert arm.n == 0
    np.testing.assert_array_equal(arm.position([], "b"), [1.0, 2.0, 3.0])


def test_mujoco_reads_the_written_urdf() -> None:
    """MuJoCo reads a URDF from `to_urdf` and ignores the extra attributes, which store exact parameters."""
    arm = models.SIX_AXES.with_frame("tool", "link6", rpy=[0.3, 0.4, 0.5])
    text = arm.with_payload("tool", 1.0, [0.1, 0.2, 0.3]).to_urdf()[0]
    assert ' parameters="' in text
    options = '<mujoco><compiler fusestatic="false" balanceinertia="false" boundmass="0" boundinertia="0"/></mujoco>'
    model = mujoco.MjModel.from_xml_string(re.sub(r"(<robot\b[^>]*>)", r"\1" + options, text, count=1))
    report = al.verify(al.load_urdf(text), against=model, rtol=1e-7)
    numbers = [row for row in report.rows if row.quantity in ("pose", "jacobian", "gravity")]
    assert len(numbers) == 3 and all(row.agrees for row in numbers), str(report)
