"""A pose (4, 4) as the target of a task of a frame. It replaces the rows of position and rotation vector."""

from __future__ import annotations

import models
import numpy as np
import pytest

import armlet as al

ARM = models.SIX_AXES
Q = np.array([0.3, -0.9, 1.3, 0.2, 0.7, -0.4])
ALL = "xyz rx ry rz"


def tip() -> str:
    assert ARM.tip_frame is not None
    return ARM.tip_frame


def test_a_pose_equals_its_rows() -> None:
    pose = ARM.pose(Q, tip())
    task = al.Task(tip(), ALL, pose)
    start = Q + 0.1
    one, two = (al.inverse_kinematics(ARM, [each], start) for each in (task, al.Task(tip(), ALL, ARM.pose_vector(Q, tip()))))
    assert one.reached and np.asarray(one.q).tobytes() == np.asarray(two.q).tobytes()
    # 1e-8: twice the tolerance 1e-9 of the search, for the norm of six rows.
    np.testing.assert_allclose(ARM.pose(one.q, tip()), pose, rtol=0.0, atol=1e-8)


def test_a_pose_of_some_rows() -> None:
    pose = ARM.pose(Q, tip())
    found = al.inverse_kinematics(ARM, [al.Task(tip(), "xyz", pose.tolist())], Q + 0.1)
    np.testing.assert_allclose(ARM.position(found.q, tip()), pose[:3, 3], rtol=0.0, atol=1e-8)
    planar = models.TWO_LINKS
    task = al.Task("link2", "x y rz", planar.pose([0.2, 0.5], "link2"))
    assert "0.7" in repr(task) and al.inverse_kinematics(planar, [task], [0.3, 0.4]).reached


def test_poses_of_a_batch() -> None:
    q = Q + np.linspace(0.0, 0.2, 3)[:, None]
    poses = ARM.pose(q, tip())
    found = al.inverse_kinematics(ARM, [al.Task(tip(), ALL, poses)], q + 0.05)
    assert found.q.shape == (3, 6) and found.reached.all()
    bad = poses.copy()
    bad[1, 0, 0] = np.nan
    found = al.inverse_kinematics(ARM, [al.Task(tip(), ALL, bad)], q + 0.05)
    assert found.reached.tolist() == [True, False, True] and found.status[1] == al.Status.DIVERGED


def test_a_law_with_a_pose() -> None:
    law = al.PriorityVelocity(ARM, [al.Task(tip(), ALL, ARM.pose(Q, tip()), 2.0)])
    run = al.simulate(al.VelocityArm(ARM), law, Q + 0.05, t_end=5.0, dt=1e-2)
    # exp(-2 * 5) = 5e-5 of an initial error of about 0.1 rad and 0.05 m remains.
    np.testing.assert_allclose(ARM.pose(run.q[-1], tip()), ARM.pose(Q, tip()), rtol=0.0, atol=1e-4)


def test_a_relative_pose() -> None:
    frames = ARM.frame_names
    other = frames[1]
    relative = np.linalg.inv(ARM.pose(Q, other)) @ ARM.pose(Q, tip())
    found = al.inverse_kinematics(ARM, [al.RelativeTask(tip(), other, ALL, relative)], Q + 0.05)
    assert found.reached
    np.testing.assert_allclose(np.linalg.inv(ARM.pose(found.q, other)) @ ARM.pose(found.q, tip()), relative, rtol=0.0, atol=1e-8)


def test_a_task_of_four_rows_has_a_batch_of_rows() -> None:
    """Then (4, 4) is a batch of four targets."""
    found = al.inverse_kinematics(ARM, [al.Task(tip(), "xyz rx", np.zeros((4, 4)))], Q, restarts=0)
    assert found.q.shape == (4, 6)


@pytest.mark.parametrize(
    ("pose", "problem"),
    [
        (2.0 * np.eye(4), "target is not a pose: expected a rotation"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "target is not a pose"),
        (np.full((4, 4), np.nan), "target is not finite"),
        (np.stack([np.eye(4), 2.0 * np.eye(4)]), r"target is not a pose.*first bad index 1"),
    ],
)
def test_a_matrix_that_is_no_pose(pose: np.ndarray, problem: str) -> None:
    with pytest.raises(al.InputError, match=problem):
        al.Task("link5", ALL, pose)


def test_tasks_without_a_frame_have_no_pose() -> None:
    for make in (lambda: al.CentreOfMassTask("xyz", np.eye(4)), lambda: al.AxisTask("link5", [0.0, 0.0, 1.0], np.eye(4))):
        with pytest.raises(al.InputError, match="target has the wrong shape"):
            make()
