"""Runs of random arms against `armlet.reference`: every rigid law, forces, sampled and continuous.

The reference differentiates Lagrange's equations and has its own RK4 method. Both take equal steps, so the runs differ by rounding only.
"""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from loops import PIDS, close, law_pair, pair

import armlet as al
from armlet import reference


@pytest.mark.parametrize("n", [1, 2, 3, 5, 7])
@pytest.mark.parametrize("name", ["Adaptive", "ComputedTorque", "PDGravity", *PIDS, "CartesianImpedance"])
def test_a_run_is_the_references(name: str, n: int) -> None:
    rng = np.random.default_rng(1000 * n + len(name))
    arms = pair(rng, n)
    law, their_law = law_pair(rng, name, arms)
    q0, v0 = rng.uniform(-0.3, 0.3, (2, n))
    options: dict[str, Any] = {"t_end": 0.02, "dt": 2e-3, "v0": v0}
    run = al.simulate(al.RigidArm(arms[0]), law, q0, **options)
    theirs = reference.simulate(reference.RigidArm(arms[1]), their_law, q0, **options)
    # Rounding errors of the accelerations, and of the complex-step derivatives of the reference, grow over the steps.
    for field in ("q", "v", "tau"):
        close(getattr(run, field), theirs[field], 1e-9)
    if name in ("Adaptive", *PIDS):
        assert run.estimate is not None
        close(run.estimate, theirs["estimate"], 1e-9)
    if name == "Adaptive":
        close(run.monitors["lyapunov_balance"], theirs["lyapunov_balance"], 1e-9)
    close(run.monitors["energy_balance"], theirs["energy_balance"], 1e-9)


@pytest.mark.parametrize("sample_time", [None, 4e-3])
def test_forces_in_steps(sample_time: float | None) -> None:
    rng = np.random.default_rng(5)
    arms = pair(rng, 3)
    law, their_law = law_pair(rng, "CartesianImpedance", arms)
    force = [(0.003, [4.0, -2.0, 1.0]), (0.01, [0.0, 3.0, 0.0])]
    options: dict[str, Any] = {"t_end": 0.02, "dt": 1e-3, "force": force, "sample_time": sample_time}
    q0 = rng.uniform(-0.3, 0.3, 3)
    run = al.simulate(al.RigidArm(arms[0]), law, q0, **options)
    theirs = reference.simulate(reference.RigidArm(arms[1]), their_law, q0, **options)
    # Rounding errors of the accelerations, and of the complex-step derivatives of the reference, grow over the steps.
    for field in ("q", "v", "tau"):
        close(getattr(run, field), theirs[field], 1e-9)
    free = al.simulate(al.RigidArm(arms[0]), law, q0, **(options | {"force": None}))
    assert np.max(np.abs(free.q[-1] - run.q[-1])) > 1e-5


def test_a_constant_and_a_function_are_the_same_force() -> None:
    rng = np.random.default_rng(6)
    arm = pair(rng, 4)[0]
    law = al.PDGravity(arm, np.zeros(4), 20.0, 6.0)
    frame, wrench = arm.frame_names[1], np.array([3.0, -1.0, 2.0, 0.1, 0.2, -0.3])
    options: dict[str, Any] = {"t_end": 0.05, "dt": 1e-3, "force_frame": frame}
    constant = al.simulate(al.RigidArm(arm), law, np.ones(4), force=wrench, **options)
    function = al.simulate(al.RigidArm(arm), law, np.ones(4), force=lambda t: wrench, **options)
    np.testing.assert_array_equal(constant.q, function.q)
    # The expected acceleration at the start includes the joint torque J'F.
    a = arm.forward_dynamics(np.ones(4), np.zeros(4), law(0.0, np.ones(4), np.zeros(4)) + arm.jacobian(np.ones(4), frame).T @ wrench)
    # First differences of v over 1 ms err by the rate of the acceleration times dt.
    np.testing.assert_allclose((constant.v[1] - constant.v[0]) / 1e-3, a, rtol=0.1, atol=0.1)


def test_batch_rows_are_runs() -> None:
    rng = np.random.default_rng(7)
    arm = pair(rng, 5)[0]
    plants = [al.RigidArm(arm.with_parameters(arm.parameters * (1.0 + 0.1 * rng.standard_normal()))) for _ in range(11)]
    motion = al.Quintic(np.zeros(5), np.full(5, 0.3), 0.5)
    laws = [al.Adaptive(arm, motion, rng.uniform(5.0, 20.0, 5), rng.uniform(2.0, 6.0, 5), 0.5) for _ in range(11)]
    q0 = rng.uniform(-0.3, 0.3, (11, 5))
    options: dict[str, Any] = {"t_end": 0.5, "dt": 1e-3, "record_every": 100}
    batch = al.simulate_batch(plants, laws, q0, **options)
    again = al.simulate_batch(plants, laws, q0, threads=3, **options)
    np.testing.assert_array_equal(batch.q, again.q)
    for i in (0, 3, 10):
        run = al.simulate(plants[i], laws[i], q0[i], **options)
        # The batch rounds in a different order, and the loop contracts.
        close(batch.q[i], run.q, 1e-10)
        close(batch.monitors["lyapunov"][i], run.monitors["lyapunov"], 1e-10)


def test_arms_of_different_geometry_share_a_batch() -> None:
    arms = [models.TWO_LINKS, al.planar_arm([0.3, 0.6])]
    laws = [al.PDGravity(arm, [0.5, -0.5], 20.0, 6.0) for arm in arms]
    plants = [al.RigidArm(arm) for arm in arms]
    options: dict[str, Any] = {"t_end": 0.2, "dt": 1e-3, "record_every": 50}
    batch = al.simulate_batch(plants, laws, np.zeros((2, 2)), **options)
    for i in range(2):
        np.testing.assert_array_equal(batch.q[i], al.simulate(plants[i], laws[i], [0.0, 0.0], **options).q)
