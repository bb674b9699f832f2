"""Limits of a frame's origin, limits that vary along the path, and position limits of `time_path`.

    one link of length L, |tip acceleration| <= A:   theta'' = 1/2 d(theta'^2)/dtheta,   L^2 (theta''^2 + theta'^4) = A^2
    theta'^2 = A/L sin 2 theta up to theta = pi/4, then theta'^2 = A/L;   T = B(1/4, 1/2)/2 sqrt(L/A) + (angle - pi/2) sqrt(L/A)

`B` is the beta function, and a prime is a derivative with respect to theta or time.

The checks compute velocity and acceleration of the origin from the reference's Jacobians, by complex steps, and by differences of
positions.
"""

from __future__ import annotations

import math
import os
import pickle
from typing import Any

import models
import numpy as np
import pytest

import armlet as al
from armlet import reference as ref
from armlet.reference import timing

CASES = int(os.environ.get("ARMLET_CASES", "12"))
LINKS = [0.5, 0.4, 0.2]
ARM, CHECKER = al.planar_arm(LINKS), ref.planar_arm(LINKS)
PROMISE = 1e-9


def problem(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Random waypoints, and torque limits that can hold the arm along the whole path with a margin."""
    q = rng.uniform(-1.5, 1.5, (rng.integers(2, 6), 3))
    path = timing.cubic_spline(timing.positions(q), q)
    held = np.abs(CHECKER.gravity(path(np.linspace(0.0, 1.0, 400))[0])).max(axis=0)
    return q, held * 1.05 + 10.0 ** rng.uniform(-0.5, 1.5, 3)


def origin(p: al.TimedPath, t: np.ndarray, frame: str) -> tuple[np.ndarray, np.ndarray]:
    """Velocity and acceleration (T, 3) of the frame's origin."""
    q, v, a = p(t)
    jacobian, change = CHECKER.jacobian(q, frame)[:, :3], CHECKER.jacobian_dot(q, v, frame)[:, :3]
    return np.einsum("kij,kj->ki", jacobian, v), np.einsum("kij,kj->ki", jacobian, a) + np.einsum("kij,kj->ki", change, v)


@pytest.mark.slow
def test_random_paths_keep_to_the_limits_of_a_frame() -> None:
    """The limits are respected at random times and near grid points."""
    rng = np.random.default_rng(24)
    active = []
    for case in range(CASES):
        q, tau_max = problem(rng)
        frame = f"link{rng.integers(1, 4)}"
        limits: dict[str, Any] = {"tip_speed": 10.0 ** rng.uniform(-1.5, 1.0), "tip_acceleration": 10.0 ** rng.uniform(-1.5, 1.5)}
        if case % 3 < 2:
            del limits[("tip_speed", "tip_acceleration")[case % 3]]
        friction = rng.uniform(0.0, 1.0, 3) if case % 4 == 3 else None
        p = al.time_path(ARM, q, tau_max=tau_max, friction=friction, frame=frame, **limits)
        assert p.feasible and p.margin >= -PROMISE, (case, p.reason)
        beside = np.array([0.0, 1e-3, 0.02, 0.5, 0.98, 0.999])
        t = np.concatenate([rng.uniform(0.0, p.duration, 500), (p.t[:-1, None] + np.diff(p.t)[:, None] * beside).ravel()])
        velocity, acceleration = origin(p, t, frame)
        used = [np.linalg.norm(velocity, axis=1) / limits.get("tip_speed", np.inf)]
        used.append(np.linalg.norm(acceleration, axis=1) / limits.get("tip_acceleration", np.inf))
        assert max(part.max() for part in used) <= 1.0 + PROMISE, case
        tau, rounding = timing.torques(CHECKER, *p(t), 0.0 if friction is None else friction)
        assert timing.excess(tau, tau_max, rounding) <= PROMISE, case
        active.append(np.mean(np.maximum(np.max(used, axis=0), np.abs(tau / tau_max).max(axis=1)) > 0.98))
    # The fastest timing has an active limit nearly everywhere.
    assert np.median(active) > 0.95


def test_differences_of_positions() -> None:
    """Speed and acceleration of the tip are computed by differences of positions only."""
    q = [[0.0, 0.3, 0.2], [0.9, -0.4, 0.5], [0.2, 0.8, -0.6]]
    p = al.time_path(ARM, q, tau_max=[60.0, 30.0, 10.0], tip_speed=0.5, tip_acceleration=2.0, frame="link3")
    t, h = np.linspace(0.01, 0.99, 3001) * p.duration, 1e-4
    behind, here, ahead = (CHECKER.position(p(t + k * h)[0], "link3") for k in (-1.0, 0.0, 1.0))
    speed = np.linalg.norm(ahead - behind, axis=1) / (2 * h)
    acceleration = np.linalg.norm(ahead - 2 * here + behind, axis=1) / h**2
    # The second differences divide rounding errors of positions, about 1e-16 m, by 1e-8 s^2.
    assert speed.max() <= 0.5 * (1 + 1e-6) and acceleration.max() <= 2.0 * (1 + 1e-6)
    assert speed.max() > 0.499 and acceleration.max() > 1.99


def test_a_link_on_its_circle() -> None:
    """The minimum time equals its closed form, up to the error of the grid."""
    length, most = 0.7, 3.0
    arm = al.planar_arm([length], gravity=(0.0, 0.0))
    beta = math.gamma(0.25) * math.gamma(0.5) / math.gamma(0.75)
    for angle in (0.6 * math.pi, 1.2 * math.pi):
        p = al.time_path(arm, [[0.0], [angle]], tip_acceleration=most, frame="link1")
        least = math.sqrt(length / most) * (0.5 * beta + angle - math.pi / 2)
        assert p.feasible and p.duration == pytest.approx(least, rel=2e-4)
        # The largest speed is the one at which the centripetal acceleration alone reaches its limit.
        assert p.s_dot.max() * angle == pytest.approx(math.sqrt(most / length), rel=1e-5)


def test_a_slide() -> None:
    """The origin of a prismatic joint moves like its joint: bang-bang, and a trapezoid under a speed limit."""
    arm = al.Arm.from_chain([{"type": "P", "axis": [1, 2, 2], "rpy": [0, 0, 0], "xyz": [0, 0, 0], "phi": [1.0] + [0.0] * 9}])
    p = al.time_path(arm, [[0.0], [2.0]], tip_acceleration=2.0, frame="link1")
    assert p.duration == pytest.approx(2.0, rel=1e-9)
    p = al.time_path(arm, [[0.0], [2.0]], tip_acceleration=2.0, tip_speed=0.5, frame="link1")
    assert p.duration == pytest.approx(2.0 / 0.5 + 0.5 / 2.0, rel=1e-4)


def test_a_joint_limit_and_the_same_limit_of_the_tip() -> None:
    """For one link |tip speed| = L |v|, so both limits give the same time."""
    arm = al.planar_arm([0.5])
    q = [[0.0], [1.0], [0.2]]
    joint = al.time_path(arm, q, tau_max=10.0, v_max=1.2)
    tip = al.time_path(arm, q, tau_max=10.0, tip_speed=0.6, frame="link1")
    assert tip.duration == pytest.approx(joint.duration, rel=2e-4)


def test_limits_that_vary_along_the_path() -> None:
    """Limits are linear between waypoints. Repeated waypoints have the smallest of their limits."""
    rng = np.random.default_rng(25)
    for case in range(CASES):
        q, tau_max = problem(rng)
        count = q.shape[0]
        spread = rng.uniform(1.0, 3.0, (3, count, 3))
        tau, v_max, a_max = tau_max * spread[0], 2.0 * spread[1], 20.0 * spread[2]
        p = al.time_path(ARM, q, tau_max=tau, v_max=v_max, a_max=a_max)
        assert p.feasible and p.margin >= -PROMISE, (case, p.reason)
        t = rng.uniform(0.0, p.duration, 800)
        motion = p(t)
        # The path position s at each time follows from the joint positions.
        s = positions_at(p, t)
        knots = timing.positions(q)
        at = [np.stack([np.interp(s, knots, column) for column in limit.T], axis=1) for limit in (tau, v_max, a_max)]
        torque, rounding = timing.torques(CHECKER, *motion)
        assert np.max((np.abs(torque) - rounding) / at[0]) <= 1.0 + 1e-8
        assert np.max(np.abs(motion[1]) / at[1]) <= 1.0 + 1e-8 and np.max(np.abs(motion[2]) / at[2]) <= 1.0 + 1e-8
    same = al.time_path(ARM, q, tau_max=tau, v_max=v_max, a_max=a_max)
    twice = al.time_path(
        ARM, np.repeat(q, 2, axis=0), tau_max=np.repeat(tau, 2, axis=0), v_max=np.repeat(v_max, 2, axis=0), a_max=a_max[0] * 1e6
    )
    assert twice.duration <= same.duration * (1 + 1e-4)


def positions_at(p: al.TimedPath, t: np.ndarray) -> np.ndarray:
    """Path positions s at the times t, in five rounds: 65 points of the path, then a finer interval around the nearest one."""
    low, high = np.zeros_like(t), np.ones_like(t)
    i = np.clip(np.searchsorted(p.t, t, side="right") - 1, 0, p.t.size - 2)
    low, high = p.s[i], p.s[i + 1]
    q = p(t)[0]
    inner = np.linspace(0.0, 1.0, 65)
    for _ in range(5):
        places = low[:, None] + inner * (high - low)[:, None]
        nearest = np.abs(p.path(places)[0] - q[:, None, :]).max(axis=2).argmin(axis=1)
        row = np.arange(t.size)
        low, high = places[row, np.maximum(nearest - 1, 0)], places[row, np.minimum(nearest + 1, 64)]
    return 0.5 * (low + high)


def test_constant_limits_in_every_form() -> None:
    """A limit as a number, as values at every waypoint, and as a function of s gives the same minimum time."""
    q = np.array([[0.0, 0.3, 0.2], [0.9, -0.4, 0.5], [0.2, 0.8, -0.6], [0.0, 0.0, 0.0]])
    tau_max, v_max = np.array([60.0, 30.0, 10.0]), np.array([2.0, 1.5, 3.0])
    plain = al.time_path(ARM, q, tau_max=tau_max, v_max=v_max)
    for tau, v in ((np.tile(tau_max, (4, 1)), np.tile(v_max, (4, 1))), (lambda s: tau_max, lambda s: v_max)):
        assert al.time_path(ARM, q, tau_max=tau, v_max=v).duration == pytest.approx(plain.duration, rel=2e-4)


def test_torque_rate_with_all_limits() -> None:
    rng = np.random.default_rng(26)
    q = [[0.0, 0.3, 0.2], [0.9, -0.4, 0.5], [0.2, 0.8, -0.6]]
    v_max = np.array([[2.0, 2.0, 2.0], [1.0, 2.0, 3.0], [2.0, 1.0, 1.0]])
    limits: dict[str, Any] = {"tip_speed": 0.8, "tip_acceleration": 4.0, "frame": "link3"}
    p = al.time_path(ARM, q, tau_max=[60.0, 30.0, 10.0], v_max=v_max, torque_rate=400.0, **limits)
    assert p.feasible and p.margin >= -PROMISE
    t = rng.uniform(0.0, p.duration, 2000)
    velocity, acceleration = origin(p, t, "link3")
    assert np.linalg.norm(velocity, axis=1).max() <= 0.8 * (1 + PROMISE)
    assert np.linalg.norm(acceleration, axis=1).max() <= 4.0 * (1 + PROMISE)
    low = np.stack([np.interp(positions_at(p, t), timing.positions(q), column) for column in v_max.T], axis=1)
    assert np.max(np.abs(p(t)[1]) / low) <= 1.0 + 1e-8


def test_position_limits_between_waypoints() -> None:
    """The waypoints are within the limits, the spline is not.

    The reported position is the extremum. Dense samples miss it slightly.
    """
    rng = np.random.default_rng(27)
    refused = 0
    for _ in range(200):
        q = rng.uniform(-1.0, 1.0, (rng.integers(2, 6), 2))
        arm = models.TWO_LINKS
        at = timing.cubic_spline(timing.positions(q), q)
        s = np.linspace(0.0, 1.0, 20001)
        values = at(s)[0]
        lower, upper = q.min(axis=0) - 1e-9, q.max(axis=0) + 1e-9
        over = np.concatenate([values - upper, lower - values], axis=1).max(axis=0)
        p = al.time_path(arm, q, a_max=1.0, q_min=lower, q_max=upper)
        assert p.feasible is bool(over.max() <= 0.0)
        if not p.feasible:
            refused += 1
            why = p.shortfall
            assert why is not None and why["missing_units"] == pytest.approx(over.max(), abs=1e-7)
            assert why["limit"] == ("q_max" if over.argmax() < 2 else "q_min") and why["joint"] == over.argmax() % 2
            assert abs(
                at(np.array([why["s"]]))[0][0, why["joint"]] - (lower, upper)[why["limit"] == "q_max"][why["joint"]]
            ) == pytest.approx(over.max(), abs=1e-7)
        wider = al.time_path(arm, q, a_max=1.0, q_min=lower - max(over.max(), 0.0) - 1e-6, q_max=upper + max(over.max(), 0.0) + 1e-6)
        assert wider.feasible
    assert refused > 50


def test_position_limits_of_quintic_pieces() -> None:
    """A callable path with derivatives: the extrema are those of polynomials of degree five."""
    arm = models.TWO_LINKS

    def whole(s: float) -> Any:
        w = 9.0
        return [np.sin(w * s), s], [w * np.cos(w * s), 1.0], [-(w**2) * np.sin(w * s), 0.0]

    for most, feasible in ((1.0 + 1e-6, True), (1.0 - 1e-6, False)):
        p = al.time_path(arm, whole, a_max=1.0, q_max=[most, np.inf], samples=23)
        assert p.feasible is feasible


def test_a_path_on_its_limit() -> None:
    """A joint that is constant at its limit, or that starts and ends there, is within it."""
    arm = models.TWO_LINKS
    assert al.time_path(arm, [[0.1, 0.2], [0.1, 0.9]], a_max=1.0, q_min=[0.1, 0.2], q_max=[0.1, 0.9]).feasible
    assert not al.time_path(arm, [[0.1, 0.2], [0.1, 0.9]], a_max=1.0, q_max=[0.1, 0.9 - 1e-9]).feasible


def test_pickles_of_refusals() -> None:
    arm = models.TWO_LINKS
    for keywords in ({"q_max": 0.1}, {"tip_speed": 1.0, "frame": "link2", "start_speed": 9.0}):
        p = al.time_path(arm, [[0.0, 0.0], [0.5, 0.5]], tau_max=30.0, **keywords)  # type: ignore[arg-type]
        other = pickle.loads(pickle.dumps(p))
        assert not p.feasible and other.shortfall == p.shortfall and other.reason == p.reason
