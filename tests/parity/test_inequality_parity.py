"""Priorities with inequalities: the active-set method of the core against the enumeration of active sets and the certificate in numpy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import armlet as al
from armlet.reference.inequality import certificate, solve_inequalities

Levels = list[tuple[np.ndarray, np.ndarray, np.ndarray]]


def random_levels(rng: np.random.Generator, n: int, most_bounds: int) -> Levels:
    """Integer rows, of which some are copies, opposite or zero. Bounds often meet in a vertex."""
    levels, left = [], most_bounds
    for _ in range(int(rng.integers(2, 5))):
        m = int(rng.integers(1, 4))
        A = rng.integers(-3, 4, size=(m, n)).astype(float)
        kind = rng.integers(0, 5)
        A[-1] = {0: 0.0 * A[0], 1: -A[0], 2: 2.0 * A[0]}.get(int(kind), A[-1])
        value = A @ rng.integers(-1, 2, size=n)
        wide = (rng.random(m) < 0.5) & (np.cumsum(np.ones(m)) <= left)
        left -= int(wide.sum())
        lower = np.where(wide & (rng.random(m) < 0.7), value - rng.integers(0, 2, size=m), value)
        upper = np.where(wide, value + rng.integers(0, 2, size=m), value)
        levels.append((A, lower, upper))
    return levels


def solve(levels: Levels, **options: Any) -> Any:
    return al.solve_priority([A for A, _, _ in levels], [al.Within(lower, upper) for _, lower, upper in levels], **options)


@pytest.mark.parametrize("seed", range(40))
def test_small_stacks_against_enumeration(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    levels = random_levels(rng, n, most_bounds=4)
    root = rng.normal(size=(n, n))
    for weight in (None, root @ root.T + np.eye(n)):
        sol, wanted = solve(levels, method="exact", weight=weight), solve_inequalities(levels, weight)
        np.testing.assert_allclose(sol.v, wanted.x, rtol=0, atol=1e-9 * (1 + np.abs(wanted.x).max()))
        for violation, expected in zip(sol.violations, wanted.violations, strict=True):
            np.testing.assert_allclose(violation, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_speed_limits_are_the_level_above(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    levels = random_levels(rng, 3, most_bounds=2)
    v_min, v_max = -rng.uniform(0.2, 1.5, 3), rng.uniform(0.2, 1.5, 3)
    sol = solve(levels, method="exact", v_min=v_min, v_max=v_max)
    wanted = solve_inequalities([(np.eye(3), v_min, v_max), *levels])
    np.testing.assert_allclose(sol.v, wanted.x, rtol=0, atol=1e-9)
    assert {limit.row for limit in sol.limits} == set(np.flatnonzero((sol.v == v_min) | (sol.v == v_max)))


@pytest.mark.parametrize("seed", range(30))
def test_large_stacks_have_a_certificate(seed: int) -> None:
    rng = np.random.default_rng(200 + seed)
    n = int(rng.integers(7, 13))
    levels = random_levels(rng, n, most_bounds=100) + random_levels(rng, n, most_bounds=100)
    limit = np.full(n, 0.7)
    sol = solve(levels, method="exact", v_max=limit)
    assert sol.certificate <= 1e-12
    assert certificate([(np.eye(n), -limit, limit), *levels], sol.v) <= 1e-9
    # Another feasible point has no certificate.
    assert certificate([(np.eye(n), -limit, limit), *levels], 0.9 * sol.v + 0.01) > 1e-6


@pytest.mark.parametrize("seed", range(10))
def test_diagnoses_within_bounds(seed: int) -> None:
    """The losses within bounds are the violations of the enumeration, and `why` names the levels with a loss."""
    rng = np.random.default_rng(300 + seed)
    levels = random_levels(rng, 3, most_bounds=2)
    jacobians, targets = [A for A, _, _ in levels], [al.Within(lower, upper) for _, lower, upper in levels]
    v_min, v_max = -rng.uniform(0.2, 0.8, 3), rng.uniform(0.2, 0.8, 3)
    seen = al.diagnose_priority(jacobians, rhs=targets, v_min=v_min, v_max=v_max)
    wanted = solve_inequalities([(np.eye(3), v_min, v_max), *levels]).violations[1:]
    assert seen.losses is not None and seen.why is not None
    sol = al.solve_priority(jacobians, targets, method="exact", v_min=v_min, v_max=v_max)
    for k, (loss, violation, sentence) in enumerate(zip(seen.losses, wanted, seen.why, strict=True), start=1):
        np.testing.assert_allclose(loss, -violation, rtol=0, atol=1e-9)
        assert sol.why(k) == sentence
        assert sentence.endswith("is reached") == (not violation.any())
    assert seen.compatible == (not any(violation.any() for violation in wanted))
