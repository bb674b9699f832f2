"""Joint-torque sensors of a sampled loop: the reading that the law receives, its statistics, and runs that repeat to the bit."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

ARM = models.TWO_HEAVY_LINKS
K, B = np.array([800.0, 500.0]), np.array([0.4, 0.25])
PLANT = al.ElasticArm(ARM, K, B)
LAWS: dict[str, al.Law] = {
    "impedance": al.ElasticImpedance(ARM, [0.5, 0.5], 300.0, 40.0, K, B, B / 10, frame="link2", axes="xy"),
    "joint": al.JointImpedance(ARM, [0.3, 1.0], 60.0, 8.0, K, B, B / 10),
    "state": al.StateFeedback(ARM, [0.3, 1.0], 200.0, 20.0, 1.0, 0.02, K),
}
START = [0.2, 1.1]


def sampled(sensor: al.TorqueSensor | None, law: Any = LAWS["state"], plant: al.Plant = PLANT, **options: Any) -> al.Run:
    effects = {key: options.pop(key) for key in ("delay", "jitter", "sensor_delay", "noise", "resolution", "seed") if key in options}
    clock = al.Sampling(1e-3, torque_sensor=sensor, **effects)
    return al.simulate(plant, law, START, **({"t_end": 0.3, "dt": 1e-4, "sample_time": clock} | options))


def watched(sensor: al.TorqueSensor, **effects: Any) -> tuple[Array, Array, Array, Array]:
    """Record 1000 samples of a run: `q` and `theta` as a Python law receives them, then the plant's true joint torque and `theta`."""
    seen: list[Array] = []

    def law(t: float, q: Array, v: Array, theta: Array, theta_dot: Array) -> Array:
        seen.append(np.concatenate([q, theta]))
        return np.asarray(LAWS["state"](t, q, v, theta=theta, theta_dot=theta_dot))

    run = sampled(sensor, law, t_end=1.0, t_eval=1e-3 * np.arange(1000), **effects)
    parts = np.array(seen)[:1000]
    return parts[:, :2], parts[:, 2:], K * (run.theta - run.q), np.asarray(run.theta)


@pytest.mark.parametrize("name", LAWS)
def test_a_perfect_sensor_changes_nothing(name: str) -> None:
    # The law computes the link positions as theta - K^-1 K (theta - q), which differs from q by rounding. The contracting loop keeps this
    # difference small.
    plain = al.simulate(PLANT, LAWS[name], START, t_end=0.3, dt=1e-4, sample_time=1e-3)
    np.testing.assert_allclose(sampled(al.TorqueSensor(), LAWS[name]).q, plain.q, rtol=0.0, atol=1e-12)
    assert np.max(np.abs(sampled(al.TorqueSensor(bandwidth=100.0), LAWS[name]).q - plain.q)) > 1e-5


