"""Symmetries of the link: its mirror image, and time run backwards.

    mirror:    theta -> -theta, tau -> -tau     swaps the limits
    reversal:  t -> T - t                       swaps the ends, keeps the limits
"""

from __future__ import annotations

import armlet as al
import numpy as np
import pytest


def problems(count: int, seed: int) -> list[tuple[float, ...]]:
    rng = np.random.default_rng(seed)
    rows = np.stack(
        [
            *rng.uniform(-4.0, 4.0, (2, count)),
            10.0 ** rng.uniform(-1.0, 1.0, count),
            rng.uniform(-1.5, 1.5, count),
            rng.uniform(0.1, 2.0, count),
            -rng.uniform(0.1, 2.0, count),
        ],
        axis=1,
    )
    return [tuple(row) for row in rows.tolist()]


def swap(kind: str, p: tuple[float, ...]) -> tuple[tuple[float, ...], float]:
    theta0, thetaf, inertia, gravity, tau_max, tau_min = p
    if kind == "mirror":
        return (-theta0, -thetaf, inertia, gravity, -tau_min), -tau_max
    return (thetaf, theta0, inertia, gravity, tau_max), tau_min


@pytest.mark.parametrize("kind", ["mirror", "reversal"])
def test_profiles(kind: str) -> None:
    """Durations agree to rounding: sin is odd to the last bit, but the middle of the path is rounded from the other end."""
    feasible = 0
    for p in problems(2000, 3):
        other, tau_min = swap(kind, p)
        for planner in (al.bang_bang_time, al.trapezoid_time):
            a, b = planner(*p[:5], tau_min=p[5]), planner(*other, tau_min=tau_min)
            assert a.feasible == b.feasible, p
            ends = (b.hold_start, b.hold_end) if kind == "mirror" else (b.hold_end, b.hold_start)
            assert (a.hold_start, a.hold_end) == ends, p
            if a.feasible:
                feasible += 1
                # A small a amplifies rounding; these limits and moments are of order one.
                worst = 1e-14 / (a.a_max if planner is al.bang_bang_time else a.k_max) + 1e-14
                assert b.t_min == pytest.approx(a.t_min, rel=worst), p
    assert feasible > 500


def test_half_ramps_are_bang_bang() -> None:
    """k = I D / T^2 = a / 4."""
    for p in problems(500, 4):
        a, b = al.bang_bang_time(*p[:5], tau_min=p[5]), al.trapezoid_time(*p[:5], tau_min=p[5], ramp=0.5)
        assert a.feasible == b.feasible
        if a.feasible:
            # Extremes are put together in another order there.
            assert b.t_min == pytest.approx(a.t_min, rel=1e-13 / min(1.0, a.a_max))


def test_the_limit_is_reached_and_not_passed() -> None:
    """At t_min the torque touches a limit and stays inside, on a grid of the motion."""
    checked = 0
    for theta0, thetaf, inertia, gravity, tau_max, tau_min in problems(300, 5):
        r = al.bang_bang_time(theta0, thetaf, inertia, gravity, tau_max, tau_min=tau_min)
        if not r.feasible:
            continue
        checked += 1
        motion = al.BangBang([theta0], [thetaf], r.t_min)
        limit = r.active_upper
        if limit.place == "interior":
            q, _, a = motion(limit.time)
            tau = inertia * a[0] + gravity * np.sin(q[0])
            assert tau == pytest.approx(tau_max if limit.limit == "tau_max" else tau_min, abs=1e-12)
            assert q[0] == pytest.approx(limit.theta, abs=1e-12)
        else:
            assert min(abs(tau - (tau_max if limit.limit == "tau_max" else tau_min)) for tau in r.torques(r.t_min)) < 1e-12
        for t in np.linspace(0.0, r.t_min, 101)[1:-1]:
            if abs(t - r.t_min / 2) > 1e-9:
                q, _, a = motion(t)
                tau = inertia * a[0] + gravity * np.sin(q[0])
                assert tau_min - 1e-11 <= tau <= tau_max + 1e-11
    assert checked > 50
