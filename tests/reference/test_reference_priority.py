"""Task priority of the reference (system 2) against vector files, the table of classes, and properties of both solutions."""

import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armlet import reference as ref
from armlet.reference import diagnosis

CASES = json.loads((Path(__file__).parents[1] / "vectors" / "oracle_ex2_taskpriority_public.json").read_text())["cases"]
POINTS = [case for case in CASES if case.get("kind") != "path"]
PATHS = [case for case in CASES if case.get("kind") == "path"]
KINDS = {"R": "regular", "A": "algorithmic", "S2": "kinematic", "AS": "algorithmic+kinematic", "D": "kinematic"}
EPS = np.finfo(float).eps


def floats(value: Any) -> np.ndarray:
    return np.array(value, dtype=np.float64)


def jacobians(q: np.ndarray, L: float = 1.0) -> list[np.ndarray]:
    arm = ref.planar_arm([L, L, L / 4, L / 4])
    return [arm.jacobian(q, "link4")[:2], arm.jacobian(q, "link2")[:2]]


def rounding(q: np.ndarray) -> float:
    """Return the relative error of Jacobian entries that are computed from joint angles."""
    return float(8 * EPS * (1 + np.abs(q).sum()))


def snapped(q: np.ndarray, tol: float) -> np.ndarray:
    return np.where(np.abs(np.sin(q)) <= tol, np.round(q / np.pi) * np.pi, q)


def test_the_vector_file_is_whole() -> None:
    assert len(POINTS) == 36 and len(PATHS) == 2


@pytest.mark.parametrize("case", POINTS, ids=lambda case: case["id"])
def test_points(case: dict[str, Any]) -> None:
    given, expected, tolerance = case["input"], case["expected"], case["tolerance"]
    q, L, velocities = floats(given["q"]), given["L"], [floats(given["pd1"]), floats(given["pd2"])]
    Js = jacobians(q, L)
    for J, key in zip(Js, ("sigma_J1", "sigma_J2"), strict=True):
        np.testing.assert_allclose(np.linalg.svd(J, compute_uv=False), floats(expected[key]), atol=1e-14 * L)

    clamped = ref.solve_priority(Js, velocities, "clamp", eps=[given["eps1_over_L"] * L, given["eps2_over_L"] * L])
    error = np.linalg.norm(clamped.v - floats(expected["reg_qd"]))
    assert error <= tolerance["reg_qd"]["rel_to_norm"] * expected["reg_norm"]
    assert np.linalg.norm(clamped.v) <= expected["norm_bound"] * (1 + tolerance["norm_bound_rel"])
    if expected["primary_must_be_exact"]:
        assert np.abs(clamped.residuals[0]).max() <= tolerance["primary_abs"]

    name, ranks = diagnosis.macro_micro_class(q, given["angle_tol"])
    assert name == expected["class_by_angle"]
    assert dict(zip(("J1", "J2", "JE", "J2P1"), ranks, strict=True)) == expected["ranks_class"]
    at = snapped(q, given["angle_tol"])
    seen = ref.diagnose_priority(jacobians(at, L), rounding=rounding(at))
    assert (*seen.ranks, seen.stacked_rank, seen.projected_ranks[1]) == ranks
    assert seen.kind == KINDS[name]

    # A relative change eps of the entries changes the exact solution by eps / sigma, so 1e-9 is reached only for sigma >= 1e-5.
    smallest = min([1.0, *np.linalg.svd(jacobians(at, L)[1] @ null_of_first(at, L), compute_uv=False)[: ranks[3]]])
    rel = max(1e-9, 1e-14 / smallest)
    exact = ref.solve_priority(jacobians(at, L), velocities, "exact", rounding=rounding(at))
    wanted = floats(expected["class_qd"])
    assert np.linalg.norm(exact.v - wanted) <= rel * np.linalg.norm(wanted)
    if expected["class_by_angle"] == expected["class_exact_input"] and expected["exact_norm"] < 1e3:
        wanted = floats(expected["exact_qd"])
        exact = ref.solve_priority(Js, velocities, "exact", rounding=rounding(q))
        assert np.linalg.norm(exact.v - wanted) <= rel * np.linalg.norm(wanted)


