"""Task priority: the core against the numpy reference, which reaches the same maps by other factorisations."""

from __future__ import annotations

import numpy as np
import pytest

import armlet as al
from armlet.reference import priority as ref

Stack = tuple[list[np.ndarray], list[np.ndarray]]


def random_stack(rng: np.random.Generator, singular: bool) -> Stack:
    """1 to 4 levels of 1 to 4 rows (more than joints included) in 1 to 8 joints; `singular`: rows repeated across and within levels."""
    n = int(rng.integers(1, 9))
    Js = [10.0 ** rng.uniform(-2, 2) * rng.normal(size=(int(rng.integers(1, 5)), n)) for _ in range(int(rng.integers(1, 5)))]
    if singular:
        source, target = Js[0], Js[int(rng.integers(len(Js)))]
        target[-1] = rng.choice([-2.0, 0.0, 0.5]) * source[0]
    return Js, [np.linalg.norm(J, 2) * rng.normal(size=J.shape[0]) for J in Js]


def smallest_counted(Js: list[np.ndarray]) -> float:
    """The worst relative conditioning of the stack: smallest counted singular value over the largest, level by level."""
    seen = al.diagnose_priority(Js)
    worst = 1.0
    for alone, projected, rank in zip(seen.singular_values, seen.projected_singular_values, seen.projected_ranks, strict=True):
        if rank:
            worst *= projected[rank - 1] / alone[0]
    return worst


@pytest.mark.parametrize("singular", [False, True], ids=["full", "singular"])
@pytest.mark.parametrize("method", ["exact", "clamp", "damped", "chiaverini"])
def test_velocities(method: str, singular: bool) -> None:
    rng = np.random.default_rng(2022)
    compared = 0
    for _ in range(400):
        Js, vs = random_stack(rng, singular)
        condition = smallest_counted(Js)
        if condition < 1e-5:
            continue  # the two rank rules may then honestly differ
        mine, theirs = al.solve_priority(Js, vs, method=method), ref.solve_priority(Js, vs, method)
        size = 1.0 + np.linalg.norm(theirs.v)
        # Roundings of the entries over the singular values they are divided by. Where a clamped level inverts rounding noise over
        # eps^2 (repeated rows) the two routes differ by eps_machine / 0.02^2 per level, multiplied level by level. The reference's
        # damping takes singular values as roots of eigenvalues: a zero one reads 1e-8 |J|, and w = s / eps is 7e-7 instead of 0.
        tolerance = 1e-13 / condition**2 if method == "exact" else 1e-5 if method == "damped" and singular else 1e-9
        assert np.linalg.norm(mine.v - theirs.v) <= tolerance * size, (Js, vs)
        for J, v, r in zip(Js, vs, mine.residuals, strict=True):
            np.testing.assert_allclose(r, v - J @ mine.v, rtol=0, atol=1e-13 * (np.abs(v).max() + np.linalg.norm(J) * size))
        compared += 1
    assert compared >= 300


@pytest.mark.parametrize("singular", [False, True], ids=["full", "singular"])
def test_diagnoses(singular: bool) -> None:
    rng = np.random.default_rng(610)
    compared = 0
    for _ in range(400):
        Js, _ = random_stack(rng, singular)
        if smallest_counted(Js) < 1e-5:
            continue
        mine, theirs = al.diagnose_priority(Js), ref.diagnose_priority(Js)
        assert (mine.ranks, mine.projected_ranks) == (theirs.ranks, theirs.projected_ranks)
        assert (mine.stacked_rank, mine.overlap, mine.kind) == (theirs.stacked_rank, theirs.overlap, theirs.kind)
        compared += 1
    assert compared >= 300


def test_weight_is_a_change_of_coordinates() -> None:
    """v' W v is minimised: the solution for J L^-T in y = L' v, with W = L L'."""
    rng = np.random.default_rng(7)
    for _ in range(50):
        n = int(rng.integers(3, 9))
        Js, vs = [rng.normal(size=(1, n)), rng.normal(size=(1, n))], [rng.normal(size=1), rng.normal(size=1)]
        root = rng.normal(size=(n, n)) + 3 * np.eye(n)
        weight = root @ root.T
        L = np.linalg.cholesky(weight)
        plain = ref.solve_exact([np.linalg.solve(L, J.T).T for J in Js], vs)
        v = al.solve_priority(Js, vs, method="exact", weight=weight).v
        # The weights' condition (some 1e3) times rounding.
        np.testing.assert_allclose(v, np.linalg.solve(L.T, plain.v), rtol=0, atol=1e-11 * (1 + np.abs(v).max()))
