"""Task priority against the numpy reference, which computes the same solutions with other factorisations."""

from __future__ import annotations

import numpy as np
import pytest

import armlet as al
from armlet import reference as ref

Stack = tuple[list[np.ndarray], list[np.ndarray]]


def random_stack(rng: np.random.Generator, singular: bool) -> Stack:
    """Return Jacobians and velocities of 1 to 4 levels, each with 1 to 4 rows, for 1 to 8 joints.

    With `singular`, a row repeats another row of the same or another level.
    """
    n = int(rng.integers(1, 9))
    Js = [10.0 ** rng.uniform(-2, 2) * rng.normal(size=(int(rng.integers(1, 5)), n)) for _ in range(int(rng.integers(1, 5)))]
    if singular:
        source, target = Js[0], Js[int(rng.integers(len(Js)))]
        target[-1] = rng.choice([-2.0, 0.0, 0.5]) * source[0]
    return Js, [np.linalg.norm(J, 2) * rng.normal(size=J.shape[0]) for J in Js]


def smallest_counted(Js: list[np.ndarray]) -> float:
    """Return the conditioning of the stack.

    At each level, the smallest counted singular value is divided by the largest one. The result is the product over all levels.
    """
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
            continue  # the two rank rules may disagree here
        mine, theirs = al.solve_priority(Js, vs, method=method), ref.solve_priority(Js, vs, method)
        size = 1.0 + np.linalg.norm(theirs.v)
        # "exact" divides rounding errors of the rows by their singular values. Where a row repeats another row, the other methods divide
        # these errors by eps^2, with the threshold eps of the level. The factors of several levels multiply.
        tolerance = 1e-13 / condition**2 if method == "exact" else 1e-9
        assert np.linalg.norm(mine.v - theirs.v) <= tolerance * size, (Js, vs)
        for J, v, r in zip(Js, vs, mine.residuals, strict=True):
            np.testing.assert_allclose(r, v - J @ mine.v, rtol=0, atol=1e-13 * (np.abs(v).max() + np.linalg.norm(J) * size))
        compared += 1
    assert compared >= 300


@pytest.mark.parametrize("method", ["clamp", "damped"])
def test_levels_of_two_rows_at_singularities(method: str) -> None:
    """Levels of two rows, which armlet solves in closed form, agree where rows repeat others exactly, nearly, or within the threshold.

    From the 17th call on a compiled program computes them.
    """
    rng = np.random.default_rng(2)
    degraded = 0
    for n, rows in ((4, (2, 2)), (3, (2, 2)), (5, (2, 1, 2)), (2, (1, 2)), (6, (2, 2, 2))):
        for k in range(80):
            Js = [rng.normal(size=(m, n)) for m in rows]
            source, target = Js[int(rng.integers(len(Js)))], Js[-1]
            target[-1] = rng.choice([-2.0, 0.5]) * source[0] + [0.0, 1e-9, 3e-3, 0.0][k % 4] * rng.normal(size=n)
            if k % 3 == 0:
                Js[0][-1] = 0.7 * Js[0][0]
            vs = [rng.normal(size=m) for m in rows]
            mine, theirs = al.solve_priority(Js, vs, method=method), ref.solve_priority(Js, vs, method)
            # Rounding errors are divided by eps^2 at each level, and the factors of the levels multiply.
            assert np.linalg.norm(mine.v - theirs.v) <= 1e-9 * (1.0 + np.linalg.norm(theirs.v)), (Js, vs)
            degraded += mine.status is al.Status.DEGRADED
    assert degraded >= 200


@pytest.mark.parametrize("method", ["clamp", "exact"])
def test_long_batches_are_their_rows(method: str) -> None:
    """Batches give the same bits as single solves, regular and singular.

    Arrays of more than 65,536 numbers are read without a copy, in pieces.
    """
    rng = np.random.default_rng(6)
    count, n = 110_000, 4
    Js = [rng.normal(size=(count, 2, n)), rng.normal(size=(count, 2, n))]
    Js[1][::7, 1] = 0.5 * Js[0][::7, 0]
    vs = [rng.normal(size=(count, 2)), rng.normal(size=(count, 2))]
    Js[0][5, 0, 0] = np.nan
    found = al.solve_priority(Js, vs, method=method)
    assert found.status[5] == al.Status.DIVERGED and np.isnan(found.v[5]).all()
    # armlet copies arrays that are not contiguous.
    copied = al.solve_priority([np.asfortranarray(J) for J in Js], vs, method=method)
    assert np.array_equal(found.v, copied.v, equal_nan=True) and np.array_equal(found.ranks, copied.ranks)
    shared = al.solve_priority([Js[0], Js[1][0]], [vs[0], vs[1][0]], method=method)
    for i in (0, 1, 7, 52_223, 52_224, 60_001, 104_447, 104_448, count - 1):
        alone = al.solve_priority([J[i] for J in Js], [v[i] for v in vs], method=method)
        assert np.array_equal(found.v[i], alone.v) and found.ranks[i].tolist() == alone.ranks and found.status[i] == alone.status
        assert all(np.array_equal(r[i], own) for r, own in zip(found.residuals, alone.residuals, strict=True))
        assert np.array_equal(found.scales[i], alone.scales)
        alone = al.solve_priority([Js[0][i], Js[1][0]], [vs[0][i], vs[1][0]], method=method)
        assert np.array_equal(shared.v[i], alone.v) and shared.status[i] == alone.status


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
    """A weight W = L L' minimises v' W v. The result is the solution for J L^-T in the coordinates y = L' v."""
    rng = np.random.default_rng(7)
    for _ in range(50):
        n = int(rng.integers(3, 9))
        Js, vs = [rng.normal(size=(1, n)), rng.normal(size=(1, n))], [rng.normal(size=1), rng.normal(size=1)]
        root = rng.normal(size=(n, n)) + 3 * np.eye(n)
        weight = root @ root.T
        L = np.linalg.cholesky(weight)
        plain = ref.solve_priority([np.linalg.solve(L, J.T).T for J in Js], vs, "exact")
        v = al.solve_priority(Js, vs, method="exact", weight=weight).v
        # The inverse of the weight amplifies rounding.
        np.testing.assert_allclose(v, np.linalg.solve(L.T, plain.v), rtol=0, atol=1e-11 * (1 + np.abs(v).max()))


