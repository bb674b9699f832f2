"""Task priority (system 2) against 120-digit vectors: classes, ranks, exact and clamped solutions, bounds and continuity."""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armlet as al

CASES = json.loads((Path(__file__).parents[1] / "vectors" / "oracle_ex2_taskpriority_public.json").read_text())["cases"]
POINTS = [case for case in CASES if case.get("kind") != "path"]
PATHS = [case for case in CASES if case.get("kind") == "path"]
KINDS = {"R": "regular", "A": "algorithmic", "S2": "kinematic", "AS": "algorithmic+kinematic", "D": "kinematic"}
EPS = float(np.finfo(float).eps)
# Each row: whether the sines s2, s3 and s4 of the joint angles are non-zero (None: either), four ranks, and the kind of singularity. The
# ranks are those of J1, J2, both stacked (J_E), and J2 projected on the null space of J1 (J2 P1). docs/methods/priority.md has this table.
TABLE = [
    ((True, None, True), (2, 2, 4, 2), "regular"),
    ((True, None, False), (2, 2, 3, 1), "algorithmic"),
    ((False, None, True), (2, 1, 3, 1), "kinematic"),
    ((False, True, False), (2, 1, 2, 0), "algorithmic+kinematic"),
    ((False, False, False), (1, 1, 2, 1), "kinematic"),
]


def floats(value: Any) -> np.ndarray:
    return np.array(value, dtype=np.float64)


def stack(q: np.ndarray, lengths: list[float]) -> list[np.ndarray]:
    """Return the position Jacobians of the tips of links 4 and 2, each (2, 4).

    Column j is the vector from joint j to the tip, rotated by 90 degrees.
    """
    angles = np.cumsum(q)
    links = np.array(lengths) * np.array([-np.sin(angles), np.cos(angles)])
    return [np.stack([links[:, j:tip].sum(axis=1) for j in range(4)], axis=1) for tip in (4, 2)]


def macro_micro(q: np.ndarray, L: float) -> list[np.ndarray]:
    return stack(q, [L, L, L / 4, L / 4])


def rounding(q: np.ndarray) -> float:
    return float(8 * EPS * (1 + np.abs(q).sum()))


def snapped(q: np.ndarray, tolerance: float) -> np.ndarray:
    return np.where(np.abs(np.sin(q)) <= tolerance, np.round(q / np.pi) * np.pi, q)


def test_the_vector_file_is_whole() -> None:
    assert len(POINTS) == 36 and len(PATHS) == 2


@pytest.mark.parametrize("case", POINTS, ids=lambda case: case["id"])
def test_classes_and_ranks(case: dict[str, Any]) -> None:
    given, expected = case["input"], case["expected"]
    q, L = snapped(floats(given["q"]), given["angle_tol"]), given["L"]
    seen = al.diagnose_priority(macro_micro(q, L), rhs=[given["pd1"], given["pd2"]], rounding=rounding(q))
    ranks = dict(zip(("J1", "J2", "JE", "J2P1"), (*seen.ranks, seen.stacked_rank, seen.projected_ranks[1]), strict=True))
    assert ranks == expected["ranks_class"]
    assert seen.projected_ranks[0] == ranks["J1"]
    assert seen.overlap == ranks["J1"] + ranks["J2"] - ranks["JE"]
    assert seen.kind == KINDS[expected["class_by_angle"]]
    assert str(seen).startswith(seen.kind) and str(seen).endswith(".")
    for sigma, key in zip(seen.singular_values, ("sigma_J1", "sigma_J2"), strict=True):
        # The test moves each angle by at most angle_tol.
        np.testing.assert_allclose(sigma, floats(expected[key]), rtol=0, atol=2 * L * given["angle_tol"])


@pytest.mark.parametrize("case", POINTS, ids=lambda case: case["id"])
def test_clamp(case: dict[str, Any]) -> None:
    given, expected = case["input"], case["expected"]
    L, eps = given["L"], [given["eps1_over_L"] * given["L"], given["eps2_over_L"] * given["L"]]
    sol = al.solve_priority(macro_micro(floats(given["q"]), L), [given["pd1"], given["pd2"]], method="clamp", eps=eps)
    wanted = floats(expected["reg_qd"])
    # The vectors allow 1e-9 of the norm. The results agree to 1.3e-13 (1 + norm).
    assert np.linalg.norm(sol.v - wanted) <= 1e-12 * (1 + np.linalg.norm(wanted))
    assert np.abs(sol.residuals[0] - floats(expected["reg_res1"])).max() <= 1e-12
    assert np.abs(sol.residuals[1] - floats(expected["reg_res2"])).max() <= 1e-11
    assert np.linalg.norm(sol.v) <= expected["norm_bound"] * (1 + case["tolerance"]["norm_bound_rel"])
    if expected["primary_must_be_exact"]:
        assert np.abs(sol.residuals[0]).max() <= case["tolerance"]["primary_abs"]


