"""Random stacks with bounds have a certificate: the optimality conditions hold, without a cycle, in all strata.

The strata are regular stacks, copies and opposite rows, rows of zeros, bounds of the joints that exclude zero, singular levels, degenerate
vertices, levels of different scales (1e-6 to 1e6), rows of different units (1e-2 to 1e2), and mixtures. In `ARMLET_RANDOM_STACKS` stacks
(`make test-stacks`: 1,000,000), the certificate of the core is checked. A sample is checked by the certificate of `armlet.reference`, too,
which has another derivation. A second test solves each stack with the active set of another. Counts, changes and seed are printed.
"""

from __future__ import annotations

import os
from collections import Counter
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al
from armlet.reference.inequality import certificate

Array = NDArray[np.float64]
COUNT = int(os.environ.get("ARMLET_RANDOM_STACKS", "4000"))
SEED = 20140605
#: Number of stacks of equal sizes that are solved in one batch.
SIZE = 200
STRATA = ("regular", "copies", "zeros", "excluded", "singular", "vertices", "scales", "units", "mixed")
METHODS = ("exact", "exact", "clamp", "damped")


def levels_of(rng: np.random.Generator, stratum: str) -> tuple[list[Array], list[Any], dict[str, Any]]:
    """The Jacobians (SIZE, m, n), the bounds, and the bounds of the joints."""
    n, count = int(rng.integers(2, 9)), int(rng.integers(2, 6))
    rows = [int(rng.integers(n, n + 3)) if rng.random() < 0.1 else int(rng.integers(1, 5)) for _ in range(count)]
    total = sum(rows)
    stack = rng.normal(size=(SIZE, total, n)) if rng.random() < 0.5 else rng.integers(-3, 4, size=(SIZE, total, n)).astype(float)
    every, mixed = np.arange(SIZE), stratum == "mixed"
    for at in range(1, total):
        now = rng.random(SIZE) < 0.35
        if stratum == "copies" or mixed:
            copy = stack[every, rng.integers(0, at, SIZE)] * rng.choice([1.0, -1.0, 2.0, -0.5], SIZE)[:, None]
            stack[now, at] = copy[now]
        if stratum == "zeros" or (mixed and rng.random() < 0.3):
            stack[rng.random(SIZE) < 0.25, at] = 0.0
        if stratum == "singular" or mixed:
            mixture = np.einsum("bm,bmn->bn", rng.integers(-2, 3, size=(SIZE, at)), stack[:, :at])
            stack[now[::-1], at] = mixture[now[::-1]]
    centre, kind = rng.integers(-3, 4, size=(SIZE, total)).astype(float), rng.random((SIZE, total))
    width = rng.integers(0, 4, size=(SIZE, total)).astype(float)
    if stratum == "vertices" or (mixed and rng.random() < 0.5):
        centre = np.einsum("bmn,bn->bm", stack, rng.integers(-1, 2, size=(SIZE, n)))
        lower, upper = np.where(kind < 0.5, centre, centre - width // 2), np.where(kind < 0.5, centre + width // 2, centre)
    else:
        lower = np.where(kind < 0.35, centre, np.where(kind < 0.5, -np.inf, centre - width))
        upper = np.where(kind < 0.35, centre, np.where((kind >= 0.5) & (kind < 0.65), np.inf, centre + width))
    if stratum in ("scales", "units"):
        unit = 10.0 ** rng.uniform(-6, 6, size=(SIZE, count)) if stratum == "scales" else 10.0 ** rng.uniform(-2, 2, size=(SIZE, total))
        unit = np.repeat(unit, rows, axis=1) if stratum == "scales" else unit
        stack, lower, upper = stack * unit[:, :, None], lower * unit, upper * unit
    ends = np.cumsum(rows)[:-1]
    low, high = np.split(lower, ends, axis=1), np.split(upper, ends, axis=1)
    limits: dict[str, Any] = {}
    if stratum == "excluded" or rng.random() < 0.5:
        limits = {"v_min": -rng.integers(1, 3, n).astype(float), "v_max": rng.integers(1, 4, n).astype(float)}
        if stratum == "excluded":
            limits["v_min"][rng.integers(n)] = 0.5
    return np.split(stack, ends, axis=1), [al.Within(*pair) for pair in zip(low, high, strict=True)], limits


def single(jacobians: list[Array], targets: list[Any], row: int) -> tuple[list[Array], list[Any]]:
    return [J[row] for J in jacobians], [al.Within(target.lower[row], target.upper[row]) for target in targets]


def reference_certificate(jacobians: list[Array], targets: list[Any], limits: dict[str, Any], v: Array) -> float:
    levels = [(J, target.lower, target.upper) for J, target in zip(jacobians, targets, strict=True)]
    first = [(np.eye(v.size), limits["v_min"], limits["v_max"])] if limits else []
    return certificate([*first, *levels], v)


def test_every_solution_has_a_certificate(capsys: pytest.CaptureFixture[str]) -> None:
    rng, seen, changes, worst = np.random.default_rng(SEED), Counter[str](), 0, {"core": 0.0, "reference": 0.0}
    for block in range(max(len(STRATA), COUNT // SIZE)):
        stratum = STRATA[block % len(STRATA)]
        method = METHODS[(block // len(STRATA)) % len(METHODS)]
        jacobians, targets, limits = levels_of(rng, stratum)
        sol = al.solve_priority(jacobians, targets, method=method, **limits)
        assert np.isin(sol.status, [al.Status.SUCCESS, al.Status.DEGRADED]).all(), (stratum, method, block)
        assert sol.certificate.max() <= 1e-9, (stratum, method, block, int(sol.certificate.argmax()))
        seen[stratum] += SIZE
        changes = max(changes, int(sol.changes.max()))
        worst["core"] = max(worst["core"], float(sol.certificate.max()))
        if limits:
            assert (sol.v >= limits["v_min"]).all() and (sol.v <= limits["v_max"]).all()
        if method == "exact" and stratum != "units":
            for row in range(0, SIZE, 20):
                found = reference_certificate(*single(jacobians, targets, row), limits, sol.v[row])
                worst["reference"] = max(worst["reference"], found)
                assert found <= 1e-8, (stratum, block, row, found)
    with capsys.disabled():
        print(
            f" {seen.total():,} stacks, seed {SEED}: {', '.join(f'{seen[name]:,} {name}' for name in STRATA)}; at most {changes} changes, "
            f"largest certificate {worst['core']:.1e}, in numpy {worst['reference']:.1e}"
        )


def test_the_active_set_of_another_stack(capsys: pytest.CaptureFixture[str]) -> None:
    """A solver that keeps its active set gives the solution of a new solver."""
    rng, warm, total = np.random.default_rng(SEED + 1), 0, 0
    for block in range(max(len(STRATA), COUNT // SIZE // 10)):
        jacobians, targets, limits = levels_of(rng, STRATA[block % len(STRATA)])
        cold = al.solve_priority(jacobians, targets, method="exact", **limits)
        solver = al.PrioritySolver(jacobians[0].shape[2], [J.shape[1] for J in jacobians], method="exact", **limits)
        for row in range(SIZE):
            v = solver.solve(*single(jacobians, targets, row))
            solution = solver.solution
            assert solution.certificate <= 1e-9 and solution.status != al.Status.MAX_STEPS
            # Nearly singular levels amplify rounding errors.
            np.testing.assert_allclose(v, cold.v[row], rtol=0, atol=1e-6 * (1 + np.abs(v).max()), err_msg=f"{block} {row}")
            warm, total = warm + (solution.changes == 0), total + 1
    with capsys.disabled():
        print(f" {total:,} stacks, {warm:,} without a change of the active set")
