"""Base parameters, physical consistency and identification against the reference: 1 to 8 joints.

armlet stacks torques and eliminates columns one by one. The reference computes the null space of mass matrix and gravity.
"""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray
from trees import close, driven_tree

import armlet as al
from armlet import reference as ref

Array = NDArray[np.float64]

OPTIONS: list[dict[str, Any]] = [{}, {"armature": True}, {"friction": True}, {"armature": True, "friction": True}]


@pytest.mark.slow
@pytest.mark.parametrize("options", OPTIONS, ids=str)
@pytest.mark.parametrize(("n", "seed"), [(n, seed) for n in range(1, 9) for seed in range(2)])
def test_base_parameters(n: int, seed: int, options: dict[str, Any]) -> None:
    arm, theirs = driven_tree(n, seed)
    got, want = arm.base_parameters(**options), ref.base_parameters(theirs, **options)
    np.testing.assert_array_equal(got.columns, want.columns)
    # Some columns are close to the space of the previous columns, which amplifies rounding.
    close(got.projection, want.projection, tolerance=1e-10)
    close(got.values, want.values, tolerance=1e-10)


def test_base_parameters_of_arms_in_closed_form() -> None:
    for arm, theirs in ((models.PR, models.REFERENCE_PR),):
        got, want = arm.base_parameters(), ref.base_parameters(theirs)
        np.testing.assert_array_equal(got.columns, want.columns)
        close(got.projection, want.projection)


def bodies(rng: np.random.Generator, n: int) -> Array:
    """Return parameters (10 n,) of possible bodies, bodies of negative mass, and bodies with an impossible moment of inertia."""
    pi = driven_tree(n, 0)[0].parameters.reshape(n, 10)
    kinds = rng.integers(0, 4, n)
    pi[kinds == 1, 0] *= -1.0
    pi[kinds == 2, 4] += 0.5
    pi[kinds == 3] = rng.normal(size=(int(np.sum(kinds == 3)), 10))
    return np.asarray(pi.reshape(-1))


@pytest.mark.parametrize("n", range(1, 9))
def test_possible_parameters(n: int) -> None:
    rng = np.random.default_rng(n)
    arm, theirs = driven_tree(n, 0)
    possible, impossible = 0, 0
    for _ in range(20):
        pi = bodies(rng, n)
        got, want = arm.check_parameters(pi), ref.check_parameters(theirs, pi)
        close(got.eigenvalues, want.eigenvalues)
        assert [not problem for problem in got.problems] == list(want.possible)
        assert got.consistent == want.consistent
        impossible, possible = impossible + len(got.inconsistent), possible + n - len(got.inconsistent)
        if got.eigenvalues.max() <= 0.0:
            continue
        for options in ({}, {"length": 0.3, "floor": 1e-3}):
            # Entries are divided by the length and multiplied again, which amplifies rounding.
            close(al.project_parameters(pi, **options), ref.project_parameters(pi, **options), tolerance=1e-11)
            np.testing.assert_array_equal(arm.project_parameters(pi, **options), al.project_parameters(pi, **options))
    assert possible and impossible
    assert arm.check_parameters().consistent == ref.check_parameters(theirs).consistent


def compare(got: Any, want: Any, rounding: float) -> None:
    """Compare all results of an identification. `rounding` is the relative tolerance of the identified values."""
    assert got.rank == want.rank
    close(got.singular_values, want.singular_values)
    # The rounding error of the least singular value is proportional to the largest singular value.
    assert got.condition == pytest.approx(want.condition, rel=1e-9)
    close(got.values, want.values, tolerance=rounding)
    close(got.covariance, want.covariance, float(np.abs(want.covariance).max()), 1e-6)
    np.testing.assert_array_equal(np.isfinite(got.deviations), np.isfinite(want.deviations))
    close(got.residuals, want.residuals)
    close(got.parameters, want.parameters, tolerance=rounding)


@pytest.mark.slow
@pytest.mark.parametrize("options", OPTIONS, ids=str)
@pytest.mark.parametrize("n", [1, 2, 4, 6])
def test_identification(n: int, options: dict[str, Any]) -> None:
    """Identified values agree for noisy torques, with and without weights.

    For one and two joints there are 300 samples, more than the 256 samples that armlet processes at a time.
    """
    rng, samples = np.random.default_rng(n), 300 if n <= 2 else 40
    arm, theirs = driven_tree(n, 1)
    q, v, a = rng.uniform(-2.0, 2.0, (3, samples, n))
    tau = theirs.inverse_dynamics(q, v, a, friction=True) + 0.1 * rng.normal(size=(samples, n))
    for extra in ({}, {"noise": rng.uniform(0.1, 2.0, n)}):
        got = arm.identify(q, v, a, tau, **options, **extra)
        # Rounding of the torque is divided by the least singular value.
        compare(got, ref.identify(theirs, q, v, a, tau, **options, **extra), 1e-9)


@pytest.mark.parametrize("others", [{}, {"armature": True, "friction": True}], ids=str)
@pytest.mark.parametrize("n", [1, 2, 4, 6])
def test_offsets(n: int, others: dict[str, bool]) -> None:
    rng = np.random.default_rng([n, 5])
    arm, theirs = driven_tree(n, 1)
    mine, other = arm.base_parameters(offset=True, **others), ref.base_parameters(theirs, offset=True, **others)
    np.testing.assert_array_equal(mine.columns, other.columns)
    close(mine.projection, other.projection, tolerance=1e-10)
    close(mine.values, other.values, tolerance=1e-10)
    q, v, a = rng.uniform(-2.0, 2.0, (3, 60, n))
    tau = theirs.inverse_dynamics(q, v, a, friction=True) + rng.normal(size=n) + 0.1 * rng.normal(size=(60, n))
    got = arm.identify(q, v, a, tau, offset=True, **others)
    compare(got, ref.identify(theirs, q, v, a, tau, offset=True, **others), 1e-9)
    np.testing.assert_array_equal(got.offsets, got.parameters[-n:])


def test_a_record_that_shows_too_little() -> None:
    """With one joint at rest, both libraries find the same rank, unidentifiable parameters and values of least norm.

    A larger cutoff gives a smaller rank.
    """
    rng = np.random.default_rng(3)
    arm, theirs = driven_tree(3, 1)
    q, v, a = rng.uniform(-2.0, 2.0, (3, 80, 3))
    q[:, 1], v[:, 1], a[:, 1] = 0.3, 0.0, 0.0
    tau = theirs.inverse_dynamics(q, v, a) + 0.1 * rng.normal(size=(80, 3))
    short = arm.identify(q, v, a, tau)
    assert short.rank < short.base.count and not np.isfinite(short.deviations).all()
    ranks = []
    for options in ({}, {"cutoff": 0.2}):
        got = arm.identify(q, v, a, tau, **options)
        compare(got, ref.identify(theirs, q, v, a, tau, **options), 1e-9)
        ranks.append(got.rank)
    assert ranks[1] < ranks[0]
