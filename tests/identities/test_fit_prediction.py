"""`fit_log` of plants: transitions against the simulator, derivatives against differences, known numbers in logs of sampled loops."""

from __future__ import annotations

import pickle
from typing import Any

import log_trials
import models
import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

import armlet as al
from armlet.fitting.predicted.innovations import Noise, kalman_gain
from armlet.fitting.predicted.inputs import pieces_of
from armlet.fitting.predicted.plant_numbers import PlantNumbers
from armlet.fitting.predicted.transitions import Motion, transitions

Array = NDArray[np.float64]

ARM = models.TWO_HEAVY_LINKS.with_drives(damping=[0.8, 0.5], armature=[0.1, 0.05])
WRONG = al.planar_arm([0.5, 0.4], masses=[2.5, 1.8])
RIGID = al.RigidArm(ARM, friction=True)
ELASTIC = al.ElasticArm(models.TWO_HEAVY_LINKS, [800.0, 500.0], [0.4, 0.25], joint_damping=[1.0, 2.0], motor_friction=[0.3, 0.2])
MOTION = al.Sinusoid([0.0, 0.0], [[0.9, 0.6], [0.9, 0.6]], [[1.3, 0.5], [2.1, 0.8]], [[0.0, 1.0], [2.0, 0.5]])
LAW = al.ComputedTorque(WRONG, MOTION, kp=60.0, kd=12.0)
PERIOD = 0.004


def states(plant: Any, count: int) -> tuple[Array, Array, Array]:
    """Random states, torques at `count` + 1 times and signs."""
    rng = np.random.default_rng(0)
    x = rng.normal(size=(count, 8 if isinstance(plant, al.ElasticArm) else 4))
    x[:, 4:6] = x[:, :2][:, : x[:, 4:6].shape[1]] + 0.01 * x[:, 4:6]
    return x, 3.0 * rng.normal(size=(count + 1, 2)), np.sign(rng.normal(size=(count, 2)))


@pytest.mark.parametrize("plant", [RIGID, ELASTIC], ids=["rigid", "elastic"])
def test_transitions_are_those_of_the_simulator(plant: Any) -> None:
    numbers = PlantNumbers(plant, ("viscous",), 0.0)
    x, tau, sign = states(plant, 10)
    t = PERIOD * np.arange(11)
    found = transitions(Motion(numbers, numbers.first), x, pieces_of(t, (t, tau), 0.0, True, False), sign)
    for row, torque, after in zip(x, tau, found.F, strict=False):
        more = {} if len(row) == 4 else {"theta0": row[4:6], "theta_dot0": row[6:]}
        simulator = al.Simulator(plant, None, row[:2], v0=row[2:4], dt=PERIOD / 40, **more)
        for _ in range(40):
            simulator.step(torque)
        parts = [simulator.q, simulator.v] + ([] if len(row) == 4 else [simulator.theta, simulator.theta_dot])
        # The method of order four has steps below 0.5 / (fastest eigenvalue): errors of 0.5^5/120 of the change.
        np.testing.assert_allclose(after, np.concatenate(parts), atol=3e-4)


