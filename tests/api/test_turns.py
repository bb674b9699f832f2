"""`Arm.nearest`, the warning of a target one turn away, and `Law.replace`."""

from __future__ import annotations

import pickle
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

URDF = """<robot name="r"><link name="base"/>
<link name="a"><inertial><mass value="1"/><origin xyz="0.5 0 0"/>
<inertia ixx="0.01" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="b"><inertial><mass value="1"/><origin xyz="0.5 0 0"/>
<inertia ixx="0.01" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="spin" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint>
<joint name="hinge" type="revolute"><parent link="a"/><child link="b"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/>
<limit lower="-6" upper="6" effort="100" velocity="10"/></joint></robot>"""
ARM = al.load_urdf(URDF, gravity=[0.0, 0.0, 0.0])
START, FAR = np.array([3.13, 0.4]), np.array([-3.13, 0.4])


def test_nearest() -> None:
    rng = np.random.default_rng(0)
    target, q = rng.uniform(-20.0, 20.0, (2, 50, 2))
    near = ARM.nearest(target, q)
    wanted = q[:, 0] + np.angle(np.exp(1j * (target[:, 0] - q[:, 0])))
    np.testing.assert_allclose(near[:, 0], wanted, atol=1e-12)
    np.testing.assert_array_equal(near[:, 1], target[:, 1])
    np.testing.assert_allclose(ARM.pose(near, "b"), ARM.pose(np.column_stack([target[:, 0], near[:, 1]]), "b"), atol=1e-12)
    # Targets and positions broadcast.
    np.testing.assert_array_equal(ARM.nearest(FAR, q), [ARM.nearest(FAR, row) for row in q])
    assert ARM.nearest(target[:, None], q[:3]).shape == (50, 3, 2)
    np.testing.assert_array_equal(ARM.nearest([0.5, 0.1], [0.4, 9.0]), [0.5, 0.1])


def test_joints_that_follow_and_slide() -> None:
    joints: list[dict[str, Any]] = [{"type": "R", "axis": [0, 0, 1], "phi": [1.0] + [0.0] * 9} for _ in range(2)]
    for multiplier, near in ((2.0, 0.0), (0.5, 2.0 * np.pi)):
        arm = al.Arm.from_chain([joints[0], joints[1] | {"mimic": {"joint": 0, "multiplier": multiplier, "offset": 0.1}}])
        assert arm.n == 1
        # With half a turn of the follower, a turn of the leader is another pose.
        np.testing.assert_allclose(arm.nearest([2.0 * np.pi], [0.1]), [near], atol=1e-12)
    rail = al.Arm.from_chain([{"type": "P", "axis": [0, 0, 1], "phi": [1.0] + [0.0] * 9}])
    assert rail.nearest([7.0], [0.0]).tolist() == [7.0]
    np.testing.assert_allclose(models.PR.nearest([7.0, 7.0], [0.0, 0.0]), [7.0, 7.0 - 2.0 * np.pi])
    for bad, message in ((([np.nan, 0.0], FAR), "target"), ((FAR, [0.0]), "q"), ((FAR, "x"), "q")):
        with pytest.raises(al.InputError, match=rf"^nearest: {message} |^Arm.nearest: {message} "):
            ARM.nearest(*bad)  # type: ignore[arg-type]


def test_a_target_one_turn_away_is_reported() -> None:
    plant, law = al.RigidArm(ARM), al.PDGravity(ARM, FAR, 200.0, 60.0)
    message = r"^simulate: the continuous joint 'spin' starts 6.26 rad from its target. Angles are not wrapped.*arm.nearest"
    with pytest.warns(UserWarning, match=message):
        long = al.simulate(plant, law, START, t_end=4.0, dt=1e-3)
    with pytest.warns(UserWarning, match=r"^simulate_batch: .* in row 1\. "):
        al.simulate_batch(plant, law, [[-3.0, 0.4], START], t_end=0.1, dt=1e-3)
    with pytest.warns(UserWarning, match=message):
        al.simulate(plant, al.ComputedTorque(ARM, al.Quintic(FAR, [0.0, 0.0], 1.0), 100.0, 20.0), START, t_end=0.1, dt=1e-3)
    # The near target, and the option, are silent: warnings are errors here.
    short = al.simulate(plant, law.replace(target=ARM.nearest(FAR, START)), START, t_end=4.0, dt=1e-3)
    al.simulate(plant, law, START, t_end=0.1, dt=1e-3, check_limits=False)
    travels = [np.abs(np.diff(run.q[:, 0])).sum() for run in (long, short)]
    np.testing.assert_allclose(travels, [6.26, 2.0 * np.pi - 6.26], atol=2e-3)


def test_replace() -> None:
    law = al.ComputedTorque(ARM, al.Hold(FAR), 100.0, 20.0)
    stiff = law.replace(kp=[300.0, 200.0])
    assert isinstance(stiff, al.ComputedTorque) and pickle.dumps(stiff) == pickle.dumps(
        al.ComputedTorque(ARM, al.Hold(FAR), [300.0, 200.0], 20.0)
    )
    np.testing.assert_array_equal(law.replace()(0.0, START, START), law(0.0, START, START))
    task = al.PriorityVelocity(ARM, [al.Task("b", "xy", [0.6, 0.4], 5.0)], method="damped", eps=0.1)
    assert "eps=0.2" in repr(task.replace(eps=0.2)) and "damped" in repr(task.replace(eps=0.2))
    inner = al.Guarded(law, al.MomentumObserver(ARM, 50.0, threshold=[5.0, 5.0]))
    assert isinstance(inner.replace(reaction="float"), al.Guarded)
    with pytest.raises(al.InputError, match="kp "):
        law.replace(kp=-1.0)
    with pytest.raises(TypeError, match="kpp"):
        law.replace(kpp=1.0)
