"""`Identification.with_prior` is the weighted least-squares solution of two kinds of equations: the estimates, and the arm's parameters."""

from __future__ import annotations

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

SIX = models.SIX_AXES
#: A vertical base joint whose axis is tilted by the rounding of an angle in the file: 1.5708 in place of pi/2.
TILT = 1.5708 - np.pi / 2


def rounded() -> al.Arm:
    """A light arm whose first moments about the vertical axis change gravity's torque by parts per million."""
    rod = {"phi": [0.1, 0.0, 0.0, 0.005, 4e-4, 0.0, 4e-4, 0.0, 0.0, 2e-5], "type": "R"}
    axes = [[0, 0, 1], [0, 1, 0], [0, 1, 0]]
    places: list[dict[str, list[float]]] = [{"rpy": [TILT, 0.0, 0.0]}, {"xyz": [0.0, 0.0, 0.1]}, {"xyz": [0.0, 0.0, 0.1]}]
    return al.Arm.from_chain([rod | place | {"axis": axis} for axis, place in zip(axes, places, strict=True)])


def recorded(arm: al.Arm, built: al.Arm, noise: float, **keywords: bool) -> al.Identification:
    """Identification from a smooth motion of `built`, with noise of this fraction of the largest torque."""
    t = np.linspace(0.0, 10.0, 400)[:, None]
    n = np.arange(1, arm.n + 1)
    q, v, a = np.sin(n * t), n * np.cos(n * t), -(n**2) * np.sin(n * t)
    tau = built.inverse_dynamics(q, v, a)
    sigma = noise * np.abs(tau).max(axis=0)
    return arm.identify(q, v, a, tau + sigma * np.random.default_rng(0).normal(size=tau.shape), noise=sigma if noise else None, **keywords)


def error(found: NDArray[np.float64], built: al.Arm) -> float:
    """The relative error of the mass matrix at one configuration."""
    q = np.linspace(0.3, 0.9, built.n)
    exact = built.mass_matrix(q)
    return float(np.linalg.norm(built.with_parameters(found).mass_matrix(q) - exact) / np.linalg.norm(exact))


@pytest.mark.parametrize("spread", [0.01, 0.3, 3.0])
@pytest.mark.parametrize("make", [lambda: SIX, rounded, lambda: models.PR], ids=["six axes", "rounded", "PR"])
def test_weighted_least_squares(make: object, spread: float) -> None:
    arm = make()  # type: ignore[operator]
    found = recorded(arm, arm.with_parameters(1.1 * arm.parameters), 0.01)
    pi = arm.parameters
    scale = np.abs(pi)
    if pi.size % 10 == 0:
        bodies = pi.reshape(-1, 10)
        radius = np.sqrt((bodies[:, 4] + bodies[:, 6] + bodies[:, 9]) / 2 / bodies[:, 0])
        scale = np.concatenate([m * np.array([1, r, r, r, *[r * r] * 6]) for m, r in zip(bodies[:, 0], radius, strict=True)])
    # Unknown is (pi - prior) / scale, so that the columns have comparable sizes.
    root = np.linalg.inv(np.linalg.cholesky(found.covariance))
    equations = np.vstack([root @ found.base.projection * scale, np.eye(pi.size) / spread])
    right = np.concatenate([root @ (found.values - found.base.projection @ pi), np.zeros(pi.size)])
    expected = np.linalg.lstsq(equations, right)[0]
    # The equations of this test are less well conditioned than those of the package.
    np.testing.assert_allclose((found.with_prior(spread) - pi) / scale, expected, rtol=0.0, atol=1e-6 * max(1.0, np.abs(expected).max()))


def test_a_combination_that_does_not_affect_the_torque_keeps_its_value() -> None:
    """The rounding of an angle makes first moments visible. Their estimates are noise, which a projection spreads to the mass matrix."""
    arm = rounded()
    built = arm.with_parameters(1.1 * arm.parameters)
    found = recorded(arm, built, 0.01)
    assert np.abs(found.deviations / np.abs(found.base.values).max()).max() > 100.0
    assert error(arm.project_parameters(found.parameters), built) > 1.0
    possible = arm.project_parameters(found.with_prior())
    assert error(possible, built) < 0.3 * error(arm.parameters, built)
    assert arm.check_parameters(possible) or np.allclose(possible, found.with_prior())


def test_the_limits_of_the_spread() -> None:
    """A small spread gives the parameters of the arm, and a large one the least-squares estimates."""
    built = SIX.with_parameters(1.1 * SIX.parameters)
    found = recorded(SIX, built, 0.01)
    np.testing.assert_allclose(found.with_prior(1e-9), SIX.parameters, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(found.base.projection @ found.with_prior(1e6), found.values, rtol=0.0, atol=1e-4)
    exact = recorded(SIX, built, 0.0)
    np.testing.assert_allclose(exact.base.projection @ exact.with_prior(), exact.values, rtol=0.0, atol=1e-8)


def test_parameters_of_joints_keep_their_estimates() -> None:
    found = recorded(SIX, SIX, 0.01, armature=True)
    assert found.with_prior().shape == found.parameters.shape == (66,)
    armature = found.base.projection[:, 60:] @ found.parameters[60:]
    assert np.abs(found.base.projection[:, 60:] @ found.with_prior(10.0)[60:] - armature).max() < 0.5 * np.abs(armature).max()


def test_combinations_without_an_estimate_are_ignored() -> None:
    """An arm at rest does not show its inertia: the deviations of these combinations are infinite."""
    arm = models.TWO_LINKS
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (200, 2))
    found = arm.identify(q, 0.0 * q, 0.0 * q, 1.1 * arm.gravity(q))
    assert found.unidentified and np.isfinite(found.with_prior()).all()


@pytest.mark.parametrize("spread", [0.0, -1.0, np.nan, "large"])
def test_refused_spreads(spread: object) -> None:
    found = recorded(SIX, SIX, 0.01)
    with pytest.raises(al.InputError, match=r"^Identification\.with_prior: spread is "):
        found.with_prior(spread)  # type: ignore[arg-type]
