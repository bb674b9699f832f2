"""`fit_log` of a plant and its law with a log without torques: the law computes them from the recorded positions and velocities."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

ARM = models.TWO_HEAVY_LINKS.with_drives(damping=[0.8, 0.5], armature=[0.1, 0.05])
WRONG = al.planar_arm([0.5, 0.4], masses=[2.5, 1.8])
MOTION = {
    "kind": "Sinusoid", "offset": [0.0, 0.0], "amplitude": [[0.9, 0.6], [0.9, 0.6]], "frequency": [[1.3, 0.5], [2.1, 0.8]],
    "phase": [[0.0, 1.0], [2.0, 0.5]],
}  # fmt: skip


def scenario(**run: Any) -> al.Scenario:
    sampling = {"period": 5e-3, "delay": 2e-3, "noise": {"q": 1e-4, "v": 1e-2}}
    return al.Scenario(
        {
            "arm": {"kind": "planar_arm", "lengths": [0.5, 0.4], "masses": [2.5, 1.8]},
            "motion": MOTION,
            "law": {"kind": "ComputedTorque", "kp": 60.0, "kd": 12.0},
            "run": {"q0": [0.8, 0.8], "t_end": 15.0, "dt": 1e-3, "record_every": 5, "sample_time": sampling} | run,
        }
    )


def measured(given: al.Scenario, seed: int = 3) -> tuple[al.Log, Array]:
    """What the law of a sampled loop in numpy measured, without its torques; and these torques. They act 2 ms later."""
    rng, built = np.random.default_rng(seed), given.build()
    simulator = al.Simulator(al.RigidArm(ARM, friction=True), None, [0.8, 0.8], dt=1e-3)
    rows, tau, before = [], np.zeros(2), np.zeros(2)
    most = built.arguments.get("tau_max")
    for k in range(3000):
        q = simulator.q + 1e-4 * rng.normal(size=2)
        v = simulator.v + 1e-2 * rng.normal(size=2)
        tau = built.law(5e-3 * k, q, v)
        tau = tau if most is None else np.clip(tau, -np.asarray(most), most)
        rows.append(np.concatenate([q, v, tau]))
        for step in range(5):
            simulator.step(before if step < 2 else tau)
        before = tau
    table = np.array(rows)
    return al.Log(5e-3 * np.arange(3000.0), table[:, :2], v=table[:, 2:4], names=ARM.joint_names), table[:, 4:]


@pytest.mark.parametrize("limit", [{}, {"tau_max": [14.0, 3.0]}], ids=["no limit", "torque limits"])
def test_the_torques_of_the_law(limit: dict[str, Any]) -> None:
    given = scenario(**limit)
    log, tau = measured(given)
    fit = al.fit_log(given, log, ["inertia", "rotors", "viscous"])
    np.testing.assert_array_equal(fit.log.tau, tau)
    assert np.any(np.abs(tau) == [14.0, 3.0]) == bool(limit)
    base = ARM.base_parameters(armature=True, friction=True)
    truth = dict(zip(base.grouping, base.projection @ np.concatenate([ARM.parameters, [0.1, 0.05], [0.8, 0.5], [0.0, 0.0]]), strict=True))
    errors = fit.values - np.array([truth[name] for name in fit.names])
    assert np.all(np.abs(errors) < 4.0 * fit.deviations), errors / fit.deviations
    assert np.all(fit.deviations < 0.05) and fit.delay == 2e-3
    # The same from a pair, whose delay is an argument.
    pair = al.fit_log((al.RigidArm(WRONG), given.build().law), log, ["inertia", "rotors", "viscous", "delay"])
    if not limit:
        assert abs(pair.delay - 2e-3) < 1e-4


def test_logs_that_do_not_determine_the_torques() -> None:
    given = scenario()
    log = al.Log(5e-3 * np.arange(200.0), np.zeros((200, 2)), v=np.zeros((200, 2)), names=ARM.joint_names)
    bare = al.Log(log.t, log.q, names=log.names)
    slow = al.Log(2.0 * log.t, log.q, v=log.v, names=log.names)
    late = scenario(sample_time={"period": 5e-3, "sensor_delay": 1})
    adaptive = al.Adaptive(WRONG, given.build().law.motion, kp=10.0, kd=5.0, gamma=1.0)
    motors = al.MotorPD(WRONG, [0.8, 0.3], kp=120.0, kd=12.0, joint_stiffness=[800.0, 500.0])
    for model, record, message in (
        (al.RigidArm(WRONG), log, "log has no torques: expected torques, or a model with a law"),
        (given, bare, "log has no torques and no velocities: expected both positions and velocities"),
        (given, slow, "log has no torques: expected one sample for each sample of the law, 0.005 s apart, got 0.01 s"),
        (late, log, "log has no torques: expected a sample_time without jitter, sensor_delay, torque_sensor and rate_limit"),
        ((al.RigidArm(WRONG), adaptive), log, "log has no torques: expected a law without a state, got Adaptive"),
        ((al.ElasticArm(WRONG, 800.0, 0.3), motors), log, "log has no torques, and the law cannot compute them: "),
        (WRONG, log, "log does not fit the model: expected torques of 2 joints, got no torques"),
    ):
        with pytest.raises(al.InputError, match=f"^fit_log: {message}"):
            al.fit_log(model, record, ["viscous"])  # type: ignore[arg-type]