@pytest.mark.parametrize("held", [True, False], ids=["held", "linear"])
@pytest.mark.parametrize("plant", [RIGID, ELASTIC], ids=["rigid", "elastic"])
def test_derivatives_of_transitions(plant: Any, held: bool) -> None:
    kinds = ("inertia", "rotors", "viscous", "coulomb", "offsets", "torque_constants", "delay")
    numbers = PlantNumbers(plant, (*kinds, *(("stiffness", "joint_damping") if plant is ELASTIC else ())), 0.0013)
    x, tau, sign = states(plant, 12)
    t = PERIOD * np.arange(13.0)

    def after(beta: Array, x: Array) -> Any:
        motion = Motion(numbers, beta)
        delay = float(motion.all[numbers.late])
        return transitions(motion, x, pieces_of(t, (t, tau), delay, held, True), sign)

    exact = after(numbers.first, x)
    for j, name in enumerate(numbers.names):
        # Twice a millionth of the number; the rounding error of the quotient is 1e-10 of the largest derivative or 1e-8 of the state.
        step = 1e-9 if name == "delay" else 1e-6 * max(1.0, abs(numbers.first[j]))
        change = step * np.eye(len(numbers.first))[j]
        quotient = (after(numbers.first + change, x).F - after(numbers.first - change, x).F) / (2.0 * step)
        np.testing.assert_allclose(exact.G[:, :, j], quotient, atol=1e-6 * max(1.0, np.abs(quotient).max()), err_msg=name)
    for j in range(x.shape[1]):
        change = 1e-6 * np.eye(x.shape[1])[j]
        quotient = (after(numbers.first, x + change).F - after(numbers.first, x - change).F) / 2e-6
        np.testing.assert_allclose(exact.Phi[:, :, j], quotient, atol=1e-6)


def test_the_gain_is_that_of_the_riccati_equation() -> None:
    rng = np.random.default_rng(1)
    Phi, B = np.eye(4) + 0.01 * np.diag([1.0, 1.0], 2) + 1e-3 * rng.normal(size=(4, 4)), rng.normal(size=(4, 2))
    C, Q, R = np.eye(2, 4), 1e-4 * B @ B.T, 1e-6 * np.eye(2)
    P = solve_discrete_are(Phi.T, C.T, Q, R)
    # The condition number of the equation is about 1e4.
    np.testing.assert_allclose(kalman_gain(Phi, C, Noise(Q, R)), P @ C.T @ np.linalg.inv(C @ P @ C.T + R), rtol=1e-8)


def sampled(plant: Any, law: Any, delay: float, *, noise: float = 1e-4, seed: int = 0, **more: Any) -> al.Log:
    """A log of a sampled loop at 200 Hz: the torque at a sample is that which acts, so its delay is that of the law less a period."""
    sampling = al.Sampling(5e-3, delay=delay, noise={"q": noise}, seed=seed)
    run = al.simulate(plant, law, [1.0, 1.0], t_end=15.0, dt=1e-3, sample_time=sampling, record_every=5, **more)
    rng = np.random.default_rng(seed)
    theta = None if run.theta is None else run.theta + noise * rng.normal(size=run.q.shape)
    return al.Log(run.t, run.q + noise * rng.normal(size=run.q.shape), tau=run.tau, theta=theta, names=plant.arm.joint_names)


def test_a_sampled_loop_with_a_fraction_of_a_delay() -> None:
    """The fit finds the delay within 0.1 ms, and each number within four deviations."""
    log = sampled(RIGID, LAW, 0.003)
    fit = al.fit_log((al.RigidArm(WRONG), LAW), log, ["inertia", "rotors", "viscous", "delay"])
    values = dict(zip(fit.names, fit.values, strict=True))
    assert abs(values["delay"] - (0.003 - 0.005)) < 1e-4 and fit.delay == values["delay"]
    base = ARM.base_parameters(armature=True, friction=True)
    truth = dict(zip(base.grouping, base.projection @ np.concatenate([ARM.parameters, [0.1, 0.05], [0.8, 0.5], [0.0, 0.0]]), strict=True))
    truth["delay"] = -0.002
    errors = np.array([values[name] - truth[name] for name in fit.names])
    assert np.all(np.abs(errors) < 4.0 * fit.deviations), errors / fit.deviations
    assert np.all(fit.deviations < 0.05)
    plant, law = fit.model
    assert law == LAW and isinstance(plant, al.RigidArm)
    np.testing.assert_allclose(plant.arm.limits["damping"], [0.8, 0.5], atol=0.02)
    np.testing.assert_allclose(fit.arm.gravity([0.3, 0.4]), ARM.gravity([0.3, 0.4]), atol=0.05)
    assert fit.plot(Figure()).shape == (2, 1) and "delay" in str(fit)
    copy = pickle.loads(pickle.dumps(fit))
    np.testing.assert_array_equal(copy.values, fit.values)
    assert [each.name for each in copy.refuted] == [each.name for each in fit.refuted]


