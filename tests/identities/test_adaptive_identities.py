"""Theorems about the adaptive loop, checked by the extension on random plants, gains and states.

V1 = s'Ms/2 + (pi - pi_hat)' Gamma^-1 (pi - pi_hat)/2,   V1(0) - V1(t) = int s'Kd s dt,   M_dot - 2C skew,   e -> 0
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]
Scales = tuple[float, float, float]


def definite(rng: np.random.Generator, n: int, scale: float, form: str) -> Array:
    """A random positive definite gain, diagonal (n,) or full (n, n), with a condition number below about 100."""
    if form == "diagonal":
        return scale * rng.uniform(0.3, 2.0, n)
    root = rng.standard_normal((n, n))
    return scale * (root @ root.T / n + 0.3 * np.eye(n))


def plant(rng: np.random.Generator) -> al.RigidArm:
    """A random plant. The smallest eigenvalue of M is above 0.3, so with the gains below no mode is faster than about 200 1/s."""
    A, C = rng.uniform(0.8, 4.0, 2)
    return al.RigidArm(al.planar_pr(A, rng.uniform(-0.7, 0.7) * np.sqrt(A * C), C))


def exciting(rng: np.random.Generator) -> al.Sinusoid:
    """A motion with two incommensurable frequencies per joint. It excites all three parameters."""
    frequency = np.array([[1.0, 2.3], [1.7, 0.6]]) * rng.uniform(0.8, 1.2)
    return al.Sinusoid(rng.uniform(-0.5, 0.5, 2), rng.uniform(0.4, 0.8, (2, 2)), frequency, rng.uniform(-3.0, 3.0, (2, 2)))


def law(
    rng: np.random.Generator, form: str, motion: al.Motion, estimate: Array | None = None, scales: Scales = (40.0, 20.0, 5.0)
) -> al.Adaptive:
    """A random adaptive law. Its arm has deliberately wrong parameters, because an adaptive law must not use them."""
    gains = [definite(rng, n, scale, form) for n, scale in zip((2, 2, 3), scales, strict=True)]
    return al.Adaptive(al.planar_pr(9.0, 1.0, 7.0), motion, *gains, estimate=estimate)


MOTIONS = {
    "sinusoid": exciting,
    "quintic": lambda rng: al.Quintic(*rng.uniform(-1.5, 1.5, (2, 2)), 2.0),
    "bang-bang": lambda rng: al.BangBang(*rng.uniform(-1.5, 1.5, (2, 2)), 2.0),
    "hold": lambda rng: al.Hold(rng.uniform(-1.5, 1.5, 2)),
}


@pytest.mark.parametrize("form", ["diagonal", "full"])
@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("method", ["dop853", "rk4"])
def test_identities_along_a_run(form: str, motion: str, method: str) -> None:
    rng = np.random.default_rng(21)
    options = {"method": "dop853", "rtol": 1e-12, "atol": 1e-12} if method == "dop853" else {"dt": 1e-4, "record_every": 50}
    # A fixed step h has the error c h^4. At 0.1 ms the balances of these loops are at most 3e-7 of the scales below.
    tight = 1e-9 if method == "dop853" else 1e-6
    for _ in range(5):
        robot, estimate = plant(rng), rng.uniform(-1.0, 2.0, 3)
        control = law(rng, form, MOTIONS[motion](rng), estimate)
        run = al.simulate(robot, control, rng.uniform(-1.0, 1.0, 2), v0=rng.uniform(-1.0, 1.0, 2), t_end=3.0, **options)
        value, scale = run.monitors["lyapunov"], run.monitors["lyapunov"][0]
        # V1 does not increase, up to rounding.
        assert np.all(np.diff(value) <= 1e-12 * scale)
        assert value[-1] < 0.999 * scale
        # Both balances are differences of large terms: stored energy and work of the input.
        assert np.max(np.abs(run.monitors["lyapunov_balance"])) <= tight * max(1.0, scale)
        energy = run.monitors["energy"]
        assert np.max(np.abs(run.monitors["energy_balance"])) <= tight * max(1.0, float(np.max(np.abs(energy))))
        speed = max(1.0, float(np.max(np.abs(run.v)))) * float(np.max(robot.arm.parameters))
        assert np.max(np.abs(run.monitors["skewness"])) <= 1e-13 * speed


def test_monitors_are_those_of_the_recorded_states() -> None:
    """V1 and E are computed from the records by their definitions."""
    rng = np.random.default_rng(22)
    robot = plant(rng)
    gains = [definite(rng, n, scale, "full") for n, scale in ((2, 40.0), (2, 20.0), (3, 5.0))]
    control = al.Adaptive(robot.arm, exciting(rng), *gains)
    run = al.simulate(robot, control, [0.3, -0.4], t_end=1.0, dt=1e-3, record_every=50)
    assert run.estimate is not None
    s = np.array([control.terms(t, q, v)["s"] for t, q, v in zip(run.t, run.q, run.v, strict=True)])
    d = robot.arm.parameters - run.estimate
    mass = robot.arm.mass_matrix(run.q)
    kinetic = 0.5 * np.einsum("ki,kij,kj->k", run.v, mass, run.v)
    stored = 0.5 * np.einsum("ki,kij,kj->k", s, mass, s) + 0.5 * np.einsum("ki,ij,kj->k", d, np.linalg.inv(gains[2]), d)
    # The inverse of Gamma amplifies rounding.
    np.testing.assert_allclose(run.monitors["lyapunov"], stored, rtol=1e-12)
    np.testing.assert_allclose(run.monitors["energy"], kinetic, rtol=1e-12)


# Some random gains are stiff for steps of 1 ms at the start. The test only checks the final states.
@pytest.mark.filterwarnings("ignore:.*balance does not close:UserWarning")
@pytest.mark.parametrize("form", ["diagonal", "full"])
def test_tracking_from_any_state_and_no_estimate(form: str) -> None:
    """e -> 0 with pi_hat(0) = 0. Under excitation also pi_hat -> pi."""
    rng = np.random.default_rng(23)
    rows = 24
    plants, laws = [plant(rng) for _ in range(rows)], [law(rng, form, exciting(rng), scales=(40.0, 20.0, 20.0)) for _ in range(rows)]
    q0, v0 = rng.uniform(-3.0, 3.0, (2, rows, 2))
    batch = al.simulate_batch(plants, laws, q0, v0=v0, t_end=120.0, dt=1e-3, record_every=1000)
    assert np.all(batch.status == al.Status.SUCCESS)
    desired = batch.desired()
    assert desired is not None and batch.estimate is not None and batch.parameters is not None
    error = np.max(np.abs(desired[0] - batch.q), axis=-1)
    wrong = np.max(np.abs(batch.parameters[:, None] - batch.estimate), axis=-1)
    np.testing.assert_array_equal(batch.estimate[:, 0], 0.0)
    # Loops with excitation converge exponentially. In these loops the error decreases by a factor of at least 1e5 in two minutes.
    assert np.all(error[:, -12:].max(axis=1) <= 1e-3 * error[:, 0])
    assert np.all(wrong[:, -1] <= 0.1 * wrong[:, 0])


def test_rk4_is_of_fourth_order() -> None:
    rng = np.random.default_rng(24)
    for form in ("diagonal", "full"):
        robot, q0 = plant(rng), rng.uniform(-0.5, 0.5, 2)
        control = law(rng, form, exciting(rng), scales=(8.0, 4.0, 1.0))
        exact = al.simulate(robot, control, q0, t_end=1.0, method="dop853", rtol=1e-14, atol=1e-14)

        def error(dt: float) -> float:
            run = al.simulate(robot, control, q0, t_end=1.0, dt=dt)  # noqa: B023  # called at once
            return float(np.max(np.abs(np.concatenate([run.q[-1] - exact.q[-1], run.v[-1] - exact.v[-1]]))))  # noqa: B023

        steps = 1.0 / np.array([1024, 2048, 4096])
        errors = np.array([error(dt) for dt in steps])
        # Terms of order five change the measured order by at most 0.02.
        np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 4.0, atol=0.1)


def test_dop853_error_falls_with_its_tolerance() -> None:
    rng = np.random.default_rng(25)
    robot, control, q0 = plant(rng), law(rng, "full", exciting(rng)), rng.uniform(-0.5, 0.5, 2)
    exact = al.simulate(robot, control, q0, t_end=2.0, dt=1e-4, record_every=100_000)
    errors, evaluations = [], []
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10):
        run = al.simulate(robot, control, q0, t_end=2.0, method="dop853", rtol=tolerance, atol=tolerance)
        errors.append(float(np.max(np.abs(run.q[-1] - exact.q[-1]))))
        evaluations.append(run.stats["evaluations"])
    # A tolerance that is 100 times smaller gives an error at least 10 times smaller, and needs more evaluations.
    assert np.all(np.array(errors[1:]) <= 0.1 * np.array(errors[:-1]))
    assert np.all(np.diff(evaluations) > 0)
    # The loop is contracting, so the error at the end is near the tolerance or below it.
    assert errors[-1] <= 1e-9


def test_inverse_dynamics_undoes_forward_dynamics() -> None:
    rng = np.random.default_rng(26)
    for _ in range(20):
        arm = plant(rng).arm
        q, v, tau = rng.uniform(-3.0, 3.0, (3, 50, 2))
        # det M is at least 0.5 A C, so M is far from singular.
        np.testing.assert_allclose(arm.inverse_dynamics(q, v, arm.forward_dynamics(q, v, tau)), tau, atol=1e-13)
        np.testing.assert_allclose(arm.forward_dynamics(q, v, arm.inverse_dynamics(q, v, tau)), tau, atol=1e-12)


def test_coriolis_matrix_is_the_skew_factorisation() -> None:
    """M_dot - 2C is skew-symmetric, with M_dot by central differences of M. The regressor is linear in the parameters."""
    rng = np.random.default_rng(27)
    h = 1e-5
    for _ in range(10):
        arm = plant(rng).arm
        q, v, v_r, a_r = rng.uniform(-3.0, 3.0, (4, 20, 2))
        rate = (arm.mass_matrix(q + h * v) - arm.mass_matrix(q - h * v)) / (2.0 * h)
        skew = rate - 2.0 * arm.coriolis_matrix(q, v)
        # The differences have the errors h^2 |v|^3 B / 6 and eps M / h, together at most 1e-9.
        np.testing.assert_allclose(skew + np.swapaxes(skew, -1, -2), 0.0, atol=2e-8)
        wanted = np.einsum("kij,kj->ki", arm.mass_matrix(q), a_r) + np.einsum("kij,kj->ki", arm.coriolis_matrix(q, v), v_r)
        np.testing.assert_allclose(arm.regressor(q, v, v_r, a_r) @ arm.parameters, wanted + arm.gravity(q), atol=1e-13 * 100)
        bias = np.einsum("kij,kj->ki", arm.coriolis_matrix(q, v), v) + arm.gravity(q)
        np.testing.assert_allclose(arm.bias(q, v), bias, atol=1e-12)


def test_saturation_is_respected_and_costs_the_lyapunov_identity() -> None:
    """A clipped torque is not the torque of the law, so the Lyapunov balance must report a violation. This shows that the monitor works."""
    rng = np.random.default_rng(28)
    robot, control = plant(rng), law(rng, "diagonal", exciting(rng))
    free = al.simulate(robot, control, [1.0, -1.0], t_end=1.0, dt=1e-4)
    clipped = al.simulate(robot, control, [1.0, -1.0], t_end=1.0, dt=1e-4, tau_max=[2.0, 1.0])
    assert clipped.tau is not None
    assert np.all(np.abs(clipped.tau) <= [2.0, 1.0])
    assert np.max(np.abs(free.monitors["lyapunov_balance"])) <= 1e-8 < 1e-3 < np.max(np.abs(clipped.monitors["lyapunov_balance"]))
    # The energy balance is an identity of the plant for every input. Kinks of the torque reduce the order of RK4.
    assert np.max(np.abs(clipped.monitors["energy_balance"])) <= 1e-5
