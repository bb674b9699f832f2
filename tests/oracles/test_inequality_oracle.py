"""Priorities with inequalities against vectors that were solved with 50 digits."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armlet as al

CASES = json.loads((Path(__file__).parents[1] / "vectors" / "oracle_i_hierarchy_public.json").read_text())["cases"]


def bound(values: list[float | None], none: float) -> np.ndarray:
    return np.array([none if value is None else value for value in values], dtype=np.float64)


def stack(case: dict[str, Any]) -> tuple[list[np.ndarray], list[Any]]:
    """The Jacobians and the targets. A level of tasks has a command, and every other level has bounds."""
    jacobians = [np.array(level["A"], dtype=np.float64).reshape(-1, case["n"]) for level in case["levels"]]
    bounds = [(bound(level["lower"], -np.inf), bound(level["upper"], np.inf)) for level in case["levels"]]
    return jacobians, [low if (low == high).all() else al.Within(low, high) for low, high in bounds]


def test_the_vector_file_is_whole() -> None:
    assert len(CASES) == 40 and {case["kind"] for case in CASES} >= {"plain", "bounds", "degenerate", "real"}


@pytest.mark.parametrize("i", range(len(CASES)))
def test_exact(i: int) -> None:
    case = CASES[i]
    jacobians, targets = stack(case)
    sol = al.solve_priority(jacobians, targets, method="exact")
    wanted = np.array(case["x"], dtype=np.float64)
    # The vectors allow 1e-9. The results agree to 1e-14.
    np.testing.assert_allclose(sol.v, wanted, rtol=0, atol=1e-12 * (1 + np.abs(wanted).max()))
    for violation, expected in zip(sol.violations, case["violations"], strict=True):
        np.testing.assert_allclose(violation, expected, rtol=0, atol=1e-12)
    assert sol.certificate <= 1e-12 and sol.status in (al.Status.SUCCESS, al.Status.DEGRADED)
    # The second solve accepts the active set of the first.
    solver = al.PrioritySolver(case["n"], [len(J) for J in jacobians], method="exact")
    for _ in range(2):
        np.testing.assert_allclose(solver.solve(jacobians, targets), wanted, rtol=0, atol=1e-12 * (1 + np.abs(wanted).max()))
    assert solver.solution.changes == 0


@pytest.mark.parametrize("method", ["clamp", "damped"])
@pytest.mark.parametrize("i", range(len(CASES)))
def test_tiny_thresholds_give_the_solution_of_exact(i: int, method: str) -> None:
    case = CASES[i]
    jacobians, targets = stack(case)
    wanted = np.array(case["x"], dtype=np.float64)
    sol = al.solve_priority(jacobians, targets, method=method, eps=1e-10)
    np.testing.assert_allclose(sol.v, wanted, rtol=0, atol=1e-9 * (1 + np.abs(wanted).max()))
