"""Random stacks with kept directions: every level has the largest scale of its command, as a linear program finds it.

    the largest s <= 1  with  U' J_i v = s U' v_i,  U' J_l v of the levels l above,  v_min <= v <= v_max

The columns of U span the range of J_i in the null space of the tasks above. The strata are regular stacks, copies of rows, rows of zeros or
multiples of others, bounds that exclude zero, levels of different scales (1e-6 to 1e6), small integers with vertices, and levels with
bounds of their rows (`Within`). In `ARMLET_RANDOM_STACKS` stacks (`make test-stacks`: 1,000,000) the certificate of the core and the bounds
are checked. In a sample, the scales are those of the linear program (HiGHS in scipy), and the optimality conditions of `armlet.reference`
hold for the velocities together with the scales. Counts and seed are printed. `test_priority_stacks.py` has stacks near singularities.
"""

from __future__ import annotations

import os
from collections import Counter
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import linprog

import armlet as al
from armlet.reference.diagnosis import EPS, _above, _null_basis, projected_ranks
from armlet.reference.inequality import certificate

Array = NDArray[np.float64]
COUNT = int(os.environ.get("ARMLET_RANDOM_STACKS", "2100"))
SEED = 20150815
#: Number of stacks of equal sizes that are solved in one batch, and the period of the sample.
SIZE, PERIOD = 100, 20
STRATA = ("regular", "copies", "singular", "excluded", "scales", "vertices", "within")
HIGHS = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


def batch(rng: np.random.Generator, stratum: str) -> tuple[list[Array], list[Any], dict[str, Any]]:
    """The Jacobians (SIZE, m, n), the targets (SIZE, m), and the bounds of the joints."""
    n, count = int(rng.integers(2, 9)), int(rng.integers(1, 5))
    Js = [rng.normal(size=(SIZE, int(rng.integers(1, 4)), n)) for _ in range(count)]
    if stratum == "vertices":
        Js = [rng.integers(-2, 3, size=J.shape) * (rng.random(size=J.shape) < 0.6).astype(float) for J in Js]
    for J in Js[1:] if stratum == "copies" else []:
        J[:, -1] = rng.choice([1.0, -1.0, 2.0]) * Js[0][:, 0]
    for J in Js if stratum == "singular" else []:
        J[:, -1] = rng.choice([0.0, 2.0, -0.5]) * J[:, 0]
    if stratum == "scales":
        Js = [J * 10.0 ** rng.uniform(-6, 6, (SIZE, 1, 1)) for J in Js]
    sizes = [np.linalg.norm(J.reshape(SIZE, -1), axis=1)[:, None] for J in Js]
    sizes = [np.where(size > 0.0, size, 1.0) for size in sizes]
    targets: list[Any] = [size * rng.normal(size=J.shape[:2]) for J, size in zip(Js, sizes, strict=True)]
    low, high = -rng.uniform(0.1, 1.5, n), rng.uniform(0.1, 1.5, n)
    if stratum == "vertices":
        targets, low, high = [np.round(v) for v in targets], -np.ones(n), np.ones(n)
    if stratum == "excluded":
        low[0], high[0] = 0.05, 0.5
    if stratum == "within":
        at = int(rng.integers(count))
        targets[at] = al.Within(targets[at] - rng.integers(0, 2, targets[at].shape), targets[at])
    return Js, targets, {"v_min": low, "v_max": high}


def ranges(Js: list[Array]) -> list[Array]:
    """The leading left vectors of each level in the null space of the levels above."""
    ranks = projected_ranks(Js, 8 * EPS)
    bases = [_null_basis(_above(Js, k), sum(ranks[:k])) for k in range(len(Js))]
    return [np.linalg.svd(J @ N, full_matrices=False)[0][:, :r] for J, N, r in zip(Js, bases, ranks, strict=True)]


