"""Commands that pass the arm's own speed limits: the warning, the metric, the text of the run, and the marks in its figure."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import armlet as al

Q = [0.3, 0.4, 0.5]
BODY = {"type": "R", "axis": [0, 0, 1], "phi": [1, 0.1, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1], "lower": -3.0, "upper": 3.0}


def arm_with(*speeds: float) -> al.Arm:
    """A planar arm with three links and these speed limits, rad/s."""
    joints = [BODY | {"xyz": [0.5 * (i > 0), 0, 0], "velocity": speed} for i, speed in enumerate(speeds)]
    return al.Arm.from_chain(joints).with_frame("tip", "link3", xyz=[0.5, 0.0, 0.0])


ARM = arm_with(2.0, 1.5, 1.0)


def law(arm: al.Arm, target: Any, gain: float = 5.0, kind: Any = al.PriorityVelocity, **options: Any) -> Any:
    return kind(arm, [al.Task("tip", "xy", target, gain)], **options)


FAR, NEAR = [5.0, 0.3], ARM.position(Q, "tip")[:2] + 0.001
TIMES: dict[str, Any] = {"t_end": 0.3, "dt": 0.01}


def heard(call: Callable[[], Any]) -> tuple[Any, list[str]]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        made = call()
    assert all(each.filename == __file__ for each in caught)
    return made, [str(each.message) for each in caught]


def test_a_target_out_of_reach_warns() -> None:
    run, texts = heard(lambda: al.simulate(al.VelocityArm(ARM), law(ARM, FAR), Q, **TIMES))
    ratio = np.abs(run.tau) / [2.0, 1.5, 1.0]
    joint = int(ratio.max(axis=0).argmax())
    assert len(texts) == 1 and "simulate: commands pass the arm's speed limits: " in texts[0] and "limits=True" in texts[0]
    assert f"{np.abs(run.tau[:, joint]).max():.4g} rad/s of link{joint + 1}" in texts[0].replace("joint", "link")
    assert run.status == al.Status.SUCCESS
    assert run.metrics()["input_ratio"] == ratio.max()
    assert run.metrics()["time_outside_limits"] > 0.0 and run.metrics().unit("input_ratio") == "1"
    assert f"commands up to {ratio.max():.3g} times the speed limits" in repr(run)


def test_a_law_that_ignores_limits_does_not_warn() -> None:
    ignoring = law(ARM, FAR, limits=False)
    assert heard(lambda: al.simulate(al.VelocityArm(ARM), ignoring, Q, **TIMES))[1] == []
    # Of a batch, every law must ignore them.
    for laws, count in (([ignoring] * 2, 0), ([ignoring, law(ARM, FAR)], 1)):
        assert len(heard(lambda laws=laws: al.simulate_batch(al.VelocityArm(ARM), laws, [Q, Q], **TIMES))[1]) == count  # type: ignore[misc]


def test_a_call_warns_once_per_law() -> None:
    still = np.zeros(3)
    for options, count in (({}, 1), ({"limits": False}, 0), ({"limits": True}, 0), ({"v_max": 0.5}, 0)):
        control = law(ARM, FAR, **options)
        texts = [text for _ in range(3) for text in heard(lambda control=control: control(0.0, Q, still))[1]]  # type: ignore[misc]
        assert len(texts) == count
        if count:
            assert texts[0].startswith("PriorityVelocity: commands pass the arm's speed limits: ") and "limits=False omits" in texts[0]
    assert heard(lambda: law(ARM, NEAR)(0.0, Q, still))[1] == []


def test_runs_without_excess_do_not_warn() -> None:
    plant, clock = al.VelocityArm(ARM), {"t_end": 0.1, "dt": 0.01}
    free = al.planar_arm([0.5, 0.5, 0.5]).with_frame("tip", "link3")
    for call in (
        lambda: al.simulate(plant, law(ARM, NEAR), Q, **clock),
        lambda: al.simulate(plant, law(ARM, FAR, method="sns"), Q, **clock),
        lambda: al.simulate(plant, law(ARM, FAR, limits=True), Q, **clock),
        lambda: al.simulate(plant, law(ARM, FAR), Q, tau_max=[2.0, 1.5, 1.0], **clock),
        lambda: al.simulate(al.VelocityArm(free), law(free, FAR), Q, **clock),
    ):
        run, texts = heard(call)
        assert texts == [] and "speed limits" not in repr(run)


def test_only_finite_positive_limits_count() -> None:
    for speeds, count in (([np.inf, np.inf, np.inf], 0), ([0.0, 0.0, 0.0], 0), ([np.inf, 0.0, 1.0], 1)):
        arm = arm_with(*speeds)
        run, texts = heard(lambda arm=arm: al.simulate(al.VelocityArm(arm), law(arm, FAR), Q, **TIMES))  # type: ignore[misc]
        assert len(texts) == count
        assert np.isfinite(run.metrics()["input_ratio"]) == bool(count)


@pytest.mark.parametrize("keep", ["all", "metrics"])
def test_a_batch_warns_once(keep: Any) -> None:
    laws = [law(ARM, target) for target in (NEAR, FAR, NEAR, FAR)]
    for more in ({}, {"progress": lambda done, runs: None}):
        batch, texts = heard(lambda more=more: al.simulate_batch(al.VelocityArm(ARM), laws, [Q] * 4, keep=keep, **TIMES, **more))  # type: ignore[misc]
        assert len(texts) == 1 and "simulate_batch: " in texts[0] and "in 2 of 4 runs (first bad index 1)" in texts[0]
        ratio = batch.metrics()["input_ratio"]
        assert ratio.shape == (4,) and (ratio[[1, 3]] > 1.0).all() and (ratio[[0, 2]] < 1.0).all()
        single = al.simulate(al.VelocityArm(ARM), laws[0], Q, **TIMES)
        # A batch and a single run may round differently.
        np.testing.assert_allclose(ratio[0], single.metrics()["input_ratio"], rtol=1e-9)
        if keep == "all":
            np.testing.assert_array_equal(batch[1].metrics()["input_ratio"], ratio[1])


def test_rows_have_the_limits_of_their_arms() -> None:
    slow, fast = arm_with(1e-4, 1e-4, 1e-4), arm_with(1e3, 1e3, 1e3)
    plants = [al.VelocityArm(fast), al.VelocityArm(slow)]
    batch, texts = heard(lambda: al.simulate_batch(plants, [law(fast, NEAR), law(slow, NEAR)], [Q] * 2, **TIMES))
    assert len(texts) == 1 and "in 1 of 2 runs (first bad index 1)" in texts[0] and "whose limit is 0.0001 rad/s" in texts[0]
    assert (batch.metrics()["input_ratio"] > 1.0).tolist() == [False, True]


def test_laws_of_accelerations_and_of_python() -> None:
    fast = law(ARM, [0.9, 0.9], 400.0, al.PriorityAcceleration)
    run, texts = heard(lambda: al.simulate(al.RigidArm(ARM), fast, Q, t_end=0.1, dt=1e-3))
    assert np.abs(run.v).max() > 2.0 and len(texts) == 1 and "commands pass the arm's speed limits" in texts[0]
    _, texts = heard(lambda: al.simulate(al.VelocityArm(ARM), lambda t, q: [0.1, 0.1, 3.0], Q, sample_time=0.01, **TIMES))
    assert len(texts) == 1 and "3 rad/s of " in texts[0] and "tau_max" in texts[0]
    # A law of torques commands no speeds.
    _, texts = heard(lambda: al.simulate(al.RigidArm(ARM), al.PDGravity(ARM, [2.0, 0.0, 0.0], 400.0, 5.0), Q, t_end=0.1, dt=1e-3))
    assert texts == []


def test_the_figure_marks_the_excess() -> None:
    from matplotlib.figure import Figure

    for target, marked in ((FAR, True), (NEAR, False)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            run = al.simulate(al.VelocityArm(ARM), law(ARM, target), Q, **TIMES)
        figure = Figure()
        run.plot(figure)
        lines = [line for ax in figure.axes for line in ax.get_lines() if line.get_gid() == "excess"]
        beyond = np.abs(run.v) > [2.0, 1.5, 1.0]
        assert len(lines) == beyond.any(axis=0).sum() and bool(lines) == marked
        for line, joint in zip(lines, np.flatnonzero(beyond.any(axis=0)), strict=True):
            np.testing.assert_array_equal(np.isfinite(line.get_ydata()), beyond[:, joint])
        labels = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
        assert ("beyond limit" in labels) == marked and ("limit" in labels or not marked)
