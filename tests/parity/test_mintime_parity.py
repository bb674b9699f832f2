"""Minimum time against the numpy reference, which samples and integrates where armlet has closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import armlet as al
from armlet import reference as ref

FIELDS = ("feasible", "t_min", "t_max", "a_min", "a_max", "hold_start", "hold_end")


def problems(count: int, seed: int) -> np.ndarray:
    """Return rows (count, 5) of theta0, thetaf, inertia, gravity and tau_max.

    The angles are within 5 rad. Gravity is from zero to three times tau_max, and inertia and tau_max are from 0.1 to 10.
    """
    rng = np.random.default_rng(seed)
    theta0, thetaf = rng.uniform(-5.0, 5.0, (2, count))
    tau_max, inertia = 10.0 ** rng.uniform(-1.0, 1.0, (2, count))
    gravity = tau_max * rng.uniform(0.0, 3.0, count) * rng.integers(0, 2, count) ** 0.5
    return np.stack([theta0, thetaf, inertia, gravity, tau_max], axis=1)


def test_bang_bang_time() -> None:
    """Bang-bang times agree.

    The reference locates extremes of sin to 1e-9 rad, which changes their value by 1e-18. Cancellation in a_max is at most 1e-13 of the
    limit.
    """
    seen = set()
    for row in problems(300, 1):
        got, expected = al.bang_bang_time(*row), ref.bang_bang_time(*row)
        seen.add(got.feasible)
        scale = 1e-13 * (row[4] + row[3])
        assert (got.feasible, got.hold_start, got.hold_end) == (expected.feasible, expected.hold_start, expected.hold_end), row
        assert got.a_min == pytest.approx(expected.a_min, abs=scale) and got.a_max == pytest.approx(expected.a_max, abs=scale), row
        if got.feasible:
            # T is proportional to a^(-1/2), so its relative error is half the relative error of a.
            assert got.t_min == pytest.approx(expected.t_min, rel=1e-14 + scale / expected.a_max), row
            small = expected.a_min > 0.0
            assert got.t_max == pytest.approx(expected.t_max, rel=1e-14 + (scale / expected.a_min if small else 0.0)), row
    assert seen == {True, False}


def test_batch_is_the_single_calls() -> None:
    """A batch that broadcasts over two axes gives the same bits as single calls."""
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


def test_two_limits() -> None:
    """Acceleration bounds agree for torque limits that differ in both directions."""
    lower = -(10.0 ** np.random.default_rng(4).uniform(-1.0, 1.0, 60))
    for row, tau_min in zip(problems(60, 4), lower, strict=True):
        got, expected = al.bang_bang_time(*row, tau_min=tau_min), ref.bang_bang_time(*row, tau_min=tau_min)
        assert (got.feasible, got.hold_start, got.hold_end) == (expected.feasible, expected.hold_start, expected.hold_end), row
        scale = 1e-13 * (row[4] + row[3] - tau_min)
        assert got.a_max == pytest.approx(expected.a_max, abs=scale) and got.a_min == pytest.approx(expected.a_min, abs=scale), row


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["trapezoid_time", "minimum_jerk_time"])
def test_shapes(shape: str) -> None:
    """Times of trapezoidal and minimum-jerk profiles agree.

    The torque at the time u T is k s''(u) + G sin x(u), with k = I D / T^2 (see `armlet.reference.profiles`). For the trapezoid,
    armlet computes the bounds of k in closed form. For minimum jerk, they are extremes over u. The reference finds both bounds by bisection
    of the largest torque excess, to 1e-14 of the limits.

    Where the torque hardly depends on k, the bisection leaves a larger error in k. For minimum jerk the reference finds `missing`, the
    smallest torque excess, with parabolas through a grid, to 2e-5.
    """
    rng = np.random.default_rng(6)
    seen = {True: 0, False: 0}
    for row in problems(24, 7):
        options = {"tau_min": -row[4] * rng.uniform(0.5, 1.5)} | ({"ramp": rng.uniform(0.1, 0.5)} if shape == "trapezoid_time" else {})
        got, expected = getattr(al, shape)(*row, **options), getattr(ref, shape)(*row, **options)
        assert (got.feasible, got.hold_start, got.hold_end) == (expected.feasible, expected.hold_start, expected.hold_end), row
        seen[got.feasible] += 1
        if not got.feasible:
            assert got.missing == pytest.approx(expected.missing, rel=1e-6 if shape == "trapezoid_time" else 2e-5), row
            continue
        for name in ("t_min", "t_max", "k_min", "k_max"):
            assert getattr(got, name) == pytest.approx(getattr(expected, name), rel=1e-9), (row, name)
    assert min(seen.values()) >= 4
    assert al.trapezoid_time(0.0, 1.0, 1.0, 0.5, 1.0) == al.trapezoid_time(0.0, 1.0, 1.0, 0.5, 1.0, ramp=1.0 / 3.0)


FRICTION = [
    (np.pi / 2, 3.0, 1.0, 1.0, 1.05, -1.05, 0.05, 0.02),
    (0.2, 2.1, 0.7, 0.8, 1.4, -0.9, 0.2, 0.0),
    (2.4, -0.3, 1.3, 1.5, 1.6, -2.0, 0.1, 0.15),
    (0.1, 1.2, 1.0, 1.0, 3.0, -3.0, 4.0, 0.3),
    (2.5, 0.5, 1.0, 1.0, 0.53, -1.07, 0.11, 0.08),
    (-0.4, 0.5, 2.0, -0.6, 0.9, -0.8, 0.3, 0.0),
    (0.3, 2.9, 1.0, 3.0, 0.5, -0.5, 0.1, 0.1),
]


@pytest.mark.parametrize("row", FRICTION, ids=range(len(FRICTION)))
def test_friction(row: tuple[float, ...]) -> None:
    """Minimum times with friction agree.

    armlet uses Taylor series of order 24, and the reference at least 300 Runge-Kutta steps.
    """
    limits = {"tau_min": row[5], "viscous": row[6], "coulomb": row[7]}
    got, expected = al.torque_optimal_time(*row[:5], **limits), ref.torque_optimal_time(*row[:5], **limits)
    agree(got, expected, row, 1e-7)
    # In these cases the grid of the reference finds the best motion.
    assert got.best.kind == expected.best.kind
    if expected.best.switches:
        assert got.best.t == pytest.approx(expected.best.t, rel=1e-7)
        # The time has a flat minimum, so the switches err by the square root of its error.
        np.testing.assert_allclose(got.best.switches, expected.best.switches, rtol=0.0, atol=1e-3)


def test_friction_has_motions_of_every_kind() -> None:
    optima = [al.torque_optimal_time(*row[:5], tau_min=row[5], viscous=row[6], coulomb=row[7]) for row in FRICTION]
    assert {o.best.kind for o in optima} == {"monotone", "back-swing", "overshoot", "none found"}
    assert {o.certified_global for o in optima} == {True, False}


def agree(got: al.TorqueOptimum, expected: Any, row: Any, tolerance: float = 1e-10) -> None:
    """Compare two optima.

    The libraries search motions with swings on different grids, so armlet may find a faster one than the reference.
    """
    assert (got.feasible, got.certified_global) == (expected.feasible, expected.certified_global), row
    assert got.sturm_bound == pytest.approx(expected.sturm_bound, rel=1e-14), row
    if got.feasible:
        # The reference halves the intervals of its quadrature until they agree to 1e-14. A motion that nearly stops amplifies rounding.
        assert got.t == pytest.approx(expected.t, rel=tolerance), row
        assert got.theta_switch == pytest.approx(expected.theta_switch, abs=0.1 * tolerance), row
        assert got.t_switch == pytest.approx(expected.t_switch, rel=10 * tolerance), row
        assert got.v_peak == pytest.approx(expected.v_peak, rel=10 * tolerance), row
    if expected.best.kind == "none found":
        return
    # armlet's motion is at most 1e-8 slower than the reference's, which results from a golden-section search.
    assert got.best.t <= expected.best.t * (1.0 + max(1e-8, tolerance)), row
    if got.best.t >= expected.best.t * (1.0 - max(1e-8, tolerance)):
        assert got.best.kind == expected.best.kind, row


@pytest.mark.slow
def test_torque_optimal_time() -> None:
    """Minimum times agree. For every second problem the torque limits differ in both directions."""
    kinds = []
    for k, row in enumerate(problems(14, 3)):
        limits = {"tau_min": -row[4] * (0.6 + 0.1 * k)} if k % 2 else {}
        got, expected = al.torque_optimal_time(*row, **limits), ref.torque_optimal_time(*row, **limits)
        agree(got, expected, row)
        if abs(got.best.t - expected.best.t) <= 1e-8 * got.best.t:
            kinds.append(got.best.kind)
    assert {"monotone", "back-swing", "overshoot"} <= {*kinds} and len(kinds) >= 8


@pytest.mark.slow
@pytest.mark.parametrize("rubs", [False, True], ids=["smooth", "rough"])
def test_equal_ends(rubs: bool) -> None:
    """With equal start and end, the time is zero if the torque, with Coulomb friction, holds the pose.

    Otherwise the best motion swings away and returns.
    """
    rng = np.random.default_rng(8)
    seen = {True: 0, False: 0}
    for _ in range(5 if rubs else 20):
        theta, gravity, up, down = rng.uniform([-5.0, -2.0, 0.1, 0.1], [5.0, 2.0, 1.5, 1.5])
        options = {"tau_min": -down} | ({"viscous": 0.1, "coulomb": 0.05} if rubs else {})
        row = (theta, theta, 1.0, gravity, up)
        got, expected = al.torque_optimal_time(*row, **options), ref.torque_optimal_time(*row, **options)
        load, help = gravity * np.sin(theta), options.get("coulomb", 0.0)
        assert got.feasible == got.certified_global == (-down - help <= load <= up + help)
        agree(got, expected, row, 1e-7 if rubs else 1e-10)
        assert got.reason == "" if got.feasible else "cannot hold the link at theta" in got.reason
        assert got.best.t == (0.0 if got.feasible else pytest.approx(expected.best.t, rel=1e-7))
        seen[got.feasible] += 1
    assert min(seen.values()) >= 1
