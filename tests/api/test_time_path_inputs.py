"""The Python interface of `time_path`: errors that name a refused argument, paths of every kind, pickles, motions in a law."""

from __future__ import annotations

import copy
import math
import pickle
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

ARM = models.TWO_LINKS
PATH = [[0.0, 0.0], [0.5, 0.2], [0.7, -0.3]]
BAD = [math.nan, math.inf, "1", 1j, [1.0, math.nan], [[1.0]], np.ones((2, 3)), True]


@pytest.mark.parametrize("bad", [*BAD, 0.0, -1.0, [1.0, 0.0]], ids=repr)
@pytest.mark.parametrize("name", ["tau_max", "v_max", "a_max"])
def test_limits(name: str, bad: Any) -> None:
    with pytest.raises(al.InputError, match=rf"^time_path: {name} "):
        al.time_path(ARM, PATH, **{"tau_max": 30.0, name: bad})


@pytest.mark.parametrize("name", ["start_speed", "end_speed"])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -1.0, "1", None.__class__, [1.0]], ids=repr)
def test_speeds(name: str, bad: Any) -> None:
    with pytest.raises(al.InputError, match=rf"^time_path: {name} "):
        al.time_path(ARM, PATH, tau_max=30.0, **{name: bad})


@pytest.mark.parametrize("bad", [math.nan, "1", 1j, [1.0, math.nan], [[1.0]], np.ones((2, 3)), True, [1.0] * 3], ids=repr)
@pytest.mark.parametrize("name", ["q_min", "q_max"])
def test_position_limits(name: str, bad: Any) -> None:
    with pytest.raises(al.InputError, match=rf"^time_path: {name} "):
        al.time_path(ARM, PATH, tau_max=30.0, **{name: bad})


ROWS: list[Any] = [[1.0] * 7, [1.0, 0.0, 1.0], [1.0, math.nan, 1.0], [[1.0], [1.0], [1.0]], []]


def label(bad: Any) -> str:
    """The name of a test case. It has no address of a function, so that several processes have the same names."""
    return bad.__name__ if callable(bad) else repr(bad)


VARYING: list[Any] = [*ROWS, lambda s: 0.0, lambda s: math.nan, lambda s: [1.0, 1.0]]


@pytest.mark.parametrize("bad", [math.nan, math.inf, 0.0, -1.0, "1", 1j, [1.0], True, *VARYING], ids=label)
@pytest.mark.parametrize("name", ["tip_speed", "tip_acceleration"])
def test_limits_of_a_frame(name: str, bad: Any) -> None:
    with pytest.raises(al.InputError, match=rf"^time_path: {name} "):
        al.time_path(ARM, PATH, tau_max=30.0, frame="link2", **{name: bad})


def test_frames() -> None:
    with pytest.raises(al.InputError, match=r"^time_path: q_min, q_max are out of order: expected q_min <= q_max, got 1 and 0"):
        al.time_path(ARM, PATH, tau_max=30.0, q_min=1.0, q_max=0.0)
    with pytest.raises(al.InputError, match=r"^time_path: frame is missing"):
        al.time_path(ARM, PATH, tau_max=30.0, tip_speed=1.0)
    with pytest.raises(al.InputError, match=r"^time_path: frame is not used"):
        al.time_path(ARM, PATH, tau_max=30.0, frame="link2")
    for bad in ("tool", 3, ""):
        with pytest.raises(al.InputError, match=r"^time_path: frame "):
            al.time_path(ARM, PATH, tau_max=30.0, tip_speed=1.0, frame=bad)  # type: ignore[arg-type]
    with pytest.raises(al.InputError, match=r"^time_path: frame is unknown.*planar_pr"):
        al.time_path(models.PR, PATH, tau_max=30.0, tip_speed=1.0, frame="link2")
    # Limits of a frame that does not move have no effect.
    with pytest.raises(
        al.InputError, match=r"^time_path: tau_max, a_max are both missing: expected one of them where the frame does not move"
    ):
        al.time_path(ARM, [[0.0, 0.0], [0.0, 1.0]], tip_acceleration=1.0, frame="link1")
    assert al.time_path(ARM, [[0.0, 0.0], [0.0, 1.0]], tip_acceleration=1.0, a_max=1.0, frame="link1").feasible


