"""Forces that are functions of time: no step passes over their changes, and `max_step` limits every run of an adaptive method."""

import math
import warnings

import models
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import armlet as al

ADAPTIVE = ["dopri5", "dop853", "radau5", "rodas4"]
M, K, C = 2.0, 8.0, 2.0  # kg, N/m, N s/m
BOX = al.Arm.from_chain([{"type": "P", "axis": [1, 0, 0], "phi": [M, 0, 0, 0, 0, 0, 0, 0, 0, 0]}])
LAW = al.PDGravity(BOX, [0.0], K, C)
CALLS = 4097 + 4096  # the largest number of calls before a run, as documented


def push(pulse, **options):
    options = {"t_end": 10.0, "force_frame": "link1"} | options
    return al.simulate(al.RigidArm(BOX), LAW, [0.0], force=lambda t: [pulse(t), 0.0, 0.0], **options)


def answer(t, steps):
    """The position of the box under forces `size` from time `start` on: the step response of a damped oscillator."""
    d = C / (2 * M)
    w = math.sqrt(K / M - d * d)
    x = np.zeros_like(t)
    for start, size in steps:
        s = np.maximum(t - start, 0.0)
        x += size / K * (1.0 - np.exp(-d * s) * (np.cos(w * s) + d / w * np.sin(w * s)))
    return x


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize(
    "steps",
    [[(1.0, 20.0), (1.05, -20.0)], [(3.0, 1.0), (5.0, -1.0)], [(7.123, -400.0), (7.13, 400.0)], [(2.0, 5.0), (2.02, -10.0), (2.04, 5.0)]],
)
def test_a_pulse_has_its_exact_effect(method, steps):
    run = push(lambda t: sum(size for start, size in steps if t >= start), method=method)
    # The tolerance of the methods is 1e-8 of the size, and steps end at the jumps.
    np.testing.assert_allclose(run.q[:, 0], answer(run.t, steps), rtol=0.0, atol=1e-6 * np.abs(run.q).max())
    assert np.abs(run.q).max() > 9e-4 and run.stats["steps"] < 1000


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize(("width", "background"), [(0.03, 0.0), (0.005, 0.0), (0.03, 10.0)])
def test_a_smooth_bump_has_its_exact_effect(method, width, background):
    def pulse(t):
        return 20.0 * math.exp(-(((t - 3.0) / width) ** 2)) + background * math.sin(t)

    run = push(pulse, method=method)
    expected = solve_ivp(
        lambda t, y: [y[1], (pulse(t) - K * y[0] - C * y[1]) / M],
        (0.0, 10.0),
        [0.0, 0.0],
        "DOP853",
        run.t,
        rtol=1e-10,
        atol=1e-12,
        max_step=width,
    )
    # The absolute tolerance of a run is 1e-10, and its relative tolerance 1e-8 per step.
    np.testing.assert_allclose(run.q[:, 0], expected.y[0], rtol=0.0, atol=1e-6 * np.abs(expected.y[0]).max())
    assert np.abs(run.q[run.t > 3.0]).max() > 1e-3


def test_a_push_of_an_arm_is_that_of_the_list():
    arm = models.SIX_AXES
    gains = al.suggest_gains(arm, 10.0)
    law = al.PDGravity(arm, np.zeros(6), gains.kp, gains.kd)
    wrench = [10.0, -5.0, 3.0, 0.5, 0.2, -0.1]
    options = {"t_end": 4.0, "method": "dop853", "force_frame": arm.tip_frame, "t_eval": np.linspace(0.0, 4.0, 81)}
    listed = al.simulate(al.RigidArm(arm), law, np.zeros(6), force=[(1.0, wrench), (1.02, [0.0] * 6)], **options)
    called = al.simulate(al.RigidArm(arm), law, np.zeros(6), force=lambda t: wrench if 1.0 <= t < 1.02 else [0.0] * 6, **options)
    assert np.abs(listed.q).max() > 1e-4
    np.testing.assert_allclose(called.q, listed.q, rtol=0.0, atol=1e-9)  # the tolerance per step is 1e-10


def test_the_number_of_calls_is_small():
    calls = []

    def still(t):
        calls.append(t)
        return 0.0

    run = push(still, method="dop853")
    assert run.stats["steps"] < 10 and len(calls) < 4097 + 200 and min(calls) == 0.0 and max(calls) <= 10.0
    calls.clear()
    rng = np.random.default_rng(0)
    run = push(lambda t: calls.append(t) or rng.normal(), method="dopri5", rtol=1e-3, atol=1e-3, t_end=1.0, monitors=False)
    assert len(calls) < CALLS + 10 * run.stats["evaluations"]
    # An infinite `max_step` omits the calls before the run.
    calls.clear()
    assert push(still, method="dop853", max_step=math.inf).stats["steps"] < 10 and len(calls) < 200


def test_an_exception_of_the_function_is_raised():
    with pytest.raises(ZeroDivisionError):
        push(lambda t: 1.0 / 0.0, method="dop853")
    with pytest.raises(al.InputError, match="force"):
        push(lambda t: math.nan, method="radau5")


