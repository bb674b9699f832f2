"""Dynamics of the planar PR arm and its laws against `armlet.reference`, for random plants, gains and states.

The reference derives Lagrange's equations with complex steps in numpy.

M(q) a + C(q, v) v + g(q) = tau,   Y(q, v, v_r, a_r) (A, B, C)' = M a_r + C v_r + g
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from trees import definite

import armlet as al
from armlet import reference

Array = NDArray[np.float64]

# The tolerance is 1e-12 of the largest number, which is some thousand rounding errors.
ROUNDING = 1e-12


def close(got: Array, expected: Array, tolerance: float = ROUNDING) -> None:
    scale = max(1.0, float(np.max(np.abs(expected), initial=0.0)))
    np.testing.assert_allclose(got, expected, rtol=0.0, atol=tolerance * scale)


def parameters(rng: np.random.Generator, coupling: float = 0.95) -> tuple[float, float, float]:
    A, C = rng.uniform(0.8, 4.0, 2)
    return float(A), float(rng.uniform(-coupling, coupling) * np.sqrt(A * C)), float(C)


def motions(rng: np.random.Generator) -> list[tuple[Any, Any]]:
    """Return pairs of one motion: armlet's and the reference's."""
    q0, q1 = rng.uniform(-2.0, 2.0, (2, 2))
    flat, many = rng.uniform(-1.5, 1.5, (3, 2)), rng.uniform(-1.5, 1.5, (3, 2, 3))
    return [
        (al.Hold(q0), reference.Hold(q0)),
        (al.Quintic(q0, q1, 1.7), reference.Quintic(q0, q1, 1.7)),
        (al.BangBang(q0, q1, 1.7), reference.BangBang(q0, q1, 1.7)),
        (al.Sinusoid(q0, *flat), reference.Sinusoid(q0, *flat)),
        (al.Sinusoid(q0, *many), reference.Sinusoid(q0, *many)),
    ]


def gains(rng: np.random.Generator, form: str) -> tuple[Any, Any, Any]:
    if form == "scalar":
        return 40.0, 12.0, 3.0
    if form == "diagonal":
        return rng.uniform(10.0, 60.0, 2), rng.uniform(5.0, 20.0, 2), rng.uniform(0.5, 6.0, 3)
    return definite(rng, 2, 40.0), definite(rng, 2, 15.0), definite(rng, 3, 4.0)


def loops(rng: np.random.Generator, form: str, motion: tuple[Any, Any]) -> tuple[Any, Any]:
    """Return armlet's plant and law, and the reference's plant and law.

    The two laws have different arms, which must not change the torque. A coupling of 0.6 keeps the eigenvalues of M above 0.3 and the rates
    of the loop below 200/s. So the loop is stable with a sample time of 4 ms.
    """
    pi, estimate, (kp, kd, gamma) = parameters(rng, 0.6), rng.uniform(-1.0, 2.0, 3), gains(rng, form)
    ours = al.planar_pr(*pi)
    theirs = reference.planar_pr(*pi)
    law = al.Adaptive(al.planar_pr(*parameters(rng)), motion[0], kp, kd, gamma, estimate=estimate)
    return (al.RigidArm(ours), law), (reference.RigidArm(theirs), reference.Adaptive(theirs, motion[1], kp, kd, gamma, estimate))


FUNCTIONS = {
    "mass_matrix": 1,
    "coriolis_matrix": 2,
    "gravity": 1,
    "bias": 2,
    "inverse_dynamics": 3,
    "forward_dynamics": 3,
    "regressor": 4,
}


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("lead", [(), (1,), (7,), (3, 1, 4)], ids=str)
def test_arm_functions(name: str, lead: tuple[int, ...]) -> None:
    rng = np.random.default_rng(11)
    for _ in range(8):
        pi = parameters(rng)
        values = rng.uniform(-3.0, 3.0, (FUNCTIONS[name], *lead, 2))
        # The determinant of M may be as small as 0.1 A C, so forward dynamics amplifies rounding.
        close(getattr(al.planar_pr(*pi), name)(*values), getattr(reference.planar_pr(*pi), name)(*values), 10 * ROUNDING)


@pytest.mark.parametrize("name", [name for name, count in FUNCTIONS.items() if count > 1])
def test_arguments_broadcast_as_in_numpy(name: str) -> None:
    rng = np.random.default_rng(12)
    arm = al.planar_pr(2.0, 0.7, 0.5)
    shapes = [(2,), (4, 2), (3, 1, 2), (1, 4, 2)]
    values = [rng.uniform(-3.0, 3.0, shape) for shape in shapes[: FUNCTIONS[name]]]
    whole = np.broadcast_arrays(*values)
    got = getattr(arm, name)(*values)
    np.testing.assert_array_equal(got, getattr(arm, name)(*whole))
    assert got.shape[:-1] == np.broadcast_shapes(*[v.shape for v in values])[:-1] or got.shape[:-2] == whole[0].shape[:-1]
    for index in np.ndindex(whole[0].shape[:-1]):
        np.testing.assert_array_equal(got[index], getattr(arm, name)(*[v[index] for v in whole]))


@pytest.mark.parametrize("lead", [(), (5,), (2, 3)], ids=str)
def test_energy(lead: tuple[int, ...]) -> None:
    rng = np.random.default_rng(13)
    for _ in range(8):
        pi = parameters(rng)
        q, v = rng.uniform(-3.0, 3.0, (2, *lead, 2))
        for got, expected in zip(al.planar_pr(*pi).energy(q, v), reference.planar_pr(*pi).energy(q, v), strict=True):
            assert np.shape(got) == lead
            close(np.asarray(got), np.asarray(expected))


def test_motions() -> None:
    rng = np.random.default_rng(14)
    for ours, theirs in motions(rng):
        for t in [-0.5, 0.0, 1e-9, 0.3, 0.85, 1.2, 1.7, 2.5, *rng.uniform(0.0, 1.7, 20)]:
            for got, expected in zip(ours(float(t)), theirs(float(t)), strict=True):
                close(got, expected)


@pytest.mark.parametrize("form", ["scalar", "diagonal", "full"])
def test_adaptive_terms(form: str) -> None:
    rng = np.random.default_rng(15)
    for motion in motions(rng):
        (_, law), (_, theirs) = loops(rng, form, motion)
        for _ in range(5):
            t, (q, v), state = float(rng.uniform(0.0, 2.0)), rng.uniform(-2.0, 2.0, (2, 2)), rng.uniform(-2.0, 2.0, 3)
            got, expected = law.terms(t, q, v, state=state), theirs.terms(t, q, v, state=state)
            for name in ("tau", "Y", "s", "e", "e_dot", "v_r", "a_r"):
                close(got[name], expected[name], 10 * ROUNDING)
            close(got["estimate_rate"], expected["state_rate"], 10 * ROUNDING)
            close(law(t, q, v, state=state), expected["tau"], 10 * ROUNDING)
            # Without `state` the law uses its estimate at the start.
            close(law(t, q, v), theirs(t, q, v), 10 * ROUNDING)


@pytest.mark.parametrize("form", ["scalar", "diagonal", "full"])
def test_computed_torque_terms(form: str) -> None:
    rng = np.random.default_rng(16)
    for motion in motions(rng):
        pi, (kp, kd, _) = parameters(rng), gains(rng, form)
        law = al.ComputedTorque(al.planar_pr(*pi), motion[0], kp, kd)
        theirs = reference.ComputedTorque(reference.planar_pr(*pi), motion[1], kp, kd)
        t, (q, v) = float(rng.uniform(0.0, 2.0)), rng.uniform(-2.0, 2.0, (2, 2))
        got, expected = law.terms(t, q, v), theirs.terms(t, q, v)
        for name in ("tau", "e", "e_dot", "a"):
            close(got[name], expected[name], 10 * ROUNDING)
        close(law(t, q, v), expected["tau"], 10 * ROUNDING)


RUNS: dict[str, dict[str, Any]] = {
    "continuous": {"t_end": 0.2, "dt": 2e-3, "record_every": 7},
    "last step short": {"t_end": 0.1333, "dt": 2e-3},
    "saturated": {"t_end": 0.2, "dt": 2e-3, "record_every": 7, "tau_max": [6.0, 3.0]},
    "sampled": {"t_end": 0.2, "dt": 2e-3, "sample_time": 4e-3},
    "sampled and saturated": {"t_end": 0.2, "dt": 2e-3, "sample_time": 4e-3, "tau_max": 4.0},
    "at wanted times": {"t_end": 0.2, "dt": 2e-3, "t_eval": [0.0, 0.0101, 0.1, 0.19999]},
}


@pytest.mark.parametrize("form", ["diagonal", "full"])
@pytest.mark.parametrize("options", RUNS.values(), ids=RUNS.keys())
def test_runs(form: str, options: dict[str, Any]) -> None:
    """Runs with equal steps of the same method differ by rounding only, since the loop contracts.

    A saturated torque has kinks. Rounding may move one stage across a kink, which changes the torque by the size of rounding.
    """
    rng = np.random.default_rng(17)
    limit = np.asarray(options.get("tau_max", np.inf))
    for motion in motions(rng)[1:]:
        (plant, law), (their_plant, theirs) = loops(rng, form, motion)
        q0, v0 = rng.uniform(-0.5, 0.5, (2, 2))
        run = al.simulate(plant, law, q0, v0=v0, **options)
        expected = reference.simulate(their_plant, theirs, q0, v0=v0, **options)
        assert run.tau is not None
        assert np.any(np.abs(run.tau) >= limit) == ("tau_max" in options)
        assert np.all(np.abs(run.tau) <= limit)
        np.testing.assert_allclose(run.t, expected["t"], atol=1e-14)
        for name in ("q", "v", "tau", "estimate"):
            close(getattr(run, name), expected[name], 1e-10)
        close(run.monitors["lyapunov"], expected["lyapunov"], 1e-10)
        close(run.monitors["lyapunov_balance"], expected["lyapunov_balance"], 1e-10)
        close(run.monitors["energy"], expected["energy"], 1e-10)
        close(run.monitors["energy_balance"], expected["energy_balance"], 1e-10)


def test_computed_torque_runs() -> None:
    rng = np.random.default_rng(18)
    for motion in motions(rng)[1:]:
        pi, (kp, kd, _) = parameters(rng), gains(rng, "full")
        theirs = reference.planar_pr(*pi)
        law = al.ComputedTorque(al.planar_pr(*pi), motion[0], kp, kd)
        q0 = rng.uniform(-0.5, 0.5, 2)
        run = al.simulate(al.RigidArm(al.planar_pr(*pi)), law, q0, t_end=0.15, dt=2e-3)
        expected = reference.simulate(
            reference.RigidArm(theirs), reference.ComputedTorque(theirs, motion[1], kp, kd), q0, t_end=0.15, dt=2e-3
        )
        for name in ("q", "v", "tau"):
            close(getattr(run, name), expected[name], 1e-10)


def test_adaptive_method_against_extrapolation() -> None:
    """Runs of DOP853 and of Gragg-Bulirsch-Stoer with tolerances of 1e-12 per step agree to 1e-10 in 0.5 s."""
    rng = np.random.default_rng(19)
    wanted = [0.1, 0.4, 0.5]
    for motion in motions(rng)[4:]:
        (plant, law), (their_plant, theirs) = loops(rng, "full", motion)
        q0 = rng.uniform(-0.5, 0.5, 2)
        run = al.simulate(plant, law, q0, t_end=0.5, t_eval=wanted, method="dop853", rtol=1e-12, atol=1e-12)
        expected = reference.simulate(their_plant, theirs, q0, t_end=0.5, t_eval=wanted, method="gbs")
        for name in ("q", "v", "tau", "estimate"):
            close(getattr(run, name), expected[name], 1e-10)
