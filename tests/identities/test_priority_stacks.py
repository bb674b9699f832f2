"""Lower levels of task priority do not disturb higher ones: random stacks in batches, with 2 to 5 levels and 4 to 9 joints.

30 % of the stacks are exactly singular, and 30 % are within 1e-16..1e-2 of a singularity. Some rows are zero, duplicate or dependent, with
commands that conflict. `ARMLET_RANDOM_STACKS` is the number of stacks (`make test-stacks`: 1,000,000). Strata and seed are printed.
rust/core/tests/suite/priority_random.rs has these checks for single solves in Rust.
"""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]
COUNT = int(os.environ.get("ARMLET_RANDOM_STACKS", "20000"))
SEED = 20220610
#: Number of stacks that are solved in one batch. They have equal sizes.
SIZE = 500
METHODS = ("exact", "clamp", "damped", "chiaverini", "sns", "exact, bounds")
STRATA = ("generic", "singular", "near")


@dataclass
class Block:
    jacobians: list[Array]
    velocities: list[Array]
    bounds: Array
    strata: NDArray[np.int64]

    @property
    def eps(self) -> list[Array]:
        """The default thresholds, (B,) each: 0.02 times the largest row norm of each level."""
        return [0.02 * np.linalg.norm(J, axis=2).max(axis=1, initial=0.0) for J in self.jacobians]


def block(rng: np.random.Generator) -> Block:
    n, levels = int(rng.integers(4, 10)), int(rng.integers(2, 6))
    sizes = {0: 0, 1: n + 1, 2: n}
    rows = [sizes.get(int(k), int(rng.integers(1, 4))) for k in rng.integers(0, 20, levels)]
    total = sum(rows)
    # Tasks have different units, so each level has a random scale.
    units = np.repeat(10.0 ** rng.uniform(-1.0, 1.0, (SIZE, levels)), rows, axis=1)
    stack = rng.normal(size=(SIZE, total, n)) * units[:, :, None]
    strata = np.digitize(rng.uniform(size=SIZE), [0.4, 0.7])
    distance = np.where(strata == 2, 10.0 ** rng.uniform(-16.0, -2.0, SIZE), 0.0)
    times = np.where(strata == 0, 0, rng.integers(1, 4, SIZE))
    every = np.arange(SIZE)
    for turn in range(3 if total > 1 else 0):
        at, kind = rng.integers(1, total, SIZE), rng.integers(0, 4, SIZE)
        weights = np.where(kind[:, None] == 0, 0.0, rng.integers(-4, 5, (SIZE, 3)) / 4.0) * (np.arange(3) < at[:, None])
        row = np.einsum("bs,bsn->bn", weights[:, : min(3, total)], stack[:, :3])
        row = np.where(kind[:, None] == 1, stack[every, rng.integers(0, at)], row) + distance[:, None] * rng.normal(size=(SIZE, n))
        now = turn < times
        stack[every[now], at[now]] = row[now]
    parts = np.split(stack, np.cumsum(rows)[:-1], axis=1)
    return Block(parts, [rng.normal(size=(SIZE, m)) for m in rows], 0.05 + 2.0 * rng.uniform(size=n), strata)


def times(J: Array, v: Array) -> Array:
    return np.asarray(np.einsum("bmn,bn->bm", J, v))


def norm(x: Array) -> Array:
    return np.asarray(np.linalg.norm(x, axis=1))


def largest(x: Array) -> Array:
    return np.asarray(np.abs(x).max(axis=1, initial=0.0))


def check(b: Block, method: str) -> None:
    bounded = method in ("sns", "exact, bounds")
    levels, always = len(b.jacobians), bounded or method in ("exact", "chiaverini")
    keywords: dict[str, Any] = {"method": method.removesuffix(", bounds")} | ({"v_max": b.bounds} if bounded else {})
    prefixes = [al.solve_priority(b.jacobians[:k], b.velocities[:k], **keywords) for k in range(1, levels + 1)]
    for sol in prefixes:
        assert np.isfinite(sol.v).all() and all(np.isfinite(r).all() for r in sol.residuals), method
    v, eps = prefixes[-1].v, b.eps
    # Velocities of the method "exact" exceed 1e16 near singularities. Their rounding errors are proportional to them.
    allowed = np.maximum(1e-10, 1e-12 * (1 + norm(v)))
    for i, J in enumerate(b.jacobians):
        moved = largest(times(J, v - prefixes[i].v))
        counts = np.full(SIZE, True) if always else prefixes[i].status == al.Status.SUCCESS
        assert (moved <= allowed)[counts].all(), (method, i, moved.max())
        if method in ("clamp", "damped"):
            before = prefixes[i - 1].v if i else np.zeros_like(v)
            rest, step = norm(b.velocities[i] - times(J, before)), norm(prefixes[i].v - before)
            # Damping by the manipulability has a largest gain of 1.21/eps. The tolerance also covers rounding errors, which are
            # proportional to the velocities.
            peak, slack = (1.0 if method == "clamp" else 1.2072), 1e-12 * (1 + np.maximum(norm(prefixes[i].v), norm(before)))
            seen = eps[i] > 0
            assert (step <= peak * rest * (1 + 1e-9) / np.where(seen, eps[i], 1.0) + slack)[seen].all(), (method, i)
    first, asked = b.jacobians[0], b.velocities[0]
    m, n = first.shape[1:]
    U, s, _ = np.linalg.svd(first, full_matrices=False)
    moved = np.abs(np.einsum("bmk,bm->bk", U, times(first, v - prefixes[0].v)))
    assert (moved <= allowed[:, None])[s >= eps[0][:, None]].all(), method
    full = np.full(SIZE, m <= n) & (s >= eps[0][:, None]).all(axis=1)
    if bounded:
        assert (np.abs(v) <= b.bounds).all()
    if method == "sns":
        # The direction of the first level's velocity is kept.
        assert (largest(times(first, v) - prefixes[-1].scales[:, :1] * asked) <= 1e-10)[full].all()
    elif not bounded:
        assert (largest(asked - times(first, v)) <= allowed)[full].all(), method
    if method == "clamp":
        exact = al.solve_priority(b.jacobians, b.velocities, method="exact").v
        # With `SUCCESS` no singular value is below its threshold. So both methods agree up to amplified rounding.
        same = largest(v - exact) <= 1e-9 * (1 + norm(exact))
        assert same[prefixes[-1].status == al.Status.SUCCESS].all()


@pytest.mark.slow
def test_no_lower_level_disturbs_a_higher_one(capsys: pytest.CaptureFixture[str]) -> None:
    rng, seen = np.random.default_rng(SEED), Counter[str]()
    for _ in range(max(1, COUNT // SIZE)):
        b = block(rng)
        seen.update(STRATA[k] for k in b.strata)
        for method in METHODS:
            check(b, method)
    total = seen.total()
    with capsys.disabled():
        print(f" {total:,} stacks, seed {SEED}: {', '.join(f'{seen[name]:,} {name}' for name in STRATA)} (1e-16..1e-2)")
    assert all(seen[name] > total / 5 for name in STRATA)
