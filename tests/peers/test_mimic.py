"""Mimic joints against Pinocchio's mimic joints on public grippers and hands, to 1e-12, and against constraints of MuJoCo.

Pinocchio's aba and regressor refuse models with mimic joints. The tests compare forward dynamics through `M a`, and the regressor through
its product with the parameters.
"""

from __future__ import annotations

import contextlib
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from robots import folder
from test_pinocchio import Peer

import armlet as al

Array = NDArray[np.float64]

# The largest difference, relative to the largest number.
TOLERANCE = 1e-12
GRIPPERS = {
    "panda": "panda_description/urdf/panda.urdf",
    "baxter": "baxter_description/urdf/baxter.urdf",
    "pr2": "pr2_description/urdf/pr2.urdf",
    "tiago_pro": "tiago_pro_description/robots/tiago_pro.urdf",
}
# Pinocchio refuses these models with mimic joints, since a mimicked joint is after its mimic joint in Pinocchio's order.
LATER = {"romeo": "romeo_description/urdf/romeo.urdf", "talos": "talos_data/robots/talos_full_v2.urdf"}


@pytest.fixture(scope="module", params=GRIPPERS)
def pair(request: pytest.FixtureRequest) -> tuple[al.Arm, Any]:
    path = str(folder() / GRIPPERS[request.param])
    return al.load_urdf(path), pin.buildModelFromUrdf(path, mimic=True)


def apart(got: Array, want: Array) -> float:
    assert got.shape == want.shape
    return float(np.abs(got - want).max(initial=0.0) / max(np.abs(want).max(initial=0.0), 1.0))


def test_each_has_followers(pair: tuple[al.Arm, Any]) -> None:
    arm, model = pair
    assert len(model.mimicking_joints) == len(arm.file_joint_names) - arm.n > 0


def test_dynamics(pair: tuple[al.Arm, Any]) -> None:
    arm, model = pair
    peer = Peer(arm, model)
    data, rows = peer.data, peer.rows
    for q, v, a in np.random.default_rng(arm.n).uniform(-1.0, 1.0, (4, 3, arm.n)):
        at, rate, acceleration = peer.q(q), peer.v(v), peer.v(a)
        upper = np.triu(pin.crba(model, data, at))
        assert apart(arm.mass_matrix(q), (upper + np.triu(upper, 1).T)[np.ix_(rows, rows)]) <= TOLERANCE
        assert apart(arm.gravity(q), np.array(pin.computeGeneralizedGravity(model, data, at))[rows]) <= TOLERANCE
        tau = np.array(pin.rnea(model, data, at, rate, acceleration))[rows]
        assert apart(arm.inverse_dynamics(q, v, a), tau) <= TOLERANCE
        assert apart(arm.regressor(q, v, v, a) @ arm.parameters + arm.limits["armature"] * a, tau) <= TOLERANCE
        bias = np.array(pin.nle(model, data, at, rate))[rows]
        assert apart(arm.bias(q, v), bias) <= TOLERANCE
        mass = arm.mass_matrix(q)
        # Links without mass make M singular, and then the test skips forward dynamics.
        if np.linalg.cond(mass) < 1e8:
            accelerated = arm.forward_dynamics(q, v, tau)
            assert apart(mass @ accelerated + bias, tau) <= TOLERANCE


def test_frames(pair: tuple[al.Arm, Any]) -> None:
    arm, model = pair
    peer = Peer(arm, model)
    (q,) = np.random.default_rng(arm.n).uniform(-1.0, 1.0, (1, arm.n))
    pin.computeJointJacobians(model, peer.data, peer.q(q))
    pin.framesForwardKinematics(model, peer.data, peer.q(q))
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    for name in arm.frame_names:
        frame = model.getFrameId(name, pin.FrameType.BODY)
        assert apart(arm.pose(q, name), peer.data.oMf[frame].homogeneous) <= TOLERANCE, name
        assert apart(arm.jacobian(q, name), pin.getFrameJacobian(model, peer.data, frame, axes)[:, peer.rows]) <= TOLERANCE, name


def test_the_arm_of_a_model_is_that_of_its_file(pair: tuple[al.Arm, Any]) -> None:
    arm, model = pair
    made = al.from_pinocchio(model)
    assert set(made.joint_names) == set(arm.joint_names) and set(made.file_joint_names) == set(arm.file_joint_names)
    order = [arm.joint_names.index(name) for name in made.joint_names]
    (q,) = np.random.default_rng(arm.n).uniform(-1.0, 1.0, (1, arm.n))
    assert apart(made.mass_matrix(q[order]), arm.mass_matrix(q)[np.ix_(order, order)]) <= TOLERANCE
    report = al.verify(made, against=model, rtol=TOLERANCE)
    assert report, str(report)


