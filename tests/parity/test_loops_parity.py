"""Loops of any arm against `armlet.reference`: random trees, every rigid law, forces, sampled and continuous.

The reference differentiates Lagrange's equations and steps with its own RK4; both take the same fixed steps, so that the two runs
differ by rounding alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al
from armlet import reference

Array = NDArray[np.float64]


def body(rng: np.random.Generator) -> Array:
    """Parameters of five random point masses and a core."""
    phi = np.zeros(10)
    for k in range(6):
        m = rng.uniform(0.2, 0.4)
        x, y, z = rng.uniform(-0.3, 0.3, 3) if k else (0.0, 0.0, 0.0)
        phi += m * np.array([1.0, x, y, z, y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y])
    # A core with inertia of its own keeps light wrists from shaking at a millisecond.
    return phi + np.array([0, 0, 0, 0, 0.05, 0, 0.05, 0, 0, 0.05])


def joints(rng: np.random.Generator, n: int) -> list[dict[str, Any]]:
    def one() -> dict[str, Any]:
        kind = "R" if rng.uniform() < 0.7 else "P"
        axis, rpy, xyz = rng.standard_normal(3), rng.uniform(-1.0, 1.0, 3), rng.uniform(-0.4, 0.4, 3)
        return {"type": kind, "axis": list(axis), "rpy": list(rpy), "xyz": list(xyz), "phi": list(body(rng))}

    return [one() for _ in range(n)]


def pair(rng: np.random.Generator, n: int) -> tuple[al.Arm, Any]:
    chain, gravity = joints(rng, n), rng.uniform(-6.0, 6.0, 3)
    return al.Arm.from_chain(chain, gravity=gravity), reference.Arm.from_chain(chain, gravity=gravity)


def close(got: Array, expected: Array, tolerance: float) -> None:
    scale = max(1.0, float(np.max(np.abs(expected), initial=0.0)))
    np.testing.assert_allclose(got, expected, rtol=0.0, atol=tolerance * scale)


def law_pair(rng: np.random.Generator, name: str, arms: tuple[al.Arm, Any]) -> tuple[al.Law, Any]:
    ours, theirs = arms
    n = ours.n
    start, end = rng.uniform(-0.5, 0.5, (2, n))
    motions = al.Quintic(start, end, 0.2), reference.Quintic(start, end, 0.2)
    frame = ours.frame_names[-1]
    if name == "Adaptive":
        kp, kd, gamma = rng.uniform(5.0, 20.0, n), rng.uniform(2.0, 6.0, n), rng.uniform(0.1, 2.0, 10 * n)
        estimate = rng.uniform(0.0, 0.3, 10 * n)
        return (
            al.Adaptive(ours, motions[0], kp, kd, gamma, estimate=estimate),
            reference.Adaptive(theirs, motions[1], kp, kd, gamma, estimate=estimate),
        )
    if name == "ComputedTorque":
        return al.ComputedTorque(ours, motions[0], 100.0, 20.0), reference.ComputedTorque(theirs, motions[1], 100.0, 20.0)
    if name == "PDGravity":
        return al.PDGravity(ours, end, 20.0, 6.0), reference.PDGravity(theirs, end, 20.0, 6.0)
    axes = "xyz" if n < 6 else "xyz rz rx"
    m = 3 if n < 6 else 5
    target = np.append(ours.position(np.zeros(n), frame), [0.1, 0.2])[:m]
    arguments = (target, rng.uniform(50.0, 100.0, m), rng.uniform(5.0, 15.0, m))
    return (
        al.CartesianImpedance(ours, *arguments, frame=frame, axes=axes),
        reference.CartesianImpedance(theirs, *arguments, frame=frame, axes=axes),
    )


@pytest.mark.parametrize("n", [1, 2, 3, 5, 7])
@pytest.mark.parametrize("name", ["Adaptive", "ComputedTorque", "PDGravity", "CartesianImpedance"])
def test_a_run_is_the_references(name: str, n: int) -> None:
    rng = np.random.default_rng(1000 * n + len(name))
    arms = pair(rng, n)
    law, their_law = law_pair(rng, name, arms)
    q0, v0 = rng.uniform(-0.3, 0.3, (2, n))
    options: dict[str, Any] = {"t_end": 0.02, "dt": 2e-3, "v0": v0}
    run = al.simulate(al.RigidArm(arms[0]), law, q0, **options)
    theirs = reference.simulate(reference.RigidArm(arms[1]), their_law, q0, **options)
    # Ten steps of rounding, amplified by accelerations of some hundreds and by the reference's complex steps.
    for field in ("q", "v", "tau"):
        close(getattr(run, field), theirs[field], 1e-9)
    if name == "Adaptive":
        assert run.estimate is not None
        close(run.estimate, theirs["estimate"], 1e-9)
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
    # As above.
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
    # J'F by the arm's own Jacobian: the acceleration at the start.
    a = arm.forward_dynamics(np.ones(4), np.zeros(4), law(0.0, np.ones(4), np.zeros(4)) + arm.jacobian(np.ones(4), frame).T @ wrench)
    # First differences of v over 1 ms: curvature times dt.
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
        # The same operations in another order of rounding, on a contracting loop.
        close(batch.q[i], run.q, 1e-10)
        close(batch.monitors["lyapunov"][i], run.monitors["lyapunov"], 1e-10)


def test_arms_of_different_geometry_share_a_batch() -> None:
    arms = [al.planar_arm([0.5, 0.4]), al.planar_arm([0.3, 0.6])]
    laws = [al.PDGravity(arm, [0.5, -0.5], 20.0, 6.0) for arm in arms]
    plants = [al.RigidArm(arm) for arm in arms]
    options: dict[str, Any] = {"t_end": 0.2, "dt": 1e-3, "record_every": 50}
    batch = al.simulate_batch(plants, laws, np.zeros((2, 2)), **options)
    for i in range(2):
        np.testing.assert_array_equal(batch.q[i], al.simulate(plants[i], laws[i], [0.0, 0.0], **options).q)
