"""Sampled runs, whose programs take many samples in one call, against `Simulator`, whose programs take one step per call of `step`.

Both share the programs and the controller. `tests/parity/test_sampling_parity.py` compares them with a controller in numpy.
"""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest

import armlet as al

DT = 1e-3
TWO = models.TWO_HEAVY_LINKS
SIX = models.SIX_AXES  # its step is divided into parts
K, B = np.array([900.0, 700.0]), np.array([0.4, 0.3])


def moving(n: int) -> al.Sinusoid:
    return al.Sinusoid([0.1] * n, [0.2] * n, [1.0 + i for i in range(n)], [0.3] * n)


def guarded() -> Any:
    inner = al.PDGravity(TWO, [0.4, 0.9], kp=[80.0, 60.0], kd=[16.0, 12.0])
    return al.Guarded(inner, al.MomentumObserver(TWO, 50.0, threshold=1.0), reaction="stop", stiffness=200.0, damping=30.0)


LOOPS: dict[str, tuple[Any, Any, list[float]]] = {
    "adaptive": (al.RigidArm(TWO), al.Adaptive(TWO, moving(2), 40.0, 8.0, 0.2), [0.1, 0.4]),
    "elastic": (al.ElasticArm(TWO, K, B), al.MotorPD(TWO, [0.2, 0.3], 60.0, 4.0, joint_stiffness=K), [0.1, 0.4]),
    "guarded": (al.RigidArm(TWO), guarded(), [0.1, 0.4]),
    "PID": (al.RigidArm(TWO), al.PID(TWO, [0.2, 0.3], 80.0, 16.0, 20.0, tau_max=[30.0, 20.0]), [0.1, 0.4]),
    "six axes": (al.RigidArm(SIX), al.ComputedTorque(SIX, moving(6), 100.0, 20.0), [0.1] * 6),
}
SAMPLINGS: dict[str, Any] = {
    "every step": DT,
    "every third step": 3 * DT,
    "a long period": 40 * DT,
    "delay": al.Sampling(3 * DT, delay=2 * DT),
    "long delay": al.Sampling(2 * DT, delay=7 * DT),
    "jitter": al.Sampling(4 * DT, jitter=3.5 * DT, seed=3),
    "jitter and delay": al.Sampling(4 * DT, jitter=3.5 * DT, delay=5 * DT, seed=4),
    "noise": al.Sampling(DT, noise={"q": 1e-3, "v": 0.05}, seed=11),
    "resolution": al.Sampling(2 * DT, resolution={"q": 2e-3, "v": 0.1}),
    "late sensors": al.Sampling(2 * DT, sensor_delay=2),
    "rate limit": al.Sampling(DT, rate_limit=400.0),
    "all": al.Sampling(2 * DT, delay=3 * DT, sensor_delay=1, noise={"v": 0.02}, resolution={"q": 1e-3}, rate_limit=900.0, seed=7),
}
STEPS = 100


def single_steps(plant: Any, law: Any, q0: Any, sampling: Any, method: str) -> tuple[Any, Any, Any]:
    """The states after each step, and the input of each step."""
    sim = al.Simulator(plant, law, q0, dt=DT, sample_time=sampling, method=method)
    q, v, tau = [sim.q.copy()], [sim.v.copy()], []
    for _ in range(STEPS):
        sim.step()
        q.append(sim.q.copy())
        v.append(sim.v.copy())
        tau.append(sim.tau.copy())
    return np.array(q), np.array(v), np.array(tau)


@pytest.mark.parametrize("sampling", SAMPLINGS.values(), ids=SAMPLINGS.keys())
@pytest.mark.parametrize("loop", LOOPS.values(), ids=LOOPS.keys())
def test_programs_have_the_bits_of_single_steps(loop: tuple[Any, Any, list[float]], sampling: Any) -> None:
    plant, law, q0 = loop
    q, v, tau = single_steps(plant, law, q0, sampling, "rk4")
    # The last step of `simulate` ends exactly at `t_end`, and may differ by rounding.
    options: dict[str, Any] = {"t_end": (STEPS + 0.5) * DT, "dt": DT, "sample_time": sampling, "monitors": False, "check_limits": False}
    for every in (1, 7):
        run = al.simulate(plant, law, q0, record_every=every, **options)
        at = np.arange(0, STEPS, every)
        np.testing.assert_array_equal(run.q[: at.size], q[at])
        np.testing.assert_array_equal(run.v[: at.size], v[at])
        np.testing.assert_array_equal(np.asarray(run.tau)[: at.size], tau[at])
    # Records outside of programs, and rows of a batch, whose random numbers begin with the seed of row 0.
    last = al.simulate(plant, law, q0, t_eval=[0.0, 0.0215, 0.05, STEPS * DT, (STEPS + 0.5) * DT], **options)
    np.testing.assert_array_equal(last.q[[0, 2, 3, 4]], [*q[[0, 50, STEPS]], run.q[-1]])
    for keep in ("final", "metrics"):
        batch = al.simulate_batch(plant, law, [q0] * 3, keep=keep, **options)
        np.testing.assert_array_equal(batch.q[0, -1], run.q[-1])