def test_elastic_joints() -> None:
    law = al.MotorPD(models.TWO_HEAVY_LINKS, [0.8, 0.3], kp=120.0, kd=12.0, joint_stiffness=[800.0, 500.0])
    moving = al.simulate(ELASTIC, law, [0.0, 0.0], t_end=4.0, dt=1e-3, sample_time=2e-3, record_every=2)
    rng = np.random.default_rng(2)
    # Positions of links and motors with the noise of encoders with 16 bits.
    noise = 1e-4 * rng.normal(size=(2, *moving.q.shape))
    log = al.Log(moving.t, moving.q + noise[0], theta=moving.theta + noise[1], tau=moving.tau, names=ELASTIC.arm.joint_names)
    start = al.ElasticArm(models.TWO_HEAVY_LINKS, [600.0, 600.0], [0.4, 0.25], joint_damping=[1.0, 2.0])
    fit = al.fit_log(start, log, ["stiffness", "viscous"], delay=-2e-3)
    errors = fit.values - [0.3, 0.2, 800.0, 500.0]
    assert np.all(np.abs(errors) < 4.0 * fit.deviations) and np.all(fit.deviations < [0.1, 0.1, 8.0, 5.0]), (errors, fit.deviations)
    np.testing.assert_array_equal(fit.model.__getnewargs_ex__()[1]["stiffness"], fit.values[2:])
    np.testing.assert_array_equal(fit.model.__getnewargs_ex__()[1]["motor_friction"], fit.values[:2])
    assert fit.names == ("damping[joint1]", "damping[joint2]", "stiffness[joint1]", "stiffness[joint2]")


def scenario(**run: Any) -> al.Scenario:
    motion = {"kind": "Sinusoid", "offset": [0.0, 0.0], "amplitude": [0.9, 0.9], "frequency": [1.3, 2.1], "phase": [0.0, 2.0]}
    data = {
        "arm": {"kind": "planar_arm", "lengths": [0.5, 0.4], "masses": [2.5, 1.8]},
        "motion": motion,
        "law": {"kind": "ComputedTorque", "kp": 60.0, "kd": 12.0},
        "run": {"q0": [0.0, 0.8], "t_end": 10.0, "dt": 1e-3, "record_every": 5, "sample_time": {"period": 5e-3, "delay": 1e-3}} | run,
    }
    return al.Scenario(data)


def test_a_scenario_with_the_fitted_values() -> None:
    given = scenario()
    built = given.build()
    log = sampled(RIGID, built.law, 0.002)
    fit = al.fit_log(given, log, ["inertia", "rotors", "viscous", "delay"], delay=-0.004)
    fitted = fit.model.build()
    assert fit.model.data["model"] == given.data["arm"] and str(fitted.law) == str(built.law), "the law keeps its model"
    np.testing.assert_allclose(fitted.plant.arm.gravity([0.3, 0.4]), ARM.gravity([0.3, 0.4]), atol=0.05)
    np.testing.assert_allclose(fitted.plant.arm.limits["damping"], [0.8, 0.5], atol=0.02)
    assert fitted.arguments["sample_time"].delay == 0.0
    assert fit.model.run().status == al.Status.SUCCESS
    # Without a change of names the delay of the scenario is the known one, and its sample time holds the torque.
    assert al.fit_log(given, log, ["viscous"]).delay == 1e-3