@pytest.mark.parametrize("pulse", [lambda t: 20.0 * (1.004 <= t < 1.016), lambda t: 20.0 * math.exp(-(((t - 3.01) / 0.003) ** 2))])
def test_fixed_steps_that_are_too_long_for_the_force_are_reported(pulse):
    with pytest.warns(UserWarning, match=r"simulate: the force changes within .* too short for steps of 0.05 s"):
        push(pulse, dt=0.05)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        push(pulse, dt=1e-3)
        push(lambda t: 2.0 * math.sin(3.0 * t) + (t >= 3.0), dt=0.05)


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("sample_time", [None, 0.5])
def test_no_step_exceeds_max_step(method, sample_time):
    free = al.simulate(al.RigidArm(BOX), LAW, [1e-3], t_end=20.0, method=method, sample_time=sample_time)
    run = al.simulate(al.RigidArm(BOX), LAW, [1e-3], t_end=20.0, method=method, sample_time=sample_time, max_step=0.07)
    assert np.diff(free.t).max() > 0.2
    assert np.diff(run.t).max() < 0.07 + 1e-12  # rounding of the times
    batch = al.simulate_batch(
        al.RigidArm(BOX), LAW, [[1e-3], [2e-3]], t_end=20.0, method=method, sample_time=sample_time, max_step=0.07, t_eval=run.t
    )
    np.testing.assert_array_equal(
        batch.q[0],
        al.simulate(al.RigidArm(BOX), LAW, [1e-3], t_end=20.0, method=method, sample_time=sample_time, max_step=0.07, t_eval=run.t).q,
    )


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, "a", [0.1]])
def test_a_max_step_that_is_none_is_refused(bad):
    for run in (al.simulate, al.simulate_batch):
        with pytest.raises(al.InputError, match=f"{run.__name__}: max_step"):
            run(al.RigidArm(BOX), LAW, [0.0] if run is al.simulate else [[0.0]], t_end=1.0, method="dop853", t_eval=[1.0], max_step=bad)


def test_fixed_steps_refuse_max_step():
    for method in ("euler", "semi_implicit", "rk4", "ros2"):
        with pytest.raises(
            al.InputError, match=f"simulate: max_step is not used: expected None for {method}, which takes fixed steps, got 0.1"
        ):
            al.simulate(al.RigidArm(BOX), LAW, [0.0], t_end=1.0, dt=0.01, method=method, max_step=0.1)


def test_a_scenario_takes_max_step():
    data = {
        "arm": {"kind": "planar_arm", "lengths": [0.5]},
        "plant": {"kind": "RigidArm"},
        "law": {"kind": "PDGravity", "target": [0.0], "kp": 8.0, "kd": 2.0},
        "run": {"q0": [1e-3], "t_end": 20.0, "method": "dop853", "max_step": 0.07},
    }
    assert np.diff(al.Scenario.from_dict(data).run().t).max() < 0.07 + 1e-12  # rounding of the times
    with pytest.raises(al.InputError, match="max_step"):
        al.Scenario.from_dict(data | {"run": data["run"] | {"max_step": 0.0}})


def test_derivatives_follow_a_pulse_between_steps():
    times = np.linspace(0.0, 6.0, 13)

    def run(stiffness, **options):
        law = al.PDGravity(BOX, [0.0], stiffness, C)
        force = {"force": lambda t: [20.0 * (1.0 <= t < 1.05), 0.0, 0.0], "force_frame": "link1"}
        return al.simulate(
            al.RigidArm(BOX), law, [0.0], t_end=6.0, method="dop853", rtol=1e-11, atol=1e-13, t_eval=times, **force, **options
        )

    found = run(K, sensitivity=["law.kp"]).sensitivity["law.kp"].q[:, 0]
    h = 1e-3
    wanted = (run(K + h).q - run(K - h).q)[:, 0] / (2 * h)
    assert np.abs(wanted).max() > 1e-3
    # The difference of second order has the error h^2, and the rounding errors of the runs divided by h.
    np.testing.assert_allclose(np.ravel(found), wanted, rtol=0.0, atol=1e-7)
    _, gradient = al.gradient(
        lambda run: run.q[-1, 0],
        al.RigidArm(BOX),
        al.PDGravity(BOX, [0.0], K, C),
        [0.0],
        "law.kp",
        t_end=6.0,
        method="dop853",
        t_eval=times,
        rtol=1e-11,
        atol=1e-13,
        force=lambda t: [20.0 * (1.0 <= t < 1.05), 0.0, 0.0],
        force_frame="link1",
        max_step=0.5,
    )
    np.testing.assert_allclose(np.ravel(gradient["law.kp"]), wanted[-1], rtol=0.0, atol=1e-7)


@pytest.mark.parametrize("method", ADAPTIVE)
def test_a_movement_of_a_table_after_a_rest_is_followed(method):
    t = np.linspace(0.0, 10.0, 201)
    s = (t - 5.0) / 0.15
    bump = 0.3 * np.exp(-(s**2))
    table_rows = bump[:, None], (-2.0 * s * bump / 0.15)[:, None], ((4.0 * s**2 - 2.0) * bump / 0.15**2)[:, None]
    law = al.ComputedTorque(BOX, al.Table(0.05, *table_rows), kp=100.0, kd=20.0)
    options = {"t_end": 10.0, "method": method, "t_eval": t}
    run = al.simulate(al.RigidArm(BOX), law, [0.0], **options)
    # The law starts on the motion. So the error is that of the quintic between knots, 0.3 h^6 120 / (46080 w^6), plus that of its jerk.
    np.testing.assert_allclose(run.q[:, 0], bump, rtol=0.0, atol=1e-4)
    batch = al.simulate_batch(al.RigidArm(BOX), law, [[0.0], [0.0]], **options)
    np.testing.assert_array_equal(batch.q[1], run.q)
    # Rows with tables of their own.
    late = al.ComputedTorque(BOX, al.Table(0.05, *table_rows, start=1.0), kp=100.0, kd=20.0)
    rows = al.simulate_batch(al.RigidArm(BOX), [law, late], [[0.0], [0.0]], **options)
    np.testing.assert_array_equal(rows.q[0], run.q)
    np.testing.assert_array_equal(rows.q[1], al.simulate(al.RigidArm(BOX), late, [0.0], **options).q)
    np.testing.assert_allclose(rows.q[1, 20:, 0], bump[:-20], rtol=0.0, atol=1e-4)
