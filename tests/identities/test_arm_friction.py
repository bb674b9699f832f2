"""Coulomb friction of an arm, which holds joints at rest: adaptive methods with `friction=True`, and every method with "stick_slip"."""

import pickle
import warnings

import models
import numpy as np
import pytest

import armlet as al

ADAPTIVE = ["dopri5", "dop853", "radau5", "rodas4"]
ARMS = {
    "2R": models.TWO_LINKS.with_drives(friction=[2.0, 1.0], damping=[0.2, 0.1]),
    "six axes": models.SIX_AXES.with_drives(friction=[2.0] * 6, damping=[1.0] * 6),
}
M, K, F = 2.0, 8.0, 1.5  # kg, N/m, N
BOX = al.Arm.from_chain([{"type": "P", "axis": [1, 0, 0], "phi": [M] + [0.0] * 9, "friction": F}])
SPRING = al.PDGravity(BOX, [0.0], K, 1e-12)  # a negligible damping


def loop(name, target):
    arm = ARMS[name]
    gains = al.suggest_gains(arm, 15.0)
    return arm, np.asarray(gains.kp), al.PDGravity(arm, np.full(arm.n, target), gains.kp, gains.kd)


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("friction", [True, "stick_slip"])
@pytest.mark.parametrize(("target", "speed"), [(0.3, 0.0), (0.0, 0.0), (0.3, 0.5), (0.0, -0.5)])
@pytest.mark.parametrize("name", list(ARMS))
def test_an_arm_comes_to_rest_within_its_friction(name, target, speed, friction, method):
    arm, kp, law = loop(name, target)
    n = arm.n
    run = al.simulate(al.RigidArm(arm, friction=friction), law, np.zeros(n), v0=np.full(n, speed), t_end=3.0, method=method)
    # At rest, kp |q_d - q| <= F. A joint that approaches rest for an infinite time adds its remaining motion, 2e-3 rad.
    assert np.all(np.abs(run.q[-1] - target) <= arm.limits["friction"] / kp + 2e-3)
    # Steps end at each change between sticking and slipping, so only the tolerance of 1e-8 remains of energies up to 60 J.
    assert np.abs(run.monitors["energy_balance"]).max() < 1e-6
    assert run.stats["steps"] < 2000


@pytest.mark.parametrize("name", list(ARMS))
def test_fixed_steps_count_the_energy_that_friction_takes(name):
    arm, _, law = loop(name, 0.3)
    run = al.simulate(al.RigidArm(arm, friction=True), law, np.zeros(arm.n), t_end=0.5, dt=1e-3)
    power = np.einsum("ki,ki->k", arm.inverse_dynamics(run.q, run.v, 0.0 * run.v, friction=True) - arm.bias(run.q, run.v), run.v)
    taken = np.sum(power[1:] + power[:-1]) / 2 * 1e-3
    assert taken > 0.05
    # The torque of dry friction jumps within a step, in which a joint turns round: its energy there is not exact.
    assert np.abs(run.monitors["energy_balance"]).max() < 5e-3 * taken


def decay(t, x0):
    """Position of a mass on a spring with Coulomb friction, from rest at x0 > 0: half cosines around +-F/K, until |x| <= F/K at rest."""
    half, offset = np.pi * np.sqrt(M / K), F / K
    x, start, side = np.zeros_like(t), x0, 1.0
    for k in range(100):
        inside = t >= k * half
        if abs(start) <= offset:
            x[inside] = start
            return x
        x[inside] = side * offset + (start - side * offset) * np.cos(np.sqrt(K / M) * (t[inside] - k * half))
        start, side = 2 * side * offset - start, -side
    raise AssertionError


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("x0", [1.0, 0.7, 0.1])
def test_a_mass_on_a_spring_decays_in_half_cosines(x0, method):
    run = al.simulate(al.RigidArm(BOX, friction=True), SPRING, [x0], t_end=8.0, method=method, t_eval=np.linspace(0.0, 8.0, 161))
    # The tolerance is 1e-8 per step.
    np.testing.assert_allclose(run.q[:, 0], decay(run.t, x0), rtol=0.0, atol=1e-6)
    assert run.v[-1, 0] == 0.0
    fixed = al.simulate(al.RigidArm(BOX, friction="stick_slip"), SPRING, [x0], t_end=8.0, dt=1e-3, record_every=50)
    # With fixed steps the time of each stop has an error of the order of the step, 1e-3 s, and its effect is F dt / M.
    np.testing.assert_allclose(fixed.q[:, 0], decay(fixed.t, x0), rtol=0.0, atol=1e-2)
    assert fixed.v[-1, 0] == 0.0


