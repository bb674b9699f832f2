"""A timing follows its active limit: between two switches the torque is continuous.

    jump of u at a grid point, both of whose neighbouring segments follow the same limit:  O(h^3) on a speed limit, O(h^2) on others

The active limit is the limit with the largest relative value in the middle of a segment. The reference computes the torques.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import armlet as al
from armlet import reference as ref

LINKS = [0.5, 0.4]
ARM, CHECKER = al.planar_arm(LINKS), ref.planar_arm(LINKS)
Q = np.array([[0.0, 0.0], [0.5, 0.8], [1.2, 0.3]])
TAU = np.array([20.0, 8.0])
# A limit is active if its relative distance in the middle of a segment is below this number.
ACTIVE = 1e-3
PROMISE = 1e-9


def used(p: al.TimedPath, t: np.ndarray, limits: dict[str, Any]) -> np.ndarray:
    """The limited quantities, relative to their limits, at the times t, (T, limits)."""
    q, v, a = p(t)
    parts = [np.abs(CHECKER.inverse_dynamics(q, v, a)) / limits["tau_max"]] if "tau_max" in limits else []
    if "v_max" in limits:
        parts.append(np.abs(v) / limits["v_max"])
    if "a_max" in limits:
        parts.append(np.abs(a) / limits["a_max"])
    if "frame" in limits:
        jacobian, change = CHECKER.jacobian(q, limits["frame"])[:, :3], CHECKER.jacobian_dot(q, v, limits["frame"])[:, :3]
        velocity = np.einsum("kij,kj->ki", jacobian, v)
        acceleration = np.einsum("kij,kj->ki", jacobian, a) + np.einsum("kij,kj->ki", change, v)
        for name, rows in (("tip_speed", velocity), ("tip_acceleration", acceleration)):
            if name in limits:
                parts.append(np.linalg.norm(rows, axis=1, keepdims=True) / limits[name])
    return np.concatenate(parts, axis=1)


def jumps(p: al.TimedPath, limits: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Torque jumps (K, n) at grid points whose four nearest segments have one active limit, and the index of this limit (K,)."""
    middles = used(p, 0.5 * (p.t[1:] + p.t[:-1]), limits)
    active = np.where(middles.max(axis=1) > 1.0 - ACTIVE, middles.argmax(axis=1), -1)
    steps = np.diff(p.s)
    near = [np.roll(active, k) for k in (2, 1, 0, -1)]
    even = np.isclose(np.roll(steps, 1), steps, rtol=1e-6)
    inner = np.arange(2, active.size - 1)
    chosen = inner[(np.ptp(np.stack(near), axis=0) == 0)[inner] & (active[inner] >= 0) & even[inner]]
    # The torques are computed 1e-8 of the duration before and after the point. In this time the motion itself hardly changes the torque.
    aside = 1e-8 * p.duration
    before, after = (CHECKER.inverse_dynamics(*p(p.t[chosen] + side * aside)) for side in (-1.0, 1.0))
    return np.abs(after - before), active[chosen]


CASES: dict[str, tuple[dict[str, Any], set[int]]] = {
    "speed": ({"tau_max": TAU, "v_max": 2.0}, {2, 3}),
    "faster": ({"tau_max": TAU, "v_max": 4.0}, {3}),
    "acceleration": ({"a_max": 4.0}, {0, 1}),
    "speed and acceleration": ({"a_max": 10.0, "v_max": 1.0}, {0, 1}),
    "tip speed": ({"tau_max": TAU, "tip_speed": 0.6, "frame": "link2"}, {2}),
    "tip acceleration": ({"tau_max": TAU, "tip_acceleration": 4.0, "frame": "link2"}, {2}),
    "both of the tip": ({"tau_max": TAU, "tip_speed": 0.6, "tip_acceleration": 4.0, "frame": "link2"}, {2, 3}),
}


@pytest.mark.parametrize("name", CASES)
def test_the_active_limit_is_followed(name: str) -> None:
    """With a torque limit of 8 N m a jump is at most 0.02 N m. Constant path acceleration on a speed limit would give 0.25 N m.

    On a limit of the tip's speed, which is small here, it would give only 0.003 N m.
    """
    limits, expected = CASES[name]
    p = al.time_path(ARM, Q, **limits)
    assert p.feasible and p.margin >= -PROMISE
    found, which = jumps(p, limits)
    assert set(which) >= expected and found.shape[0] > 20
    assert found.max() <= (1e-3 if name == "tip speed" else 0.02), (name, found.max())


