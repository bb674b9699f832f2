"""Minimum time in Rust against the numpy reference, which samples and integrates where the core has closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import armlet as al
from armlet.reference import mintime as ref

FIELDS = ("feasible", "t_min", "t_max", "a_min", "a_max", "hold_start", "hold_end")


def problems(count: int, seed: int) -> np.ndarray:
    """Ends within a turn and a half, gravity from none to three times the limit, inertias and limits over two decades."""
    rng = np.random.default_rng(seed)
    theta0, thetaf = rng.uniform(-5.0, 5.0, (2, count))
    tau_max, inertia = 10.0 ** rng.uniform(-1.0, 1.0, (2, count))
    gravity = tau_max * rng.uniform(0.0, 3.0, count) * rng.integers(0, 2, count) ** 0.5
    return np.stack([theta0, thetaf, inertia, gravity, tau_max], axis=1)


def test_bang_bang_time() -> None:
    """The reference refines extremes of sin to 1e-9 in the angle: 1e-18 in their value; a_max cancels to 1e-13 of the limit at worst."""
    seen = set()
    for row in problems(300, 1):
        got, expected = al.bang_bang_time(*row), ref.bang_bang_time(*row)
        seen.add(got.feasible)
        scale = 1e-13 * (row[4] + row[3])
        assert (got.feasible, got.hold_start, got.hold_end) == (expected.feasible, expected.hold_start, expected.hold_end), row
        assert got.a_min == pytest.approx(expected.a_min, abs=scale) and got.a_max == pytest.approx(expected.a_max, abs=scale), row
        if got.feasible:
            # T ~ a^(-1/2): the relative error of a small a, halved.
            assert got.t_min == pytest.approx(expected.t_min, rel=1e-14 + scale / expected.a_max), row
            small = expected.a_min > 0.0
            assert got.t_max == pytest.approx(expected.t_max, rel=1e-14 + (scale / expected.a_min if small else 0.0)), row
    assert seen == {True, False}


def test_batch_is_the_single_calls() -> None:
    """Bit by bit, broadcast over two axes."""
    rows = problems(12, 2)
    theta0, thetaf = rows[:, :1], rows[:, 1]
    batch = al.bang_bang_time(theta0, thetaf, 1.3, 0.7, [1.0] * 12)
    assert batch.shape == batch.t_min.shape == (12, 12)
    for i in range(12):
        for j in range(12):
            single = al.bang_bang_time(theta0[i, 0], thetaf[j], 1.3, 0.7, 1.0)
            for name in FIELDS:
                np.testing.assert_array_equal(getattr(batch, name)[i, j], getattr(single, name))
            assert batch[i, j] == single and batch.reason[i, j] == single.reason


def test_torque_optimal_time() -> None:
    """Two quadratures of the same optimum; swings are searched on different grids, so one may find what the other misses."""
    kinds = set()
    for row in problems(20, 3):
        got, expected = al.torque_optimal_time(*row), ref.torque_optimal_time(*row)
        kinds.add(got.best.kind)
        assert (got.feasible, got.certified_global) == (expected.feasible, expected.certified_global), row
        if got.feasible:
            # The reference halves until 1e-14; a motion that nearly stalls amplifies rounding.
            assert got.t == pytest.approx(expected.t, rel=1e-10), row
            assert got.theta_switch == pytest.approx(expected.theta_switch, abs=1e-11), row
            assert got.t_switch == pytest.approx(expected.t_switch, rel=1e-9), row
        if expected.best.kind == "none found":
            continue
        # Never slower than the reference beyond its golden section.
        assert got.best.t <= expected.best.t * (1.0 + 1e-8), row
        if got.best.t >= expected.best.t * (1.0 - 1e-8):
            assert got.best.kind == expected.best.kind, row
    assert {"monotone", "back-swing", "overshoot"} <= kinds
