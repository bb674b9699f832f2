"""Random paths under limits, checked by `reference.timing`, which is independent of the planner.

No limit is exceeded at any time, the motion is on the path, no feasible problem is refused, and every number is finite.
`ARMLET_CASES=n` runs n problems per stratum.
"""

from __future__ import annotations

import os
from typing import Any

import models
import numpy as np
import pytest

import armlet as al
from armlet import reference as ref
from armlet.reference import timing

CASES = int(os.environ.get("ARMLET_CASES", "20"))
# Largest relative excess of a limit. The check adds rounding.
PROMISE = 1e-9


def sliding(gravity: float) -> tuple[al.Arm, Any]:
    """A prismatic, a revolute and a prismatic joint, with products of inertia."""
    joints = []
    for kind, axis, xyz in (("P", (0, 1, 1), (0, 0, 0)), ("R", (0, 0, 1), (0.3, 0, 0.1)), ("P", (1, 0, 0), (0.2, 0.1, 0))):
        phi = np.array([2.0, 0.1, 0.2, -0.1, 0.4, 0.02, 0.5, 0.01, -0.03, 0.6])
        joints.append({"type": kind, "axis": np.array(axis) / np.linalg.norm(axis), "xyz": xyz, "rpy": (0.1, 0.2, 0.3), "phi": phi})
    g = (0.0, 0.0, -gravity)
    return al.Arm.from_chain(joints, gravity=g), ref.Arm.from_chain(joints, gravity=g)


def arms(gravity: float) -> list[tuple[al.Arm, Any]]:
    g = (0.0, -gravity)
    planar = [(al.planar_arm(links, gravity=g), ref.planar_arm(links, gravity=g)) for links in ([0.5], [0.5, 0.4], [0.5, 0.4, 0.2])]
    return [*planar, sliding(gravity), (models.PR, models.REFERENCE_PR)]


LIGHT, HEAVY = arms(0.0), arms(9.81)


def static(arm: Any, path: Any) -> np.ndarray:
    """Largest static torque along the path, (n,)."""
    return np.abs(arm.gravity(path(np.linspace(0.0, 1.0, 400))[0])).max(axis=0)


def judge(arm: Any, p: al.TimedPath, spline: Any, limits: dict[str, Any], rng: Any, viscous: Any = 0.0) -> None:
    """Check at random times and at grid times that the motion is on the path and within the limits."""
    assert np.isfinite(p.duration) and p.duration > 0.0 and p.reason is None and p.shortfall is None
    assert p.margin >= -PROMISE
    t = np.concatenate([rng.uniform(0.0, p.duration, 300), rng.choice(p.t, 60), [0.0, p.duration]])
    q, v, a = p(t)
    for values in (q, v, a, p.s_dot, p.t):
        assert np.isfinite(values).all()
    inside = t < p.duration  # at the end of a motion that stops, the acceleration is zero
    t, q, v, a = t[inside], q[inside], v[inside], a[inside]
    if limits.get("tau_max") is not None:
        tau, rounding = timing.torques(arm, q, v, a, viscous)
        assert timing.excess(tau, limits["tau_max"], rounding) <= PROMISE
    # Speeds and accelerations exceed their limits by at most the relative tolerance of the planner.
    for name, values in (("v_max", v), ("a_max", a)):
        if limits.get(name) is not None:
            assert timing.excess(values, limits[name]) <= PROMISE, name
    # v and a are derivatives of q. s(t) is found again from q, in the middle of grid segments.
    middle = 0.5 * (p.t[1:] + p.t[:-1])
    q, v, a = p(middle)
    size = np.abs(q - q[0]).max() + np.abs(q[0]).max() * 1e-15
    low, high = p.s[:-1].copy(), p.s[1:].copy()
    h = 1e-3 * np.diff(p.t)
    later, sooner = p(middle + h), p(middle - h)
    # Central differences err by h^2 times the third derivative, which is small on this grid, plus rounding of q divided by h.
    speed = np.abs(v).max()
    least = 1e-5 * speed + 1e-15 * np.abs(q).max() / h.min()
    np.testing.assert_allclose((later[0] - sooner[0]) / (2 * h[:, None]), v, rtol=0.0, atol=least)
    # The motion is on the path: the spline passes through each of its points at some s within the segment.
    for _ in range(60):
        s = 0.5 * (low + high)
        ahead = ((q - spline(s)[0]) * spline(s)[1]).sum(axis=1) > 0.0
        low, high = np.where(ahead, s, low), np.where(ahead, high, s)
    np.testing.assert_allclose(spline(0.5 * (low + high))[0], q, rtol=0.0, atol=1e-9 * size + 1e-15 * np.abs(q).max())


