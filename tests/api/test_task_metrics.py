"""Errors of tasks in metres: compared with the monitors and with direct computation, in batches and in files; and errors of any frame."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

import armlet as al
from armlet.run.metrics import PER_TASK

ARM = al.planar_arm([1.0, 1.0, 0.25, 0.25])
TWO = models.TWO_HEAVY_LINKS
Q0 = [0.0, 1.2, 0.4, 0.4]
TASKS = [al.Task("link4", "xy", [1.2, 1.0], 5.0), al.PostureTask([0.1] * 4, 1.0), al.Task("link2", "rz x", [0.3, 0.9], 5.0)]
MOTION = al.Sinusoid([0.4, 0.5], [0.1, 0.1], [2.0, 3.0], [0.0, 0.0])
HOLD = al.CartesianImpedance(TWO, [0.6, 0.3], [300.0, 200.0], [40.0, 30.0], frame="link2", axes="xy")
FOLLOW = al.ElasticTracking(TWO, MOTION, [300.0, 200.0], [40.0, 30.0], 800.0, 0.4, 0.1, frame="link2", axes="xy")


def test_errors_equal_those_of_the_monitors() -> None:
    """The monitor of a position task is the same distance, computed by the loop."""
    run = al.simulate(al.VelocityArm(ARM), al.PriorityVelocity(ARM, TASKS), Q0, t_end=1.0, dt=1e-2)
    assert run.position_error is not None and run.position_error.shape == (101, 2)
    np.testing.assert_allclose(run.position_error[:, 0], run.monitors["error_1"], rtol=0.0, atol=1e-14)
    # The second column is the x row of the last task. A posture has no frame, and rz is not a position.
    x = np.abs(0.9 - ARM.position(run.q, "link2")[:, 0])
    np.testing.assert_allclose(run.position_error[:, 1], x, rtol=0.0, atol=1e-15)
    found = run.metrics()
    assert found["position_error_rms"].shape == (2,) and found.unit("position_error_rms") == "m"
    assert list(found.columns())[24:26] == ["position_error_rms1", "position_error_rms2"]
    np.testing.assert_array_equal(found["position_error_peak"], run.position_error.max(axis=0))
    np.testing.assert_array_equal(found["position_error_final"], run.position_error[-1])
    squares = run.position_error**2
    np.testing.assert_allclose(found["position_error_rms"], np.sqrt((squares[1:] + squares[:-1]).sum(axis=0) / 2.0 * 1e-2), rtol=1e-12)
    assert f"position_error_final {found['position_error_final'][0]:.6g} m" in str(found)


def test_targets_that_move() -> None:
    run = al.simulate(al.ElasticArm(TWO, 800.0, 0.4), FOLLOW, [0.2, 0.9], t_end=0.5, dt=5e-4, record_every=50)
    wanted = np.array([MOTION(float(t))[0] for t in run.t])
    expected = np.linalg.norm(wanted - TWO.position(run.q, "link2")[:, :2], axis=-1)
    assert run.position_error is not None
    np.testing.assert_allclose(run.position_error[:, 0], expected, rtol=0.0, atol=1e-15)


def test_rows_of_a_batch_are_runs(tmp_path: Path) -> None:
    """A batch equals single runs: with one law or one law per row, for arms of different lengths, as metrics only, and after saving."""
    q0 = np.random.default_rng(3).uniform(0.2, 0.8, (5, 2))
    arms = [al.planar_arm([0.5, length], masses=[3.0, 2.0]) for length in (0.3, 0.35, 0.4, 0.45, 0.5)]
    laws = [
        al.CartesianImpedance(TWO, [x, 0.3], 300.0 * np.ones(2), 40.0 * np.ones(2), frame="link2", axes="xy")
        for x in (0.3, 0.4, 0.5, 0.6, 0.7)
    ]
    options: dict[str, Any] = {"t_end": 0.5, "dt": 1e-3, "record_every": 10}
    cases: list[tuple[Any, Any]] = [(al.RigidArm(TWO), HOLD), (al.RigidArm(TWO), laws), ([al.RigidArm(arm) for arm in arms], HOLD)]
    for plants, law in cases:
        batch = al.simulate_batch(plants, law, q0, **options)
        found = batch.metrics()
        assert found["position_error_rms"].shape == (5, 1)
        for i, run in enumerate(batch):
            for name in PER_TASK:
                np.testing.assert_allclose(found[name][i], run.metrics()[name], rtol=1e-12, err_msg=name)
            arm = arms[i] if isinstance(plants, list) else TWO
            target = [(0.3, 0.4, 0.5, 0.6, 0.7)[i], 0.3] if law is laws else [0.6, 0.3]
            by_hand = np.linalg.norm(arm.position(run.q[-1], "link2")[:2] - target)
            np.testing.assert_allclose(found["position_error_final"][i, 0], by_hand, rtol=1e-12)
        alone = al.simulate_batch(plants, law, q0, **options, keep="metrics").metrics()
        batch.save(tmp_path / "batch.npz")
        again = al.load(tmp_path / "batch.npz").metrics()
        for name in PER_TASK:
            # Sums and squares round differently if they are computed record by record.
            np.testing.assert_allclose(alone[name], found[name], rtol=1e-12)
            np.testing.assert_array_equal(again[name], found[name])


def test_a_row_that_failed_is_nan() -> None:
    v0 = np.zeros((3, 2))
    v0[1] = 1e60
    batch = al.simulate_batch(al.RigidArm(TWO), HOLD, np.full((3, 2), 0.5), v0=v0, t_end=0.1, dt=1e-2)
    found = batch.metrics()["position_error_rms"]
    assert np.isnan(found[1]).all() and np.isfinite(found[[0, 2]]).all()


def test_any_frame_of_a_law_of_joints() -> None:
    law = al.ComputedTorque(TWO, al.Quintic([0.0, 0.5], [0.8, 1.2], 0.3), 100.0, 20.0)
    run = al.simulate(al.RigidArm(TWO), law, [0.1, 0.4], t_end=0.5, dt=1e-3)
    assert run.position_error is None and not set(PER_TASK) & set(run.metrics())
    desired = run.desired()
    assert desired is not None
    distance = np.linalg.norm(TWO.position(run.q, "link1") - TWO.position(desired[0], "link1"), axis=-1)
    found = run.metrics(frame="link1")
    np.testing.assert_allclose(found["position_error_peak"], [distance.max()], rtol=1e-12)
    batch = al.simulate_batch([al.RigidArm(TWO)] * 2, law, [[0.1, 0.4], [0.0, 0.5]], t_end=0.5, dt=1e-3)
    np.testing.assert_allclose(batch.metrics(frame="link1")["position_error_peak"][0], found["position_error_peak"], rtol=1e-9)


def test_refusals(tmp_path: Path) -> None:
    run = al.simulate(al.RigidArm(TWO), HOLD, [0.1, 0.6], t_end=0.1, dt=1e-3)
    with pytest.raises(al.InputError, match="metrics: frame is given for a run with no reference of joints: expected None"):
        run.metrics(frame="link1")
    run = al.simulate(al.RigidArm(TWO), al.PDGravity(TWO, [0.1, 0.2], 10.0, 1.0), [0.1, 0.6], t_end=0.1, dt=1e-3)
    with pytest.raises(al.InputError, match="link9"):
        run.metrics(frame="link9")
    run.save(tmp_path / "run.npz")
    with pytest.raises(al.InputError, match="no arm, as a run that was read from a file"):
        al.load(tmp_path / "run.npz").metrics(frame="link1")


def test_the_rotation_from_the_target(tmp_path: Path) -> None:
    """The metric is the norm of the law's error in its orientation rows, for any angle. A saved run keeps it."""
    arm = models.SIX_AXES
    rng = np.random.default_rng(5)
    for axes, rows in (("xyz rx ry rz", [3, 4, 5]), ("z rx rz", [1, 2]), ("rx ry rz", [0, 1, 2])):
        m = len(axes.split()[0].replace("r", "")) if axes.startswith(("xyz", "z ")) else 0
        target = rng.uniform(-1.5, 1.5, m + len(rows))
        law = al.CartesianImpedance(arm, target, 1.0, 1.0, frame="flange", axes=axes)
        t, q = np.linspace(0.0, 1.0, 20), rng.uniform(-3.0, 3.0, (20, 6))
        run = al.Run({"t": t, "q": q, "v": 0.0 * q}, law=law, plant=al.RigidArm(arm))
        expected = [np.linalg.norm(law.terms(0.0, each, 0.0 * each)["e"][rows]) for each in q]
        assert run.orientation_error is not None
        np.testing.assert_allclose(run.orientation_error[:, 0], expected, rtol=0.0, atol=2e-14)
    run.save(path := tmp_path / "run.npz")
    np.testing.assert_array_equal(al.load(path).orientation_error, run.orientation_error)