@pytest.mark.parametrize("sampling", [None, DT, SAMPLINGS["all"]], ids=["continuous", "every step", "all"])
@pytest.mark.parametrize("law", [LOOPS["six axes"][1], al.Adaptive(SIX, moving(6), 40.0, 8.0, 0.2)], ids=["computed torque", "adaptive"])
def test_long_batches_have_the_bits_of_single_runs(law: Any, sampling: Any) -> None:
    """In a long batch, the program of a large step is not divided into parts. One run of the batch is not long."""
    q0 = np.linspace(0.05, 0.15, 64)[:, None] * np.ones(6)
    options: dict[str, Any] = {"dt": DT, "t_end": 0.52, "sample_time": sampling, "monitors": False, "check_limits": False}
    batch = al.simulate_batch(al.RigidArm(SIX), law, q0, keep="final", **options)
    run = al.simulate(al.RigidArm(SIX), law, q0[0], record_every=520, **options)
    np.testing.assert_array_equal(batch.q[0, -1], run.q[-1])
    np.testing.assert_array_equal(batch.v[0, -1], run.v[-1])
    short = al.simulate_batch(al.RigidArm(SIX), law, q0[:9], keep="final", **options)
    np.testing.assert_array_equal(short.q[:, -1], batch.q[:9, -1])


@pytest.mark.parametrize("method", ["euler", "semi_implicit"])
@pytest.mark.parametrize("name", ["every third step", "jitter and delay", "all"])
def test_other_methods(name: str, method: str) -> None:
    plant, law, q0 = LOOPS["adaptive"]
    q, _, tau = single_steps(plant, law, q0, SAMPLINGS[name], method)
    run = al.simulate(plant, law, q0, t_end=(STEPS + 0.5) * DT, dt=DT, sample_time=SAMPLINGS[name], method=method, monitors=False)
    np.testing.assert_array_equal(run.q[:-1], q)
    np.testing.assert_array_equal(np.asarray(run.tau)[:STEPS], tau)


def test_a_diverging_run_repeats_its_samples() -> None:
    """A block of steps that is repeated after a fault draws the same noise, and uses the same queue of outputs."""
    law = al.PDGravity(TWO, [0.4, 0.9], kp=[8e4, 6e4], kd=[1e-3, 1e-3])
    sampling = al.Sampling(2 * DT, delay=3 * DT, noise={"q": 1e-3}, seed=5)
    sim = al.Simulator(al.RigidArm(TWO), law, [0.1, 0.4], dt=DT, sample_time=sampling, state_limit=50.0)
    states = []
    with pytest.raises(al.SolveError):
        for _ in range(1000):
            states.append(sim.q.copy())
            sim.step()
    run = al.simulate(
        al.RigidArm(TWO), law, [0.1, 0.4], t_end=1.0, dt=DT, sample_time=sampling, state_limit=50.0, monitors=False, throw=False
    )
    assert run.status is al.Status.DIVERGED
    assert run.t.size < 1000
    np.testing.assert_array_equal(run.q, states[: run.t.size])


def test_a_loop_lists_its_sampled_step() -> None:
    """The sampled step has fewer lines than the step with the law in every stage, and more than the held step."""
    plant, law, _ = LOOPS["adaptive"]
    continuous = al.loop_program(plant, law).parts
    parts = al.loop_program(plant, law, sample_time=DT).parts
    assert parts["step"] < parts["sampled_step"] < continuous["step"]
    assert parts["sampled_step"] < parts["step"] + parts["law"]
    limited = al.loop_program(plant, law, sample_time=SAMPLINGS["all"], part="sampled_step")
    assert {"measured_q1", "measured_v2", "change", "output1"} <= set(limited.inputs)
    six = al.loop_program(*LOOPS["six axes"][:2], sample_time=DT).parts
    assert six["rates"] < six["sampled_rates"] < six["rates"] + six["law"]