def problem(stratum: str, rng: np.random.Generator) -> tuple[Any, Any, np.ndarray, dict[str, Any]]:
    """A random feasible problem: arm, its reference, waypoints, keyword arguments."""
    light = stratum in ("tiny", "limits", "end speed", "idle") or rng.random() < 0.5
    arm, checker = (LIGHT if light else HEAVY)[rng.integers(5)]
    n = arm.n
    q = rng.uniform(-1.5, 1.5, (rng.integers(2, 6), n))
    if stratum == "tiny":
        q = (q - q[0]) * 10.0 ** rng.uniform(-16.0, -6.0) + (rng.uniform(-1.0, 1.0, n) if rng.random() < 0.3 else 0.0)
        if np.unique(q, axis=0).shape[0] < q.shape[0]:  # rounding made two waypoints equal
            q = q - q[0] + rng.uniform(-1e-9, 1e-9, q.shape)
    if stratum == "idle":
        q[:, rng.random(n) < 0.5] = 0.3
        q[:, rng.integers(n)] = np.cumsum(rng.uniform(0.1, 1.0, q.shape[0]))
    if stratum == "repeated":
        q = np.repeat(q, rng.integers(1, 4, q.shape[0]), axis=0)
    if stratum == "reversed":
        q = np.concatenate([q, q[-2::-1]])
    keep = np.concatenate([[True], np.any(np.diff(q, axis=0) != 0.0, axis=1)])
    spline = timing.cubic_spline(timing.positions(q[keep]), q[keep])
    span = 10.0 ** rng.uniform(-3.0, 8.0, n) if stratum == "limits" else rng.uniform(1.0, 30.0, n)
    limits: dict[str, Any] = {"tau_max": static(checker, spline) * 1.05 + span}
    if rng.random() < 0.5 and stratum != "start on a limit":
        limits["tau_max"] = np.stack([-limits["tau_max"], limits["tau_max"] * rng.uniform(1.0, 3.0, n)], axis=1)
    if rng.random() < 0.5 or stratum == "end speed":
        limits["v_max"] = rng.uniform(0.5, 5.0, n)
    if rng.random() < 0.3:
        limits["a_max"] = rng.uniform(1.0, 20.0, n)
    if stratum == "end speed":
        # The end speed is on the speed limit. Torque and acceleration limits do not bind.
        limits["tau_max"] = 1e6
        limits.pop("a_max", None)
        slope = np.abs(spline(np.array([1.0]))[1][0])
        limits["end_speed"] = float(np.min(limits["v_max"][slope > 0] / slope[slope > 0]))
    return arm, checker, q, limits