@pytest.mark.parametrize("name", ["tau_max", "v_max", "a_max"])
def test_limits_that_vary(name: str) -> None:
    good = {"tau_max": 30.0, name: np.full((3, 2), 30.0)}
    assert al.time_path(ARM, PATH, **good).feasible
    for bad in (np.full((4, 2), 30.0), np.full((3, 3), 30.0), np.full((3, 2), -1.0), np.full((3, 2), math.nan), np.zeros((3, 2))):
        with pytest.raises(al.InputError, match=rf"^time_path: {name} "):
            al.time_path(ARM, PATH, **{**good, name: bad})
    for wrong in (lambda s: [1.0] * 3, lambda s: "x", lambda s: -1.0, lambda s: math.nan):
        with pytest.raises(al.InputError, match=rf"^time_path: {name} "):
            al.time_path(ARM, PATH, **{**good, name: wrong})
    with pytest.raises(ZeroDivisionError):
        al.time_path(ARM, PATH, **{**good, name: lambda s: 1 / 0})
    # For two joints and two waypoints, (2, 2) means lower and upper limits of torque, but one row per waypoint for other limits.
    if name != "tau_max":
        assert al.time_path(ARM, PATH[:2], **{**good, name: [[1.0, 2.0], [3.0, 1.0]]}).feasible
    # A callable path has no waypoints.
    with pytest.raises(al.InputError, match=rf"^time_path: {name} "):
        al.time_path(ARM, lambda s: [s, s], **good)
    assert al.time_path(ARM, lambda s: [s, s], **{**good, name: lambda s: 30.0}).feasible


WRONG = [[[0.0, 0.0]], [[0.0], [1.0]], [0.0, 1.0], [[0.0, math.nan], [1.0, 1.0]], [[0.0, 1.0], [math.inf, 1.0]], "path", None, 3.0]


@pytest.mark.parametrize("bad", WRONG)
def test_paths(bad: Any) -> None:
    with pytest.raises(al.InputError, match=r"^time_path: path "):
        al.time_path(ARM, bad, tau_max=30.0)


@pytest.mark.parametrize(
    "name, bad",
    [
        ("grid", 0),
        ("grid", 1),
        ("grid", 2.5),
        ("grid", 10**9),
        ("spline", "cubic"),
        ("spline", 3),
        ("knots", [0.0, 1.0]),
        ("knots", [0.0, 0.0, 1.0]),
        ("knots", [0.0, math.nan, 1.0]),
        ("stops", [7]),
        ("stops", [-1]),
        ("samples", 100),
        ("friction", -1.0),
        ("friction", math.nan),
    ],
)
def test_options(name: str, bad: Any) -> None:
    with pytest.raises(al.InputError, match=rf"^time_path: {name} "):
        al.time_path(ARM, PATH, tau_max=30.0, **{name: bad})


def test_a_limit_of_force_or_acceleration_is_needed() -> None:
    with pytest.raises(al.InputError, match="tau_max, a_max are both missing"):
        al.time_path(ARM, PATH, v_max=1.0)
    assert al.time_path(ARM, PATH, a_max=1.0).feasible
    with pytest.raises(al.InputError, match="tau_max is empty: expected a lower below an upper limit, got 1 and 1"):
        al.time_path(ARM, PATH, tau_max=[[1.0, 1.0], [-1.0, 1.0]])
    with pytest.raises(al.InputError, match="arm is of the wrong type"):
        al.time_path(3, PATH, tau_max=1.0)  # type: ignore[arg-type]


def test_waypoints_of_every_layout() -> None:
    wanted = al.time_path(ARM, PATH, tau_max=30.0)
    q = np.array(PATH)
    for same in (q, np.asfortranarray(q), np.repeat(q, 2, axis=1)[:, ::2], q[::-1][::-1], tuple(map(tuple, PATH))):
        assert al.time_path(ARM, same, tau_max=[30.0, 30.0]) == wanted
    assert al.time_path(ARM, np.repeat(q, 3, axis=0), tau_max=30.0) == wanted
    assert al.time_path(ARM, PATH, tau_max=[[-30.0, 30.0]] * 2) == wanted


def test_points() -> None:
    """A path of equal points takes no time if the arm can hold itself."""
    held = al.time_path(ARM, [[0.1, 0.2]] * 3, tau_max=30.0)
    assert held.feasible and held.duration == 0.0 and held.margin > 0.0
    np.testing.assert_array_equal(held(1.0)[0], [0.1, 0.2])
    fallen = al.time_path(ARM, [[0.1, 0.2]] * 3, tau_max=0.1)
    assert not fallen.feasible and fallen.shortfall is not None and fallen.shortfall["limit"] == "tau_max"