ARMS = {name: al.load_urdf(al.example_urdf(name)) for name in ("six_axis", "seven_axis")} | {
    "five links": al.planar_arm([0.4, 0.3, 0.3, 0.2, 0.1]),
    "two links and a slide": al.Arm.from_chain(
        [
            {"type": "R", "axis": [0, 0, 1], "rpy": [0, 0, 0], "xyz": [0, 0, 0.3], "phi": [3.0, 0.6, 0, 0, 0.05, 0, 0, 0.2, 0, 0.2]},
            {"type": "R", "axis": [0, 1, 0], "rpy": [0, 0, 0], "xyz": [0.4, 0, 0], "phi": [2.0, 0.3, 0, 0, 0.02, 0, 0, 0.1, 0, 0.1]},
            {"type": "P", "axis": [1, 0, 0], "rpy": [0, 0, 0], "xyz": [0.3, 0, 0], "phi": [1.0, 0.1, 0, 0, 0.01, 0, 0, 0.02, 0, 0.02]},
        ]
    ),
}


@pytest.mark.parametrize("name", ARMS)
def test_torque_on_a_speed_limit_of_other_arms(name: str) -> None:
    """On the speed limit of one joint, the torque has small jumps at grid points, relative to the largest torque of the motion.

    If the four nearest segments are within 5e-6 of the limit, a jump is at most 1e-3. Near a switch the speed approaches the limit over
    some segments. If the segments are only within 1e-3 of the limit, 3 % of the jumps may exceed 5e-3.
    """
    arm = ARMS[name]
    for seed in range(3):
        q = np.random.default_rng([24, seed]).uniform(-0.6, 0.6, (4, arm.n)) - (1.0 if name == "seven_axis" else 0.0)
        path = al.time_path(arm, q, v_max=1.0, a_max=20.0, check_limits=False)
        held = np.abs(arm.gravity(path.path(np.linspace(0.0, 1.0, 300))[0])).max()
        p = al.time_path(arm, q, tau_max=1.2 * held + 5.0, v_max=1.0, check_limits=False)
        assert p.feasible and p.margin >= -PROMISE, p.reason
        share = np.abs(p(0.5 * (p.t[1:] + p.t[:-1]))[1])
        largest = np.abs(arm.inverse_dynamics(*p(np.linspace(0.0, p.duration, 500)))).max()
        for near, most, apart in ((5e-6, 1e-3, 0.0), (1e-3, 5e-3, 0.03)):
            active = np.where(share.max(axis=1) > 1.0 - near, share.argmax(axis=1), -1)
            steps = np.diff(p.s)
            even = np.isclose(np.roll(steps, 1), steps, rtol=1e-6)
            about = np.stack([np.roll(active, k) for k in (2, 1, 0, -1)])
            inner = np.arange(2, active.size - 1)
            at = p.t[inner[(np.ptp(about, axis=0) == 0)[inner] & (active[inner] >= 0) & even[inner]]]
            before, after = (arm.inverse_dynamics(*p(at + side * 1e-8 * p.duration)) for side in (-1.0, 1.0))
            jump = np.abs(after - before).max(axis=1) / largest
            assert at.size > 100 and np.mean(jump > most) <= apart, (name, seed, near, np.sort(jump)[-5:])


def test_speed_limits_that_vary() -> None:
    """On a speed limit that is linear between waypoints, the torque has only small jumps, as on a constant limit."""
    limits = {"tau_max": TAU, "v_max": np.array([[4.0, 4.0], [2.0, 2.0], [0.5, 0.5]])}
    p = al.time_path(ARM, Q, **limits)
    knots = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(Q, axis=0), axis=1))])
    middle = 0.5 * (p.s[1:] + p.s[:-1])
    # The middle in s is the middle in time, up to the change of speed in a segment.
    here = np.stack([np.interp(middle, knots / knots[-1], column) for column in limits["v_max"].T], axis=1)
    share = np.abs(p(0.5 * (p.t[1:] + p.t[:-1]))[1] / here).max(axis=1)
    inner = np.arange(2, share.size - 1)
    on = np.stack([np.roll(share, k) for k in (2, 1, 0, -1)])[:, inner].min(axis=0) > 1.0 - ACTIVE
    at = p.t[inner[on]]
    before, after = (CHECKER.inverse_dynamics(*p(at + side * 1e-8 * p.duration)) for side in (-1.0, 1.0))
    # The jumps may include one at a switch between joints.
    assert at.size > 50 and np.sort(np.abs(after - before).max(axis=1))[-10] <= 0.02


def test_the_grid_and_the_jumps() -> None:
    """Half the step reduces the jump on a smooth speed limit to an eighth, and does not increase the duration."""
    largest, durations = [], []
    for grid in (201, 401):
        p = al.time_path(ARM, Q, tau_max=TAU, v_max=2.0, grid=grid, refine=False)
        found, which = jumps(p, {"tau_max": TAU, "v_max": 2.0})
        largest.append(np.median(found[which == 3].max(axis=1)))
        durations.append(p.duration)
    # With constant path acceleration the factor would be one half.
    assert largest[1] <= 0.25 * largest[0], largest
    assert durations[1] <= durations[0]
