"""Tables and timed paths against the reference, which uses Bezier curves for Hermite interpolation, and series for hyperbolic functions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from trees import close

import armlet as al
from armlet import reference as ref
from armlet.reference import timing


@pytest.mark.parametrize("knots", [1, 2, 9])
@pytest.mark.parametrize("n", [1, 3, 8])
def test_tables(n: int, knots: int) -> None:
    rng = np.random.default_rng([n, knots])
    rows = rng.uniform(-1.0, 1.0, (3, knots, n))
    for dt, start in ((0.1, 0.0), (0.37, -1.3)):
        ours, other = al.Table(dt, *rows, start=start), ref.Table(dt, *rows, start=start)
        ends = start + dt * np.arange(-1, knots + 1)
        # The times are at knots, just before and after them, and between.
        for t in [*ends, *(ends + 1e-7), *(ends - 1e-7), *rng.uniform(ends[0], ends[-1], 30)]:
            for got, want in zip(ours(float(t)), other(float(t)), strict=True):
                # The second derivative divides rounding by dt^2.
                close(got, want, 10.0 / dt**2)


@pytest.mark.parametrize("n", [1, 2, 4])
@pytest.mark.parametrize("options", [{}, {"start_speed": 0.2, "end_speed": 0.3}, {"torque_rate": 400.0}], ids=str)
def test_timed_paths(n: int, options: dict[str, float]) -> None:
    rng = np.random.default_rng(n)
    arm = al.planar_arm([0.5, 0.4, 0.3, 0.2][:n], gravity=(0.0, 0.0))
    points = np.cumsum(rng.uniform(0.1, 0.5, (5, n)), axis=0)
    p = al.time_path(arm, points, tau_max=20.0, v_max=2.0, **options)
    assert p.feasible
    spline = timing.cubic_spline(timing.positions(points), points)
    other = ref.TimedPath(spline, p.s, p.s_dot, p.t, cubic="torque_rate" in options)
    times = [-0.1, 0.0, *p.t[1:-1:7], *rng.uniform(0.0, p.duration, 60), p.duration, p.duration + 0.1]
    for t in times:
        got, want = p(float(t)), other(float(t))
        # The duration T of an interval is a difference of times, so it has a rounding error. The coefficient b divides by T^2.
        for mine, theirs, rounding in zip(got, want, (1e-12, 1e-11, 1e-8), strict=True):
            close(mine, theirs, 10.0, rounding)


def derivative_rounding(dt: float) -> tuple[float, ...]:
    """Derivatives of a table divide rounding by powers of dt."""
    return tuple(1e-13 * max(1.0, 10.0 / dt**k) for k in range(5))


@pytest.mark.parametrize("n", [1, 3, 8])
def test_derivatives_up_to_snap(n: int) -> None:
    """Polynomials, phasors and Bezier curves of the reference against the formulas of the core, at and between all changes of a formula."""
    rng = np.random.default_rng([n, 7])
    q0, q1 = rng.uniform(-1.0, 1.0, (2, n))
    waves = rng.uniform(0.2, 1.5, (4, n, 2))
    rows = rng.uniform(-1.0, 1.0, (3, 9, n))
    pairs: list[tuple[al.Motion, Any, list[float], float]] = [
        (al.Hold(q0), ref.Hold(q0), [0.0], 1.0),
        (al.Quintic(q0, q1, 1.4), ref.Quintic(q0, q1, 1.4), [0.0, 1.4], 1.0),
        (al.Sinusoid(waves[0, :, 0], *waves[1:]), ref.Sinusoid(waves[0, :, 0], *waves[1:]), [0.0], 1.0),
        (al.Table(0.1, *rows), ref.Table(0.1, *rows), [0.1 * k for k in range(9)], 0.1),
        (al.Table(0.1, *rows[:, :1]), ref.Table(0.1, *rows[:, :1]), [0.0], 0.1),
    ]
    for motion, other, changes, dt in pairs:
        for t in [-0.3, *changes, *rng.uniform(-0.1, 1.5, 30), 2.0]:
            got = motion.derivatives(t, 4)
            assert got.shape == (5, n)
            for mine, theirs, rounding in zip(got, other.derivatives(t, 4), derivative_rounding(dt), strict=True):
                close(mine, theirs, 10.0, rounding)
            np.testing.assert_array_equal(got[:3], motion(t))
            for order in range(4):
                np.testing.assert_array_equal(motion.derivatives(t, order), got[: order + 1])
    fast = al.BangBang(q0, q1, 1.4), ref.BangBang(q0, q1, 1.4)
    for t in (-0.1, 0.0, 0.3, 0.7, 1.1, 1.4):
        np.testing.assert_array_equal(fast[0].derivatives(t, 2), fast[0](t))
        close(fast[0].derivatives(t, 2), fast[1].derivatives(t, 2), 10.0)
    with pytest.raises(ValueError, match="acceleration jumps"):
        fast[1].derivatives(0.3, 3)


@pytest.mark.parametrize("n", [1, 2, 4])
def test_derivatives_of_timed_paths(n: int) -> None:
    """Powers of a Taylor polynomial in the reference against the chain rule in the core."""
    rng = np.random.default_rng(n)
    arm = al.planar_arm([0.5, 0.4, 0.3, 0.2][:n], gravity=(0.0, 0.0))
    points = np.cumsum(rng.uniform(0.1, 0.5, (5, n)), axis=0)
    p = al.time_path(arm, points, tau_max=20.0, v_max=2.0, torque_rate=400.0)
    spline = timing.cubic_spline(timing.positions(points), points)
    other = ref.TimedPath(spline, p.s, p.s_dot, p.t, cubic=True)
    for t in [-0.1, *rng.uniform(0.0, p.duration, 60), p.duration + 0.1]:
        got, want = p.derivatives(t, 4), other.derivatives(t, 4)
        # The core stores the path acceleration at each node. The reference divides path speeds by the durations of segments.
        for mine, theirs, rounding in zip(got, want, (1e-12, 1e-11, 1e-8, 1e-5, 1e-5), strict=True):
            close(mine, theirs, 10.0, rounding)
        np.testing.assert_array_equal(got[:3], p(t))
    with pytest.raises(al.InputError, match=r"^Motion.derivatives: order is too high: expected at most 2 for a motion whose accel"):
        al.time_path(arm, points, tau_max=20.0, v_max=2.0).derivatives(0.1, 3)


@pytest.mark.parametrize("name", ["Hold", "Quintic", "Sinusoid", "Table"])
def test_derivatives_are_differences(name: str) -> None:
    """Each derivative is the slope of the one before, to the error h^2 of central differences and rounding."""
    motion, h = MOTIONS[name], 1e-5
    for t in (0.213, 0.61, 1.17, 1.42):
        rows = motion.derivatives([t - h, t, t + h], 4)
        assert rows.shape == (3, 5, 2)
        np.testing.assert_allclose((rows[2, :-1] - rows[0, :-1]) / (2.0 * h), rows[1, 1:], atol=2e-6, rtol=0.0)


def test_derivatives_at_arrays_of_times() -> None:
    for motion in MOTIONS.values():
        order = 2 if isinstance(motion, al.BangBang) else 4
        for t in (np.linspace(-0.5, 2.5, 12).reshape(3, 4), np.float32([0.25, 1.5]), [0, 1], np.zeros((0,)), 1, np.float64(0.4)):
            rows = motion.derivatives(t, order)
            assert rows.shape == (*np.shape(t), order + 1, 2) and rows.flags.c_contiguous
            alone = [motion.derivatives(float(time), order) for time in np.ravel(t)]
            np.testing.assert_array_equal(rows.reshape(-1, order + 1, 2), np.reshape(alone, (-1, order + 1, 2)))


def test_derivatives_of_bad_arguments() -> None:
    for motion in MOTIONS.values():
        for bad in (np.nan, np.inf, "1", [0.0, np.nan], 1j, None):
            with pytest.raises(al.InputError, match=r"^Motion.derivatives: t "):
                motion.derivatives(bad, 2)  # type: ignore[arg-type]
        for bad in (-1, 5, 2.0, 1.5, "2", None, True, [2], 10**30):
            with pytest.raises(al.InputError, match=r"^Motion.derivatives: order "):
                motion.derivatives(0.5, bad)  # type: ignore[arg-type]
    with pytest.raises(al.InputError, match=r"order is too high: expected at most 2 for a motion whose acceleration jumps, got 3"):
        MOTIONS["BangBang"].derivatives(0.5, 3)
    refused = al.time_path(al.planar_arm([1.0]), [[0.0], [1.0]], tau_max=1.0, check_limits=False)
    assert not refused.feasible
    with pytest.raises(al.SolveError, match="the path has no timing"):
        refused.derivatives(0.0, 0)


MOTIONS = {
    "Hold": al.Hold([0.1, -0.2]),
    "Quintic": al.Quintic([0.0, 0.0], [1.0, -1.0], 1.5),
    "BangBang": al.BangBang([0.0, 0.0], [1.0, -1.0], 1.5),
    "Sinusoid": al.Sinusoid([0.1, 0.2], [[0.3, 0.1], [0.2, 0.4]], [[1.0, 2.0], [3.0, 1.0]], 0.2),
    "Table": al.Table(0.5, np.eye(4)[:, :2], np.zeros((4, 2)), np.zeros((4, 2))),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_motions_at_arrays_of_times(name: str) -> None:
    """A call with an array of times gives the same bits as a call for each time."""
    motion = MOTIONS[name]
    for t in (np.linspace(-0.5, 2.5, 12).reshape(3, 4), np.float32([0.25, 1.5]), [0, 1], np.zeros((0,))):
        rows = motion(t)
        alone = [motion(float(time)) for time in np.ravel(t)]
        for part, got in enumerate(rows):
            assert got.shape == (*np.shape(t), 2) and got.flags.c_contiguous
            np.testing.assert_array_equal(got.reshape(-1, 2), np.reshape([one[part] for one in alone], (-1, 2)))
    for bad in ([0.0, np.nan], [[0.0, np.inf]], ["1"], [1j], object()):
        with pytest.raises(al.InputError, match=r"^Motion: t "):
            motion(bad)  # type: ignore[arg-type]
