"""Tasks, their laws, solvers and inverse kinematics: an error names an invalid argument; every object can be pickled and printed."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

ARM = al.planar_arm([1.0, 1.0, 0.25, 0.25])
TIP = al.Task("link4", "xy", [1.2, 1.0], 5.0)
ELBOW = al.Task("link2", "xy", al.Quintic([0.0, 0.0], [0.9, 0.8], 1.0), [5.0, 4.0])
Q = np.array([0.1, 1.2, 0.4, 0.4])
TASKS = [
    TIP,
    ELBOW,
    al.Task("link4", "xy", motion=al.Hold([1.0, 1.0]), gain=[[2.0, 0.5], [0.5, 2.0]], damping=3.0),
    al.PostureTask([0.0, 0.5], 1.0, joints=["joint1", "joint3"]),
    al.CentreOfMassTask("xy", [0.5, 0.0]),
    al.AxisTask("link4", [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 2.0),
    al.RelativeTask("link4", "link1", "xy", [0.3, 0.1], 2.0),
    al.DistanceTask("link4", "link1", 0.2, 2.0, points=[[0.0, 0.0, 0.0], [-0.1, 0.0, 0.0]], radius=0.05, other_points=[0.1, 0.0, 0.0]),
    al.DistanceTask(None, "link4", upper=0.4, other_radius=0.1, damping=2.0),
    al.JointLimitTask(2.0, 0.2),
    al.Task("link4", "xy"),
]
WAYS: dict[str, Callable[[Any], Any]] = {
    **{f"pickle {p}": lambda x, p=p: pickle.loads(pickle.dumps(x, p)) for p in range(2, pickle.HIGHEST_PROTOCOL + 1)},
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
}
way = pytest.mark.parametrize("back", WAYS.values(), ids=WAYS.keys())


@way
@pytest.mark.parametrize("task", TASKS, ids=repr)
def test_tasks_can_be_pickled(back: Callable[[Any], Any], task: al.Task) -> None:
    other = back(task)
    assert type(other) is type(task) and repr(other) == repr(task)


@way
def test_laws_and_solvers_can_be_pickled(back: Callable[[Any], Any]) -> None:
    zero = np.zeros(4)
    for law in (
        al.PriorityVelocity(ARM, [TIP, ELBOW], "damped", [0.05, 0.02]),
        al.PriorityAcceleration(ARM, [TIP, ELBOW], joint_damping=2.0),
    ):
        other = back(law)
        assert type(other) is type(law) and repr(other) == repr(law)
        np.testing.assert_array_equal(other(0.3, Q, zero), law(0.3, Q, zero))
    solver = al.PrioritySolver.for_arm(ARM, [TIP, ELBOW], method="sns", v_max=1.0)
    other = back(solver)
    velocities = [np.ones(2), np.zeros(2)]
    assert repr(other) == repr(solver)
    np.testing.assert_array_equal(other.solve(Q, velocities), solver.solve(Q, velocities))
    found = al.inverse_kinematics(ARM, [TIP], Q)
    again = back(found)
    assert repr(again) == repr(found) and bool(again) and again.status is al.Status.SUCCESS


def test_tasks_copy_their_arguments() -> None:
    target = np.array([1.2, 1.0])
    law = al.PriorityVelocity(ARM, [al.Task("link4", "xy", target, 5.0)])
    before = law(0.0, Q, np.zeros(4))
    target[:] = 0.0
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(law))(0.0, Q, np.zeros(4)), before)


BAD: list[tuple[Callable[[], Any], str]] = [
    (lambda: al.Task("link4", "q"), "Task: axes is not made of"),
    (lambda: al.Task("link4", "xx"), "Task: axes repeats x"),
    (lambda: al.Task(4, "xy"), "Task: frame is not a name"),
    (lambda: al.Task("link4", "xy", [1.0, np.nan]), "Task: target is not finite"),
    (lambda: al.Task("link4", "xy", 1.0), "Task: target has the wrong shape"),
    (lambda: al.PriorityVelocity(ARM, [al.Task("link4", "xy", [[1.0, 2.0]])]), r"tasks\[0\].target is a batch"),
    (
        lambda: al.inverse_kinematics(ARM, [al.Task("link4", "xy", np.ones((5, 3)))], Q),
        r"Task: target has the wrong shape: expected \(rows,\) or \(..., 2\), got \(5, 3\)",
    ),
    (lambda: al.inverse_kinematics(ARM, [al.Task("link4", "xy", np.ones((5, 2)))], np.ones((3, 4))), "tasks, q0 do not broadcast"),
    (lambda: al.inverse_kinematics(ARM, [TIP], Q, solutions=0), "solutions is not positive"),
    (lambda: al.inverse_kinematics(ARM, [TIP], Q, solutions=-1), "solutions is not a count"),
    (lambda: al.inverse_kinematics(ARM, [TIP], Q, threads=0), "threads is not a positive integer"),
    (lambda: al.inverse_kinematics(ARM, [TIP], Q, threads=2000), "threads is out of range"),
    (lambda: al.Task("link4", "xy", [1.0, 2.0], -1.0), "Task: gain is negative"),
    (lambda: al.Task("link4", "xy", [1.0, 2.0], np.inf), "Task: gain is not finite"),
    (lambda: al.Task("link4", "xy", [1.0, 2.0], np.ones((2, 3))), "Task: gain has the wrong shape"),
    (lambda: al.Task("link4", "xy", [1.0, 2.0], motion=al.Hold([1.0, 2.0])), "Task: motion is given twice"),
    (lambda: al.Task("link4", "xy", "there"), "Task: target is not an array of real numbers"),
    (lambda: al.AxisTask("link4", [0.0, 0.0, 0.0]), "axis has no direction"),
    (lambda: al.PostureTask(joints="joint1"), "joints is a single name"),
    (lambda: al.CentreOfMassTask("w"), "axes is not made of"),
    (lambda: al.JointLimitTask(1.0, 0.7), "margin is not a part of the range"),
    (lambda: al.PriorityVelocity(ARM, []), "tasks is empty"),
    (lambda: al.PriorityVelocity(ARM, TIP), "tasks is a single task"),
    (lambda: al.PriorityVelocity(ARM, 3), "tasks is not a list"),
    (lambda: al.PriorityVelocity(ARM, [TIP, "xy"]), r"tasks is of the wrong type: expected tasks, got str \(first bad index 1\)"),
    (
        lambda: al.PriorityVelocity(ARM, [TIP, al.Task("link9", "xy", [1.0, 1.0])]),
        r"tasks\[1\].frame is unknown: expected one of the frames",
    ),
    (lambda: al.PriorityVelocity(ARM, [al.Task("link4", "xy")]), r"tasks\[0\].target is missing"),
    (
        lambda: al.PriorityVelocity(ARM, [al.Task("link4", "xy", [1.0])]),
        r"tasks\[0\].target has the wrong shape: expected \(2,\), got \(1,\)",
    ),
    (lambda: al.PriorityVelocity(ARM, [al.Task("link4", "xy", al.Hold([1.0]))]), r"tasks\[0\].target has the wrong shape"),
    (lambda: al.PriorityVelocity(ARM, [al.Task("link4", "xy", [1.0, 1.0], [1.0, 1.0, 1.0])]), r"tasks\[0\].gain has the wrong shape"),
    (lambda: al.PriorityVelocity(ARM, [al.Task("link4", "xy", [1.0, 1.0], -np.eye(2))]), r"tasks\[0\].gain is not positive definite"),
    (lambda: al.PriorityVelocity(ARM, [TIP], "best"), "method is unknown"),
    (lambda: al.PriorityVelocity(ARM, [TIP], eps=-1.0), "eps is not positive"),
    (lambda: al.PriorityVelocity(ARM, [TIP], eps=[0.1, 0.2]), "eps has the wrong shape"),
    (lambda: al.PriorityVelocity(ARM, [TIP], "sns"), "v_max is missing"),
    (lambda: al.PriorityVelocity(ARM, [al.JointLimitTask()]), "no joint with limits"),
    (lambda: al.PriorityVelocity(ARM, [al.RelativeTask("link4", "link4", "x", [0.0])]), "reference is the frame itself"),
    (lambda: al.PriorityVelocity(models.PR, [TIP]), "arm has no links"),
    (lambda: al.PriorityVelocity("arm", [TIP]), "arm is of the wrong type"),
    (lambda: al.PriorityAcceleration(ARM, [TIP], "sns"), "v_max is missing"),
    (lambda: al.PriorityAcceleration(ARM, [TIP], joint_damping=-1.0), "joint_damping is not a damping"),
    (lambda: al.PrioritySolver.for_arm(ARM, []), "tasks is empty"),
    (lambda: al.PrioritySolver.for_arm(ARM, [TIP]).solve(Q, [[1.0]]), r"velocities\[0\] has the wrong shape: expected \(..., 2\)"),
    (lambda: al.PrioritySolver.for_arm(ARM, [TIP]).solve(Q, []), "velocities has the wrong number of levels"),
    (lambda: al.PrioritySolver.for_arm(ARM, [TIP]).solve(Q[:3], [[1.0, 1.0]]), "q has the wrong shape"),
    (lambda: al.PrioritySolver.for_arm(ARM, [TIP]).solve([0.0, np.nan, 0.0, 0.0], [[1.0, 1.0]]), r"q is not finite.*index 1"),
    (lambda: al.PrioritySolver.for_arm(ARM, [TIP]).solve(Q, [np.array([1.0, np.inf])]), r"velocities\[0\] is not finite.*index 1"),
    (lambda: al.PrioritySolver.for_arm(ARM, [TIP]).solve(np.array([0.0, np.inf, 0.0, 0.0]), [np.ones(2)]), r"q is not finite.*index 1"),
    (lambda: al.PrioritySolver.for_arm(ARM, [TIP]).solve(np.zeros((3, 4)), [np.ones((2, 2))]), "do not broadcast"),
    (lambda: al.PrioritySolver.for_arm(ARM, [TIP]).diagnose([0.0], None), "q has the wrong shape"),
    (lambda: al.inverse_kinematics(ARM, [ELBOW], Q), r"tasks\[0\].target moves"),
    (lambda: al.inverse_kinematics(ARM, [TIP], Q[:2]), "q0 has the wrong shape"),
    (lambda: al.inverse_kinematics(ARM, [TIP], Q, tolerance=0.0), "tolerance is not positive"),
    (lambda: al.inverse_kinematics(ARM, [TIP], Q, restarts=-1), "restarts is not a count"),
    (lambda: al.inverse_kinematics(ARM, [TIP], Q, method="sns"), "method bounds velocities"),
    (lambda: al.inverse_kinematics(ARM, [al.AxisTask("link4", [1, 0, 0], [0.0, 0.0, 0.0])], Q), "target has no direction"),
]


@pytest.mark.parametrize(("call", "words"), BAD, ids=[words for _, words in BAD])
def test_bad_input_is_refused(call: Callable[[], Any], words: str) -> None:
    with pytest.raises(al.InputError, match=words):
        call()


def test_plants_and_methods_that_do_not_fit() -> None:
    law = al.PriorityVelocity(ARM, [TIP])
    with pytest.raises(al.InputError, match="law is made for another plant"):
        al.simulate(al.RigidArm(ARM), law, Q, t_end=0.1, dt=0.01)
    with pytest.raises(al.InputError, match="method needs derivatives, which PriorityVelocity has not"):
        al.simulate(al.VelocityArm(ARM), law, Q, t_end=0.1, method="radau5")
    # In a sampled loop the input is constant between samples, so no derivative is needed.
    al.simulate(al.VelocityArm(ARM), law, Q, t_end=0.1, method="radau5", sample_time=0.02)


def test_batches_of_a_law_are_its_single_runs() -> None:
    law, q0 = al.PriorityVelocity(ARM, [TIP, ELBOW]), np.random.default_rng(0).uniform(-1.0, 1.0, (5, 4))
    batch = al.simulate_batch(al.VelocityArm(ARM), law, q0, t_end=0.2, dt=0.01)
    for i, start in enumerate(q0):
        np.testing.assert_array_equal(batch[i].q, al.simulate(al.VelocityArm(ARM), law, start, t_end=0.2, dt=0.01).q)
    laws = [al.PriorityVelocity(ARM, [TIP]), al.PriorityVelocity(ARM, [TIP, ELBOW]), al.PriorityVelocity(ARM, [ELBOW])]
    mixed = al.simulate_batch(al.VelocityArm(ARM), laws, q0[:3], t_end=0.2, dt=0.01, monitors=False)
    for i, each in enumerate(laws):
        np.testing.assert_array_equal(mixed[i].q, al.simulate(al.VelocityArm(ARM), each, q0[i], t_end=0.2, dt=0.01, monitors=False).q)


def test_arrays_of_any_kind_and_out() -> None:
    solver = al.PrioritySolver.for_arm(ARM, [TIP, ELBOW])
    velocities = [np.array([1.0, 2.0]), np.array([0.5, -1.0])]
    wanted = solver.solve(Q, velocities)
    np.testing.assert_array_equal(solver.solve(list(Q), [list(v) for v in velocities]), wanted)
    np.testing.assert_array_equal(solver.solve(Q[::-1].copy()[::-1], tuple(velocities)), wanted)
    out = np.empty(4)
    assert solver.solve(Q, velocities, out=out) is out
    np.testing.assert_array_equal(out, wanted)
    with pytest.raises(al.InputError, match="out overlaps an argument"):
        q = Q.copy()
        solver.solve(q, velocities, out=q)
    with pytest.raises(al.InputError, match="out has the wrong shape"):
        solver.solve(Q, velocities, out=np.empty(3))
    grid = solver.solve(np.tile(Q, (2, 3, 1)), [np.tile(velocities[0], (3, 1)), velocities[1]])
    assert grid.shape == (2, 3, 4)
    np.testing.assert_array_equal(grid, np.broadcast_to(wanted, (2, 3, 4)))
    assert solver.solve(np.zeros((0, 4)), velocities).shape == (0, 4)


def test_one_thread_or_many_give_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    solver = al.PrioritySolver.for_arm(ARM, [TIP, ELBOW])
    q = np.random.default_rng(2).uniform(-3.0, 3.0, (3000, 4))
    answers = []
    for threads in ("1", "3"):
        monkeypatch.setenv("ARMLET_NUM_THREADS", threads)
        answers.append(solver.solve(q, [np.ones(2), np.zeros(2)]))
    np.testing.assert_array_equal(*answers)


def test_out_of_reach_is_a_status() -> None:
    found = al.inverse_kinematics(ARM, [al.Task("link4", "xy", [100.0, 0.0])], Q, restarts=2)
    assert not found and found.status is al.Status.INFEASIBLE and found.reached == [False] and found.restarts == 2
    both = al.inverse_kinematics(ARM, [TIP, al.PostureTask(np.zeros(4))], Q, restarts=2)
    assert both.status is al.Status.DEGRADED and both.reached == [True, False]
    # The posture is the nearest one that the tip's task allows, so its error has no component in the null space.
    J = ARM.jacobian(both.q, "link4")[:2]
    null = np.linalg.svd(J)[2][2:]
    assert np.abs(null @ both.errors[1]).max() <= 1e-6
