"""Tables and timed paths against the reference, which uses Bezier curves for Hermite interpolation, and series for hyperbolic functions."""

from __future__ import annotations

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
