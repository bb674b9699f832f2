"""Mimic joints: accepted, refused, reported, stored and cut."""

from __future__ import annotations

import pickle
from typing import Any

import models
import numpy as np
import pytest
from grippers import GRIPPER, joint, link

import armlet as al

ARM = al.load_urdf(GRIPPER)


def fingers(*more: str, kind: str = "prismatic") -> str:
    """A base with two joints. `more` are the child elements of the first and of the second joint."""
    first, second = (*more, "", "")[:2]
    bodies = link("a", 1.0, "0 0 0.1", 0.1) + link("b", 1.0, "0 0 0.1", 0.1)
    joints = [joint("j1", "revolute", "base", "a", "0 0 0", "0 0 1", first), joint("j2", kind, "a", "b", "0 0 1", "1 0 0", second)]
    return "<robot name='r'><link name='base'/>\n" + bodies + "\n" + "\n".join(joints) + "</robot>"


REFUSED = {
    "no such joint": (fingers("", "<mimic joint='j7'/>"), 4, "joint j2 mimics j7, which is no joint"),
    "itself": (fingers("", "<mimic joint='j2'/>"), 4, "joint j2 mimics itself, directly or by way of others"),
    "each other": (fingers("<mimic joint='j2'/>", "<mimic joint='j1'/>"), 3, "joint j1 mimics itself, directly or by way of others"),
    "itself, and is followed": (fingers("<mimic joint='j2'/>", "<mimic joint='j2'/>"), 4, "joint j2 mimics itself"),
    "a fixed one": (fingers("<mimic joint='j2'/>", kind="fixed"), 3, "joint j1 mimics j2, which is fixed"),
    "no leader": (fingers("", "<mimic multiplier='2'/>"), 4, "mimic has no joint"),
    "multiplier": (fingers("", "<mimic joint='j1' multiplier='two'/>"), 4, "multiplier of mimic is not a number"),
    "offset": (fingers("", "<mimic joint='j1' offset='nan'/>"), 4, "offset of mimic is not finite"),
    "infinite": (fingers("", "<mimic joint='j1' multiplier='inf'/>"), 4, "multiplier of mimic is not finite"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_invalid_mimic_joints_are_refused_with_their_line(name: str) -> None:
    text, line, problem = REFUSED[name]
    with pytest.raises(al.ModelError) as caught:
        al.load_urdf(text)
    assert problem in str(caught.value) and caught.value.line == line, caught.value


def test_independent_joints_on_request() -> None:
    free = al.load_urdf(GRIPPER, mimic="independent")
    assert free.n == 6 and any("joint right mimics left: kept as an independent joint" in line for line in free.report)
    assert free.joint_names == free.file_joint_names and np.array_equal(free.file_positions(np.arange(6.0)), np.arange(6.0))
    # With mimic="independent" a missing leader does not matter.
    assert al.load_urdf(REFUSED["no such joint"][0], mimic="independent").n == 2
    with pytest.raises(al.InputError, match="load_urdf: mimic is unknown: expected joined or independent, got free"):
        al.load_urdf(GRIPPER, mimic="free")  # type: ignore[arg-type]
    with pytest.raises(al.InputError, match="load_urdf: mimic is not a name"):
        al.load_urdf(GRIPPER, mimic=3)  # type: ignore[arg-type]


def test_the_report_and_the_table_say_who_follows() -> None:
    assert ARM.n == 3
    lines = [line for line in ARM.report if line.startswith("joined with their leaders")]
    assert len(lines) == 1 and "right = -1 left + 0" in lines[0] and "turn_right = -3 left + 0.5" in lines[0]
    assert "right       prismatic   = -1 left + 0" in repr(ARM)


def test_limits_that_leave_no_room_are_left_out() -> None:
    near, far = "<mimic joint='j1' multiplier='1' offset='5'/>", "<mimic joint='j1' multiplier='1' offset='3'/>"
    arm = al.load_urdf(fingers("", near))
    assert arm.limits["q_min"] == [-2.0] and arm.limits["q_max"] == [2.0]
    assert any("limits of j2, which follows j1, leave j1 no range: left out" in line for line in arm.report)
    arm = al.load_urdf(fingers("", far))
    assert arm.limits["q_min"] == [-2.0] and arm.limits["q_max"] == [-1.0]


def test_a_mimic_joint_with_multiplier_zero_is_fixed() -> None:
    """A multiplier of zero fixes the mimic joint at its offset."""
    arm = al.load_urdf(fingers("", "<mimic joint='j1' multiplier='0' offset='0.25'/>"))
    held = al.load_urdf(fingers("", ""), mimic="independent").locked({"j2": 0.25})
    q, v, a = [0.3], [0.4], [0.5]
    np.testing.assert_allclose(arm.inverse_dynamics(q, v, a), held.inverse_dynamics(q, v, a), rtol=1e-13)
    np.testing.assert_allclose(arm.pose(q, "b"), held.pose(q, "b"), atol=1e-15)
    assert arm.limits["v_max"] == [3.0]


def test_files_and_pickles_keep_who_follows() -> None:
    text, lost = ARM.to_urdf()
    again = al.load_urdf(text)
    assert again == ARM and not lost and again.report[-1] == ARM.report[-1]
    stored = pickle.loads(pickle.dumps(ARM))
    assert stored == ARM and stored.report == ARM.report and stored.joint_names == ARM.joint_names
    q = np.linspace(-0.2, 0.3, 3)
    assert np.array_equal(stored.mass_matrix(q), ARM.mass_matrix(q)) and np.array_equal(again.mass_matrix(q), ARM.mass_matrix(q))
    assert al.load_urdf(GRIPPER, mimic="independent") != ARM
    law = pickle.loads(pickle.dumps(al.Adaptive(ARM, al.Hold([0.0, 0.0, 0.0]), 10.0, 5.0, 0.1)))
    assert law.arm == ARM


def test_parameters_are_those_of_all_bodies_and_drives_those_of_coordinates() -> None:
    assert ARM.parameters.shape == (60,) and ARM.check_parameters().joints == ARM.file_joint_names
    heavier = ARM.with_parameters(2.0 * ARM.parameters).with_drives(armature=[0.0, 0.0, 0.0])
    q = [0.1, 0.2, 0.3]
    bare = ARM.with_drives(armature=[0.0, 0.0, 0.0])
    np.testing.assert_allclose(heavier.mass_matrix(q), 2.0 * bare.mass_matrix(q), rtol=1e-13)
    driven = bare.with_drives(armature=[0.1, 0.2, 0.3], damping=[1.0, 2.0, 3.0], friction=[0.5, 0.6, 0.7])
    np.testing.assert_allclose(driven.mass_matrix(q) - bare.mass_matrix(q), np.diag([0.1, 0.2, 0.3]), atol=1e-14)
    assert driven.limits["damping"].tolist() == [1.0, 2.0, 3.0]
    with pytest.raises(al.InputError, match=r"armature has the wrong (length|shape)"):
        ARM.with_drives(armature=[0.1] * 6)
    with pytest.raises(al.InputError, match=r"expected \(60,\)|expected 60"):
        ARM.with_parameters(np.zeros(30))


def test_positions_of_the_joints_of_the_file() -> None:
    q = np.tile([0.1, 0.2, 0.3], (2, 5, 1))
    positions = dict(zip(ARM.file_joint_names, ARM.file_positions(q)[1, 4], strict=True))
    assert positions["left"] == 0.3 and positions["right"] == -0.3 and abs(positions["turn_right"] - (0.5 - 0.9)) < 1e-15
    assert ARM.file_positions(q).shape == (2, 5, 6) and ARM.file_positions(np.zeros((0, 3))).shape == (0, 6)
    for bad, problem in (([0.0, 0.0], "q has the wrong shape"), ([0.0, np.nan, 0.0], "q is not finite"), (["a"] * 3, "q")):
        with pytest.raises(al.InputError, match=f"file_positions: {problem}"):
            ARM.file_positions(bad)  # type: ignore[arg-type]
    plain = models.PR
    assert plain.file_joint_names == plain.joint_names and plain.file_positions([1.0, 2.0]).tolist() == [1.0, 2.0]


def test_the_tree_of_the_joints() -> None:
    """Parents of joints, joints that move each frame, and poses of joints. planar_pr has no links."""
    assert [ARM.file_joint_names[p] if p >= 0 else "" for p in ARM.file_joint_parents][:2] == ["", "shoulder"]
    for frame, mover in zip(ARM.frame_names, ARM.frame_joints, strict=True):
        assert mover >= -1 and (mover >= 0 or np.ptp(ARM.position(np.eye(3), frame), axis=0).max() == 0.0)
    q = np.tile([0.1, 0.2, 0.3], (2, 5, 1))
    assert ARM.file_joint_poses(q).shape == (2, 5, 6, 4, 4) and ARM.file_joint_poses(np.zeros((0, 3))).shape == (0, 6, 4, 4)
    many = np.random.default_rng(0).uniform(-1.0, 1.0, (400, 3))  # enough rows for a compiled program
    np.testing.assert_array_equal(ARM.file_joint_poses(many)[17], ARM.file_joint_poses(many[17]))
    out = np.empty((6, 4, 4))
    assert ARM.file_joint_poses(many[0], out=out) is out
    for bad, problem in (([0.0, 0.0], "q has the wrong shape"), ([0.0, np.nan, 0.0], "q .*not finite"), (["a"] * 3, "q")):
        with pytest.raises(al.InputError, match=f"file_joint_poses: {problem}"):
            ARM.file_joint_poses(bad)  # type: ignore[arg-type]
    with pytest.raises(al.InputError, match=r"out"):
        ARM.file_joint_poses(many[0], out=np.empty((5, 4, 4)))
    plain = models.PR
    assert plain.file_joint_parents == (-1, 0) and plain.frame_joints == ()
    with pytest.raises(al.InputError, match="arm has no links"):
        plain.file_joint_poses([0.0, 0.0])


def test_cut_arms() -> None:
    """Locking a leader locks its mimic joints. If a leader is cut off, its first mimic joint becomes the leader."""
    free = al.load_urdf(GRIPPER, mimic="independent")
    held = ARM.locked({"left": 0.2})
    values = dict(zip(ARM.file_joint_names, ARM.file_positions([0.0, 0.0, 0.2]), strict=True))
    wanted = free.locked({name: values[name] for name in ("left", "right", "turn_left", "turn_right")})
    q = [0.3, -0.4]
    np.testing.assert_allclose(held.mass_matrix(q)[0], (wanted.mass_matrix(q))[0], atol=1e-14)
    assert held.joint_names == ("shoulder", "elbow") and held.file_joint_names == held.joint_names
    with pytest.raises(al.InputError, match="joint is unknown: expected one of the joints shoulder, elbow, left"):
        ARM.locked({"right": 0.0})
    kept = ARM.locked({"shoulder": 0.0})
    assert kept.joint_names == ("elbow", "left") and len(kept.file_joint_names) == 5
    cut = al.load_urdf(GRIPPER, tip="k2")
    assert cut.joint_names == ("shoulder", "elbow", "right") and cut.file_joint_names == ("shoulder", "elbow", "right", "turn_right")
    assert any("joint right leads in the place of left" in line for line in cut.report)
    # right = -left, turn_right = -3 left + 0.5 = 3 right + 0.5.
    np.testing.assert_allclose(cut.file_positions([0.0, 0.0, 0.1]), [0.0, 0.0, 0.1, 0.8], atol=1e-15)
    q = np.array([0.3, -0.2, 0.1])
    np.testing.assert_allclose(cut.pose(q, "k2"), ARM.pose(q * [1, 1, -1], "k2"), atol=1e-15)
    np.testing.assert_allclose([cut.limits[key][2] for key in ("q_min", "q_max")], [-ARM.limits["q_max"][2], -ARM.limits["q_min"][2]])
    assert cut.limits["armature"][2] == pytest.approx(ARM.limits["armature"][2], rel=1e-14)


def chain(**mimic: Any) -> list[dict[str, Any]]:
    body = {"type": "R", "axis": [0, 0, 1], "xyz": [1, 0, 0], "phi": [1.0, 0.5, 0, 0, 0.1, 0, 0.4, 0, 0, 0.4]}
    return [body, {**body, "mimic": mimic}]


CHAINS: dict[str, tuple[Any, str]] = {
    "itself": (chain(joint=1), r"joints\[1\].mimic leads back to the joint itself"),
    "into a cycle": ([{**chain()[0], "mimic": {"joint": 1}}, chain(joint=1)[1]], r"joints\[1\].mimic leads back to the joint itself"),
    "far": (chain(joint=7), r"joints\[1\].mimic is out of range: expected an index below 2, got 7"),
    "none": (chain(multiplier=2.0), r"joints\[1\]\[\"mimic\"\] has no joint: expected the index"),
    "word": (chain(joint="joint1"), r"joints\[1\]\[\"mimic\"\] has no joint: expected the index"),
    "huge": (chain(joint=10**30), r"joints\[1\]\[\"mimic\"\] has no joint: expected the index"),
    "nan": (chain(joint=0, multiplier=np.nan), r"joints\[1\]\[\"mimic\"\]\[\"multiplier\"\] is not finite"),
    "key": (chain(joint=0, factor=2.0), r"mimic of joints\[1\] has an unknown key: expected one of joint, multiplier, offset"),
    "list": ([*chain(joint=0)[:1], {**chain()[0], "mimic": [0, 1.0]}], r"joints\[1\]\[\"mimic\"\] is not a dict"),
    "fixed": ([{**chain()[0], "type": "F"}, chain(joint=0)[1]], r"joints\[1\].mimic is for joints that move"),
}


@pytest.mark.parametrize("name", CHAINS)
def test_lists_of_joints_are_checked(name: str) -> None:
    joints, problem = CHAINS[name]
    with pytest.raises(al.InputError, match=problem):
        al.Arm.from_chain(joints)


def test_trees_that_are_too_large_say_so() -> None:
    joints = [*chain(joint=0), *[chain()[0]] * 255]
    with pytest.raises(
        al.InputError, match='too many joints for some that follow others: expected at most 256, got 257; read it with mimic="indep'
    ):
        al.Arm.from_chain(joints)
    assert al.Arm.from_chain(joints[:256]).n == 255


def test_long_chains_of_followers() -> None:
    """Each joint mimics the previous one: q_k = q_1 + k. The leader does not depend on the order of the list."""
    joints = [chain()[0], *[{**chain()[0], "mimic": {"joint": k, "offset": 1.0}} for k in range(100)]]
    arm = al.Arm.from_chain(joints)
    assert arm.n == 1 and np.array_equal(arm.file_positions([0.5])[:4], [0.5, 1.5, 2.5, 3.5])
    back = [{**chain()[0], "parent": -1, "mimic": {"joint": 1, "multiplier": -1.0}}, {**chain()[0], "parent": -1}]
    assert al.Arm.from_chain(back).joint_names == ("joint2",)


def test_an_arm_whose_follower_alone_has_mass() -> None:
    """The leader has no mass, but its mimic joint has. The mass matrix is regular, so the report has no line about a singular one."""
    light = fingers("", "<mimic joint='j1'/>").replace(link("a", 1.0, "0 0 0.1", 0.1), "<link name='a'/>")
    assert not any("positive definite" in line for line in al.load_urdf(light).report)
    none = light.replace(link("b", 1.0, "0 0 0.1", 0.1), "<link name='b'/>").replace("armature='0.03'", "")
    assert any("not positive definite" in line and line.endswith("joints j1") for line in al.load_urdf(none).report)


def test_scenarios_read_both_ways(tmp_path: Any) -> None:
    (tmp_path / "gripper.urdf").write_text(GRIPPER)
    data: dict[str, Any] = {
        "arm": {"kind": "urdf", "path": str(tmp_path / "gripper.urdf")},
        "law": {"kind": "PDGravity", "target": [0.1, 0.2, 0.1], "kp": 30.0, "kd": 5.0},
        "run": {"q0": [0.0, 0.0, 0.0], "t_end": 0.1, "dt": 1e-3},
    }
    built = al.Scenario(data).build()
    assert built.plant.arm.n == 3
    data["arm"]["mimic"] = "independent"
    data["law"]["target"], data["run"]["q0"] = [0.0] * 6, [0.0] * 6
    assert al.Scenario(data).build().plant.arm.n == 6
    data["arm"]["mimic"] = "free"
    with pytest.raises(al.InputError, match="mimic"):
        al.Scenario(data).check()