def test_encoder_offsets_and_torque_constants() -> None:
    """With known bodies, gravity determines the factors of torques, and the angle of an encoder."""
    log = sampled(RIGID, LAW, 0.0)
    assert log.tau is not None
    shifted = al.Log(log.t, log.q + np.array([0.05, 0.0]), tau=log.tau / [1.1, 1.0], names=log.names)
    fit = al.fit_log(RIGID, shifted, ["torque_constants", "encoder_offsets"])
    values = dict(zip(fit.names, fit.values, strict=True))
    assert abs(values["torque_constant[joint1]"] - 1.1) < 0.01
    assert abs(values["encoder_offset[joint1]"] - 0.05) < 0.005 and abs(values["encoder_offset[joint2]"]) < 0.005


def test_numbers_that_cannot_be_told_apart() -> None:
    """All numbers of the bodies and all torques may be scaled together."""
    fit = al.fit_log(RIGID, sampled(RIGID, LAW, 0.0), ["inertia", "rotors", "viscous", "torque_constants"])
    assert fit.rank < len(fit.names)
    assert any("torque_constant[joint1]" in line for line in fit.unidentifiable)


@pytest.mark.parametrize("name", ["", "coulomb", "payload", "elasticity", "delay", "clock_drift"])
def test_assumptions_of_a_plant(name: str) -> None:
    """Logs with measured torques: nothing in a right one, and each wrong assumption by name."""
    assert log_trials.first(log_trials.trial(name, 1, predicted=True)) == name


def test_lost_samples_and_gaps() -> None:
    log = sampled(RIGID, LAW, 0.005)
    rng = np.random.default_rng(3)
    kept = rng.uniform(size=len(log.t)) > 0.01
    kept[1000:1100] = False
    assert log.tau is not None
    fit = al.fit_log(
        al.RigidArm(WRONG), al.Log(log.t[kept], log.q[kept], tau=log.tau[kept], names=log.names), ["inertia", "rotors", "viscous"]
    )
    np.testing.assert_allclose(fit.arm.gravity([0.3, 0.4]), ARM.gravity([0.3, 0.4]), atol=0.1)


def test_consistent_bodies() -> None:
    log = sampled(RIGID, LAW, 0.005)
    fit = al.fit_log(al.RigidArm(WRONG), log, ["inertia", "rotors", "viscous"], consistent=True)
    assert fit.arm.check_parameters().consistent and fit.before is not None
    assert "damping[joint1]" in fit.names and fit.refuted == fit.before.refuted


LOG = al.Log(0.01 * np.arange(60.0), np.zeros((60, 2)), tau=np.ones((60, 2)), names=ARM.joint_names)
ERRORS = {
    "a velocity plant": (al.VelocityArm(ARM), {}, "model has the wrong plant"),
    "a wall": (al.RigidArm(ARM, wall=al.Wall("link2", [0.0, -1.0, 0.0], [0.0, 1.0, 0.0], stiffness=1e3)), {}, "model has wall"),
    "bristles": (al.RigidArm(ARM, friction=al.LuGre(coulomb=1.0, stiffness=1e3)), {}, "model has other friction"),
    "a full stiffness": (al.ElasticArm(ARM, [[800.0, 1.0], [1.0, 500.0]], 0.3), {}, "model has a stiffness that is not diagonal"),
    "two clocks": (RIGID, {"names": ["delay", "clock_offset"]}, "names have delay and clock_offset"),
    "no springs": (RIGID, {"names": ["viscous", "stiffness"]}, r"names\[1\] is 'stiffness'"),
    "stribeck": (RIGID, {"names": ["stribeck"]}, "names"),
    "a pair without a law": ((RIGID, 3), {}, "model is of the wrong type"),
    "a number": (3, {}, "model is of the wrong type"),
    "held": (RIGID, {"held": 1}, "held"),
    "delay": (RIGID, {"delay": np.inf}, "delay is not finite"),
    "short": (RIGID, {"log": LOG.cut(0.0, 0.1)}, "log is too short"),
}


@pytest.mark.parametrize("name", ERRORS)
def test_errors(name: str) -> None:
    model, more, message = ERRORS[name]
    with pytest.raises(al.InputError, match=message):
        al.fit_log(model, **{"log": LOG, "names": ["viscous"], **more})
