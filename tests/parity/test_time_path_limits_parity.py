"""No limit of `time_path` is exceeded between grid points, checked by the reference on random trees in space.

    used = |tau| / tau_max,  |v| / v_max,  |a| / a_max,  |velocity of the origin| / tip_speed,  |its acceleration| / tip_acceleration
    used <= 1 + 1e-9 at random times and near every grid point;  q within q_min and q_max

The reference computes torques from its energies, and the motion of the frame's origin from its Jacobian. Limits that vary along the path
are linear in the path position s, which the test finds from the joint positions.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest
from trees import driven_tree

import armlet as al
from armlet.reference import timing

CASES = int(os.environ.get("ARMLET_CASES", "7"))
PROMISE = 1e-9
#: Times in each segment of the grid, as a part of its duration: the start and points near both ends.
BESIDE = np.array([0.0, 1e-6, 1e-3, 0.03, 0.25, 0.5, 0.75, 0.97, 0.999])
KINDS = ("tau_max", "v_max", "a_max", "tip_speed", "tip_acceleration")


def places(p: al.TimedPath, t: np.ndarray) -> np.ndarray:
    """Return path positions s at the times t, by Gauss-Newton steps within the grid segment of each time."""
    i = np.clip(np.searchsorted(p.t, t, side="right") - 1, 0, p.t.size - 2)
    low, high, q = p.s[i], p.s[i + 1], p(t)[0]
    s = low + (high - low) * (t - p.t[i]) / (p.t[i + 1] - p.t[i])
    for _ in range(8):
        at, slope, _ = p.path(s)
        s = np.clip(s + np.sum(slope * (q - at), axis=1) / np.sum(slope * slope, axis=1), low, high)
    assert np.abs(p.path(s)[0] - q).max() < 1e-14
    return np.asarray(s)


def problem(theirs: Any, rng: np.random.Generator, low: str | None) -> tuple[np.ndarray, dict[str, Any]]:
    """Return waypoints and all limits.

    The limit with the name `low` is about 1000 times tighter than the others. Some limits vary along the path. The torques can hold the
    arm.
    """
    n = theirs.n
    q = rng.uniform(-0.4, 0.4, (rng.integers(2, 6), n))
    along = timing.cubic_spline(timing.positions(q), q)(np.linspace(0.0, 1.0, 400))[0]
    held = np.abs(theirs.gravity(along)).max(axis=0)
    limits: dict[str, Any] = {"tau_max": held * 1.1 + 10.0 ** rng.uniform(-0.5, 1.5, n), "v_max": 10.0 ** rng.uniform(-1.0, 0.0, n)}
    limits["a_max"] = 10.0 ** rng.uniform(-0.5, 0.5, n)
    limits["tip_speed"], limits["tip_acceleration"] = 10.0 ** rng.uniform([-2.5, -2.5], [-1.5, -1.5])
    for name in KINDS:
        limits[name] = limits[name] * (1000.0 if low not in (None, name) else 1.0)
        if rng.random() < 0.4:
            spread = rng.uniform(1.0, 2.0, (q.shape[0], *np.shape(limits[name])))
            # For two joints, one row per waypoint looks like pairs of lower and upper limits. So tau_max stays constant.
            limits[name] = limits[name] * spread if name != "tau_max" or n != 2 else limits[name]
    return q, limits | {"q_min": along.min(axis=0) - 0.01, "q_max": along.max(axis=0) + 0.01}


def tip_of(arm: al.Arm, q: np.ndarray) -> str:
    """Return the frame whose origin moves most with the joints at the first waypoint."""
    return max(arm.frame_names, key=lambda frame: float(np.linalg.norm(arm.jacobian(q[0], frame)[:3])))


def shares(theirs: Any, p: al.TimedPath, t: np.ndarray, knots: np.ndarray, limits: dict[str, Any]) -> dict[str, np.ndarray]:
    """Return the used part of each limit at the times t, (T,) or (T, n), reduced by the reference's rounding."""
    q, v, a = p(t)
    s = places(p, t)
    J, change = theirs.jacobian(q, limits["frame"])[:, :3], theirs.jacobian_dot(q, v, limits["frame"])[:, :3]
    tau, rounding = timing.torques(theirs, q, v, a)
    motion = {
        "tau_max": np.abs(tau) - rounding,
        "v_max": np.abs(v),
        "a_max": np.abs(a),
        "tip_speed": np.linalg.norm(np.einsum("kij,kj->ki", J, v), axis=1),
        "tip_acceleration": np.linalg.norm(np.einsum("kij,kj->ki", J, a) + np.einsum("kij,kj->ki", change, v), axis=1),
    }
    used = {}
    for name, value in motion.items():
        limit, size = np.asarray(limits[name], dtype=float), value.ndim - 1
        if limit.ndim > size:
            columns = limit.reshape(knots.size, -1)
            limit = np.stack([np.interp(s, knots, column) for column in columns.T], axis=1)
            limit = limit if size else limit[:, 0]
        used[name] = value / limit
    return used


@pytest.mark.slow
@pytest.mark.parametrize("n", [2, 3, 6])
def test_no_limit_is_exceeded_between_grid_points(n: int) -> None:
    active: dict[str, float] = dict.fromkeys(KINDS, 0.0)
    for seed in range(CASES):
        arm, theirs = driven_tree(n, seed)
        rng = np.random.default_rng([24, n, seed])
        q, limits = problem(theirs, rng, KINDS[seed] if seed < len(KINDS) else None)
        limits["frame"] = tip_of(arm, q)
        p = al.time_path(arm, q, **limits)
        assert p.feasible and p.margin >= -PROMISE, (n, seed, p.reason)
        grid = (p.t[:-1, None] + np.diff(p.t)[:, None] * BESIDE).ravel()
        t = np.concatenate([rng.uniform(0.0, p.duration, 250), rng.choice(grid, 750)])
        used = shares(theirs, p, t, timing.positions(q), limits)
        for name, share in used.items():
            # 1e-10 covers the rate of a varying limit times the error of s, and the rounding of Jacobians.
            assert share.max() <= 1.0 + PROMISE + 1e-10, (n, seed, name, share.max() - 1.0)
            active[name] = max(active[name], float(share.max()))
        at = p(t)[0]
        assert np.all(at >= limits["q_min"]) and np.all(at <= limits["q_max"])
    # Each kind of limit is reached in some problem.
    assert CASES < len(KINDS) or min(active.values()) > 0.99, active


@pytest.mark.slow
def test_the_judge_sees_a_motion_that_is_too_fast() -> None:
    """The check detects a violation: against a limit that is lower by 1e-6, each timing exceeds it."""
    arm, theirs = driven_tree(6, 0)
    q, limits = problem(theirs, np.random.default_rng([24, 6, 0]), None)
    frame = tip_of(arm, q)
    for name in KINDS:
        alone: dict[str, Any] = {"a_max": np.full(6, 1e4)} | {name: limits[name]} | ({"frame": frame} if name.startswith("tip") else {})
        p = al.time_path(arm, q, **alone, check_limits=False)
        assert p.feasible, (name, p.reason)
        t = np.concatenate([np.linspace(0.0, p.duration, 801), p.t])[:-1]
        lower = limits | {name: np.asarray(limits[name]) * (1.0 - 1e-6), "frame": frame}
        assert shares(theirs, p, t, timing.positions(q), lower)[name].max() > 1.0 + PROMISE, name
