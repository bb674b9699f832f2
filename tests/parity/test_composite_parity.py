"""Composite adaptation against the reference, whose filters use the plant's true acceleration."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from adaptive_options import columns_beside, laws, parametrisation
from numpy.typing import NDArray
from trees import close, driven_tree

import armlet as al
from armlet import reference as ref

Array = NDArray[np.float64]

OPTIONS: dict[str, dict[str, Any]] = {
    "alone": {},
    "full weight": {},
    "columns": {"friction": ("viscous",), "armature": True},
    "leakage": {"friction": True, "friction_speed": 0.4, "leakage": 0.2},
    "dead zone": {"dead_zone": 1.0, "armature": True},
    "base": {"friction": True, "friction_speed": 0.5},
    "natural": {"friction": True, "friction_speed": 0.5},
    "projection": {"armature": True},
    "with offset": {"armature": True, "offset": True},
}


def pair(option: str, n: int) -> tuple[Any, Any, tuple[Any, Any]]:
    """Return armlet's law, the reference's law and both arms, for one option."""
    rng = np.random.default_rng([n, sorted(OPTIONS).index(option)])
    arm, theirs = driven_tree(n, 2)
    ball = np.array([1.0, 0, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1])
    bodies = np.tile(ball, n) + 0.02 * rng.uniform(-1.0, 1.0, 10 * n)
    arm, theirs = arm.with_parameters(bodies), theirs.with_parameters(bodies)
    keywords = dict(OPTIONS[option])
    beside = columns_beside(n, keywords)
    own, other, size = parametrisation(option, (arm, theirs), bodies)
    weight: Any = 0.4
    if option == "full weight":
        root = rng.standard_normal((n, n))
        weight = 0.2 * (root @ root.T + np.eye(n))
    gamma = rng.uniform(0.1, 0.3, n + beside if option == "natural" else size + beside)
    estimate = np.concatenate([0.5 * bodies[:size], rng.uniform(0.0, 0.3, beside)])
    common: dict[str, Any] = {"estimate": estimate, "composite": weight, "composite_rate": 4.0, **keywords}
    motion = rng.uniform(0.2, 0.8, (4, n))
    ours, expected = laws((arm, theirs), motion, gamma, common | own, common | other)
    return ours, expected, (arm, theirs)


def state_of(law: Any, own: Any, q: Array, v: Array, state: Array) -> Array:
    """Convert the state of the reference's law to that of armlet's law, which stores W minus the columns of the momentum."""
    n, p, b = law.arm.n, law.p, law.inertial
    W, tau_W = state[p : p + n * p].reshape(n, p), state[p + n * p :]
    still = np.zeros(n)
    momentum = (law.arm.regressor(q, still, still, v) - law.arm.regressor(q, still, still, still))[:, law.columns]
    joints = np.arange(p - b) % n
    beside = W[joints, b + np.arange(p - b)]
    known = law.arm.armature
    if "armature" in law.kinds:
        beside[:n] -= v
        known = still
    return np.concatenate([state[:p], (W[:, :b] - momentum).ravel(), beside, tau_W + known * v])


def reached(law: Any) -> NDArray[np.bool_]:
    """Return a mask (n, p) of the entries of W that can differ from zero.

    They are entries of the regressor above 1e-9 at one of four random states.
    """
    rng, n = np.random.default_rng(7), law.arm.n
    states = rng.uniform(0.3, 1.3, (4, 3, n))
    found: NDArray[np.bool_] = np.max([np.abs(law.arm.regressor(q, v, v, a)[:, law.columns]) for q, v, a in states], axis=0) > 1e-9
    return found


@pytest.mark.slow
@pytest.mark.parametrize("n", range(1, 9))
@pytest.mark.parametrize("option", OPTIONS)
def test_terms(option: str, n: int) -> None:
    ours, other, _ = pair(option, n)
    rng = np.random.default_rng(n)
    p = len(ours.parameter_names)
    q, v = rng.uniform(-1.0, 1.0, (2, n))
    # At the start all filters are zero, for any state of the arm.
    start = ours.terms(0.2, q, v)
    for key in ("W", "tau_W", "e_W"):
        np.testing.assert_array_equal(start[key], np.zeros_like(start[key]))
    filtered = rng.uniform(-0.5, 0.5, (n, p))
    # A parameter of a joint changes the torque of that joint only.
    beside = np.arange(p - other.inertial)
    filtered[:, other.inertial :] *= beside % n == np.arange(n)[:, None]
    # armlet does not store entries that are zero at every state, so the test sets them to zero.
    filtered[:, : other.inertial] *= reached(other)
    state = np.concatenate([1.2 * other.state0[:p], filtered.ravel(), rng.uniform(-1.0, 1.0, n)])
    got, want = ours.terms(0.3, q, v, state=state_of(other, ours, q, v, state)), other.terms(0.3, q, v, state=state)
    for key in ("tau", "W", "tau_W", "e_W"):
        close(got[key], want[key], tolerance=1e-11)
    # For natural adaptation the reference solves with a 10 x 10 matrix for each body, which amplifies rounding.
    close(got["estimate_rate"], want["state_rate"][:p], tolerance=1e-10)


@pytest.mark.parametrize("n", [1, 2, 3, 4])
@pytest.mark.parametrize("option", ["alone", "columns", "full weight"])
def test_runs(option: str, n: int) -> None:
    """RK4 integrates two forms of the same filters. They differ by its error, (1e-3)^4 times rates to the fifth power."""
    ours, other, (arm, theirs) = pair(option, n)
    friction = option == "columns"
    rng = np.random.default_rng(n)
    start = dict(zip(("q0", "v0"), rng.uniform(-0.5, 0.5, (2, n)), strict=True))
    run = al.simulate(al.RigidArm(arm, friction=friction), ours, **start, t_end=0.1, dt=1e-3, check_limits=False)
    expected = ref.simulate(ref.RigidArm(theirs, friction=friction), other, **start, t_end=0.1, dt=1e-3)
    p = len(ours.parameter_names)
    for key in ("q", "v", "tau"):
        close(getattr(run, key), expected[key], tolerance=1e-7)
    close(run.estimate[:, :p], expected["estimate"][:, :p], tolerance=1e-7)
    at_end = ours.terms(0.1, run.q[-1], run.v[-1], state=run.estimate[-1])
    close(at_end["W"].ravel(), expected["estimate"][-1, p:-n], tolerance=1e-7)
    close(at_end["tau_W"], expected["estimate"][-1, -n:], tolerance=1e-7)
    for key in ("lyapunov", "lyapunov_balance"):
        close(run.monitors[key], expected[key], tolerance=1e-7)
