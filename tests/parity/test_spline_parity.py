"""`Spline` against the reference, which solves one linear system for the coefficients of all polynomials."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from trees import close

import armlet as al
from armlet import reference as ref


def knots(n: int, count: int, seed: int) -> tuple[Any, Any]:
    """Uneven times from -0.3 s on, and random positions, velocities and accelerations, (3, count, n)."""
    rng = np.random.default_rng([n, count, seed])
    return np.cumsum(rng.uniform(0.1, 0.6, count)) - 0.3, rng.uniform(-1.0, 1.0, (3, count, n))


@pytest.mark.parametrize("count", [2, 3, 4, 9])
@pytest.mark.parametrize("n", [1, 3, 8])
@pytest.mark.parametrize("spline", ["clamped", "natural", "not-a-knot"])
def test_positions_alone(spline: str, n: int, count: int) -> None:
    t, (q, _, _) = knots(n, count, 0)
    compare(al.Spline(t, q, spline=spline), ref.Spline(t, q, spline=spline), t)


@pytest.mark.parametrize("count", [2, 5])
@pytest.mark.parametrize("n", [1, 3, 8])
def test_velocities_and_accelerations(n: int, count: int) -> None:
    t, (q, v, a) = knots(n, count, 1)
    compare(al.Table.at(t, q, v), ref.Spline(t, q, v), t)
    compare(al.Table.at(t, q, v, a), ref.Spline(t, q, v, a), t)


def compare(motion: al.Motion, other: ref.Spline, t: Any) -> None:
    order = 4 if motion.__getnewargs_ex__()[1].keys() != {"t", "q", "v"} else 2
    for time in [t[0] - 1.0, *t, *np.random.default_rng(0).uniform(t[0] - 0.2, t[-1] + 0.2, 30), t[-1] + 1.0]:
        got, want = motion.derivatives(time, order), other.derivatives(time, order)
        for mine, theirs, rounding in zip(got, want, (1e-12, 1e-11, 1e-10, 1e-9, 1e-8), strict=False):
            close(mine, theirs, 10.0, rounding)
        np.testing.assert_array_equal(got[:3], motion(time))
