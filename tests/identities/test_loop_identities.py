"""Loops of any arm: orders of the methods, sampled control, laws in Python, single steps, natural adaptation."""

from __future__ import annotations

import pickle
from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]

ARM = al.planar_arm([0.5, 0.4], masses=[3.0, 2.0], coms=[0.25, 0.2], inertias=[0.0625, 0.027])
MOTION = al.Sinusoid([0.3, 0.5], [0.5, 0.4], [1.0, 1.3], [0.0, 0.2])
LAW = al.ComputedTorque(ARM, MOTION, 100.0, 20.0)
PLANT = al.RigidArm(ARM)


def run(**options: Any) -> al.Run:
    return al.simulate(PLANT, LAW, [0.0, 0.0], **({"t_end": 1.0} | options))


@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("semi_implicit", 1), ("ros2", 2), ("rk4", 4)])
def test_fixed_steps_converge_at_their_order(method: str, order: int) -> None:
    exact = run(method="dop853", rtol=1e-13, atol=1e-14, t_eval=[1.0]).q[-1]
    error = [np.max(np.abs(run(method=method, dt=dt, t_eval=[1.0]).q[-1] - exact)) for dt in (4e-3, 2e-3)]
    # At these steps the measured order is within 0.1.
    assert abs(np.log2(error[0] / error[1]) - order) < 0.1, error


@pytest.mark.parametrize("method", ["dopri5", "dop853", "radau5", "rodas4"])
def test_adaptive_methods_keep_their_tolerance(method: str) -> None:
    exact = run(method="dop853", rtol=1e-13, atol=1e-14, t_eval=[0.5, 1.0]).q
    errors = [np.max(np.abs(run(method=method, rtol=rtol, atol=rtol, t_eval=[0.5, 1.0]).q - exact)) for rtol in (1e-5, 1e-8)]
    # In a contracting loop the global error is near the error of one step.
    assert errors[0] < 1e-4 and errors[1] < 1e-7 and errors[1] < 0.05 * errors[0], errors


@pytest.mark.parametrize("method", ["dopri5", "dop853", "radau5", "rodas4"])
def test_a_jump_changes_nothing_before_it(method: str) -> None:
    """A step ends at a jump of the force. Its last stages are evaluated there, and must use the force before the jump."""
    after = [[5.0, 0.0, 0.0], [-500.0, 900.0, 0.0]]
    options: dict[str, Any] = {"method": method, "force_frame": "link2", "t_eval": [0.3, 0.4, 0.5, 0.6]}
    runs = [run(force=[(0.0, [5.0, 0.0, 0.0]), (0.5, force)], **options) for force in after]
    np.testing.assert_array_equal(runs[0].q[:3], runs[1].q[:3])
    assert not np.array_equal(runs[0].q[3], runs[1].q[3])


@pytest.mark.parametrize("method", ["rk4", "ros2", "dopri5", "radau5", "rodas4"])
def test_all_methods_make_the_same_sampled_run(method: str) -> None:
    options = {"sample_time": 1e-2, "t_eval": [0.5, 1.0]}
    exact = run(method="dop853", rtol=1e-12, atol=1e-13, **options)
    steps: dict[str, Any] = {"dt": 5e-4} if method in ("rk4", "ros2") else {"rtol": 1e-10, "atol": 1e-11}
    got = run(method=method, **steps, **options)
    # The second-order method with steps of 0.5 ms is the least accurate.
    np.testing.assert_allclose(got.q, exact.q, rtol=0.0, atol=2e-6 if method == "ros2" else 1e-8)
    np.testing.assert_allclose(got.tau, exact.tau, rtol=0.0, atol=1e-3 if method == "ros2" else 1e-5)


def test_a_perfect_sampling_is_a_sample_time() -> None:
    plain = run(dt=1e-3, sample_time=2e-3)
    clocked = run(dt=1e-3, sample_time=al.Sampling(2e-3, rate_limit=1e9))
    np.testing.assert_array_equal(plain.q, clocked.q)