def null_of_first(q: np.ndarray, L: float) -> np.ndarray:
    first = jacobians(q, L)[0]
    return np.linalg.svd(first)[2][np.linalg.matrix_rank(first, 1e-12) :].T


@pytest.mark.parametrize("case", PATHS, ids=lambda case: case["id"])
def test_paths_are_continuous(case: dict[str, Any]) -> None:
    given, expected = case["input"], case["expected"]
    L, velocities = given["L"], [floats(given["pd1"]), floats(given["pd2"])]
    eps = [given["eps1_over_L"] * L, given["eps2_over_L"] * L]
    shares = np.linspace(-1.0, 1.0, given["n_points"])
    points = [floats(given["q_mid"]) + share * floats(given["q_half"]) for share in shares]
    values = np.array([ref.solve_priority(jacobians(q, L), velocities, "clamp", eps=eps).v for q in points])
    for index, sample in expected["samples"].items():
        rel = case["tolerance"]["samples_rel"]
        np.testing.assert_allclose(values[int(index)], floats(sample), rtol=rel, atol=rel * np.linalg.norm(floats(sample)))
    assert np.linalg.norm(np.diff(values, axis=0), axis=1).max() <= 1.02 * expected["max_step"]
    assert abs(np.linalg.norm(values, axis=1).max() / expected["max_norm"] - 1) <= 1e-6


def test_cases_a_and_b_of_the_exam() -> None:
    ones = [np.ones(2), np.ones(2)]
    a, b = np.array([0, np.pi / 2, np.pi / 2, 0]), np.array([0, 0, np.pi / 2, 0])
    np.testing.assert_allclose(ref.solve_priority(jacobians(a), ones, "exact", rounding=rounding(a)).v, [1, -2, 0.8, 0.4], atol=1e-14)
    for turn in (0.0, 0.3, 2.0, 40 * np.pi + 0.3):
        spun = b + turn * np.eye(4)[0]
        R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        sol = ref.solve_priority(jacobians(spun), [R @ ones[0], R @ ones[1]], "exact", rounding=rounding(spun))
        # The rounding error of a base angle of 20 turns is at most 32 eps.
        np.testing.assert_allclose(sol.v, np.array([22, -15, -52, -26]) / 29, atol=1e-12)


def test_the_cutoff_on_the_projected_block_alone_would_fail() -> None:
    """numpy's default cut-off, applied to the projected block, inverts rounding noise in case b of docs/methods/priority.md."""
    J1, J2 = jacobians(np.array([0.3, 0, np.pi / 2, 0]))
    P1 = np.eye(4) - np.linalg.pinv(J1) @ J1
    wild = np.linalg.pinv(J2 @ P1) @ np.ones(2)
    assert np.linalg.norm(wild) > 1e6


@pytest.mark.parametrize("multiples", list(itertools.product((-1, 0, 1), repeat=3)))
def test_all_sign_patterns(multiples: tuple[int, int, int]) -> None:
    """Every combination of a free angle (0), a stretched angle (1) and a folded angle (-1) has the ranks of `macro_micro_class`."""
    free = (0.7, -1.3, 2.1)
    q = np.array([0.4, *(f if m == 0 else (0.0 if m == 1 else np.pi) for f, m in zip(free, multiples, strict=True))])
    name, ranks = diagnosis.macro_micro_class(q)
    seen = ref.diagnose_priority(jacobians(q, 0.37), rounding=rounding(q))
    assert (*seen.ranks, seen.stacked_rank, seen.projected_ranks[1]) == ranks and seen.kind == KINDS[name]