def check_scales(Js: list[Array], vs: list[Array], bounds: dict[str, Array], v: Array, scales: Array) -> tuple[int, float]:
    """The number of feasible linear programs, and the certificate of the velocities and the scales."""
    n, count, programs = v.size, len(Js), 0
    above: list[tuple[Array, Array]] = []
    unit = np.eye(n + count)
    levels = [(unit[:n], bounds["v_min"], bounds["v_max"]), (unit[n:], np.zeros(count), np.ones(count))]
    for k, (J, target, U) in enumerate(zip(Js, vs, ranges(Js), strict=True)):
        size = float(np.linalg.norm(J)) or 1.0
        command, none = U.T @ target / size, np.zeros(len(J))
        rows = np.c_[J / size, np.zeros((len(J), count))]
        rows[:, n + k] = -U @ command
        levels += [(rows, none, none), (unit[n + k : n + k + 1], np.ones(1), np.ones(1))]
        if np.linalg.norm(command) > 1e-12 * np.linalg.norm(target) / size:
            A = np.vstack([np.c_[U.T @ J / size, -command], *(np.c_[rows, 0.0 * rows[:, :1]] for rows, _ in above)])
            values = np.concatenate([0.0 * command, *(values for _, values in above)])
            sides = [*zip(bounds["v_min"], bounds["v_max"], strict=True), (0.0, 1.0)]
            found = linprog(-np.eye(n + 1)[n], A_eq=A, b_eq=values, bounds=sides, method="highs", options=HIGHS)
            if found.status == 0:
                programs += 1
                assert abs(found.x[n] - scales[k]) <= 1e-7, (k, found.x[n], scales[k])
        above.append((J / size, J @ v / size))
    return programs, certificate(levels, np.r_[v, scales])


@pytest.mark.slow
def test_every_scale_is_the_largest(capsys: pytest.CaptureFixture[str]) -> None:
    rng, seen, scaled, programs, changes = np.random.default_rng(SEED), Counter[str](), 0, 0, 0
    worst = {"core": 0.0, "numpy": 0.0}
    for block in range(max(len(STRATA), COUNT // SIZE)):
        stratum = STRATA[block % len(STRATA)]
        Js, targets, bounds = batch(rng, stratum)
        sol = al.solve_priority(Js, targets, method="exact", scale="direction", **bounds)
        assert np.isin(sol.status, [al.Status.SUCCESS, al.Status.DEGRADED]).all(), (stratum, block)
        assert sol.certificate.max() <= 1e-9, (stratum, block, int(sol.certificate.argmax()), sol.certificate.max())
        assert (sol.v >= bounds["v_min"]).all() and (sol.v <= bounds["v_max"]).all()
        assert ((sol.scales >= 0) & (sol.scales <= 1)).all()
        # A scale just below 1 is a rounding error.
        assert not ((sol.scales < 1) & (sol.scales > 1 - 1e-13)).any()
        seen[stratum] += SIZE
        scaled += int((sol.scales < 1).any(axis=-1).sum())
        changes, worst["core"] = max(changes, int(sol.changes.max())), max(worst["core"], float(sol.certificate.max()))
        if stratum == "within":
            continue
        same = al.solve_priority(Js, targets, method="sns", **bounds)
        np.testing.assert_allclose(same.v, sol.v, rtol=0, atol=1e-9, err_msg=f"{stratum} {block}")
        np.testing.assert_allclose(same.scales, sol.scales, rtol=0, atol=1e-9, err_msg=f"{stratum} {block}")
        for row in range(0, SIZE, PERIOD):
            single = [J[row] for J in Js], [v[row] for v in targets]
            feasible, found = check_scales(*single, bounds, sol.v[row], sol.scales[row])
            assert found <= 1e-8, (stratum, block, row, found)
            programs, worst["numpy"] = programs + feasible, max(worst["numpy"], found)
    with capsys.disabled():
        print(
            f" {seen.total():,} stacks, seed {SEED}: {', '.join(f'{seen[name]:,} {name}' for name in STRATA)}; {scaled:,} scaled, at most "
            f"{changes} changes, {programs:,} linear programs, largest certificate {worst['core']:.1e}, in numpy {worst['numpy']:.1e}"
        )
    assert scaled > seen.total() / 5 and programs > seen.total() / PERIOD / 2


def test_the_last_active_set() -> None:
    """A solver that keeps its active set gives the solution of a new solver, also after another stack."""
    rng, warm, total = np.random.default_rng(SEED + 1), 0, 0
    for stratum in STRATA:
        Js, targets, bounds = batch(rng, stratum)
        cold = al.solve_priority(Js, targets, method="exact", scale="direction", **bounds)
        solver = al.PrioritySolver(Js[0].shape[2], [J.shape[1] for J in Js], method="exact", scale="direction", **bounds)
        for row in range(0, SIZE, 4):
            single = [al.Within(t.lower[row], t.upper[row]) if isinstance(t, al.Within) else t[row] for t in targets]
            for _ in range(2):
                v = solver.solve([J[row] for J in Js], single)
                np.testing.assert_allclose(v, cold.v[row], rtol=0, atol=1e-8, err_msg=f"{stratum} {row}")
                np.testing.assert_allclose(solver.scales, cold.scales[row], rtol=0, atol=1e-8, err_msg=f"{stratum} {row}")
                assert solver.solution.certificate <= 1e-9
            warm, total = warm + (solver.solution.changes == 0), total + 1
    # The second solve of a stack accepts the set of the first.
    assert warm > 0.9 * total
