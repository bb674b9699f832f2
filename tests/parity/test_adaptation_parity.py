"""Natural, base and projected adaptation against the reference.

The reference computes matrix roots from eigenvalues. For the natural metric, it solves with a 10 x 10 matrix, and armlet uses congruences.
"""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray
from trees import body, close, driven_tree

import armlet as al
from armlet import reference as ref

Array = NDArray[np.float64]


def gamma_of(rng: np.random.Generator, size: int, form: str) -> Any:
    """Return adaptation gains: a number, a vector (size,) or a matrix (size, size)."""
    if form == "scalar":
        return 0.3
    if form == "diagonal":
        return rng.uniform(0.1, 1.0, size)
    root = rng.standard_normal((size, size))
    return 0.2 * (root @ root.T / size + 0.1 * np.eye(size))


def pair(n: int, form: str, option: str, start: str = "inside") -> tuple[Any, Any, Any]:
    """Return armlet's law, the reference's law and both arms. Gains and estimates at the start are equal."""
    rng = np.random.default_rng(n)
    arm, theirs = driven_tree(n, 1)
    bodies = np.concatenate([body(rng) for _ in range(n)])
    arm, theirs = arm.with_parameters(bodies), theirs.with_parameters(bodies)
    motion = rng.uniform(0.2, 0.8, (4, n))
    size, estimate = 10 * n, {"inside": 0.8, "near": 0.25, "negative": -0.5}[start] * bodies
    keywords: dict[str, dict[str, Any]] = {"al": {}, "ref": {}}
    if option == "natural":
        size = n
        keywords = {lib: {"natural": True} for lib in keywords}
    if option == "base":
        keywords = {"al": {"base": arm.base_parameters()}, "ref": {"base": ref.base_parameters(theirs)}}
        size = keywords["al"]["base"].count
        estimate = estimate[:size]
    if option == "projection":
        keywords = {lib: {"projection": 0.3 * bodies} for lib in keywords}
    if option == "mass":
        keywords = {lib: {"projection": 0.4} for lib in keywords}
    gamma = gamma_of(rng, size, form)
    ours = al.Adaptive(arm, al.Sinusoid(*motion), 30.0, 10.0, gamma, estimate=estimate, **keywords["al"])
    other = ref.Adaptive(theirs, ref.Sinusoid(*motion), 30.0, 10.0, gamma, estimate=estimate, **keywords["ref"])
    return ours, other, (arm, theirs)


CASES = [("natural", "scalar"), ("natural", "diagonal"), ("base", "scalar"), ("base", "full"), ("projection", "full"), ("mass", "diagonal")]


@pytest.mark.slow
@pytest.mark.parametrize("start", ["inside", "near", "negative"])
@pytest.mark.parametrize("n", [1, 2, 3, 5, 8])
@pytest.mark.parametrize(("option", "form"), CASES)
def test_torques_and_rates(option: str, form: str, n: int, start: str) -> None:
    """Torques and rates agree for arms with armature.

    Estimates start above the lower bounds of the projection, between half of these bounds and the bounds, or negative.
    """
    if option == "natural" and start == "negative":
        start = "near"  # natural adaptation refuses an impossible start
    ours, other, _ = pair(n, form, option, start)
    for t, (q, v) in zip((0.0, 0.9), np.random.default_rng(n).uniform(-1.0, 1.0, (2, 2, n)), strict=True):
        for share in (1.0, 0.9, 0.5):
            state = share * other.state0 if option != "mass" else other.state0 * (2.0 - share)
            got, want = ours.terms(t, q, v, state=state), other.terms(t, q, v, state=state)
            for key in ("tau", "Y", "s"):
                close(got[key], want[key], tolerance=1e-11)
            # For natural adaptation the reference solves with a 10 x 10 matrix for each body, which amplifies rounding.
            close(got["estimate_rate"], want["state_rate"], tolerance=1e-10)
        # Without `state`, a law uses its estimate at the start, which the projection moves inside its bounds.
        close(ours(t, q, v), other(t, q, v), tolerance=1e-11)


@pytest.mark.parametrize("estimate", [[0.5, 0.1, 0.2], [0.0, 0.0, 0.0], [-1.0, 0.4, 0.3]])
@pytest.mark.parametrize("projection", [0.3, [0.5, 0.1, 0.1]])
def test_projection_of_the_planar_pr(estimate: list[float], projection: Any) -> None:
    motion = [[0.1, 0.2], [0.5, 0.4], [1.0, 1.5], [0.0, 0.3]]
    ours = al.Adaptive(models.PR, al.Sinusoid(*motion), 40.0, 20.0, 3.0, estimate=estimate, projection=projection)
    other = ref.Adaptive(models.REFERENCE_PR, ref.Sinusoid(*motion), 40.0, 20.0, 3.0, estimate=estimate, projection=projection)
    for state in (None, [0.2, 0.15, 0.01], [1.0, 0.1, 0.5]):
        got, want = (
            ours.terms(0.3, [0.2, 0.5], [1.0, -0.4], state=state),
            other.terms(0.3, np.array([0.2, 0.5]), np.array([1.0, -0.4]), state=None if state is None else np.array(state)),
        )
        close(got["tau"], want["tau"])
        close(got["estimate_rate"], want["state_rate"], tolerance=1e-11)


@pytest.mark.parametrize(("option", "form"), CASES[:-1])
def test_runs(option: str, form: str) -> None:
    """Runs agree in states, torques, Lyapunov function and its balance, with equal steps of the same method.

    The option "mass" is excluded, because rounding grows much faster in its runs.
    """
    ours, other, (arm, theirs) = pair(2, form, option, "near")
    run = al.simulate(al.RigidArm(arm), ours, [0.3, -0.2], t_end=0.2, dt=2e-3)
    expected = ref.simulate(ref.RigidArm(theirs), other, [0.3, -0.2], t_end=0.2, dt=2e-3)
    for key in ("q", "v", "tau", "estimate"):
        close(getattr(run, key), expected[key], tolerance=1e-9)
    for key in ("lyapunov", "lyapunov_balance"):
        close(run.monitors[key], expected[key], tolerance=1e-9)