@pytest.mark.parametrize("name", LATER)
def test_by_projection(name: str) -> None:
    path = str(folder() / LATER[name])
    arm = al.load_urdf(path)
    assert len(arm.file_joint_names) - arm.n >= 12
    with pytest.raises(ValueError, match="parent joint of the mimic joint"):
        pin.buildModelFromUrdf(path, mimic=True)
    report = al.verify(arm, against=pin.buildModelFromUrdf(path), rtol=TOLERANCE)
    assert report, str(report)


def test_a_wrong_multiplier_is_noticed() -> None:
    path = folder() / GRIPPERS["panda"]
    model = pin.buildModelFromUrdf(str(path), mimic=True)
    text = path.read_text()
    planted = text.replace('<mimic joint="panda_finger_joint1"', '<mimic multiplier="1.001" joint="panda_finger_joint1"')
    assert planted != text
    assert not al.verify(al.load_urdf(planted), against=model, rtol=TOLERANCE)


GRIPPER = """
<mujoco><compiler angle="radian"/><worldbody><body name="wrist"><joint name="turn" axis="0 0 1"/><geom type="box" size=".1 .1 .1" mass="2"/>
<body name="one" pos=".1 0 .2">
<joint name="left" type="slide" axis="1 0 0" ref="0.02" range="0 0.05" limited="true" armature="0.2"/>
<geom type="box" size=".02 .02 .05" mass="0.3"/>
<body name="tip" pos="0 0 .1"><joint name="curl" axis="0 1 0" ref="0.3"/>
<geom type="box" size=".01 .01 .05" pos="0 0 .05" mass="0.1"/></body></body>
<body name="two" pos="-.1 0 .2"><joint name="right" type="slide" axis="1 0 0"/><geom type="box" size=".02 .02 .05" mass="0.4"/></body>
<body name="free" pos="0 .1 .2"><joint name="other" axis="1 0 0"/><geom type="box" size=".02 .02 .05" mass="0.2"/></body></body></worldbody>
<equality>{}</equality></mujoco>
"""
TIED = '<joint joint1="right" joint2="left" polycoef="0.01 -1 0 0 0"/><joint joint1="curl" joint2="right" polycoef="0 5 0 0 0"/>'


class TestMuJoCo:
    def model(self, constraints: str) -> mujoco.MjModel:
        return mujoco.MjModel.from_xml_string(GRIPPER.format(constraints))

    def test_linear_constraints_join_two_joints(self) -> None:
        model = self.model(TIED)
        arm = al.from_mujoco(model)
        assert arm.joint_names == ("turn", "left", "other") and "constraints between joints are rigid here; MuJoCo's are soft" in arm.report
        assert not any("dropped" in line for line in arm.report), arm.report
        # The constraints are right - 0 = 0.01 - (left - 0.02) and curl - 0.3 = 5 (right - 0).
        left = 0.03
        positions = dict(zip(arm.file_joint_names, arm.file_positions([0.1, left, 0.2]), strict=True))
        right = 0.01 - (left - 0.02)
        assert positions == pytest.approx({"turn": 0.1, "left": left, "right": right, "curl": 0.3 + 5 * right, "other": 0.2}, abs=1e-15)
        report = al.verify(arm, against=model, rtol=TOLERANCE)
        assert report, str(report)
        # At the reference position, the errors of MuJoCo's constraints have the expected values.
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        assert float(np.abs(data.efc_pos[: data.ne] - np.array([-0.01, 0.0])).max()) < 1e-12

    def test_joints_stay_independent_on_request(self) -> None:
        model = self.model(TIED)
        arm = al.from_mujoco(model, mimic="independent")
        assert arm.n == 5 and "equality constraints dropped (2)" in arm.report
        with pytest.raises(al.InputError, match="mimic is unknown: expected one of joined, independent"):
            al.from_mujoco(model, mimic="both")  # type: ignore[arg-type]

    @pytest.mark.parametrize(
        ("constraints", "n", "dropped"),
        [
            ('<joint joint1="right" joint2="left" polycoef="0 1 0.1 0 0"/>', 5, 1),
            ('<joint joint1="right" joint2="left" active="false"/>', 5, 1),
            ('<joint joint1="right"/>', 5, 1),
            ('<joint joint1="right" joint2="left"/><joint joint1="left" joint2="right"/>', 4, 1),
            ('<joint joint1="right" joint2="left"/><joint joint1="right" joint2="curl"/>', 4, 1),
            ('<weld body1="one" body2="two"/>', 5, 1),
        ],
    )
    def test_nonlinear_and_inactive_constraints_are_dropped(self, constraints: str, n: int, dropped: int) -> None:
        # An active constraint that is dropped changes the motion, so the call warns. An inactive constraint has no effect.
        warns = contextlib.nullcontext() if 'active="false"' in constraints else pytest.warns(UserWarning, match="lacks active constraints")
        with warns:
            arm = al.from_mujoco(self.model(constraints))
        assert arm.n == n and f"equality constraints dropped ({dropped})" in arm.report
