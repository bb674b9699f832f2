"""Systems for python-control: responses compared with `simulate`, poles compared with `equilibrium`, and refused arguments."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import control
import models
import numpy as np
import pytest

import armlet as al

ARM = models.TWO_HEAVY_LINKS
SEVEN = models.SEVEN_AXES
MOTION = al.Sinusoid([0.0, 0.5], [0.5, 0.5], [1.0, 2.0], [0.0, 0.3])
HOLD = [0.3, 1.0]
STIFF = [[800.0, 50.0], [50.0, 500.0]]
ELASTIC = al.ElasticArm(ARM, STIFF, [0.4, 0.3], joint_damping=[1.0, 0.5], motor_friction=[0.2, 0.1])
PLAIN_ELASTIC = al.ElasticArm(ARM, 800.0, 0.4)
SPRING = al.ElasticImpedance(ARM, [0.6, 0.4], [300.0, 200.0], [40.0, 30.0], 800.0, 0.4, 0.1, frame="link2", axes="xy")
MOTORS = al.MotorPD(ARM, HOLD, 400.0, 60.0, STIFF)
PD = al.PDGravity(ARM, HOLD, kp=100.0, kd=20.0)
ADAPTIVE = al.Adaptive(models.PR, MOTION, [40.0, 20.0], [20.0, 10.0], 5.0, estimate=[1.0, 0.2, 0.4])
FILTERED = al.PID(ARM, MOTION, 80.0, 60.0, 15.0, derivative_filter=300.0, observer_bandwidth=20.0)
COMPOSITE = al.Adaptive(ARM, MOTION, 40.0, 20.0, 0.5, composite=1.0)
PUSHED = al.CartesianImpedance(ARM, [0.6, 0.4], 300.0, 40.0, frame="link2", axes="xy", integral_gain=200.0)
REACH = al.PriorityVelocity(ARM, [al.Task("link2", "xy", [0.5, 0.4], 5.0)])

LOOPS: dict[str, tuple[al.Plant, al.Law]] = {
    "PD": (al.RigidArm(ARM), PD),
    "computed torque": (al.RigidArm(ARM), al.ComputedTorque(ARM, MOTION, 100.0, 20.0)),
    "adaptive": (al.RigidArm(models.PR), ADAPTIVE),
    "adaptive, all parameters": (al.RigidArm(ARM), al.Adaptive(ARM, MOTION, 40.0, 20.0, 0.5)),
    "PID": (al.RigidArm(ARM), al.PID(ARM, MOTION, 80.0, 60.0, 15.0)),
    "PID with filter and observer": (al.RigidArm(ARM), FILTERED),
    "composite": (al.RigidArm(ARM), COMPOSITE),
    "impedance with integral": (al.RigidArm(ARM), PUSHED),
    "guarded": (al.RigidArm(ARM), al.Guarded(FILTERED, al.MomentumObserver(ARM, 30.0))),
    "elastic, closed form": (
        al.ElasticArm(models.PR, 800.0, 0.4),
        al.MotorPD(models.PR, HOLD, 90.0, 30.0, 800.0),
    ),
    "elastic": (PLAIN_ELASTIC, SPRING),
    "motors": (ELASTIC, MOTORS),
    "velocity": (al.VelocityArm(ARM), REACH),
}
Q0 = np.array([0.2, 0.8])
TIMES = np.linspace(0.0, 0.5, 6)
TIGHT = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-12}


def start(system: Any, run: al.Run) -> Any:
    """The first record of a run as a state vector of the system."""
    parts = {name: getattr(run, name) for name in ("q", "v", "theta", "theta_dot", "estimate")}
    return np.concatenate([values[0] for name, values in parts.items() if values is not None and f"{name}1" in system.state_labels])


@pytest.mark.parametrize(("plant", "law"), LOOPS.values(), ids=LOOPS.keys())
def test_a_loop_responds_as_it_is_simulated(plant: al.Plant, law: al.Law) -> None:
    """Two integrators with small tolerances agree, because the loops are contracting."""
    run = al.simulate(plant, law, Q0, t_end=0.5, method="dop853", rtol=1e-11, atol=1e-12, t_eval=TIMES)
    system = al.to_control(plant, law)
    response = control.input_output_response(system, TIMES, 0.0, start(system, run), solve_ivp_kwargs=TIGHT)
    found = dict(zip(system.output_labels, response.outputs, strict=True))
    for name in ("q", "v", "theta", "theta_dot", "estimate", "tau"):
        wanted = getattr(run, name)
        drive = name == "tau" and isinstance(plant, al.VelocityArm)
        if wanted is None or (name == "v" and "v1" not in found):
            continue
        scale = np.abs(wanted).max()
        for i in range(wanted.shape[1]):
            np.testing.assert_allclose(found[f"{'u' if drive else name}{i + 1}"], wanted[:, i], rtol=0.0, atol=1e-8 * max(scale, 1.0))


@pytest.mark.parametrize("plant", [al.RigidArm(ARM), al.RigidArm(SEVEN, friction=True), ELASTIC], ids=["rigid", "friction", "elastic"])
def test_an_arm_responds_as_it_is_simulated(plant: al.Plant) -> None:
    """Under a constant torque, the response of `to_control` equals the simulation of the arm.

    The tolerances are larger than for a loop. The errors of the integrators grow here, and the dry friction of seven axes switches.
    """
    n = plant.arm.n
    tau = 0.5 * np.ones(n)
    push: Any = (lambda t, q, v, theta, theta_dot: tau) if isinstance(plant, al.ElasticArm) else (lambda t, q, v: tau)
    q0, v0 = np.linspace(0.2, 0.8, n), np.linspace(0.5, 0.4, n)
    times = np.linspace(0.0, 0.1, 3)
    options: Any = {"method": "dop853", "rtol": 1e-11, "atol": 1e-12, "t_eval": times, "sample_time": 0.1, "check_limits": False}
    run = al.simulate(plant, push, q0, v0=v0, t_end=0.1, **options)
    system = al.to_control(plant)
    inputs = np.tile(tau[:, None], (1, 3))
    response = control.input_output_response(system, times, inputs, start(system, run), solve_ivp_kwargs=TIGHT)
    np.testing.assert_allclose(response.outputs[:n].T, run.q, rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(response.outputs[n : 2 * n].T, run.v, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(("plant", "law"), LOOPS.values(), ids=LOOPS.keys())
def test_the_linear_loop_is_the_slope_of_the_nonlinear_one(plant: al.Plant, law: al.Law) -> None:
    """python-control differentiates by one-sided differences with step 1e-6.

    Their errors are the step times the second derivative, plus rounding errors of the rates divided by the step.
    """
    nonlinear = al.to_control(plant, law)
    rng = np.random.default_rng(2)
    x = rng.uniform(-0.5, 0.5, nonlinear.nstates)
    linear = al.to_control(plant, law, x, t=0.7)
    theirs = nonlinear.linearize(x, np.zeros(nonlinear.ninputs), t=0.7)
    for name in "ABCD":
        mine, wanted = getattr(linear, name), getattr(theirs, name)
        np.testing.assert_allclose(mine, wanted, rtol=0.0, atol=3e-5 * max(np.abs(wanted).max(), 1.0), err_msg=name)
    assert linear.state_labels == nonlinear.state_labels and linear.output_labels == nonlinear.output_labels


def test_a_small_step_of_the_linear_loop_is_the_simulated_one() -> None:
    """At a distance of 1e-4 from the equilibrium, the linear system neglects terms of second order."""
    system = al.to_control(al.RigidArm(ARM), PD, HOLD)
    off = np.array([1e-4, -1e-4])
    run = al.simulate(al.RigidArm(ARM), PD, HOLD + off, t_end=0.5, method="dop853", rtol=1e-11, atol=1e-13, t_eval=TIMES)
    response = control.initial_response(system, TIMES, np.concatenate([off, [0.0, 0.0]]))
    np.testing.assert_allclose(response.outputs[:2].T, run.q - HOLD, rtol=0.0, atol=3e-8)
    assert np.abs(run.q[-1] - HOLD).max() > 5e-6


@pytest.mark.parametrize(("plant", "law"), [(al.RigidArm(ARM), PD), (PLAIN_ELASTIC, SPRING), (ELASTIC, None)], ids=["PD", "elastic", "arm"])
def test_poles(plant: al.Plant, law: al.Law | None) -> None:
    """The poles equal the eigenvalues of `equilibrium`.

    For an arm alone, the magnitudes of the poles equal the undamped frequencies of its mass and stiffness matrices.
    """
    if law is not None:
        rest = al.equilibrium(plant, law, None, q0=HOLD)
        x = np.concatenate([rest.q, [0.0, 0.0]] + ([] if rest.theta is None else [rest.theta, [0.0, 0.0]]))
        found = np.sort_complex(al.to_control(plant, law, x).poles())
        # The poles agree to 3e-11 1/s.
        np.testing.assert_allclose(found, np.sort_complex(rest.eigenvalues), rtol=0.0, atol=1e-4)
        return
    system = al.to_control(al.ElasticArm(ARM.with_gravity([0.0, 0.0, 0.0]), STIFF, [0.4, 0.3]), x0=HOLD)
    M, K, B = ARM.mass_matrix(HOLD), np.array(STIFF), np.diag([0.4, 0.3])
    squares = np.linalg.eigvals(np.linalg.solve(np.block([[M, 0 * M], [0 * M, B]]), np.block([[K, -K], [-K, K]])))
    np.testing.assert_allclose(np.sort(np.abs(system.poles()))[::2][-2:], np.sort(np.sqrt(np.abs(squares)))[-2:], rtol=1e-6)


@pytest.mark.parametrize(
    ("arguments", "keywords", "message"),
    [
        ((3,), {}, "plant is of the wrong type: expected a plant or an arm, got int"),
        ((ARM, 3), {}, "law is of the wrong type"),
        ((ARM, al.PDGravity(SEVEN, np.zeros(7), 1.0, 1.0)), {}, "to_control: law "),
        ((ARM, None, [0.0]), {}, r"x0 has the wrong shape: expected \(2,\) or \(4,\), got \(1,\)"),
        ((ARM, None, [0.0, np.nan]), {}, "x0 is not finite"),
        ((ARM, None, HOLD), {"u0": [1.0]}, "u0 has the wrong shape"),
        ((ARM, PD, HOLD), {"u0": [1.0, 0.0]}, "u0 is given with a law"),
        ((ARM,), {"u0": [1.0, 0.0]}, "u0 is given without x0"),
        ((ELASTIC, PD), {}, "to_control: law .*expected a law for ElasticArm, got PDGravity"),
        ((al.RigidArm(ARM, wall=al.Wall("link2", [0.7, 0, 0], [-1, 0, 0], stiffness=1e3)),), {}, "plant has a wall"),
        ((al.RigidArm(ARM, stops=al.JointStops(1e4, 10.0, -1.0, 1.0)), PD), {}, "plant has joint stops"),
    ],
)
def test_refusals(arguments: Any, keywords: dict[str, Any], message: str) -> None:
    with pytest.raises(al.InputError, match=message):
        al.to_control(*arguments, **keywords)


def test_without_python_control_one_line() -> None:
    call = "try:\n al.to_control(al.pendulum(1.0, 1.0))\nexcept ImportError as error: print(error)"
    code = f"import sys; sys.modules['control'] = None\nimport armlet as al\n{call}"
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "to_control: python-control is not installed: pip install '.[control]' in the folder of armlet's sources\n"


DRY = ARM.with_drives(damping=[0.8, 0.5], friction=[1.5, 1.0])


@pytest.mark.parametrize("law", [None, PD], ids=["arm", "loop"])
def test_friction_is_in_the_linear_system(law: al.Law | None) -> None:
    """In motion, the derivative of Coulomb friction is zero, and that of viscous friction is not.

    The linear system has the derivatives of the nonlinear one.
    """
    plant, x = al.RigidArm(DRY, friction=True), np.array([0.3, 1.0, 0.6, -0.7])
    u = np.zeros(2) if law else DRY.bias(x[:2], x[2:], friction=True)
    linear = al.to_control(plant, law, x)
    theirs = al.to_control(plant, law).linearize(x, u)
    # The reference uses one-sided differences with step 1e-6.
    np.testing.assert_allclose(linear.A, theirs.A, rtol=0.0, atol=3e-5 * np.abs(theirs.A).max())
    np.testing.assert_allclose(linear.B, theirs.B, rtol=0.0, atol=3e-5 * np.abs(theirs.B).max())
    without = al.to_control(al.RigidArm(DRY), law, x)
    viscous = np.linalg.solve(DRY.mass_matrix(x[:2]), np.diag([0.8, 0.5]))
    np.testing.assert_allclose((without.A - linear.A)[2:, 2:], viscous, rtol=0.0, atol=1e-9 * np.abs(viscous).max())
