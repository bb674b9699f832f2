"""What a law tracks: its errors are the same in a run, a batch, a batch of metrics, a gradient and a file, for every law and target."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from matplotlib.figure import Figure

import armlet as al
from armlet.run.metrics import PER_TASK

ARM = models.TWO_LINKS
STIFFNESS, MOTORS = np.array([800.0, 500.0]), np.array([0.4, 0.25])
Q0 = [0.2, 0.9]
# Fixed steps of the recorded times, so that the trapezoidal rule of the test is that of the metrics.
OPTIONS: dict[str, Any] = {"t_end": 0.2, "dt": 5e-4}
TIP: dict[str, Any] = {"frame": "link2", "axes": "xy"}
JOINTS = {
    "constant": [0.3, 0.5],
    "Hold": al.Hold([0.3, 0.5]),
    "Quintic": al.Quintic([0.0, 0.0], [0.3, 0.5], 0.5),
    "Sinusoid": al.Sinusoid([0.1, 0.2], [0.1, 0.1], [1.0, 2.0], [0.0, 0.0]),
}
FRAMES = {
    "constant": [0.6, 0.4],
    "Hold": al.Hold([0.6, 0.4]),
    "Quintic": al.Quintic([0.8, 0.1], [0.6, 0.4], 0.5),
    "Sinusoid": al.Sinusoid([0.6, 0.4], [0.05, 0.05], [1.0, 2.0], [0.0, 0.0]),
}
RIGID, ELASTIC, VELOCITY = al.RigidArm(ARM), al.ElasticArm(ARM, STIFFNESS, MOTORS), al.VelocityArm(ARM)
Make = Callable[[Any], al.Law]
ELASTIC_TIP = (300.0, 40.0, STIFFNESS, MOTORS, MOTORS / 10)
#: Laws with a reference of the joints, and the targets that they accept.
OF_JOINTS: dict[str, tuple[al.Plant, Make, tuple[str, ...]]] = {
    "PID": (RIGID, lambda target: al.PID(ARM, target, 80.0, 30.0, 25.0), tuple(JOINTS)),
    "ComputedTorque": (RIGID, lambda target: al.ComputedTorque(ARM, target, 100.0, 20.0), ("Hold", "Quintic", "Sinusoid")),
    "Adaptive": (RIGID, lambda target: al.Adaptive(ARM, target, 100.0, 20.0, 0.1), ("Hold", "Quintic", "Sinusoid")),
    "PDGravity": (RIGID, lambda target: al.PDGravity(ARM, target, 80.0, 25.0), ("constant",)),
    "JointImpedance": (ELASTIC, lambda target: al.JointImpedance(ARM, target, 80.0, 25.0, STIFFNESS, MOTORS, MOTORS), tuple(JOINTS)),
    "JointTracking": (
        ELASTIC,
        lambda target: al.JointTracking(ARM, target, 80.0, 25.0, STIFFNESS, MOTORS),
        ("Hold", "Quintic", "Sinusoid"),
    ),
    "MotorPD": (ELASTIC, lambda target: al.MotorPD(ARM, target, 80.0, 25.0, STIFFNESS), tuple(JOINTS)),
    "StateFeedback": (ELASTIC, lambda target: al.StateFeedback(ARM, target, 80.0, 25.0, 0.1, 0.01, STIFFNESS), tuple(JOINTS)),
}
OF_FRAMES: dict[str, tuple[al.Plant, Make, tuple[str, ...]]] = {
    "CartesianImpedance": (RIGID, lambda target: al.CartesianImpedance(ARM, target, 300.0, 40.0, **TIP), tuple(FRAMES)),
    "ElasticImpedance": (ELASTIC, lambda target: al.ElasticImpedance(ARM, target, *ELASTIC_TIP, **TIP), tuple(FRAMES)),
    "ElasticTracking": (ELASTIC, lambda target: al.ElasticTracking(ARM, target, *ELASTIC_TIP, **TIP), ("Hold", "Quintic", "Sinusoid")),
    "PriorityVelocity": (VELOCITY, lambda target: al.PriorityVelocity(ARM, [al.Task("link2", "xy", target, 5.0)]), tuple(FRAMES)),
}


def cases(table: dict[str, tuple[al.Plant, Make, tuple[str, ...]]], targets: dict[str, Any]) -> list[Any]:
    """One case per law and target, and one for each law of rigid arms inside a `Guarded` law."""
    found = []
    for name, (plant, make, kinds) in table.items():
        for kind in kinds:
            law = make(targets[kind])
            found.append(pytest.param(plant, law, targets[kind], id=f"{name} {kind}"))
            if isinstance(plant, al.RigidArm):
                found.append(pytest.param(plant, guarded(law), targets[kind], id=f"Guarded {name} {kind}"))
    return found


def guarded(law: al.Law) -> al.Guarded:
    return al.Guarded(law, al.MomentumObserver(ARM, 30.0))


def positions(target: Any, t: np.ndarray) -> np.ndarray:
    """The reference at the times `t`, (K, n), computed from the target that the law was given."""
    return np.array([target(float(time))[0] if callable(target) else target for time in t])


def rms(values: np.ndarray, t: np.ndarray) -> np.ndarray:
    return np.sqrt(np.trapezoid(values**2, t, axis=0) / (t[-1] - t[0]))


def measured(plant: al.Plant, law: al.Law, tmp_path: Path) -> tuple[Any, list[tuple[str, Any]]]:
    """A run, and its metrics by each route that computes them."""
    run = al.simulate(plant, law, Q0, **OPTIONS)
    batch = al.simulate_batch(plant, law, [Q0, Q0], **OPTIONS)
    ends = al.simulate_batch(plant, law, [Q0, Q0], keep="metrics", **OPTIONS)
    run.save(tmp_path / "run.npz")
    found = [
        ("run", run.metrics()),
        ("row", batch[1].metrics()),
        ("pickle", pickle.loads(pickle.dumps(run)).metrics()),
        ("file", al.load(tmp_path / "run.npz").metrics()),
    ]
    return run, found + [(name, {key: each[1] for key, each in of.metrics().items()}) for name, of in (("batch", batch), ("ends", ends))]


@pytest.mark.parametrize(("plant", "law", "target"), cases(OF_JOINTS, JOINTS))
def test_errors_of_joints(plant: al.Plant, law: al.Law, target: Any, tmp_path: Path) -> None:
    run, found = measured(plant, law, tmp_path)
    error = positions(target, run.t) - run.q
    for route, metrics in found:
        # Sums of 401 terms of order one, in another order.
        np.testing.assert_allclose(metrics["error_rms"], rms(error, run.t), rtol=1e-12, atol=1e-15, err_msg=route)
        np.testing.assert_allclose(metrics["error_peak"], np.abs(error).max(axis=0), rtol=1e-13, atol=1e-15, err_msg=route)
        np.testing.assert_allclose(metrics["error_final"], np.abs(error[-1]), rtol=1e-13, atol=1e-15, err_msg=route)
        assert list(metrics) == list(found[0][1]), route
    value, _ = al.gradient("error_rms", plant, law, Q0, ["q0"], **OPTIONS)
    # The loss is the sum of the squares, and the run of the gradient is the same run.
    assert value == pytest.approx(float((rms(error, run.t) ** 2).sum()), rel=1e-12)
    desired, reference = run.desired(), run.reference()
    assert reference is not None
    # The laws of motors compute the target of the links from that of the motors, with one rounding.
    np.testing.assert_allclose(np.broadcast_to(reference[0], run.q.shape), positions(target, run.t), rtol=2.3e-16, atol=0.0)
    assert (run.target is None) == (desired is not None)
    axes = run.plot(Figure())
    titles = [ax.get_title(loc="left") or ax.get_title() for ax in axes.flat]
    assert any("Tracking error" in title for title in titles) == (desired is not None)


@pytest.mark.parametrize(("plant", "law", "target"), cases(OF_FRAMES, FRAMES))
def test_errors_of_frames(plant: al.Plant, law: al.Law, target: Any, tmp_path: Path) -> None:
    run, found = measured(plant, law, tmp_path)
    distance = np.linalg.norm(positions(target, run.t) - ARM.position(run.q, "link2")[:, :2], axis=-1)
    for route, metrics in found:
        expected = [rms(distance, run.t), distance.max(), distance[-1]]
        np.testing.assert_allclose([metrics[name][0] for name in PER_TASK], expected, rtol=1e-12, err_msg=route)
        assert np.isnan(metrics["error_rms"]).all() and list(metrics) == list(found[0][1]), route
    with pytest.raises(al.InputError, match="expected a law with a reference of joints"):
        al.gradient("error_rms", plant, law, Q0, ["q0"], **OPTIONS)


def test_batches_of_targets_and_motions() -> None:
    """Rows of one batch with constant targets and with motions have the metrics, targets and motions of single runs."""
    laws = [al.PID(ARM, target, 80.0, 30.0, 25.0) for target in JOINTS.values()]
    batch = al.simulate_batch(RIGID, laws, [Q0] * 4, **OPTIONS)
    ends = al.simulate_batch(RIGID, laws, [Q0] * 4, keep="metrics", **OPTIONS)
    for i, law in enumerate(laws):
        run, row = al.simulate(RIGID, law, Q0, **OPTIONS), batch[i]
        for name, values in run.metrics().items():
            for others in (row.metrics()[name], batch.metrics()[name][i], ends.metrics()[name][i]):
                np.testing.assert_allclose(others, values, rtol=1e-12, atol=1e-12, err_msg=f"{i} {name}")
        assert (run.desired() is None) == (row.desired() is None)
        if run.target is not None:
            np.testing.assert_array_equal(run.target, row.target)
        else:
            assert row.target is None


def test_motions_of_laws() -> None:
    """`law.motion` is the motion that the law tracks, in whichever argument it was given."""
    for table, targets in ((OF_JOINTS, JOINTS), (OF_FRAMES, FRAMES)):
        for name, (_, make, kinds) in table.items():
            for kind in kinds:
                law = make(targets[kind])
                expected = targets[kind] if callable(targets[kind]) and name != "PriorityVelocity" else None
                assert law.motion is expected, (name, kind)


@pytest.mark.parametrize("wrap", [lambda law: law, guarded])
def test_gradients_refuse_numbers_that_move_the_reference(wrap: Callable[[al.Law], al.Law]) -> None:
    """The slopes of a named loss leave out the change of the reference, also for a law inside a `Guarded` law."""
    swing = JOINTS["Sinusoid"]
    for law, name in (
        (al.ComputedTorque(ARM, swing, 100.0, 20.0), "motion.amplitude"),
        (al.PID(ARM, swing, 80.0, 30.0, 25.0), "target.amplitude"),
        (al.PID(ARM, [0.3, 0.5], 80.0, 30.0, 25.0), "target"),
    ):
        wrapped = wrap(law)
        full = f"law.{name}" if wrapped is law else f"law.law.{name}"
        with pytest.raises(al.InputError, match=f"expected no name that moves the reference, got {full}"):
            al.gradient("error_rms", RIGID, wrapped, Q0, [full], **OPTIONS)
        _, slopes = al.gradient("tau_rms", RIGID, wrapped, Q0, [full], **OPTIONS)
        assert np.isfinite(slopes[full]).all()