def test_levels_are_lexicographic() -> None:
    rng = np.random.default_rng(5)
    for _ in range(50):
        n = int(rng.integers(4, 9))
        Js = [rng.normal(size=(int(rng.integers(1, 4)), n)) for _ in range(int(rng.integers(2, 5)))]
        if rng.random() < 0.5:
            Js[1][0] = Js[0][0]  # a shared row: an algorithmic singularity
        vs = [rng.normal(size=J.shape[0]) for J in Js]
        sol = ref.solve_priority(Js, vs, "exact")
        for level in range(1, len(Js) + 1):
            part = ref.solve_priority(Js[:level], vs[:level], "exact")
            np.testing.assert_allclose(part.residuals[-1], sol.residuals[level - 1], atol=1e-9)
        # All non-zero singular values are above eps, so the clamp gives the exact solution up to rounding over eps^2: 1e-15/1e-8 = 1e-7.
        np.testing.assert_allclose(ref.solve_priority(Js, vs, "clamp", eps=1e-4).v, sol.v, atol=1e-6 * (1 + np.abs(sol.v).max()))


def near_singular(rng: np.random.Generator) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return three levels for seven joints. The second and third nearly repeat rows of higher levels."""
    size = 10.0 ** rng.uniform(-14, 0)
    J1 = rng.normal(size=(2, 7))
    J2 = np.vstack([J1[0] + size * rng.normal(size=7), rng.normal(size=7)])
    J3 = np.vstack([J2[1] + size * rng.normal(size=7), rng.normal(size=7), J1[1]])
    return [J1, J2, J3], [rng.normal(size=J.shape[0]) for J in (J1, J2, J3)]


@pytest.mark.parametrize("method", ["clamp", "damped", "chiaverini"])
def test_bounded_and_primary_exact_near_singularities(method: str) -> None:
    rng = np.random.default_rng(11)
    for _ in range(200):
        Js, vs = near_singular(rng)
        sol = ref.solve_priority(Js, vs, method, eps=0.05)
        # The singular values of the first level are far above eps, so its residual is a rounding error: 1e-12 (1 + |v|).
        assert np.abs(sol.residuals[0]).max() <= 1e-12 * (1 + np.linalg.norm(sol.v))
        # The contribution of each level is at most |v_i - J_i x| / eps.
        bound = 0.0
        for J, v in zip(Js, vs, strict=True):
            bound += (np.linalg.norm(v) + np.linalg.norm(J, 2) * bound) / 0.05
        assert np.linalg.norm(sol.v) <= bound


@pytest.mark.parametrize("method", ["clamp", "damped"])
def test_the_continuous_maps_are_continuous(method: str) -> None:
    """When a row passes through an exact repetition of another, the solution is continuous.

    A change of 1e-6 in the entries changes it by at most 100 |v|/eps^2 times 1e-6.
    """
    rng = np.random.default_rng(12)
    Js, vs = near_singular(rng)
    away = rng.normal(size=7)
    values = []
    for k in range(-50, 51):
        Js[1][0] = Js[0][0] + 1e-6 * k * away
        values.append(ref.solve_priority(Js, vs, method, eps=0.05).v)
    assert np.linalg.norm(np.diff(values, axis=0), axis=1).max() <= 1e-6 * 100 * np.linalg.norm(vs[1]) / 0.05**2
    assert np.ptp(np.array(values), axis=0).max() > 1e-4


@pytest.mark.parametrize("method", ["clamp", "damped"])
def test_regular_levels_are_exact(method: str) -> None:
    rng = np.random.default_rng(13)
    Js, vs = [rng.normal(size=(2, 7)) for _ in range(3)], [rng.normal(size=2) for _ in range(3)]
    exact = ref.solve_priority(Js, vs, "exact")
    assert max(np.abs(r).max() for r in exact.residuals) < 1e-12
    np.testing.assert_allclose(ref.solve_priority(Js, vs, method, eps=1e-3).v, exact.v, atol=1e-12)


def test_chiaverini_is_exact_for_orthogonal_tasks() -> None:
    rng = np.random.default_rng(14)
    rows = np.linalg.qr(rng.normal(size=(6, 6)))[0]
    Js, vs = [2.0 * rows[:2], rows[2:3], rows[3:5]], [rng.normal(size=m) for m in (2, 1, 2)]
    np.testing.assert_allclose(ref.solve_priority(Js, vs, "chiaverini").v, ref.solve_priority(Js, vs, "exact").v, atol=1e-13)


def test_unknown_method() -> None:
    with pytest.raises(ValueError, match="chiaverini"):
        ref.solve_priority([np.eye(2)], [np.ones(2)], "pinv")
