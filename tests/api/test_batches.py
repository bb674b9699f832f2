"""Batches that armlet divides into pieces: equal bits for every division, batches that compute only metrics, and progress."""

from __future__ import annotations

import pickle
from typing import Any

import models
import numpy as np
import pytest

import armlet as al
from armlet.run import batches

ARM = models.PR
LAW = al.ComputedTorque(ARM, al.Quintic([0.0, 0.0], [1.0, 0.5], 0.5), kp=100.0, kd=20.0)
PLANT = al.RigidArm(ARM)
Q0 = np.random.default_rng(0).uniform(-0.2, 0.2, (150, 2))
OPTIONS: dict[str, Any] = {"t_end": 1.0, "dt": 1e-3, "record_every": 10}


def test_metrics_alone_are_those_of_the_records(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = al.simulate_batch(PLANT, LAW, Q0, **OPTIONS)
    # PIECE = 1 gives pieces of 64 runs, so the batch has three pieces.
    monkeypatch.setattr(batches, "PIECE", 1)
    seen: list[tuple[int, int]] = []
    summed = al.simulate_batch(PLANT, LAW, Q0, keep="metrics", progress=lambda done, runs: seen.append((done, runs)), **OPTIONS)
    assert seen == [(64, 150), (128, 150), (150, 150)]
    assert summed.q.shape == (150, 1, 2)
    np.testing.assert_array_equal(summed.q[:, 0], whole.q[:, -1])
    for name, values in whole.metrics().items():
        # The terms are added in another order, which changes rounding. A balance is a difference of energies, so it has the rounding error
        # of the energies.
        np.testing.assert_allclose(summed.metrics()[name], values, rtol=1e-12, atol=1e-14, err_msg=name)
    again = pickle.loads(pickle.dumps(summed))
    np.testing.assert_array_equal(again.metrics()["error_rms"], summed.metrics()["error_rms"])


def test_pieces_are_the_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    sampling = al.Sampling(2e-3, noise={"v": 0.01}, seed=3)
    laws = [al.ComputedTorque(ARM, al.Hold([0.1, 0.2]), kp=50.0 + i, kd=20.0) for i in range(150)]
    plants = [al.RigidArm(al.planar_pr(2.0 + 0.01 * i, 0.5, 0.5)) for i in range(150)]
    options = OPTIONS | {"sample_time": sampling, "v0": Q0[::-1]}
    whole = al.simulate_batch(plants, laws, Q0, **options)
    monkeypatch.setattr(batches, "PIECE", 1)
    pieces = al.simulate_batch(plants, laws, Q0, progress=lambda done, runs: None, **options)
    np.testing.assert_array_equal(pieces.q, whole.q)
    np.testing.assert_array_equal(pieces.monitors["energy"], whole.monitors["energy"])
    np.testing.assert_array_equal(pieces.stats["ended"], whole.stats["ended"])


def test_a_batch_of_nothing_has_no_metrics() -> None:
    empty = al.simulate_batch(PLANT, LAW, np.zeros((0, 2)), keep="metrics", **OPTIONS)
    assert len(empty) == 0 and empty.metrics()["error_rms"].shape == (0, 2)


def test_invalid_arguments_are_refused() -> None:
    with pytest.raises(al.InputError, match="law has the wrong number of entries: expected 1 or 150, got 2"):
        al.simulate_batch(PLANT, [LAW, LAW], Q0, keep="metrics", **OPTIONS)
    with pytest.raises(al.InputError, match="keep is unknown"):
        al.simulate_batch(PLANT, LAW, Q0, keep="some", **OPTIONS)  # type: ignore[arg-type]


@pytest.mark.parametrize("keep", ["all", "metrics"])
def test_every_run_has_a_disturbance_of_its_own(keep: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The force is a constant (B, k), or a list of steps for each run. Each row equals a single run with its own force."""
    monkeypatch.setattr(batches, "PIECE", 1)
    arm = models.TWO_LINKS
    plant, law = al.RigidArm(arm), al.PDGravity(arm, [0.3, 0.6], kp=60.0, kd=12.0)
    rng = np.random.default_rng(3)
    q0, constant = rng.normal(size=(70, 2)), rng.normal(size=(70, 3))
    steps = [[(0.0, row), (0.05, -row)] for row in constant]
    options: dict[str, Any] = {"t_end": 0.1, "dt": 1e-3, "force_frame": "link2"}
    for forces in (constant, constant.tolist(), steps):
        batch = al.simulate_batch(plant, law, q0, force=forces, keep=keep, **options)
        for i in (0, 7, 69):
            one = forces[i] if forces is steps else [(0.0, constant[i])]
            np.testing.assert_array_equal(batch.q[i, -1], al.simulate(plant, law, q0[i], force=one, **options).q[-1])
    assert np.ptp(batch.q[:, -1], axis=0).min() > 1e-3
    for bad, message in (
        (constant[:5], r"force has the wrong shape: expected \(70, k\), got \(5, 3\)"),
        (steps[:5], "force has the wrong number of entries"),
        (np.where(constant == constant[3, 1], np.nan, constant), r"force is not finite: .*first bad index \(3, 1\)"),
        ([lambda t: [0.0, 0.0, 0.0]] * 70, "force"),
    ):
        with pytest.raises(al.InputError, match=f"^simulate_batch: {message}"):
            al.simulate_batch(plant, law, q0, force=bad, keep="final", **options)
    # One force for all runs, also as nested lists.
    together = al.simulate_batch(plant, law, q0[:3], force=[[0.0, [1.0, 2.0, 0.0]], [0.05, [0.0, 0.0, 0.0]]], **options)
    np.testing.assert_array_equal(
        together.q[1, -1], al.simulate(plant, law, q0[1], force=[(0.0, [1.0, 2.0, 0.0]), (0.05, [0.0] * 3)], **options).q[-1]
    )


@pytest.mark.parametrize("sampled", [True, False])
def test_monitors_of_a_row_are_of_its_own_law(sampled: bool) -> None:
    """At given times, the records of sampled adaptive laws and of task priority are not computed in programs."""
    plant: Any = PLANT if sampled else al.VelocityArm(models.TWO_LINKS)
    if sampled:
        laws: list[Any] = [al.Adaptive(ARM, LAW.motion, kp=60.0 + 10.0 * i, kd=20.0, gamma=5.0) for i in range(3)]
    else:
        laws = [al.PriorityVelocity(models.TWO_LINKS, [al.Task("link2", "x", [0.3 + 0.1 * i], 5.0)]) for i in range(3)]
    options: dict[str, Any] = {"t_end": 0.1, "dt": 1e-3, "t_eval": [0.0, 0.05, 0.1], "sample_time": 1e-3 if sampled else None}
    batch = al.simulate_batch(plant, laws, np.full((3, 2), 0.5), monitors=True, **options)
    for i, law in enumerate(laws):
        alone = al.simulate(plant, law, [0.5, 0.5], monitors=True, **options).monitors
        assert alone.keys() == batch.monitors.keys()
        for name, values in alone.items():
            np.testing.assert_array_equal(batch.monitors[name][i], values, err_msg=name)


def test_finished_rows_are_kept_in_the_arrays_of_the_caller() -> None:
    """The progress callback raises KeyboardInterrupt after the second piece.

    Two pieces are valid, the other rows have the status INTERRUPTED.
    """
    q0 = np.linspace(-0.2, 0.2, 600).reshape(300, 2)
    whole = al.simulate_batch(PLANT, LAW, q0, **OPTIONS)
    q, status = np.zeros_like(whole.q), np.zeros(300, dtype=np.int64)

    def interrupt(done: int, runs: int) -> None:
        if done >= 128:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        al.simulate_batch(PLANT, LAW, q0, progress=interrupt, out={"q": q, "status": status}, **OPTIONS)
    np.testing.assert_array_equal(q[:128], whole.q[:128])
    assert np.all(np.isnan(q[128:])) and np.all(status[:128] == al.Status.SUCCESS) and np.all(status[128:] == al.Status.INTERRUPTED)
    final = np.empty((300, 1, 2))
    done = al.simulate_batch(PLANT, LAW, q0, keep="final", out={"v": final}, **OPTIONS)
    np.testing.assert_array_equal(final, whole.v[:, -1:])
    np.testing.assert_array_equal(done.q[:, -1], whole.q[:, -1])
    readonly = np.zeros_like(q)
    readonly.flags.writeable = False
    for out, message in (
        ({"x": q}, "a name of out is unknown"),
        ({"q": q[:5]}, r'out\["q"\] is not fit'),
        ({"q": q.astype(np.float32)}, r'out\["q"\] is not fit'),
        ({"q": readonly}, r'out\["q"\] is not fit'),
        ({"q": q[:, :3]}, r'out\["q"\] has the wrong shape: expected \(300, 101, 2\), got \(300, 3, 2\)'),
        ({"theta": q}, r'out\["theta"\] has the wrong shape: expected no such rows'),
    ):
        with pytest.raises(al.InputError, match=f"^simulate_batch: {message}"):
            al.simulate_batch(PLANT, LAW, q0, out=out, **OPTIONS)
