"""Symmetries of the minimum-time problem of one link: mirror image and time reversal.

mirror:    theta -> -theta, tau -> -tau     exchanges the limits
reversal:  t -> T - t                       exchanges the ends, keeps the limits
"""

from __future__ import annotations

import friction_trials
import numpy as np
import pytest

import armlet as al


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
    """Durations are equal up to rounding. The sine is exactly odd, but the middle of a reversed path is rounded differently."""
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
                # A small acceleration limit amplifies rounding. Limits and moments are of order one.
                worst = 1e-14 / (a.a_max if planner is al.bang_bang_time else a.k_max) + 1e-14
                assert b.t_min == pytest.approx(a.t_min, rel=worst), p
    assert feasible > 500


def test_half_ramps_are_bang_bang() -> None:
    """A trapezoid with ramps of half the duration is bang-bang, so both functions give the same time."""
    for p in problems(500, 4):
        a, b = al.bang_bang_time(*p[:5], tau_min=p[5]), al.trapezoid_time(*p[:5], tau_min=p[5], ramp=0.5)
        assert a.feasible == b.feasible
        if a.feasible:
            # The two functions combine the extreme values in a different order.
            assert b.t_min == pytest.approx(a.t_min, rel=1e-13 / min(1.0, a.a_max))


def test_the_limit_is_reached_and_not_passed() -> None:
    """At t_min the torque reaches a limit and does not exceed it, at the points of a grid."""
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


SWAPPED = {"monotone": "monotone", "back-swing": "overshoot", "overshoot": "back-swing", "none found": "none found"}


@pytest.mark.parametrize("kind", ["mirror", "reversal"])
def test_torque_optimum(kind: str) -> None:
    """Mirror image and reversal do not change durations. Reversal exchanges back-swing and overshoot."""
    seen = set()
    for p in problems(300, 6):
        other, tau_min = swap(kind, p)
        a, b = al.torque_optimal_time(*p[:5], tau_min=p[5]), al.torque_optimal_time(*other, tau_min=tau_min)
        seen.add(a.best.kind)
        assert (a.feasible, a.certified_global) == (b.feasible, b.certified_global), p
        # The tolerance is 1e-9, because motions near a stall amplify the rounding of the switching time.
        assert b.t == pytest.approx(a.t, rel=1e-9, nan_ok=True), p
        assert b.best.t == pytest.approx(a.best.t, rel=1e-9, nan_ok=True), p
        assert b.best.kind == (a.best.kind if kind == "mirror" else SWAPPED[a.best.kind]), p
        if a.feasible:
            assert abs(b.v_peak) == pytest.approx(abs(a.v_peak), rel=1e-9), p
            assert b.t_switch == pytest.approx(a.t_switch if kind == "mirror" else a.t - a.t_switch, rel=1e-8), p
    assert seen == set(SWAPPED)


def test_the_optimum_is_never_slower_than_the_profile() -> None:
    checked = 0
    for p in problems(500, 7):
        r = al.bang_bang_time(*p[:5], tau_min=p[5])
        if r.feasible:
            o = al.torque_optimal_time(*p[:5], tau_min=p[5])
            checked += 1
            # `best.t` is the least time, `o.t` that of the fastest monotone motion, and `t_min` that of a motion with constant acceleration
            # and equal braking.
            assert o.feasible and o.best.t <= o.t <= r.t_min * (1.0 + 1e-12), p
    assert checked > 100


def test_the_profile_moves_the_link() -> None:
    """The torque is always on a limit, energy changes by the work of the torque, and the link is at rest at both ends."""
    kinds = set()
    for p in problems(60, 8):
        theta0, thetaf, inertia, gravity, tau_max, tau_min = p
        o = al.torque_optimal_time(*p[:5], tau_min=tau_min)
        best = o.best
        if best.kind == "none found" or best.t > 50.0:
            continue
        kinds.add(best.kind)
        t = np.linspace(0.0, np.nextafter(best.t, 0.0), 257)
        q, v, a, tau = o.profile(t)
        assert set(tau.tolist()) <= {tau_max, tau_min}
        # The equation of motion holds up to rounding.
        np.testing.assert_allclose(inertia * a + gravity * np.sin(q), tau, rtol=0.0, atol=1e-13)
        # While the torque is constant, I v^2/2 - G cos q - tau q is constant up to rounding.
        energy = inertia * v**2 / 2 - gravity * np.cos(q) - tau * q
        phase = np.searchsorted(best.t_switches, t, side="right")
        for k in range(len(best.switches) + 1):
            part = energy[phase == k]
            assert part.size == 0 or np.ptp(part) <= 1e-8, p
        np.testing.assert_allclose([q[0], v[0], q[-1], v[-1]], [theta0, 0.0, thetaf, 0.0], atol=1e-8)
        for angle, time in zip(best.switches, best.t_switches, strict=True):
            np.testing.assert_allclose([o.profile(np.nextafter(time, 0.0))[0], o.profile(time)[0]], angle, atol=1e-7)
    assert {"monotone", "back-swing", "overshoot"} <= kinds


