"""Derivatives of runs that settle, with adaptive methods: compared with differences of tight runs and with closed forms.

Where the state hardly moves, the error of the state does not limit the steps of an explicit method. The derivatives must limit them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

import armlet as al
from armlet.run.named_numbers import loop_with, named_numbers

Array = NDArray[np.float64]

ARM = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0], inertias=[0.3, 0.2])
LIGHT = models.TWO_LINKS
Q0, TARGET = np.array([0.1, -0.2]), [0.4, 0.3]
SWING = al.Quintic([0.0, 0.0], TARGET, 0.3)
GAINS: dict[str, Any] = {"kp": [400.0, 300.0], "kd": [60.0, 40.0]}
K, B = [3e4, 2e4], [0.2, 0.1]
TIP = {"frame": "link2", "axes": "xy"}
IMPEDANCE: tuple[Any, ...] = ([0.7, 0.1], [400.0, 300.0], [80.0, 60.0])

LAWS: dict[str, Callable[[], Any]] = {
    "PDGravity": lambda: al.PDGravity(ARM, TARGET, **GAINS),
    "full gains": lambda: al.PDGravity(ARM, TARGET, kp=[[400.0, 50.0], [50.0, 300.0]], kd=[[60.0, 5.0], [5.0, 40.0]]),
    "PID": lambda: al.PID(ARM, TARGET, kp=[400.0, 300.0], ki=[200.0, 300.0], kd=[60.0, 40.0]),
    "PID, all options": lambda: al.PID(
        ARM,
        TARGET,
        kp=[80.0, 60.0],
        ki=[20.0, 30.0],
        kd=[30.0, 20.0],
        tau_max=[500.0, 500.0],
        derivative_filter=[900.0, 1200.0],
        friction=True,
        observer_bandwidth=[30.0, 20.0],
        nominal_inertia=[0.5, 0.2],
    ),
    "ComputedTorque": lambda: al.ComputedTorque(ARM, SWING, kp=[900.0, 400.0], kd=[200.0, 100.0]),
    "Adaptive": lambda: al.Adaptive(ARM, SWING, **GAINS, gamma=0.3, estimate=0.8 * ARM.parameters),
    "Adaptive, composite": lambda: al.Adaptive(ARM, SWING, **GAINS, gamma=0.1, composite=0.3, composite_rate=80.0),
    "Adaptive, leakage": lambda: al.Adaptive(ARM, SWING, **GAINS, gamma=0.1, leakage=0.2, armature=True),
    "CartesianImpedance": lambda: al.CartesianImpedance(ARM, *IMPEDANCE, **TIP),
    "MotorPD": lambda: al.MotorPD(ARM, TARGET, kp=[400.0, 300.0], kd=[60.0, 40.0], joint_stiffness=K),
    "JointImpedance": lambda: al.JointImpedance(
        ARM, TARGET, [400.0, 300.0], [60.0, 40.0], joint_stiffness=K, motor_inertia=B, reduced_inertia=[0.1, 0.06]
    ),
    "ElasticImpedance": lambda: al.ElasticImpedance(ARM, *IMPEDANCE, K, B, [0.1, 0.06], **TIP),
    "PriorityVelocity": lambda: al.PriorityVelocity(
        ARM, [al.Task("link2", "x", target=[0.6], gain=200.0), al.Task("link1", "y", target=[0.1], gain=150.0)]
    ),
    "PriorityAcceleration": lambda: al.PriorityAcceleration(
        ARM, [al.Task("link2", "xy", target=[0.6, 0.2], gain=800.0)], joint_damping=50.0
    ),
}
ELASTIC = ("MotorPD", "JointImpedance", "ElasticImpedance")
SERIES = ("q", "v", "tau", "estimate", "theta", "theta_dot")
#: A parameter of each kind: start, gains, target, motion, state of the law, model, plant.
NAMES = ("q0", "law.kp", "law.ki", "law.stiffness", "law.target", "law.motion.end", "law.estimate", "plant.stiffness", "law.tasks.0.gain")
TIGHT: dict[str, Any] = {"method": "dop853", "rtol": 1e-13, "atol": 1e-14, "monitors": False}
#: For a law with fast filters. Steps of `dop853` at its limit of stability have errors of 1e-8 in `tau`.
STIFF = TIGHT | {"method": "radau5", "rtol": 1e-12, "atol": 1e-13}


def plant_of(name: str) -> Any:
    if name in ELASTIC:
        return al.ElasticArm(ARM, K, B)
    return al.VelocityArm(ARM) if name == "PriorityVelocity" else al.RigidArm(ARM)


def records(run: Any) -> dict[str, Array]:
    return {each: getattr(run, each) for each in SERIES if getattr(run, each) is not None}


def differences(plant: Any, law: Any, q0: Array, name: str, along: Array, options: dict[str, Any]) -> dict[str, Array]:
    """The derivative of the records with respect to a parameter along `along`: a difference of order six of tight runs."""
    start = {"q0": q0, "v0": None, "theta0": None, "theta_dot0": None}
    tight = STIFF if isinstance(law, al.PID) else TIGHT
    value, step, total = named_numbers(plant, law, start)[name], 4e-3, dict[str, Array]()
    for offset, weight in ((1, 45.0), (2, -9.0), (3, 1.0)):
        for sign in (1, -1):
            other, control, begun = loop_with(plant, law, start, name, value + sign * offset * step * along)
            for each, x in records(al.simulate(other, control, begun["q0"], **options | tight)).items():
                total[each] = total.get(each, np.zeros_like(x)) + sign * weight * x / (60.0 * step)
    return total


def compare(plant: Any, law: Any, q0: Array, names: list[str], options: dict[str, Any], method: str) -> None:
    """Compare the forward derivatives with differences, and the adjoint of a random weighted sum of the records."""
    rng = np.random.default_rng(3)
    run = al.simulate(plant, law, q0, monitors=False, method=method, sensitivity=names, **options)
    weights = {each: rng.standard_normal(x.shape) for each, x in records(run).items()}
    _, slopes = al.gradient(lambda _: (0.0, weights), plant, law, q0, names, method=method, **options)
    known = named_numbers(plant, law, {"q0": q0, "v0": None, "theta0": None, "theta_dot0": None})
    assert run.sensitivity is not None
    for name in names:
        value = known[name]
        along = rng.uniform(0.3, 1.0, value.shape) * np.where(value == 0.0, 0.5, np.abs(value)) * rng.choice([-1.0, 1.0], value.shape)
        along = (along + along.T) / 2 if value.ndim == 2 and value.shape[0] == value.shape[1] else along
        expected = differences(plant, law, q0, name, along, options)
        total, size = 0.0, 0.0
        for each, right in expected.items():
            found = getattr(run.sensitivity[name], each) @ along.ravel()
            # The tolerances of the run are 1e-10 and 1e-12. The differences have rounding errors near 1e-10 of the records.
            np.testing.assert_allclose(found, right, rtol=0.0, atol=1e-6 * np.abs(right).max() + 1e-9, err_msg=f"{name} {each}")
            total, size = total + (weights[each] * right).sum(), size + np.abs(weights[each] * right).sum()
        assert abs(slopes[name].ravel() @ along.ravel() - total) <= 1e-6 * size + 1e-8, name


@pytest.mark.parametrize("method", ["dopri5", "dop853"])
@pytest.mark.parametrize("name", LAWS)
def test_every_law(name: str, method: str) -> None:
    law, plant = LAWS[name](), plant_of(name)
    known = named_numbers(plant, law, {"q0": Q0, "v0": None, "theta0": None, "theta_dot0": None})
    names = [each for each in NAMES if each in known]
    assert len(names) >= 2
    options = {"t_end": 1.5, "t_eval": np.linspace(0.0, 1.5, 7), "rtol": 1e-9, "atol": 1e-11}
    compare(plant, law, Q0, names, options, method)


@pytest.mark.parametrize("method", ["dopri5", "dop853"])
@pytest.mark.parametrize(("kp", "kd"), [(40.0, 7.0), (400.0, 60.0), (4000.0, 600.0)])
@pytest.mark.parametrize("times", [None, np.linspace(0.0, 2.0, 11)], ids=["steps", "times"])
def test_a_pendulum_at_its_target(kp: float, kd: float, method: str, times: Array | None) -> None:
    """The state does not move: `dq/dq0` is an entry of `exp(A t)`."""
    arm = al.pendulum(0.3, 2.0)
    law, a = al.PDGravity(arm, [1.0], kp, kd), np.array([[0.0, 1.0], [-kp / 0.3, -kd / 0.3]])
    # The default tolerances are 1e-8 and 1e-10.
    run = al.simulate(al.RigidArm(arm), law, [1.0], t_end=2.0, method=method, t_eval=times, sensitivity=["q0", "law.kp"])
    assert run.sensitivity is not None
    expected = np.array([expm(a * t)[0] for t in run.t])
    np.testing.assert_allclose(run.sensitivity["q0"].q[:, 0, 0], expected[:, 0], rtol=0.0, atol=1e-7)
    # The gain acts on an error of zero, so its derivative is zero up to rounding.
    assert np.abs(run.sensitivity["law.kp"].q).max() < 1e-12

    def last(run: Any) -> tuple[float, dict[str, Array]]:
        return run.q[-1, 0], {"q": np.eye(1, len(run.t), len(run.t) - 1).T}

    _, slopes = al.gradient(last, al.RigidArm(arm), law, [1.0], ["q0", "law.kp"], t_end=2.0, method=method, t_eval=times)
    np.testing.assert_allclose(slopes["q0"], expected[-1, 0], rtol=0.0, atol=1e-9)
    assert np.abs(slopes["law.kp"]) < 1e-12


@pytest.mark.parametrize("method", ["dopri5", "dop853"])
def test_parameters_that_hardly_act(method: str) -> None:
    """The loop starts 1 nrad from its target, so the tangents of the gains are small and limit no step. The adjoint must be bounded too."""
    law, plant, q0 = al.PDGravity(LIGHT, [0.4, 0.9], 60.0, 20.0), al.RigidArm(LIGHT), [0.4 + 1e-9, 0.9]
    options: dict[str, Any] = {"t_end": 2.0, "t_eval": np.linspace(0.0, 2.0, 21), "method": method}
    weights = {"q": np.ones((21, 2)), "v": np.ones((21, 2)), "tau": np.ones((21, 2))}
    _, slopes = al.gradient(lambda _: (0.0, weights), plant, law, q0, ["law.kp", "law.kd"], **options)
    tight = al.simulate(plant, law, q0, t_end=2.0, t_eval=options["t_eval"], dt=1e-4, sensitivity=["law.kp", "law.kd"])
    assert tight.sensitivity is not None
    for name, slope in slopes.items():
        expected = sum(getattr(tight.sensitivity[name], each).sum(axis=(0, 1)) for each in weights)
        # The tolerance 1e-10 of the state, divided by the gains.
        np.testing.assert_allclose(slope, expected, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("method", ["dopri5", "dop853"])
def test_a_run_that_succeeds_has_derivatives(method: str, rtol: float) -> None:
    law, plant = al.PDGravity(LIGHT, [0.4, 0.9], 60.0, 20.0), al.RigidArm(LIGHT)
    for times in (None, np.linspace(0.0, 2.0, 11), np.linspace(0.0, 2.0, 401)):
        options: dict[str, Any] = {"t_end": 2.0, "rtol": rtol, "atol": rtol / 100, "t_eval": times, "method": method}
        run = al.simulate(plant, law, [0.0, 0.0], sensitivity="law.kp", **options)
        tight = al.simulate(plant, law, [0.0, 0.0], sensitivity="law.kp", **options | {"rtol": 1e-12, "atol": 1e-14, "t_eval": run.t})
        assert run.sensitivity is not None and tight.sensitivity is not None
        found, expected = run.sensitivity["law.kp"].q, tight.sensitivity["law.kp"].q
        # The error is below the relative tolerance, up to the amplification of errors by the loop.
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=10.0 * rtol * np.abs(expected).max())


@pytest.mark.parametrize("method", ["dopri5", "dop853"])
@pytest.mark.parametrize("case", ["wall", "stops", "sampled"])
def test_contacts_and_samples(case: str, method: str) -> None:
    law = LAWS["PDGravity"]()
    wall = al.Wall("link2", [0.86, 0.0, 0.0], [-1.0, 0.0, 0.0], stiffness=3e4, damping=300.0)
    stops = al.JointStops(lower=[-3.0, -3.0], upper=[0.3, 3.0], stiffness=3e4, damping=300.0)
    plant = {"wall": al.RigidArm(ARM, wall=wall), "stops": al.RigidArm(ARM, stops=stops), "sampled": al.RigidArm(ARM)}[case]
    options: dict[str, Any] = {"t_end": 1.0, "t_eval": np.linspace(0.0, 1.0, 6), "rtol": 1e-10, "atol": 1e-12}
    if case == "sampled":
        options["sample_time"] = 4e-3
    compare(plant, law, Q0, ["q0", "law.kp"], options, method)


def test_rows_of_a_batch_have_the_bits_of_single_runs() -> None:
    law, plant, starts = LAWS["PDGravity"](), al.RigidArm(ARM), np.array([[0.1, -0.2], [0.4, 0.3], [0.0, 0.5]])
    options: dict[str, Any] = {"t_end": 1.0, "t_eval": np.linspace(0.0, 1.0, 6), "method": "dopri5"}
    batch = al.simulate_batch(plant, law, starts, sensitivity="law.kp", **options)
    _, slopes = al.gradient("error_rms", plant, law, starts, "law.kp", **options)
    assert batch.sensitivity is not None
    for row, q0 in enumerate(starts):
        run = al.simulate(plant, law, q0, sensitivity="law.kp", **options)
        assert run.sensitivity is not None
        np.testing.assert_array_equal(batch.sensitivity["law.kp"].q[row], run.sensitivity["law.kp"].q)
        np.testing.assert_array_equal(slopes["law.kp"][row], al.gradient("error_rms", plant, law, q0, "law.kp", **options)[1]["law.kp"])