def test_callables() -> None:
    """A callable path with or without derivatives gives equal timings, up to the error of the splines."""

    def q(s: float) -> np.ndarray:
        return np.array([np.sin(s), s * s])

    def all_three(s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return q(s), np.array([np.cos(s), 2 * s]), np.array([-np.sin(s), 2.0])

    a, b = al.time_path(ARM, q, tau_max=30.0), al.time_path(ARM, all_three, tau_max=30.0)
    # Both durations have the error of their grid.
    assert a.feasible and b.feasible and a.duration == pytest.approx(b.duration, rel=2e-4)
    t = np.linspace(0.0, b.duration, 200)
    x = b(t)[0]
    # The error of quintic Hermite interpolation with 200 pieces is (1/200)^6 / 46080 times the sixth derivative. asin adds rounding.
    np.testing.assert_allclose(x[:, 1], np.arcsin(np.clip(x[:, 0], -1.0, 1.0)) ** 2, atol=1e-12)
    for bad in (lambda s: [1.0], lambda s: [math.nan, 1.0], lambda s: None, lambda s: (q(s), q(s), [1.0])):
        with pytest.raises(al.InputError, match=r"^time_path: path "):
            al.time_path(ARM, bad, tau_max=30.0)
    with pytest.raises(ZeroDivisionError):
        al.time_path(ARM, lambda s: [1 / 0, 0.0], tau_max=30.0)
    with pytest.raises(al.InputError, match="knots is not used"):
        al.time_path(ARM, q, tau_max=30.0, knots=[0.0, 1.0])
    with pytest.raises(al.InputError, match="samples is out of range"):
        al.time_path(ARM, q, tau_max=30.0, samples=2)


def test_times() -> None:
    p = al.time_path(ARM, PATH, tau_max=30.0)
    q, v, a = p(np.linspace(0.0, p.duration, 6).reshape(2, 3))
    assert q.shape == v.shape == a.shape == (2, 3, 2) and p(0.1)[0].shape == (2,) and p([])[0].shape == (0, 2)
    np.testing.assert_array_equal(p(-1.0), [PATH[0], [0.0, 0.0], [0.0, 0.0]])
    np.testing.assert_array_equal(p(p.duration), [PATH[-1], [0.0, 0.0], [0.0, 0.0]])
    np.testing.assert_array_equal(p(1e9), p(p.duration))
    for bad in (math.nan, [0.0, math.inf], "1", None):
        with pytest.raises(al.InputError, match="TimedPath: t "):
            p(bad)  # type: ignore[arg-type]


TIMED = [al.time_path(ARM, path, tau_max=tau) for path, tau in ((PATH, 30.0), (PATH, 0.1), ([PATH[0]] * 2, 30.0))]


@pytest.mark.parametrize("p", TIMED)
def test_pickles_and_texts(p: al.TimedPath) -> None:
    assert isinstance(p, al.Motion) and p.n == 2 and repr(p).startswith("TimedPath(n=2, ")
    for other in (pickle.loads(pickle.dumps(p)), copy.copy(p), copy.deepcopy(p)):
        assert type(other) is al.TimedPath and repr(other) == repr(p) and other.reason == p.reason and other.shortfall == p.shortfall
        assert other == p
        np.testing.assert_array_equal(other.s_dot, p.s_dot)
        if p.feasible:
            np.testing.assert_array_equal(other(0.1), p(0.1))


def test_in_a_loop() -> None:
    """Computed torque with the exact model tracks the timed path within the torque limits."""
    arm = models.PR
    tau_max = np.array([8.0, 1.0])
    p = al.time_path(arm, [[0.0, 0.0], [1.0, 0.5], [0.2, 1.0]], tau_max=tau_max)
    run = al.simulate(al.RigidArm(arm), al.ComputedTorque(arm, p, 100.0, 20.0), [0.0, 0.0], t_end=p.duration, method="dop853", rtol=1e-10)
    # The run follows the path up to the error of the integrator.
    np.testing.assert_allclose(run.q, p(run.t)[0], atol=1e-7)
    assert np.all(np.abs(run.tau) <= tau_max * (1.0 + 1e-5))
    np.testing.assert_allclose(run.q[-1], [0.2, 1.0], atol=1e-7)


@pytest.mark.parametrize("end", ["start_speed", "end_speed"])
def test_an_end_speed_above_the_speed_limit_names_this_limit(end: str) -> None:
    """A path of one rad per unit of s with v_max = 1 rad/s: a path speed of 5 1/s exceeds the limit by 4 rad/s."""
    arm = models.TWO_LINKS
    limits = {"tau_max": 500.0, "v_max": 1.0, "a_max": 10.0}
    found = al.time_path(arm, [[0.0, 0.0], [1.0, 0.5]], **limits, **{end: 5.0})  # type: ignore[arg-type]
    assert found.reason is not None
    # The text has seven digits.
    assert f"{end} is not possible: expected at most 1.00000" in found.reason and "v_max of joint 0 (joint1) is 4.00000" in found.reason
    within = al.time_path(arm, [[0.0, 0.0], [1.0, 0.5]], tau_max=500.0, v_max=20.0, a_max=10.0, start_speed=15.0)
    assert within.reason is not None and within.reason.startswith("start_speed is not possible") and "v_max" not in within.reason


def test_a_law_without_a_timing_is_refused() -> None:
    """The error of the run has the reason of the planner, also if the duration of the run is that of the motion."""
    weak = al.time_path(ARM, PATH, tau_max=1.0)
    assert not weak.feasible
    law = al.ComputedTorque(ARM, weak, 100.0, 20.0)
    for loop in (law, al.Guarded(law, al.MomentumObserver(ARM, 10.0))):
        for t_end in (1.0, weak.duration):
            with pytest.raises(al.InputError, match=r"^simulate: law\.motion has no timing: .* tau_m\w+ of joint"):
                al.simulate(al.RigidArm(ARM), loop, PATH[0], t_end=t_end, dt=1e-3)