@pytest.mark.parametrize("case", POINTS, ids=lambda case: case["id"])
def test_exact(case: dict[str, Any]) -> None:
    given, expected = case["input"], case["expected"]
    velocities = [given["pd1"], given["pd2"]]
    q = snapped(floats(given["q"]), given["angle_tol"])
    sol = al.solve_priority(macro_micro(q, given["L"]), velocities, method="exact", rounding=rounding(q))
    wanted = floats(expected["class_qd"])
    # The tolerance is the rounding of the entries divided by the smallest non-zero singular value.
    sigma = np.concatenate([floats(expected["sigma_J2P1"]), floats(expected["sigma_J1"])])
    assert np.linalg.norm(sol.v - wanted) <= 4e-15 * (1 + np.linalg.norm(wanted)) / min(1.0, sigma[sigma > 1e-9].min())
    assert sol.ranks == [expected["ranks_class"]["J1"], expected["ranks_class"]["J2P1"]]


@pytest.mark.parametrize("case", PATHS, ids=lambda case: case["id"])
def test_paths_are_continuous(case: dict[str, Any]) -> None:
    given, expected = case["input"], case["expected"]
    L, shares = given["L"], np.linspace(-1.0, 1.0, given["n_points"])
    stacks = [macro_micro(floats(given["q_mid"]) + share * floats(given["q_half"]), L) for share in shares]
    eps = [given["eps1_over_L"] * L, given["eps2_over_L"] * L]
    first, second = (np.array(blocks) for blocks in zip(*stacks, strict=True))
    sol = al.solve_priority([first, second], [given["pd1"], given["pd2"]], method="clamp", eps=eps)
    solver = al.PrioritySolver(4, [2, 2], method="clamp", eps=eps)
    singly = np.array([solver.solve(each, [given["pd1"], given["pd2"]]) for each in stacks])
    np.testing.assert_array_equal(sol.v, singly)
    rel = case["tolerance"]["samples_rel"]
    for index, sample in expected["samples"].items():
        np.testing.assert_allclose(sol.v[int(index)], floats(sample), rtol=rel, atol=rel * np.linalg.norm(floats(sample)))
    # The file gives the largest step between the same points.
    assert np.linalg.norm(np.diff(sol.v, axis=0), axis=1).max() <= 1.02 * expected["max_step"]
    assert abs(np.linalg.norm(sol.v, axis=1).max() / expected["max_norm"] - 1) <= 1e-6


def test_cases_a_and_b_of_the_exam() -> None:
    a, b = np.array([0, np.pi / 2, np.pi / 2, 0]), np.array([0, 0, np.pi / 2, 0])
    ones = [np.ones(2), np.ones(2)]
    np.testing.assert_allclose(
        al.solve_priority(macro_micro(a, 1.0), ones, method="exact", rounding=rounding(a)).v, [1, -2, 0.8, 0.4], atol=1e-14
    )
    for turn in (0.0, 0.3, 2.0, 40 * np.pi + 0.3):
        q = b + turn * np.eye(4)[0]
        R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        sol = al.solve_priority(macro_micro(q, 1.0), [R @ ones[0], R @ ones[1]], method="exact", rounding=rounding(q))
        # The rounding error of a base angle of 20 turns is at most 32 eps.
        np.testing.assert_allclose(sol.v, np.array([22, -15, -52, -26]) / 29, atol=1e-12)
        assert sol.ranks == [2, 0]


@pytest.mark.parametrize("lengths", [[1.0, 1.0, 0.25, 0.25], [0.37, 0.37, 0.0925, 0.0925], [3.0, 0.2, 1.1, 0.7]], ids=str)
@pytest.mark.parametrize("multiples", list(itertools.product((-1, 0, 1), repeat=3)), ids=str)
def test_all_sign_patterns(multiples: tuple[int, int, int], lengths: list[float]) -> None:
    """Every combination of a free angle (0), a stretched angle (1) and a folded angle (-1) has the ranks in `TABLE`."""
    turns = {0: None, 1: 0.0, -1: np.pi}
    q = np.array([0.4, *(f if m == 0 else turns[m] for f, m in zip((0.7, -1.3, 2.1), multiples, strict=True))])
    moved = [m == 0 for m in multiples]
    (ranks, kind), *others = [
        (ranks, kind) for pattern, ranks, kind in TABLE if all(p in (None, m) for p, m in zip(pattern, moved, strict=True))
    ]
    assert not others
    seen = al.diagnose_priority(stack(q, lengths), rounding=rounding(q))
    assert (*seen.ranks, seen.stacked_rank, seen.projected_ranks[1]) == ranks
    assert seen.kind == kind