def test_thresholds() -> None:
    """Solutions agree with one threshold for all levels, and with one for each level."""
    rng = np.random.default_rng(3)
    for _ in range(150):
        Js, vs = random_stack(rng, False)
        sizes = [np.linalg.norm(J, 2) for J in Js]
        for eps in (0.3 * min(sizes), [0.1 * size for size in sizes]):
            # Each level multiplies the rounding error by (norm of its Jacobian / threshold)^2.
            worst = max((size / np.min(eps)) ** 2 if np.ndim(eps) == 0 else 1e4 for size in sizes)
            for method in ("clamp", "damped", "chiaverini"):
                mine, theirs = al.solve_priority(Js, vs, method=method, eps=eps), ref.solve_priority(Js, vs, method, eps)
                assert np.linalg.norm(mine.v - theirs.v) <= 1e-15 * max(worst, 1e4) * (1.0 + np.linalg.norm(theirs.v))


def test_errors_of_the_entries() -> None:
    """A row differs from another by 1e-6.

    It counts for the rank if the entries are exact to 1e-9, and does not count if they are exact to 1e-3.
    """
    rng = np.random.default_rng(8)
    for _ in range(50):
        Js, vs = [rng.normal(size=(2, 7)), rng.normal(size=(3, 7))], [rng.normal(size=2), rng.normal(size=3)]
        Js[1][0] = Js[0][0] + 1e-6 * rng.normal(size=7)
        for rounding, rank in ((1e-9, 3), (1e-3, 2)):
            mine, theirs = al.diagnose_priority(Js, rounding=rounding), ref.diagnose_priority(Js, rounding=rounding)
            assert mine.projected_ranks == theirs.projected_ranks == [2, rank] and mine.kind == theirs.kind
            got, want = al.solve_priority(Js, vs, method="exact", rounding=rounding), ref.solve_priority(Js, vs, "exact", rounding=rounding)
            assert list(got.ranks) == want.ranks == [2, rank]
            # Rounding is divided by the least singular value that counts: 1e-6 with rank 3, about 1 with rank 2.
            assert np.linalg.norm(got.v - want.v) <= (1e-8 if rank == 3 else 1e-11) * (1.0 + np.linalg.norm(want.v))


@pytest.mark.parametrize("singular", [False, True], ids=["full", "singular"])
def test_losses_of_a_command(singular: bool) -> None:
    """The lost part of the velocities at each level agrees, for random velocities and for velocities of a joint motion."""
    rng = np.random.default_rng(5)
    compared, executed = 0, 0
    for _ in range(200):
        Js, vs = random_stack(rng, singular)
        if smallest_counted(Js) < 1e-4:
            continue
        motion = rng.normal(size=Js[0].shape[1])
        for rhs in (vs, [J @ motion for J in Js]):
            mine, theirs = al.diagnose_priority(Js, rhs=rhs), ref.diagnose_priority(Js, rhs=rhs)
            assert mine.losses is not None and theirs.losses is not None
            assert mine.compatible == theirs.compatible
            assert (mine.kinematic, mine.algorithmic) == (theirs.kinematic, theirs.algorithmic)
            for level, J in enumerate(Js):
                size = np.linalg.norm(J, 2)
                scale = 1.0 + size * np.linalg.norm(motion) + sum(np.linalg.norm(v) for v in rhs)
                for name in ("singular_values", "projected_singular_values"):
                    got, want = getattr(mine, name)[level], getattr(theirs, name)[level]
                    np.testing.assert_allclose(got[: len(want)], want, rtol=0, atol=1e-11 * size)
                # Both codes project on bases of the rows of the previous levels. Small singular values of these rows amplify rounding.
                np.testing.assert_allclose(mine.lost[level].T @ mine.lost[level], theirs.lost[level], rtol=0, atol=1e-10)
                np.testing.assert_allclose(mine.losses[level], theirs.losses[level], rtol=0, atol=1e-8 * scale)
            compared, executed = compared + 1, executed + bool(mine.compatible)
    assert compared >= 200 and executed >= compared // 2


@pytest.mark.parametrize("method", ["exact", "clamp", "damped", "chiaverini"])
def test_solvers_with_buffers(method: str) -> None:
    """`PrioritySolver` returns the reference's velocities for each option, in 20 calls with new rows."""
    rng = np.random.default_rng(6)
    root = rng.normal(size=(6, 6)) + 3 * np.eye(6)
    for options in ({}, {"weight": root @ root.T}, {"rounding": 1e-10}, {"eps": [0.1, 0.3]}):
        if method == "exact" and "eps" in options:
            continue
        solver = al.PrioritySolver(6, [2, 3], method=method, **options)
        for _ in range(20):
            Js, vs = [rng.normal(size=(2, 6)), rng.normal(size=(3, 6))], [rng.normal(size=2), rng.normal(size=3)]
            want = ref.solve_priority(Js, vs, method, **options)
            np.testing.assert_allclose(solver.solve(Js, vs), want.v, rtol=0, atol=1e-10 * (1.0 + np.linalg.norm(want.v)))
            for mine, theirs in zip(solver.residuals, want.residuals, strict=True):
                np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-10 * (1.0 + np.linalg.norm(want.v)))