def test_a_delay_moves_the_input_by_that_much() -> None:
    # The law's output for a sample acts 3 ms later. Before the first output the input is zero.
    late = al.simulate(PLANT, lambda t, q, v: [t, 1.0], [0.0, 0.0], t_end=0.02, dt=1e-3, sample_time=al.Sampling(2e-3, delay=3e-3))
    expected = [[0.0, 0.0] if k < 3 else [2e-3 * ((k - 3) // 2), 1.0] for k in range(21)]
    np.testing.assert_allclose(late.tau, expected, rtol=0.0, atol=1e-15)


def test_sensors_round_lag_and_make_noise() -> None:
    seen: list[tuple[float, Array, Array]] = []

    def law(t: float, q: Array, v: Array) -> Array:
        seen.append((t, q.copy(), v.copy()))
        return np.array([1.0, 0.5])

    sampling = al.Sampling(1e-3, sensor_delay=2, noise={"v": 0.1}, resolution={"q": 1e-3}, seed=9)
    result = al.simulate(PLANT, law, [0.2, -0.1], t_end=2.0, dt=1e-3, sample_time=sampling)
    times = np.array([t for t, _, _ in seen])
    np.testing.assert_allclose(times, 1e-3 * np.arange(len(times)), atol=1e-12)
    q, v = np.array([q for _, q, _ in seen]), np.array([v for _, _, v in seen])
    # The measurement is two samples old and rounded to the resolution of the encoder.
    np.testing.assert_allclose(q[2:2000], np.round(result.q[:1998] / 1e-3) * 1e-3, rtol=0.0, atol=1e-12)
    noise = v[2:2000] - result.v[:1998]
    # The limits are five standard errors of mean and deviation for 2 x 1998 draws.
    assert abs(noise.mean()) < 5 * 0.1 / np.sqrt(noise.size) and abs(noise.std() - 0.1) < 5 * 0.1 / np.sqrt(2 * noise.size)
    # The noise of one joint says nothing about that of the other.
    assert abs(np.corrcoef(noise.T)[0, 1]) < 5 / np.sqrt(len(noise))


def test_the_rate_of_the_input_is_limited() -> None:
    limited = run(dt=1e-3, sample_time=al.Sampling(1e-3, rate_limit=100.0))
    # The input changes by at most 0.1 N m per sample, and starts at zero.
    assert np.max(np.abs(np.diff(limited.tau[:-1], axis=0, prepend=0.0))) <= 0.1 + 1e-12
    assert np.max(np.abs(np.diff(run(dt=1e-3, sample_time=1e-3).tau, axis=0))) > 0.1


def test_a_limited_rate_holds_under_delay_jitter_and_saturation() -> None:
    """A short controller in Python gives the same run. It saturates the law's output, then changes the input at most by the rate limit."""
    period, rate, limit, dt = 1e-2, 50.0, 2.0, 1e-3
    asked: list[float] = []

    def law(t: float, q: Array, v: Array) -> list[float]:
        asked.append(t)
        return [40.0 * np.sin(9.0 * t + 0.5), 0.0]

    for extra in ({}, {"delay": 3e-3}, {"delay": 3e-3, "jitter": 8e-3, "seed": 4}):
        asked.clear()
        sampling = al.Sampling(period, rate_limit=rate, **extra)
        result = al.simulate(PLANT, law, [0.0, 0.0], t_end=1.0, dt=dt, sample_time=sampling, tau_max=limit)
        applied, before, expected = 0.0, asked[0] - period, np.zeros(len(result.t))
        for t in asked:
            answer = np.clip(40.0 * np.sin(9.0 * t + 0.5), -limit, limit)
            most = rate * (t - before)
            applied, before = float(np.clip(answer, applied - most, applied + most)), t
            expected[round((t + extra.get("delay", 0.0)) / dt) :] = applied
        if not extra.get("jitter"):
            assert len(asked) == 101
        np.testing.assert_allclose(result.tau[:, 0], expected, rtol=0.0, atol=1e-12)


def test_rows_of_a_batch_have_seeds_of_their_own() -> None:
    sampling = al.Sampling(1e-3, delay=5e-4, jitter=4e-4, noise={"q": 1e-4, "v": 1e-2}, seed=5)
    options: dict[str, Any] = {"t_end": 0.2, "dt": 1e-4}
    batch = al.simulate_batch(PLANT, LAW, np.zeros((3, 2)), sample_time=sampling, threads=2, **options)
    for i in range(3):
        alone = al.Sampling(1e-3, delay=5e-4, jitter=4e-4, noise={"q": 1e-4, "v": 1e-2}, seed=5 + i)
        np.testing.assert_array_equal(batch.q[i], al.simulate(PLANT, LAW, [0.0, 0.0], sample_time=alone, **options).q)
    assert np.max(np.abs(batch.q[0] - batch.q[1])) > 1e-9


def test_jitter_in_adaptive_and_fixed_runs() -> None:
    sampling = al.Sampling(2e-3, delay=1e-3, jitter=1.5e-3, seed=2)
    fixed = run(dt=1e-5, sample_time=sampling, t_eval=[1.0])
    free = run(method="dopri5", rtol=1e-9, atol=1e-10, sample_time=sampling, t_eval=[1.0])
    # Fixed steps round each delay down to a multiple of 10 us.
    np.testing.assert_allclose(fixed.q, free.q, rtol=0.0, atol=2e-5)


def test_a_law_in_python_is_the_law() -> None:
    native = run(dt=1e-3, sample_time=2e-3)
    python = al.simulate(PLANT, lambda t, q, v: LAW(t, q, v), [0.0, 0.0], t_end=1.0, dt=1e-3, sample_time=2e-3)
    # The law of armlet runs as a compiled program, the law in Python directly. They may differ by rounding, which the contracting loop does
    # not amplify.
    np.testing.assert_allclose(native.q, python.q, rtol=0.0, atol=1e-14)


def test_an_exception_of_a_python_law_passes_unchanged() -> None:
    def broken(t: float, q: Array, v: Array) -> Array:
        raise KeyError("no such gain")

    with pytest.raises(KeyError, match="no such gain"):
        al.simulate(PLANT, broken, [0.0, 0.0], t_end=1.0, dt=1e-3, sample_time=1e-3)
    with pytest.raises(al.InputError, match=r"simulate: law has the wrong shape: expected \(2,\), got \(3,\)"):
        al.simulate(PLANT, lambda t, q, v: [1.0, 2.0, 3.0], [0.0, 0.0], t_end=1.0, dt=1e-3, sample_time=1e-3)
    with pytest.raises(al.InputError, match="sample_time is missing"):
        al.simulate(PLANT, lambda t, q, v: q, [0.0, 0.0], t_end=1.0, dt=1e-3)


@pytest.mark.parametrize("method", ["euler", "semi_implicit", "rk4", "ros2"])
def test_steps_by_hand_are_the_run(method: str) -> None:
    result = run(dt=1e-3, t_end=0.3, method=method, monitors=False)
    sim = al.Simulator(PLANT, LAW, [0.0, 0.0], dt=1e-3, method=method)
    q = sim.q
    for _ in range(300):
        sim.step()
    # `sim.q` is one array during the whole run.
    assert q is sim.q and abs(sim.t - 0.3) < 1e-12
    np.testing.assert_allclose(sim.q, result.q[-1], rtol=0.0, atol=1e-14)
    sim.reset()
    assert sim.t == 0.0 and not sim.q.any()
    held = run(dt=1e-3, t_end=0.3, method=method, sample_time=3e-3)
    by_hand = al.Simulator(PLANT, None, [0.0, 0.0], dt=1e-3, method=method)
    for k in range(300):
        if k % 3 == 0:
            tau = LAW(by_hand.t, by_hand.q, by_hand.v)
        by_hand.step(tau)
    np.testing.assert_allclose(by_hand.q, held.q[-1], rtol=0.0, atol=1e-14)


def test_missing_arguments_of_a_simulator_are_named() -> None:
    with pytest.raises(al.InputError, match="dt is missing"):
        al.Simulator(PLANT, None, [0.0, 0.0])
    with pytest.raises(al.InputError, match="method chooses its own steps"):
        al.Simulator(PLANT, None, [0.0, 0.0], dt=1e-3, method="dop853")
    with pytest.raises(al.InputError, match="record is unknown"):
        al.Simulator(PLANT, None, [0.0, 0.0], dt=1e-3, record=1)
    sim = al.Simulator(PLANT, None, [0.0, 0.0], dt=1e-3)
    for bad, words in ((None, "tau is missing"), ([1.0], "wrong shape"), ([1.0, np.inf], "not finite")):
        with pytest.raises(al.InputError, match=words):
            sim.step(bad)
    assert sim.t == 0.0


def random_arm(rng: np.random.Generator, n: int) -> al.Arm:
    def body() -> list[float]:
        phi = np.array([0.0, 0, 0, 0, 0.03, 0, 0.03, 0, 0, 0.03])
        for m, x, y, z in np.column_stack([rng.uniform(0.2, 0.4, 6), rng.uniform(-0.3, 0.3, (6, 3))]):
            phi += m * np.array([1.0, x, y, z, y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y])
        return list(phi)

    joints = [
        {"type": "R", "axis": list(rng.standard_normal(3)), "rpy": [0.0, 0.0, 0.0], "xyz": [0.3, 0.0, 0.1], "phi": body()} for _ in range(n)
    ]
    return al.Arm.from_chain(joints, gravity=(0.0, 0.0, -9.81))


@pytest.mark.parametrize("variant", ["base", "natural"])
def test_variants_of_adaptation_keep_the_lyapunov_identity(variant: str) -> None:
    arm = random_arm(np.random.default_rng(3), 3)
    motion = al.Sinusoid(np.zeros(3), [0.4, 0.3, 0.5], [1.0, 1.7, 2.3], np.zeros(3))
    base = arm.base_parameters() if variant == "base" else None
    guess = al.Arm.from_chain(
        [{"type": "R", "axis": [0, 0, 1], "rpy": [0, 0, 0], "xyz": [0, 0, 0], "phi": [1, 0, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1]}] * 3
    ).parameters
    estimate = guess if variant == "natural" else None
    law = al.Adaptive(arm, motion, 30.0, 10.0, 0.5, estimate=estimate, base=base, natural=variant == "natural")
    result = al.simulate(
        al.RigidArm(arm), law, [0.3, -0.2, 0.1], t_end=20.0, method="dop853", rtol=1e-10, atol=1e-11, t_eval=np.linspace(0, 20, 81)
    )
    assert result.estimate is not None
    assert result.estimate.shape[1] == (base.count if base else 30)
    lyapunov = result.monitors["lyapunov"]
    # The Lyapunov function does not increase and its balance is zero, up to the error of the integrator.
    assert np.all(np.diff(lyapunov) < 1e-8) and lyapunov[-1] < lyapunov[0] - 1.0
    assert np.max(np.abs(result.monitors["lyapunov_balance"])) < 1e-7
    q_d = np.array([motion(t)[0] for t in result.t])
    assert np.max(np.abs(result.q - q_d)[-8:]) < 0.05 * np.max(np.abs(result.q - q_d)[:8])
    if variant == "natural":
        reports = [arm.check_parameters(row) for row in result.estimate]
        assert all(bool(report.consistent) for report in reports)
    again = pickle.loads(pickle.dumps(law))
    state = result.estimate[5]
    np.testing.assert_array_equal(again(1.0, result.q[5], result.v[5], state=state), law(1.0, result.q[5], result.v[5], state=state))
    assert "Y" in law.terms(0.0, result.q[0], result.v[0])


def test_natural_adaptation_starts_possible() -> None:
    arm = random_arm(np.random.default_rng(4), 2)
    with pytest.raises(al.InputError, match="not physically possible"):
        al.Adaptive(arm, al.Hold([0.0, 0.0]), 10.0, 5.0, 1.0, natural=True)
    with pytest.raises(al.InputError, match="base"):
        al.Adaptive(arm, al.Hold([0.0, 0.0]), 10.0, 5.0, 1.0, base=random_arm(np.random.default_rng(4), 3).base_parameters())


def test_walls_push_and_never_pull() -> None:
    arm = al.planar_arm([0.5, 0.4], gravity=(0.0, 0.0))
    wall = al.Wall("link2", [0.6, 0.0, 0.0], [-1.0, 0.0, 0.0], stiffness=2e4, damping=50.0)
    law = al.CartesianImpedance(arm, [0.65, 0.3], [500.0, 500.0], [20.0, 20.0], frame="link2", axes="xy")
    result = al.simulate(al.RigidArm(arm, wall=wall), law, [0.3, 1.2], t_end=4.0, method="dopri5", rtol=1e-9, atol=1e-10)
    x = arm.position(result.q[-1], "link2")
    # At rest the springs balance: 500 (0.65 - x) = 2e4 (x - 0.6).
    np.testing.assert_allclose(x[:2], [(500 * 0.65 + 2e4 * 0.6) / 20500, 0.3], atol=1e-6)
    # The balance counts the energy that the wall's damper dissipates. So it is zero, up to the error of locating the contacts.
    assert np.max(np.abs(result.monitors["energy_balance"])) < 1e-5


def test_friction_acts_only_if_the_plant_has_it() -> None:
    arm = models.SIX_AXES
    assert np.any(arm.limits["damping"] > 0)
    q, v, tau = np.full(6, 0.3), np.linspace(0.5, 1.0, 6), np.ones(6)
    for friction in (True, False):
        sim = al.Simulator(al.RigidArm(arm, friction=friction), None, q, v0=v, dt=1e-6)
        sim.step(tau)
        # One step of 1 us. Its relative error is below 1e-4.
        np.testing.assert_allclose((sim.v - v) / 1e-6, arm.forward_dynamics(q, v, tau, friction=friction), rtol=1e-2, atol=1e-2)
    assert np.max(np.abs(arm.forward_dynamics(q, v, tau, friction=True) - arm.forward_dynamics(q, v, tau))) > 0.1


def test_plants_and_laws_belong_together() -> None:
    elastic = al.ElasticArm(ARM, [800.0, 500.0], [0.4, 0.25])
    with pytest.raises(al.InputError, match="law is made for another plant: expected a law for ElasticArm"):
        al.simulate(elastic, LAW, [0.0, 0.0], t_end=1.0, dt=1e-3)
    with pytest.raises(al.InputError, match="theta0 is not used"):
        al.simulate(PLANT, LAW, [0.0, 0.0], t_end=1.0, dt=1e-3, theta0=[0.0, 0.0])
    with pytest.raises(al.InputError, match="force_frame is missing"):
        al.simulate(PLANT, LAW, [0.0, 0.0], t_end=1.0, dt=1e-3, force=[1.0, 0.0, 0.0])
    with pytest.raises(al.InputError, match="force has the wrong shape"):
        al.simulate(PLANT, LAW, [0.0, 0.0], t_end=1.0, dt=1e-3, force=[1.0, 0.0], force_frame="link2")
    with pytest.raises(al.InputError, match="force is not in order of time"):
        force = [(0.2, [1.0, 0.0, 0.0]), (0.1, [0.0, 0.0, 0.0])]
        al.simulate(PLANT, LAW, [0.0, 0.0], t_end=1.0, dt=1e-3, force=force, force_frame="link2")
    with pytest.raises(ZeroDivisionError):
        al.simulate(PLANT, LAW, [0.0, 0.0], t_end=1.0, dt=1e-3, force=lambda t: 1 / 0, force_frame="link2")


@pytest.mark.parametrize(
    "plant", [PLANT, al.RigidArm(ARM, wall=al.Wall("link2", [1, 0, 0], [-1, 0, 0], stiffness=1e4)), al.VelocityArm(ARM)]
)
def test_plants_keep_through_pickle(plant: al.Plant) -> None:
    assert repr(pickle.loads(pickle.dumps(plant))) == repr(plant)
