"""Arms made from MuJoCo models, and URDFs read by both, against MuJoCo's own numbers."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

import armlet as al

sys.path.insert(0, str(Path(__file__).parent))
from robots import path

# Anchors off the origin, reference positions, two joints on a body, branches, fixed bodies, turned inertias, rotors, friction.
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
    # Quaternions of unit length to one rounding.
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
    # MuJoCo reads URDF with its own idea of what is fused, which inertias are balanced and which armature there is.
    options = '<mujoco><compiler fusestatic="false" discardvisual="true" balanceinertia="false" boundmass="0" boundinertia="0"/></mujoco>'
    text = re.sub(r"(<robot\b[^>]*>)", r"\1" + options, text, count=1)
    model = mujoco.MjModel.from_xml_string(text)
    arm = al.load_urdf(str(path(name)))
    # MuJoCo keeps principal axes as quaternions and rounds what it reads: 1e-8 of the largest.
    report = al.verify(arm, against=model, samples=3, rtol=1e-7)
    numbers = [row for row in report.rows if row.quantity not in ("gravity vector", "armature")]
    assert all(row.agrees for row in numbers), str(report)
    assert al.verify(al.from_mujoco(model), against=model, samples=3)


def test_what_is_not_an_arm() -> None:
    free = '<mujoco><worldbody><body name="b"><freejoint name="root"/><geom type="sphere" size="1"/></body></worldbody></mujoco>'
    with pytest.raises(al.InputError, match=r"expected hinge or slide, got free \(joint root\)"):
        al.from_mujoco(mujoco.MjModel.from_xml_string(free))
    with pytest.raises(al.InputError, match="against is of the wrong type"):
        al.verify(al.pendulum(1.0, 1.0), against=3)


EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "mujoco_loop.py"


def test_a_law_drives_a_model(tmp_path: Path) -> None:
    """The example, whose two loops agree to 1e-10; with a gram more on one side they do not."""
    code = EXAMPLE.read_text()
    assert subprocess.run([sys.executable, "-P", "-c", code, str(tmp_path / "figure.png")], check=False).returncode == 0
    assert (tmp_path / "figure.png").stat().st_size > 0
    planted = code.replace("arm = al.from_mujoco(model)", "arm = al.from_mujoco(model).with_payload('fore', 1e-3)")
    assert planted != code
    done = subprocess.run([sys.executable, "-P", "-c", planted], capture_output=True, text=True, check=False)
    assert done.returncode == 1 and "AssertionError" in done.stderr
