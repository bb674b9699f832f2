"""Distances of spheres and capsules: geometry by sampling, closed loops that keep a distance, parallel capsules, and scenario files."""

from __future__ import annotations

import pickle
from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]
SEVEN: al.Arm = models.SEVEN_AXES
TOOL = SEVEN.frame_names[-1]
PLANAR = models.THREE_LINKS
START = np.array([0.3, 0.8, 0.4])
#: A motion of the tip from its start past the obstacles at (0.45, 0.95).
PASSING = al.Quintic(PLANAR.position(START, "link3")[:2], [0.25, 0.9], 2.0)
METHODS = ["exact", "clamp", "damped"]
#: A capsule along the last link of the planar arm, whose frame is at its end.
LINK: dict[str, Any] = {"points": [[0.0, 0.0, 0.0], [-0.3, 0.0, 0.0]], "radius": 0.03}


def distances(law: Any, q: Array) -> Array:
    """The distances of all rows of the first task of a law, which has the bound 1e3 m."""
    return np.asarray(1e3 - law.terms(0.0, q, np.zeros(q.size))["e"][0])


def test_the_smallest_row_is_the_distance_of_sampled_points() -> None:
    rng = np.random.default_rng(0)
    places = np.linspace(0.0, 1.0, 401)[:, None]
    for count in (1, 2):
        for _ in range(10):
            points, others = rng.uniform(-0.5, 0.5, (count, 3)), rng.uniform(-0.8, 0.8, (2, 3))
            task = al.DistanceTask(
                TOOL, None, 1e3, points=points if count > 1 else points[0], radius=0.02, other_points=others, other_radius=0.03
            )
            q = rng.uniform(-1.0, 1.0, 7)
            ends = points @ SEVEN.pose(q, TOOL)[:3, :3].T + SEVEN.position(q, TOOL)
            a, b = (p[0] + places * (p[-1] - p[0]) for p in (ends, others))
            sampled = np.linalg.norm(a[:, None] - b[None], axis=2).min() - 0.05
            found = distances(al.PriorityVelocity(SEVEN, [task], "exact"), q)
            # Neighbouring samples are 5 mm apart or nearer.
            assert found.shape == ((5,) if count > 1 else (1,)) and sampled - 3e-3 <= found.min() <= sampled + 1e-12


def test_the_jacobian_is_the_derivative_of_the_distance() -> None:
    rng = np.random.default_rng(1)
    task = al.DistanceTask(
        TOOL, SEVEN.frame_names[2], 1e3, points=rng.uniform(-0.3, 0.3, (2, 3)), other_points=rng.uniform(-0.3, 0.3, (2, 3))
    )
    law = al.PriorityAcceleration(SEVEN, [task], "exact")
    for _ in range(5):
        q, v = rng.uniform(-1.0, 1.0, (2, 7))
        h = 1e-5
        ahead, behind, here = (law.terms(0.0, q + s * h * v, v) for s in (1.0, -1.0, 0.0))
        # Errors are bounds minus distances. Central differences have an error of h^2.
        np.testing.assert_allclose((behind["e"][0] - ahead["e"][0]) / (2 * h), here["J"][0] @ v, rtol=0.0, atol=1e-6)
        np.testing.assert_allclose((ahead["J"][0] - behind["J"][0]) / (2 * h), here["J_dot"][0], rtol=0.0, atol=1e-5)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("capsule", [False, True])
def test_a_distance_holds_along_a_motion(method: str, capsule: bool) -> None:
    """The tip follows a target through a ball or a capsule, and keeps its distance."""
    obstacle = {"other_points": [[0.45, 0.95, -0.2], [0.45, 0.95, 0.2]] if capsule else [0.45, 0.95, 0.0], "other_radius": 0.1}
    keep = al.DistanceTask("link3", None, 0.02, 8.0, **LINK, **obstacle)
    tip = al.Task("link3", "xy", PASSING, 6.0)
    law = al.PriorityVelocity(PLANAR, [keep, tip], method, v_max=3.0)
    run = al.simulate(al.VelocityArm(PLANAR), law, START, t_end=3.0, dt=0.005)
    found = np.array([0.02 - law.terms(0.0, q, np.zeros(3))["e"][0].max() for q in run.q[::10]])
    # RK4 of d_dot >= -K (d - 0.02) with K dt = 0.04.
    assert found.min() >= 0.02 - 1e-6
    assert any(hold.name.endswith("of level 1") and hold.level == 2 for hold in run.active)