def test_friction() -> None:
    """Small friction changes the result little. Coulomb friction alone is equivalent to shifted limits."""
    for p in problems(100, 9):
        plain = al.torque_optimal_time(*p[:5], tau_min=p[5])
        rough = al.torque_optimal_time(*p[:5], tau_min=p[5], viscous=0.05)
        assert not rough.certified_global or rough.best.kind == "monotone"
        if rough.feasible:
            assert rough.best.t <= rough.t and (rough.best.kind == "monotone") == (rough.best.t == rough.t)
            nearly = al.torque_optimal_time(*p[:5], tau_min=p[5], viscous=1e-9)
            # The time is continuous at zero friction: friction of 1e-9 changes T little. Near a stall it changes T more.
            assert not plain.feasible or nearly.t == pytest.approx(plain.t, rel=1e-5)
        c = 0.05
        if p[1] > p[0] and p[4] > c:
            shifted = al.torque_optimal_time(*p[:4], p[4] - c, tau_min=p[5] - c)
            coulomb = al.torque_optimal_time(*p[:5], tau_min=p[5], coulomb=c)
            assert coulomb.feasible == shifted.feasible
            # Taylor steps are compared with quadrature. A motion near a stall amplifies the difference.
            assert coulomb.t == pytest.approx(shifted.t, rel=1e-8, nan_ok=True)


#: Number of turning angles per problem.
TURNS = 32


@pytest.mark.slow
def test_swings_with_friction() -> None:
    """The time of the best swing is the sum of the times of its two legs. No turning angle of a grid gives a faster motion."""
    rows = problems(50, 10)
    roughness = [(0.1 * (p[2] * abs(p[3])) ** 0.5, 0.05 * p[4]) for p in rows]
    optima = [al.torque_optimal_time(*p[:5], tau_min=p[5], viscous=d, coulomb=c) for p, (d, c) in zip(rows, roughness, strict=True)]
    theta0, thetaf, inertia, gravity, high, low = np.array(rows).T
    viscous, coulomb = np.array(roughness).T
    sign, depth = np.sign(thetaf - theta0)[:, None], np.geomspace(1e-3, 9.0, TURNS // 2)
    turns = np.concatenate([theta0[:, None] - sign * depth, thetaf[:, None] + sign * depth], axis=1)
    kinds = [o.best.kind for o in optima]
    swings = np.array([kind in ("back-swing", "overshoot") for kind in kinds])
    turns[swings, 0] = [o.best.theta_turn for o in optima if o.best.kind in ("back-swing", "overshoot")]
    for k in np.flatnonzero(swings):
        beyond = (theta0[k] - turns[k, 0] if kinds[k] == "back-swing" else turns[k, 0] - thetaf[k]) * sign[k, 0]
        assert beyond > 0.0, rows[k]
    best, monotone = np.array([o.best.t for o in optima]), np.array([o.t for o in optima])
    parameters = np.array([inertia, gravity, high, low, viscous, coulomb])
    each = np.repeat(parameters, TURNS, axis=1)
    first, second = (np.repeat(ends, TURNS) for ends in (theta0, thetaf))
    detours = (friction_trials.legs(first, turns.ravel(), each) + friction_trials.legs(turns.ravel(), second, each)).reshape(turns.shape)
    straight = friction_trials.legs(theta0, thetaf, parameters)
    # Legs of 1,500 steps have a relative error of at most 1e-5.
    np.testing.assert_allclose(straight, monotone, rtol=1e-3)
    np.testing.assert_allclose(detours[swings, 0], best[swings], rtol=1e-3)
    assert not np.any(detours < best[:, None] * (1.0 - 1e-3))
    # If the planner finds no motion, the grid of turning angles has none.
    assert np.isnan(detours[np.isnan(best)]).all()
    assert kinds.count("back-swing") > 2 and kinds.count("overshoot") > 2 and "none found" in kinds, kinds
