"""Concurrent learning against the reference, which computes M_dot v by differences and adds up samples one by one."""

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
    "columns": {"friction": ("viscous", "coulomb", "stribeck"), "friction_speed": 0.4, "armature": True},
    "leakage": {"friction": True, "friction_speed": 0.4, "leakage": 0.2},
    "dead zone": {"dead_zone": 1.0, "armature": True},
    "composite": {"composite": 0.4, "composite_rate": 4.0},
    "base": {"friction": True, "friction_speed": 0.5},
    "natural": {"friction": True, "friction_speed": 0.5},
    "projection": {"armature": True},
    "with offset": {"armature": True, "offset": True},
}


def pair(option: str, n: int) -> tuple[Any, Any, tuple[Any, Any], dict[str, Any]]:
    """Return armlet's law, the reference's law, both arms and the samples, which both laws store."""
    rng = np.random.default_rng([n, sorted(OPTIONS).index(option)])
    arm, theirs = driven_tree(n, 2)
    ball = np.array([1.0, 0, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1])
    bodies = np.tile(ball, n) + 0.02 * rng.uniform(-1.0, 1.0, 10 * n)
    arm, theirs = arm.with_parameters(bodies), theirs.with_parameters(bodies)
    keywords = dict(OPTIONS[option])
    beside = columns_beside(n, keywords)
    own, other, size = parametrisation(option, (arm, theirs), bodies)
    root = rng.standard_normal((n, n))
    W, tau = rng.uniform(-0.3, 0.3, (4, n, size + beside)), rng.uniform(-0.5, 0.5, (4, n))
    stored = al.Samples(W=W, tau=tau, indices=np.arange(4), singular_value=0.0, rank=0)
    gamma = rng.uniform(0.1, 0.3, n + beside if option == "natural" else size + beside)
    estimate = np.concatenate([0.5 * bodies[:size], rng.uniform(0.0, 0.3, beside)])
    common: dict[str, Any] = {"estimate": estimate, "concurrent": stored, "concurrent_weight": root @ root.T + np.eye(n), **keywords}
    motion = rng.uniform(0.2, 0.8, (4, n))
    ours, expected = laws((arm, theirs), motion, gamma, common | own, common | other)
    return ours, expected, (arm, theirs), {"W": W, "tau": tau}


@pytest.mark.slow
@pytest.mark.parametrize("n", range(1, 9))
@pytest.mark.parametrize("option", [name for name in OPTIONS if name != "composite"])
def test_terms(option: str, n: int) -> None:
    ours, other, _, stored = pair(option, n)
    rng = np.random.default_rng(n)
    q, v = rng.uniform(-1.0, 1.0, (2, n))
    state = 1.2 * other.state0
    got, want = ours.terms(0.3, q, v, state=state), other.terms(0.3, q, v, state=state)
    close(got["tau"], want["tau"], tolerance=1e-11)
    # For natural adaptation the reference solves with a 10 x 10 matrix for each body, which amplifies rounding.
    close(got["estimate_rate"], want["state_rate"], tolerance=1e-10)
    close(got["e_stored"], stored["tau"] - stored["W"] @ state, tolerance=1e-12)


@pytest.mark.parametrize("n", [1, 2, 3, 4])
@pytest.mark.parametrize("option", ["alone", "columns", "composite"])
def test_runs(option: str, n: int) -> None:
    """RK4 integrates two forms of the same filters. They differ by its error, (1e-3)^4 times rates to the fifth power."""
    ours, other, (arm, theirs), _ = pair(option, n)
    friction = option == "columns"
    rng = np.random.default_rng(n)
    start = dict(zip(("q0", "v0"), rng.uniform(-0.5, 0.5, (2, n)), strict=True))
    run = al.simulate(al.RigidArm(arm, friction=friction), ours, **start, t_end=0.1, dt=1e-3, check_limits=False)
    expected = ref.simulate(ref.RigidArm(theirs, friction=friction), other, **start, t_end=0.1, dt=1e-3)
    p = len(ours.parameter_names)
    assert run.estimate is not None
    for key in ("q", "v", "tau"):
        close(getattr(run, key), expected[key], tolerance=1e-7)
    close(run.estimate[:, :p], expected["estimate"][:, :p], tolerance=1e-7)
    for key in ("lyapunov", "lyapunov_balance"):
        close(run.monitors[key], expected[key], tolerance=1e-7)


def record(arm: al.Arm, count: int, friction: bool = False) -> dict[str, Array]:
    """Return `count` samples of a motion in 2 s, with one frequency per joint, and its torques."""
    t = np.linspace(0.0, 2.0, count)
    rng = np.random.default_rng(arm.n)
    w, phase, size = rng.uniform(1.0, 5.0, arm.n), rng.uniform(0.0, 3.0, arm.n), rng.uniform(0.3, 0.9, arm.n)
    angle = np.outer(t, w) + phase
    q, v, a = size * np.sin(angle), size * w * np.cos(angle), -size * w**2 * np.sin(angle)
    return {"t": t, "q": q, "v": v, "a": a, "tau": arm.inverse_dynamics(q, v, a, friction=friction)}


@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("option", ["alone", "columns", "base"])
def test_rows_of_samples_and_windows(option: str, n: int) -> None:
    """The selection of all samples returns the same W and tau as the reference."""
    ours, other, (arm, _), _ = pair(option, n)
    known = record(arm, 25)
    q, v, a, tau, t = (known[name] for name in ("q", "v", "a", "tau", "t"))
    got = al.select_samples(ours, q, v, tau, 25, a=a)
    W, torques = ref.sample_rows(other, q, v, a, tau)
    close(got.W, W, tolerance=1e-11)
    close(got.tau, torques, tolerance=1e-11)
    assert got.indices.tolist() == list(range(25))
    for held in (False, True):
        # There are 11 windows of 4 steps, each half a window after the previous one. The reference uses differences of fourth order.
        W, torques = ref.window_rows(other, t, q, v, tau, 4.2 * (t[1] - t[0]), held)
        got = al.select_samples(ours, q, v, tau, 11, t=t, window=4.2 * (t[1] - t[0]), held=held)
        close(got.W, W, tolerance=1e-8)
        close(got.tau, torques, tolerance=1e-11)


@pytest.mark.parametrize("seed", range(6))
def test_the_choice_is_near_the_best(seed: int) -> None:
    """The selected samples have a singular value of at least 0.85 times the reference's.

    The reference starts from the first samples and exchanges two at a time. Both searches end where no exchange improves the set.
    """
    rng = np.random.default_rng(seed)
    n = 1 + seed % 3
    arm, theirs = driven_tree(n, 2)
    motion = rng.uniform(0.2, 0.8, (4, n))
    ours, other = laws((arm, theirs), motion, 1.0, {}, {})
    q, v, a = rng.uniform(-1.5, 1.5, (3, 30, n))
    tau = arm.inverse_dynamics(q, v, a)
    W, _ = ref.sample_rows(other, q, v, a, tau)
    count = 12
    got = al.select_samples(ours, q, v, tau, count, a=a)
    stacked = np.linalg.svd(np.vstack(W[got.indices]), compute_uv=False)
    rank = np.linalg.matrix_rank(np.vstack(W), tol=1e-6 * stacked[0])
    assert got.rank == rank
    np.testing.assert_allclose(got.singular_value, stacked[rank - 1], rtol=1e-6)
    _, best = ref.select_samples(W, count)
    assert got.singular_value >= 0.85 * best
    # Fifty random selections have smaller singular values.
    others = [ref.samples.smallest(W, rng.choice(30, count, replace=False), rank) for _ in range(50)]
    assert got.singular_value > max(others)