@pytest.mark.slow
@pytest.mark.parametrize("stratum", ["nominal", "tiny", "limits", "repeated", "reversed", "end speed", "idle"])
def test_random_paths(stratum: str, capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(sum(map(ord, stratum)))
    worst = np.inf
    for case in range(CASES):
        arm, checker, q, limits = problem(stratum, rng)
        p = al.time_path(arm, q, **limits)
        assert p.feasible, (stratum, case, p.reason)
        keep = np.concatenate([[True], np.any(np.diff(q, axis=0) != 0.0, axis=1)])
        spline = timing.cubic_spline(timing.positions(q[keep]), q[keep])
        judge(checker, p, spline, limits, rng)
        worst = min(worst, p.margin)
    with capsys.disabled():
        print(f"  time_path, {stratum}: {CASES} problems, smallest margin {worst:.1e}")


@pytest.mark.parametrize("points", [17, 33, 101, 401])
def test_end_on_the_limit_of_speed_on_a_kept_grid(points: int) -> None:
    """The bound of the path speed at the end cannot be reduced, only the bound before it. The corrections must converge nevertheless."""
    rng = np.random.default_rng(4)
    arm, checker = LIGHT[1]
    for _ in range(5):
        q = rng.uniform(-1.5, 1.5, (3, 2))
        spline = timing.cubic_spline(timing.positions(q), q)
        v_max = rng.uniform(0.5, 5.0, 2)
        limits = {"tau_max": 1e6, "v_max": v_max, "end_speed": float(np.min(v_max / np.abs(spline(np.array([1.0]))[1][0])))}
        p = al.time_path(arm, q, grid=points, refine=False, **limits)
        assert p.feasible, p.reason
        judge(checker, p, spline, limits, rng)


def beyond(p: al.TimedPath, checker: Any, tau_max: np.ndarray, viscous: Any = 0.0) -> float:
    """The largest relative excess of a torque at 100 points of every segment."""
    t = (p.t[:-1, None] + np.linspace(0.0, 1.0, 101)[:-1] * np.diff(p.t)[:, None]).ravel()
    tau, rounding = timing.torques(checker, *p(t), viscous)
    return timing.excess(tau, tau_max, rounding)


def test_peaks_near_grid_points_are_detected() -> None:
    """Two difficult torques near grid points.

    One has its maximum 1 % of a segment before its end, where its curvature is large. The other has friction proportional to the square
    root of the path position, which a parabola cannot approximate near rest.
    """
    q = [[0.9757989668849767, -0.5212380160511579], [-0.1424320173030642, -0.23717237432761573]]
    q.append([-0.03958529599572769, -0.7344661477294436])
    tau_max = np.array([0.1028888, 0.09024266])
    p = al.time_path(LIGHT[1][0], q, tau_max=tau_max, a_max=[7.57082471, 19.07995545], grid=38)
    assert beyond(p, LIGHT[1][1], tau_max) <= PROMISE
    q = [[-0.17655546067289318, 1.4299170821125435], [0.49057980868167084, 0.5803432356378773], [0.9625158427144491, 0.6757962988121378]]
    q.append([0.6632619608486721, -0.7178525424443779])
    tau_max, viscous = np.array([24.56718292, 18.61178312]), np.array([0.00255016, 0.23173754])
    p = al.time_path(LIGHT[4][0], q, tau_max=tau_max, v_max=[1.13537159, 1.91589197], friction=viscous, grid=25)
    assert beyond(p, LIGHT[4][1], tau_max, viscous) <= PROMISE


def test_start_on_a_limit() -> None:
    """At the start the first joint of a horizontal arm can just hold it, and moves down.

    In a second case an idle joint is always at its limit.
    """
    arm, checker = models.TWO_LINKS, models.REFERENCE_TWO_LINKS
    rng = np.random.default_rng(5)
    held = float(checker.gravity(np.array([0.0, 0.0]))[0])
    for _ in range(CASES):
        q = np.array([[0.0, 0.0], [-rng.uniform(0.1, 1.5), 0.0]])
        limits = {"tau_max": np.array([[-200.0, held], [-50.0, 50.0]])}
        p = al.time_path(arm, q, **limits)
        assert p.feasible, p.reason
        judge(checker, p, timing.cubic_spline([0.0, 1.0], q), limits, rng)
    slide = [{"type": "P", "axis": (0, 0, 1), "phi": [2.0] + [0.0] * 9}, {"type": "P", "axis": (1, 0, 0), "phi": [1.0] + [0.0] * 9}]
    arm, checker = al.Arm.from_chain(slide), ref.Arm.from_chain(slide)
    p = al.time_path(arm, [[0.0, 0.0], [0.0, 1.0]], tau_max=[3.0 * 9.81, 4.0])
    # A mass of 1 kg moves 1 m with 4 m/s^2: T = 2 sqrt(d/a).
    assert p.feasible and p.duration == pytest.approx(1.0, rel=1e-9)


def test_friction() -> None:
    """The torque limits include mild viscous friction. Strong friction is in test_time_path_options.py."""
    rng = np.random.default_rng(6)
    for arm, checker in HEAVY[1:4]:
        for _ in range(max(1, CASES // 8)):
            q = rng.uniform(-1.0, 1.0, (4, arm.n))
            spline = timing.cubic_spline(timing.positions(q), q)
            limits = {"tau_max": static(checker, spline) * 1.1 + 5.0}
            viscous = rng.uniform(0.02, 0.1, arm.n)
            p, free = al.time_path(arm, q, friction=viscous, **limits), al.time_path(arm, q, **limits)
            assert p.feasible and free.feasible, (p.reason, free.reason)
            judge(checker, p, spline, limits, rng, viscous)
            assert p.duration != free.duration


def test_stops_and_speeds_at_the_ends() -> None:
    """A stop divides a path into two rest-to-rest timings. A start speed is respected."""
    arm = models.TWO_LINKS
    q = [[0.0, 0.0], [0.5, 0.2], [0.7, -0.3]]
    free, stopped = al.time_path(arm, q, tau_max=30.0), al.time_path(arm, q, tau_max=30.0, stops=[1])
    assert stopped.duration > free.duration
    k = int(np.argmin(stopped.s_dot[1:-1])) + 1
    np.testing.assert_allclose(stopped(stopped.t[k])[0], q[1], atol=1e-12)
    assert stopped.s_dot[k] == 0.0
    moving = al.time_path(arm, q, tau_max=30.0, start_speed=0.5, end_speed=0.25)
    # The motion takes 0.16 s. Its end speeds equal the arguments, up to rounding.
    assert (moving.s_dot[0], moving.s_dot[-1]) == (pytest.approx(0.5, rel=1e-12), pytest.approx(0.25, rel=1e-12))
    assert moving.duration < free.duration
    assert np.abs(moving(moving.duration)[1]).max() > 0.0 and np.abs(moving(moving.duration + 1e-9)[1]).max() == 0.0


def test_symmetries() -> None:
    """Without gravity and friction, the reversed path takes the same time. Limits four times as large halve the time."""
    rng = np.random.default_rng(7)
    for arm, _ in LIGHT:
        q = rng.uniform(-1.0, 1.0, (4, arm.n))
        there, back = (al.time_path(arm, path, tau_max=5.0, grid=801) for path in (q, q[::-1]))
        # Both timings approximate the same minimum, on grids that treat the ends of a segment differently.
        assert back.duration == pytest.approx(there.duration, rel=1e-4)
        assert al.time_path(arm, q, tau_max=20.0, grid=801).duration == pytest.approx(0.5 * there.duration, rel=1e-6)


def test_infeasible_paths_say_why() -> None:
    """The arm cannot hold itself in the middle of the path. The reported joint, place, limit and missing torque agree with statics."""
    arm, checker = models.TWO_LINKS, models.REFERENCE_TWO_LINKS
    q = np.array([[-np.pi / 2, 0.0], [np.pi / 4, 0.0]])
    most = float(checker.gravity(np.array([0.0, 0.0]))[0])
    p = al.time_path(arm, q, tau_max=[0.5 * most, 50.0])
    assert not p.feasible and np.isnan(p.duration) and np.isnan(p.margin)
    why = p.shortfall
    assert why is not None and (why["joint"], why["limit"]) == (0, "tau_max")
    assert "joint 0" in (p.reason or "") and "short" in (p.reason or "")
    held = float(checker.gravity(q[0] + why["s"] * (q[1] - q[0]))[0])
    assert why["missing_units"] == pytest.approx(held - 0.5 * most, rel=1e-6)
    assert why["missing"] == pytest.approx(held / (0.5 * most) - 1.0, rel=1e-6)
    with pytest.raises(al.SolveError, match="the path has no timing") as caught:
        p(0.0)
    assert caught.value.status is al.Status.INFEASIBLE


@pytest.mark.parametrize("grid", [31, 32, 33])
def test_a_path_that_turns_back_within_rounding(grid: int) -> None:
    """At the turning point M q' is zero except for 3e-17. The remaining torque divided by this number is not a path acceleration."""
    there, turn = [0.1752904998800946, 0.781117978963942], [-0.01675097507218748, 0.027823179036827295]
    tau_max = [[-27.12999685638095, 49.72768525783256], [-7.013772251711607, 37.22577236072692]]
    arm = al.planar_arm([0.5, 0.4], gravity=(0.0, 0.0))
    path = al.time_path(arm, [there, turn, there], tau_max=tau_max, v_max=[2.604642581277789, 1.3478641318789544], grid=grid)
    assert path.reason is None
    # The tolerance is for the error of coarse grids.
    assert path.duration == pytest.approx(1.1277, rel=1e-4)


def test_torques_that_peak_beside_a_grid_point() -> None:
    """Where the active limit changes, a torque has a maximum just after or before a grid point, between two samples of the check."""
    phi = [2.0, 0.0, 0.2, 0.2, 0.2, 0.0, 0.2, 0.0, 0.0, 0.1]
    joints = [{"type": "R", "axis": [0, i % 2, 1 - i % 2], "rpy": [0, 0, 0], "xyz": [0, 0, 0.3], "phi": phi} for i in range(7)]
    arm = al.Arm.from_chain(joints)
    limit = 2.0 * np.array([80.0, 80.0, 60.0, 60.0, 30.0, 20.0, 20.0])
    rng = np.random.default_rng(77)
    planned, beside = 0, np.concatenate([np.linspace(0.0, 0.1, 21), np.linspace(0.9, 1.0, 21)])
    for _ in range(90):
        q = rng.normal(size=(rng.integers(2, 8), 7)) * rng.choice([1.0, 0.3, 1e-2, 1e-3, 1e-4])
        p = al.time_path(arm, q, tau_max=limit)
        if p.feasible:
            planned += 1
            t = (p.t[:-1, None] + np.diff(p.t)[:, None] * beside).ravel()
            # At a grid point p(t) has the acceleration of one of the two segments. Rounding is below the tolerance.
            assert np.max(np.abs(arm.inverse_dynamics(*p(t[t < p.duration]))) / limit) <= 1.0 + PROMISE
    assert planned > 60