@pytest.mark.parametrize("friction", [True, "stick_slip"])
def test_a_row_of_a_batch_is_the_single_run(friction):
    arm, _, law = loop("2R", 0.3)
    plant, times = al.RigidArm(arm, friction=friction), np.linspace(0.0, 3.0, 31)
    starts = np.array([[0.0, 0.0], [0.3, 0.3], [0.5, -0.4]])
    batch = al.simulate_batch(plant, law, starts, t_end=3.0, method="radau5", t_eval=times)
    assert (batch.status == al.Status.SUCCESS).all()
    for q0, row in zip(starts, batch, strict=True):
        run = al.simulate(plant, law, q0, t_end=3.0, method="radau5", t_eval=times)
        np.testing.assert_array_equal(row.q, run.q)
        np.testing.assert_array_equal(row.friction, run.friction)


def test_a_sampled_law_holds_an_arm_with_friction():
    arm, kp, law = loop("2R", 0.3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = al.simulate(al.RigidArm(arm, friction=True), law, [0.0, 0.0], t_end=3.0, method="dop853", sample_time=1e-3)
    assert np.all(np.abs(run.q[-1] - 0.3) <= arm.limits["friction"] / kp + 2e-3)


def test_the_word_is_an_argument_of_the_plant():
    plant = al.RigidArm(ARMS["2R"], friction="stick_slip")
    assert "friction='stick_slip'" in repr(plant)
    arm, _, law = loop("2R", 0.3)
    runs = [al.simulate(p, law, [0.0, 0.0], t_end=1.0, dt=1e-3).q for p in (plant, pickle.loads(pickle.dumps(plant)))]
    np.testing.assert_array_equal(runs[0], runs[1])
    with pytest.raises(al.InputError, match=r"RigidArm: friction is unknown: expected a flag, a friction model or \"stick_slip\", got"):
        al.RigidArm(arm, friction="smooth")
    with pytest.raises(al.InputError, match="friction"):
        al.RigidArm(models.PR, friction="stick_slip")
    data = {
        "arm": {"kind": "example", "name": "six_axis"},
        "plant": {"kind": "RigidArm", "friction": "stick_slip"},
        "law": {"kind": "PDGravity", "target": [0.1] * 6, "kp": 100.0, "kd": 20.0},
        "run": {"q0": [0.0] * 6, "t_end": 0.1, "method": "dopri5"},
    }
    assert al.Scenario.from_dict(data).run().friction.shape[1] == 6
    with pytest.raises(al.InputError, match=r"plant.friction: expected one of stick_slip, got 'smooth'"):
        al.Scenario.from_dict(data | {"plant": data["plant"] | {"friction": "smooth"}})


@pytest.mark.parametrize("method", ["radau5", "dop853"])
def test_a_jump_at_the_start_ends_a_run_at_a_sane_step(method):
    calls = []

    def slope(t, y):
        calls.append(t)
        return np.where(y > 0.0, -1.0, 2.0)

    run = al.integrate(slope, (0.0, 1.0), [0.0], method=method, throw=False)
    assert run.status in (al.Status.STEP_UNDERFLOW, al.Status.STALLED) and len(calls) < 200_000
    assert min(t for t in calls if t > 0.0) > 1e-40