@pytest.mark.parametrize("sample_time", [None, 2e-3])
def test_accelerations_keep_a_distance(sample_time: float | None) -> None:
    keep = al.DistanceTask("link3", None, 0.05, 100.0, radius=0.03, other_points=[0.45, 0.95, 0.0], other_radius=0.1)
    tip = al.Task("link3", "xy", PASSING, 60.0)
    law = al.PriorityAcceleration(PLANAR, [keep, tip], "exact")
    run = al.simulate(al.RigidArm(PLANAR), law, START, t_end=3.0, dt=2e-3, sample_time=sample_time)
    nearest = np.linalg.norm(PLANAR.position(run.q, "link3")[:, :2] - [0.45, 0.95], axis=1).min() - 0.13
    # Torque that is held for a sample adds an error of its square.
    assert 0.05 - (1e-6 if sample_time is None else 1e-3) <= nearest < 0.1


def test_parallel_capsules_make_no_jump() -> None:
    """A link turns through the direction of a capsule below it, while its middle is pushed down: the velocities are continuous."""
    table = {"other_points": [[-2.0, 0.0, 0.0], [2.0, 0.0, 0.0]], "other_radius": 0.05}
    keep = al.DistanceTask("link3", None, 0.1, 5.0, **LINK, **table)
    law = al.PriorityVelocity(PLANAR, [keep, al.Task("link3", "xy", [0.8, -0.5], 1.0), al.PostureTask([0.0, 0.0, 0.0], 0.3)], "exact")
    found = []
    for angle in np.linspace(-1e-3, 1e-3, 201):
        # The last link has the direction `angle`, and its middle is at a height of 0.19 m.
        q = np.array([0.9, 0.0, 0.0])
        q[1] = np.arcsin((0.19 + 0.15 * np.sin(angle) - 0.3 * np.sin(angle) - 0.5 * np.sin(q[0])) / 0.4) - q[0]
        q[2] = angle - q[0] - q[1]
        found.append(law(0.0, q, np.zeros(3)))
    steps = np.abs(np.diff(found, axis=0)).max(axis=0)
    assert np.abs(found).max() > 0.1 and steps.max() < 1e-3


def test_a_start_too_near_moves_away_with_the_gain() -> None:
    keep = al.DistanceTask("link3", None, 0.3, 4.0, other_points=[0.5, 0.9, 0.0])
    run = al.simulate(al.VelocityArm(PLANAR), al.PriorityVelocity(PLANAR, [keep], "exact"), START, t_end=1.0, dt=0.005)
    d = np.linalg.norm(PLANAR.position(run.q, "link3")[:, :2] - [0.5, 0.9], axis=1)
    assert d[0] < 0.3
    np.testing.assert_allclose(0.3 - d, (0.3 - d[0]) * np.exp(-4.0 * run.t), rtol=0.0, atol=1e-6)


def test_inverse_kinematics_keeps_distances_and_intervals() -> None:
    ball = [0.55, 0.55, 0.0]
    tip = al.Task("link3", "xy", [0.9, 0.5])
    keep = al.DistanceTask("link2", None, 0.05, radius=0.05, other_points=ball, other_radius=0.1)
    band = al.PostureTask(joints=["joint3"], lower=0.6, upper=0.9)
    free = al.inverse_kinematics(PLANAR, [tip], START)
    found = al.inverse_kinematics(PLANAR, [tip, keep, band], START)
    assert found and found.status is al.Status.SUCCESS and all(np.abs(errors).max() <= 1e-9 for errors in found.errors)
    assert np.linalg.norm(PLANAR.position(found.q, "link2") - ball) >= 0.2 - 1e-9 and 0.6 - 1e-9 <= found.q[2] <= 0.9 + 1e-9
    assert np.linalg.norm(PLANAR.position(free.q, "link2") - ball) < 0.2 or not 0.6 <= free.q[2] <= 0.9
    # A distance that no posture has is an unreachable task, and not an error.
    far = al.inverse_kinematics(PLANAR, [al.DistanceTask("link3", None, 5.0)], START, restarts=2)
    assert far.status is al.Status.INFEASIBLE and far.errors[0][0] == pytest.approx(5.0 - 1.2, abs=1e-6)
    batch = al.inverse_kinematics(PLANAR, [al.Task("link3", "xy", [[0.9, 0.5], [0.5, 0.9]]), band], START)
    assert batch.reached.all() and ((batch.q[:, 2] >= 0.6 - 1e-9) & (batch.q[:, 2] <= 0.9 + 1e-9)).all()


