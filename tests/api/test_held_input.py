"""The held input of sampled runs at records between two samples: the law's output at the last sample, in runs, batches and derivatives."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest

import armlet as al

ARM = models.PENDULUM
PLANT = al.RigidArm(ARM)
RAIL = models.PR


def rates_of(run: Any, name: str) -> Any:
    return run.sensitivity[name]


def tau_of(run: Any) -> Any:
    return run.tau


def law(kp: float = 10.0) -> Any:
    return al.PDGravity(ARM, [1.0], kp, 4.0)


def held(run: Any, control: Any, t: float) -> Any:
    """The law's output at the recorded state at time `t`."""
    k = int(np.argmin(np.abs(run.t - t)))
    return control(t, run.q[k], run.v[k])


@pytest.mark.parametrize("t_end", [0.0303, 0.0305, 0.0309])
@pytest.mark.parametrize("method", ["euler", "semi_implicit", "rk4", "ros2"])
@pytest.mark.parametrize(("dt", "period"), [(1e-3, 1e-3), (5e-4, 1e-3), (1e-3, 3e-3)])
@pytest.mark.parametrize("options", [{}, {"monitors": False}, {"record_every": 4}])
def test_the_last_input_is_the_held_one(method: Any, dt: float, period: float, t_end: float, options: dict[str, Any]) -> None:
    if period == 3e-3:
        t_end += 2e-3  # 33 steps: the last, shorter step ends where the next sample would be if it had the full length
    kw: dict[str, Any] = {"t_end": t_end, "dt": dt, "sample_time": period, "method": method}
    run = al.simulate(PLANT, law(), [0.0], **{**kw, **options})
    full = al.simulate(PLANT, law(), [0.0], **kw)
    last = np.floor(t_end / period + 1e-9) * period
    # The recorded input and the evaluation of the law differ by rounding.
    np.testing.assert_allclose(tau_of(run)[-1], held(full, law(), last), rtol=1e-13)
    batch = al.simulate_batch(PLANT, [law(), law(11.0), law(12.0)], np.zeros((3, 1)), **{**kw, **options})
    np.testing.assert_array_equal(tau_of(batch)[0, -1], tau_of(run)[-1])
    final = al.simulate_batch(PLANT, [law(), law(11.0), law(12.0)], np.zeros((3, 1)), keep="final", **kw)
    np.testing.assert_array_equal(tau_of(final)[:, -1], tau_of(batch)[:, -1])


def test_metrics_use_the_held_input() -> None:
    """The largest input of a run whose last input would be the largest if the law were evaluated at the end."""
    away = al.PDGravity(ARM, [2.0], 40.0, 1e-3)
    kw: dict[str, Any] = {"t_end": 0.0205, "dt": 1e-3, "sample_time": 1e-3, "v0": [-3.0]}
    run = al.simulate(PLANT, away, [0.0], **kw)
    peak = np.abs(tau_of(run)).max()
    batch = al.simulate_batch(PLANT, away, np.zeros((2, 1)), keep="metrics", **{**kw, "v0": [[-3.0], [-3.0]]})
    # Both sums have the same terms in another order.
    np.testing.assert_allclose(batch.metrics()["tau_peak"].ravel(), [peak, peak], rtol=1e-13)


@pytest.mark.parametrize("method", ["euler", "rk4"])
def test_the_held_rate_of_the_law_remains_too(method: Any) -> None:
    """A record between two samples, at a time of `t_eval`, has the input of the sample before."""
    t = np.array([0.0, 0.0103, 0.02, 0.0207])
    kw: dict[str, Any] = {"dt": 1e-3, "sample_time": 1e-3, "method": method}
    control = al.Adaptive(RAIL, al.Hold([1.0, 0.5]), 40.0, 20.0, 5.0)
    start = [0.1, 0.2]
    run = al.simulate(al.RigidArm(RAIL), control, start, t_end=0.0207, t_eval=t, **kw)
    full = al.simulate(al.RigidArm(RAIL), control, start, t_end=0.03, **kw)
    np.testing.assert_allclose(tau_of(run), tau_of(full)[[0, 10, 20, 20]], rtol=1e-13)


@pytest.mark.parametrize("t_end", [0.0203, 0.0205])
@pytest.mark.parametrize("period", [1e-3, 2e-3])
def test_its_derivative_is_that_of_the_held_input(t_end: float, period: float) -> None:
    kw: dict[str, Any] = {"t_end": t_end, "dt": 1e-3, "sample_time": period}
    run = al.simulate(PLANT, law(), [0.0], sensitivity="law.kp", **kw)
    h = 1e-3
    difference = (tau_of(al.simulate(PLANT, law(10.0 + h), [0.0], **kw)) - tau_of(al.simulate(PLANT, law(10.0 - h), [0.0], **kw))) / (2 * h)
    # The error of the central difference is h^2 times a third derivative below 1e-2, and 1e-15 * 10 / h of rounding.
    np.testing.assert_allclose(rates_of(run, "law.kp").tau[:, :, 0], difference, atol=1e-8)

    def last(run: Any) -> Any:
        weights = np.zeros_like(tau_of(run))
        weights[-1, 0] = 1.0
        return run.tau[-1, 0], {"tau": weights}

    value, slopes = al.gradient(last, PLANT, law(), [0.0], "law.kp", **kw)
    assert value == tau_of(run)[-1, 0]
    np.testing.assert_allclose(slopes["law.kp"], rates_of(run, "law.kp").tau[-1, 0], rtol=1e-12)
