"""Timings with strong friction, with torque-rate limits and on a fixed grid, checked by `reference.timing`."""

from __future__ import annotations

import os
import pickle
from typing import Any

import models
import numpy as np
import pytest

import armlet as al
from armlet import reference as ref
from armlet.reference import timing

CASES = int(os.environ.get("ARMLET_CASES", "20"))
LINKS = [0.5, 0.4]
ARM, CHECKER = al.planar_arm(LINKS), ref.planar_arm(LINKS)
SEVEN = models.SEVEN_AXES


def problem(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Random waypoints, and torque limits that can hold the arm along the whole path with a margin."""
    q = rng.uniform(-1.5, 1.5, (rng.integers(2, 5), 2))
    path = timing.cubic_spline(timing.positions(q), q)
    held = np.abs(CHECKER.gravity(path(np.linspace(0.0, 1.0, 400))[0])).max(axis=0)
    return q, held * 1.05 + 10.0 ** rng.uniform(-0.5, 1.5, 2)


def test_strong_friction() -> None:
    """At 1 rad/s friction is up to 100 times the remaining torque. No limit is exceeded, and no problem is refused."""
    rng = np.random.default_rng(8)
    for case in range(CASES):
        q, tau_max = problem(rng)
        viscous = 10.0 ** rng.uniform(-2.0, 2.0, 2)
        followed(case, rng, q, tau_max, viscous)


def followed(case: int, rng: np.random.Generator, q: np.ndarray, tau_max: np.ndarray, viscous: np.ndarray) -> None:
    p = al.time_path(ARM, q, tau_max=tau_max, friction=viscous)
    assert p.feasible, (case, p.reason)
    t = np.concatenate([rng.uniform(0.0, p.duration, 300), p.t[:-1]])
    tau, rounding = timing.torques(CHECKER, *p(t), viscous)
    assert timing.excess(tau, tau_max, rounding) <= 1e-9


#: Waypoints, torque limits and friction for which simpler corrections do not converge. In some cases, a new tangent of the friction curve
#: undoes the reduction of a limit. In others, the error of a tangent causes a reduction. In the rest, the excess of torque moves from one
#: segment to the next.
STUCK = [
    (
        "0.8463410586492675 1.4234639384615129 0.34340582121877317 -0.7300582484555804 "
        "-0.1517849719590969 -1.0269239943612463 -0.19737931720531243 1.171231110644225",
        [4.777533012122016, 3.2420746896301167],
        [3.380287895206345, 62.086791935957436],
    ),
    (
        "0.7141725003093402 1.2609034846430247 -1.2288962912431431 -0.6292971302885688 -0.24075418382216518 -0.5592963709259248",
        [20.923989273454545, 1.2076784901052435],
        [0.05259184460659371, 37.45119138011882],
    ),
    (
        "0.7250387337217791 -0.18030571484100455 1.0672719664800718 1.4364025481859688 "
        "1.3780235354953505 -0.1951969895247303 -0.9505207206331352 0.8601405219333857",
        [28.71980143956981, 4.232906530998163],
        [0.13205473422758537, 43.48306201486851],
    ),
]


@pytest.mark.parametrize("case", range(len(STUCK)))
def test_friction_that_was_refused(case: int) -> None:
    q, tau_max, viscous = STUCK[case]
    followed(case, np.random.default_rng(case), np.array(q.split(), dtype=float).reshape(-1, 2), np.array(tau_max), np.array(viscous))


def test_torque_rate() -> None:
    """By central differences at random times, the rate of the torque is within its limit. It is zero at both ends."""
    rng = np.random.default_rng(9)
    for case in range(CASES):
        q, tau_max = problem(rng)
        rate = tau_max * 10.0 ** rng.uniform(-0.5, 3.0)
        viscous = rng.uniform(0.0, 1.0, 2) if case % 2 else None
        rub = 0.0 if viscous is None else viscous
        fast = al.time_path(ARM, q, tau_max=tau_max, friction=viscous)
        p = al.time_path(ARM, q, tau_max=tau_max, friction=viscous, torque_rate=rate)
        assert p.feasible and p.margin >= -1e-9, (case, p.reason)
        h = 1e-5 * p.duration
        t = rng.uniform(h, p.duration - h, 600)
        tau, rounding = timing.torques(CHECKER, *p(t), rub)
        assert timing.excess(tau, tau_max, rounding) <= 1e-9
        ahead, behind = (timing.torques(CHECKER, *p(t + side * h), rub)[0] for side in (1.0, -1.0))
        # A difference quotient is a mean of rates, so it is within their limit, up to rounding of torques divided by 2 h.
        assert np.all(np.abs(ahead - behind) / (2 * h) <= rate * (1 + 1e-9) + 64 * timing.EPS * np.abs(tau).max() / h)
        for end, position in ((0.0, q[0]), (p.duration * (1.0 - 1e-12), q[-1])):
            tau, _ = timing.torques(CHECKER, *(part[None] for part in p(end)), rub)
            np.testing.assert_allclose(tau[0], CHECKER.gravity(position), rtol=0.0, atol=1e-6 * tau_max.max())
        # The motion is on the path from start to end. It is slower than without the limit, unless the limit is far above the required rate.
        np.testing.assert_allclose(p(0.0)[0], q[0], rtol=0.0, atol=1e-12)
        np.testing.assert_array_equal(p(p.duration)[0], q[-1])
        assert p.duration >= fast.duration * (1 - 1e-3)


def test_a_rate_far_above_the_motion_costs_little() -> None:
    q, tau_max = [[0.0, 0.0], [0.5, 0.8], [1.2, 0.3]], np.array([20.0, 8.0])
    fast = al.time_path(ARM, q, tau_max=tau_max).duration
    slower = [al.time_path(ARM, q, tau_max=tau_max, torque_rate=rate).duration / fast for rate in (10.0, 100.0, 1e3, 1e4)]
    assert slower == sorted(slower, reverse=True)
    # A change between the torque limits takes 2 tau_max / rate. At rate 1e4 the motion is 2 % slower than
    # without this limit.
    assert slower[-1] < 1.1


def test_torque_rate_on_seven_axes() -> None:
    q = np.random.default_rng(3).uniform(-1.0, 1.0, (4, 7))
    tau_max = np.array([174.0, 174.0, 174.0, 174.0, 24.0, 24.0, 24.0])
    p = al.time_path(SEVEN, q, tau_max=tau_max, v_max=2.0, a_max=30.0, torque_rate=1000.0, check_limits=False)
    assert p.feasible and p.margin >= -1e-9
    t = np.linspace(0.0, p.duration, 4001)[:-1]
    motion = p(t)
    assert np.all(np.abs(motion[1]) <= 2.0 * (1 + 1e-9)) and np.all(np.abs(motion[2]) <= 30.0 * (1 + 1e-9))
    tau = SEVEN.inverse_dynamics(*motion)
    assert np.all(np.abs(tau) <= tau_max * (1 + 1e-9))
    assert np.all(np.abs(np.diff(tau, axis=0)) / t[1] <= 1000.0 * (1 + 1e-6))
    again = pickle.loads(pickle.dumps(p))
    assert again == p
    np.testing.assert_array_equal(again(0.3 * p.duration), p(0.3 * p.duration))


def test_options_that_torque_rate_excludes_are_refused() -> None:
    q = [[0.0, 0.0], [0.5, 0.2], [0.7, -0.3]]
    for other in ({"stops": [1]}, {"start_speed": 0.1}, {"end_speed": 0.1}):
        with pytest.raises(al.InputError, match="torque_rate is not offered here"):
            al.time_path(ARM, q, tau_max=30.0, torque_rate=100.0, **other)  # type: ignore[arg-type]
    for bad in (0.0, -1.0, np.nan, [1.0], "1"):
        with pytest.raises(al.InputError, match=r"^time_path: torque_rate "):
            al.time_path(ARM, q, tau_max=30.0, torque_rate=bad)
    # An arm that can only just hold itself at the start has no margin of torque, at any speed.
    held = float(CHECKER.gravity(np.zeros(2))[0])
    p = al.time_path(ARM, [[0.0, 0.0], [-1.0, 0.0]], tau_max=[[-200.0, held], [-50.0, 50.0]], torque_rate=1e3)
    assert p.feasible or "torque rate" in (p.reason or "")


@pytest.mark.parametrize("points", [11, 26, 51, 101, 201])
def test_kept_grids_settle(points: int) -> None:
    """With refine=False the grid is kept, and the corrections converge on it. The example is seven axes with active speed limits."""
    for seed in range(5):
        q = np.random.default_rng(seed).uniform(-1.0, 1.0, (5, 7))
        tau_max = np.array([174.0, 174.0, 174.0, 174.0, 24.0, 24.0, 24.0])
        limits: Any = {"tau_max": tau_max, "v_max": 2.0, "check_limits": False}
        p = al.time_path(SEVEN, q, knots=np.linspace(0.0, 1.0, 5), grid=points, refine=False, **limits)
        assert p.feasible, (seed, p.reason)
        assert abs(len(p.s) - points) <= 10 and p.margin >= -1e-9


def test_path_without_timing() -> None:
    p = al.time_path(ARM, [[0.0, 0.0], [0.5, 0.2], [0.7, -0.3]], tau_max=30.0)
    q, slope, bend = p.path(np.array([0.0, 0.3, 1.0]))
    np.testing.assert_array_equal(q[0], [0.0, 0.0])
    np.testing.assert_allclose(q[2], [0.7, -0.3], rtol=0.0, atol=1e-15)
    h = 1e-6
    np.testing.assert_allclose((p.path(0.3 + h)[0] - p.path(0.3 - h)[0]) / (2 * h), slope[1], rtol=0.0, atol=1e-8)
    np.testing.assert_allclose((p.path(0.3 + h)[1] - p.path(0.3 - h)[1]) / (2 * h), bend[1], rtol=0.0, atol=1e-7)
    for bad in (-0.1, 1.1, np.nan, "1"):
        with pytest.raises(al.InputError, match=r"^TimedPath.path: s "):
            p.path(bad)  # type: ignore[arg-type]