def test_the_law_sees_bias_steps_and_noise() -> None:
    q, theta, torque, _ = watched(al.TorqueSensor(bias=[2.0, -1.0]))
    np.testing.assert_allclose(K * (theta - q), torque + np.array([2.0, -1.0]), rtol=0.0, atol=1e-9)
    q, theta, torque, true = watched(al.TorqueSensor(resolution=0.25), resolution={"theta": 1e-4})
    np.testing.assert_allclose(K * (theta - q), np.round(torque / 0.25) * 0.25, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(theta, np.round(true / 1e-4) * 1e-4, rtol=0.0, atol=1e-12)
    q, theta, torque, _ = watched(al.TorqueSensor(noise=0.5), seed=3)
    noise = K * (theta - q) - torque
    # The noise is 2 x 1000 numbers. Its mean, deviation and correlations (between joints, between samples) may differ from their
    # expectations by five standard errors.
    assert abs(noise.mean()) < 5 * 0.5 / np.sqrt(noise.size) and abs(noise.std() - 0.5) < 5 * 0.5 / np.sqrt(2 * noise.size)
    assert abs(np.corrcoef(noise.T)[0, 1]) < 5 / np.sqrt(1000) and abs(np.corrcoef(noise[1:, 0], noise[:-1, 0])[0, 1]) < 5 / np.sqrt(1000)


@pytest.mark.parametrize("lag", [0, 2])
def test_the_filter_is_of_first_order(lag: int) -> None:
    w = 300.0
    q, theta, torque, true = watched(al.TorqueSensor(bandwidth=w), sensor_delay=lag)
    # The exact response of a first-order filter, from rest, to torques that are linear between samples. This formula uses the ramp
    # response.
    decay, filtered = np.exp(-w * 1e-3), [torque[0]]
    for before, now in pairwise(torque):
        slope = (now - before) / 1e-3
        filtered.append(now - slope / w + (filtered[-1] - before + slope / w) * decay)
    np.testing.assert_allclose((K * (theta - q))[lag:], np.array(filtered)[: 1000 - lag], rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(theta[lag:], true[: 1000 - lag], rtol=0.0, atol=1e-12)


def test_the_law_reads_through_its_own_stiffness() -> None:
    # The law assumes springs half as stiff as the plant's. With a sensor it still receives the true joint torque.
    soft = al.StateFeedback(ARM, [0.3, 1.0], 200.0, 20.0, 1.0, 0.02, K / 2)
    assert (
        np.max(np.abs(sampled(al.TorqueSensor(), soft).q - al.simulate(PLANT, soft, START, t_end=0.3, dt=1e-4, sample_time=1e-3).q)) > 1e-4
    )
    rest = sampled(al.TorqueSensor(), soft, t_end=20.0, dt=1e-3)
    # At rest tau = tau_J = g(q), and the joint torque in the law equals that in the plant.
    theta_d = np.array([0.3, 1.0]) + ARM.gravity([0.3, 1.0]) / (K / 2)
    tau = 2.0 * ARM.gravity([0.3, 1.0]) + 200.0 * (theta_d - rest.theta[-1]) - K * (rest.theta[-1] - rest.q[-1])
    np.testing.assert_allclose(rest.tau[-1], tau, rtol=0.0, atol=1e-6)


SENSOR = al.TorqueSensor(noise=0.3, bias=0.5, resolution=0.05, bandwidth=800.0)
EFFECTS: dict[str, Any] = {"noise": {"theta": 1e-5, "v": 1e-3}, "resolution": {"theta": 1e-5}, "seed": 7}


@pytest.mark.parametrize("method", ["rk4", "ros2", "dop853"])
def test_runs_repeat_to_the_bit(method: str) -> None:
    options: dict[str, Any] = {"method": method, "delay": 5e-4, "jitter": 4e-4} | EFFECTS | ({"dt": None} if method == "dop853" else {})
    first = sampled(SENSOR, **options)
    np.testing.assert_array_equal(first.q, sampled(SENSOR, **options).q)
    assert np.max(np.abs(first.q[-1] - sampled(SENSOR, **(options | {"seed": 8})).q[-1])) > 1e-9


@pytest.mark.parametrize("jitter", [0.0, 3e-4])
def test_rows_of_a_batch_are_runs_of_their_own(jitter: float) -> None:
    # Without jitter, the batch integrates several rows together in SIMD lanes.
    clock = al.Sampling(1e-3, torque_sensor=SENSOR, jitter=jitter, **EFFECTS)
    batch = al.simulate_batch(PLANT, LAWS["joint"], np.tile(START, (10, 1)), t_end=0.1, dt=1e-4, sample_time=clock, threads=2)
    for i in (0, 3, 9):
        alone = sampled(SENSOR, LAWS["joint"], t_end=0.1, jitter=jitter, **(EFFECTS | {"seed": 7 + i}))
        np.testing.assert_allclose(batch.q[i], alone.q, rtol=0.0, atol=1e-12)
    assert np.max(np.abs(batch.q[0, -1] - batch.q[1, -1])) > 1e-9


def test_steps_by_hand_have_the_same_sensors() -> None:
    clock = al.Sampling(1e-3, torque_sensor=SENSOR, **EFFECTS)
    sim = al.Simulator(PLANT, LAWS["state"], START, dt=1e-4, sample_time=clock)
    for _ in range(1000):
        sim.step()
    run = sampled(SENSOR, t_end=0.1, monitors=False, **EFFECTS)
    np.testing.assert_allclose(sim.q, run.q[-1], rtol=0.0, atol=1e-14)
    sim.reset()
    for _ in range(1000):
        sim.step()
    np.testing.assert_allclose(sim.q, run.q[-1], rtol=0.0, atol=1e-14)