TABLE = """
[arm]
kind = "planar_arm"
lengths = [0.5, 0.4, 0.3]

[plant]
kind = "VelocityArm"

[law]
kind = "PriorityVelocity"
method = "exact"

[[law.tasks]]
kind = "DistanceTask"
frame = "link3"
lower = 0.02
gain = 8.0
points = [[0.0, 0.0, 0.0], [-0.3, 0.0, 0.0]]
radius = 0.03
other_points = [0.5, 0.7, 0.0]
other_radius = 0.1

[[law.tasks]]
kind = "Task"
frame = "link3"
axes = "xy"
gain = 3.0
target = [0.5, 0.8]

[[law.tasks]]
kind = "PostureTask"
gain = 1.0
target = [0.3, 0.8, 0.4]
joins = true
weight = 0.1

[run]
q0 = [0.3, 0.8, 0.4]
t_end = 1.0
dt = 0.01
"""


def test_scenario_files_have_distances_and_levels_of_several_tasks(tmp_path: Any) -> None:
    (tmp_path / "keep.toml").write_text(TABLE)
    run = al.Scenario.load(tmp_path / "keep.toml").run()
    tasks = [
        al.DistanceTask("link3", None, 0.02, 8.0, **LINK, other_points=[0.5, 0.7, 0.0], other_radius=0.1),
        [al.Task("link3", "xy", [0.5, 0.8], 3.0), (al.PostureTask([0.3, 0.8, 0.4], 1.0), 0.1)],
    ]
    same = al.simulate(al.VelocityArm(PLANAR), al.PriorityVelocity(PLANAR, tasks, "exact"), START, t_end=1.0, dt=0.01)
    np.testing.assert_array_equal(run.q, same.q)
    assert "residual_2" in run.monitors and "residual_3" not in run.monitors
    (tmp_path / "keep.toml").write_text(TABLE.replace('kind = "DistanceTask"', 'kind = "DistanceTask"\njoins = true'))
    with pytest.raises(al.InputError, match=r"tasks\[0\].joins: has no level above"):
        al.Scenario.load(tmp_path / "keep.toml").run()


REFUSED: list[tuple[Any, str]] = [
    (lambda: al.DistanceTask("link3"), "DistanceTask: lower is missing: expected lower or upper"),
    (lambda: al.DistanceTask("link3", None, 0.1, points=[0.0, 1.0]), "points has the wrong shape"),
    (lambda: al.PriorityVelocity(PLANAR, [al.DistanceTask("link3", None, 0.1, radius=-1.0)]), r"radius is not a radius"),
    (lambda: al.PriorityVelocity(PLANAR, [al.DistanceTask("link3", "link3", 0.1)]), "other is the frame itself"),
    (lambda: al.PriorityVelocity(PLANAR, [al.DistanceTask(None, None, 0.1)]), "other is the frame itself"),
    (lambda: al.PriorityVelocity(PLANAR, [al.DistanceTask("tip", None, 0.1)]), "frame"),
    (lambda: al.PriorityVelocity(PLANAR, [al.DistanceTask("link3", None, 0.1, points=np.zeros((2, 3)))]), "points has two equal ends"),
    (lambda: al.PriorityVelocity(PLANAR, [al.DistanceTask("link3", None, 0.1, other_points=[np.inf, 0.0, 0.0])]), "other_points"),
    (lambda: al.DistanceTask("link3", None, 0.1, "fast"), "DistanceTask: gain"),
]


@pytest.mark.parametrize(("call", "words"), REFUSED, ids=range(len(REFUSED)))
def test_wrong_distances_are_refused(call: Any, words: str) -> None:
    with pytest.raises(al.InputError, match=words):
        call()


def test_pickles_and_replacements() -> None:
    law = al.PriorityVelocity(PLANAR, [al.DistanceTask("link3", None, 0.02, 8.0, **LINK, other_points=[0.5, 0.7, 0.0])])
    copy = pickle.loads(pickle.dumps(law))
    assert repr(copy) == repr(law) and "radius=0.03" in repr(law)
    np.testing.assert_array_equal(copy(0.0, START, np.zeros(3)), law(0.0, START, np.zeros(3)))
