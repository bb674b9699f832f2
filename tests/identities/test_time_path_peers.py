"""Timings of paths against test problems of drake and toppra, whose durations are closed formulas or published numbers.

drake (multibody/optimization/test/toppra_test.cc): a KUKA LBR iiwa moves along a straight line of joint positions. The limits are on its
joints and on the origin of its last link, here called the tip.
toppra (tests/tests/retime/robustness, cpp/tests/test_algorithm.cpp): short moves, and a cubic path of two joints.
toppra solves no problem with a limit of the tip: its only test of such a limit evaluates the constraint.

The duration of a straight line of joint positions, |v_j| <= V_j and |a_j| <= A_j, with the displacement d = q1 - q0:

    nu = min V_j/|d_j|,   alpha = min A_j/|d_j|
    T = 2 sqrt(1/alpha), where sqrt(alpha) <= nu,  else 1/nu + nu/alpha

drake bounds each component of a velocity from below and above by different numbers. armlet's limits are symmetric.
For joint velocities both problems have the same solution: on the line each joint moves in one direction only.
For accelerations and for components of the tip's velocity, these tests use the smaller bound in both directions.
"""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest

import armlet as al

H = np.pi / 2
# Denavit-Hartenberg parameters (alpha in rad, d in m) of the LBR iiwa 7 R800 from its manufacturer. The origin of the last link is 0.081 m
# from the wrist.
TURNS, SHIFTS = [-H, H, H, -H, -H, H, 0.0], [0.34, 0.0, 0.4, 0.0, 0.4, 0.0, 0.081]
START = np.array([-1.57, 0.1, 0.0, -1.2, 0.0, 1.6, 0.0])
END = np.array([-0.8, -0.6, 0.5, 0.1, -0.5, -0.1, -1.0])
A_MAX = 10.0
PROMISE = 1e-9


def tip(q: np.ndarray) -> np.ndarray:
    """Return the positions (T, 3) in m of the last link's origin, by products of Denavit-Hartenberg transforms."""
    R, p = np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3))
    for joint, (turn, shift) in enumerate(zip(TURNS, SHIFTS, strict=True)):
        c, s, ca, sa = np.cos(q[:, joint]), np.sin(q[:, joint]), np.cos(turn), np.sin(turn)
        zero = np.zeros_like(c)
        p = p + shift * R[:, :, 2]
        rows = [[c, -s * ca, s * sa], [s, c * ca, -c * sa], [zero, zero + sa, zero + ca]]
        R = R @ np.array(rows).transpose(2, 0, 1)
    return p


def kuka() -> al.Arm:
    """Return the same arm as an `al.Arm`. Its masses are 1 kg, since the tests compare only kinematics."""
    body = {"type": "R", "axis": [0, 0, 1], "phi": [1.0, 0, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1]}
    before = [(0.0, 0.0), *zip(TURNS, SHIFTS, strict=True)]
    joints: list[dict[str, Any]] = [body | {"rpy": [turn, 0, 0], "xyz": [0, 0, shift]} for turn, shift in before[:7]]
    return al.Arm.from_chain([*joints, {"type": "F", "rpy": [0, 0, 0], "xyz": [0, 0, SHIFTS[6]]}])


ARM = kuka()
TOOL = ARM.frame_names[-1]


def moved(p: al.TimedPath, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return velocity (m/s) and acceleration (m/s^2) of the tip, each (T, 3).

    They are differences of fourth order along the parabola q + v h + a h^2/2.
    """
    q, v, a = p(t)
    h = 1e-3
    far, near, here, on, last = (tip(q + v * (k * h) + a * (0.5 * (k * h) ** 2)) for k in (-2, -1, 0, 1, 2))
    return (far - 8 * near + 8 * on - last) / (12 * h), (-far + 16 * near - 30 * here + 16 * on - last) / (12 * h * h)


def instants(p: al.TimedPath) -> np.ndarray:
    return np.concatenate([np.linspace(0.0, p.duration, 3001), p.t])[:-1]


def least(d: np.ndarray, v: Any, a: Any) -> float:
    """Return the duration in s of a straight line from rest to rest: `T` in the docstring of this file."""
    nu, alpha = np.min(np.broadcast_to(v, d.shape) / np.abs(d)), np.min(np.broadcast_to(a, d.shape) / np.abs(d))
    return float(2.0 / np.sqrt(alpha) if alpha <= nu * nu else 1.0 / nu + nu / alpha)


def test_drake_joint_speeds() -> None:
    """Each joint reaches the bound of its direction: -1.1 .. -1.7 rad/s backwards, 2.1 .. 2.7 rad/s forwards."""
    lower, upper = 1.1 + 0.1 * np.arange(7), 2.1 + 0.1 * np.arange(7)
    v_max = np.where(END > START, upper, lower)
    p = al.time_path(ARM, [START, END], v_max=v_max, a_max=A_MAX)
    # The grid of path positions makes the motion slightly longer.
    assert p.duration == pytest.approx(least(END - START, v_max, A_MAX), rel=2e-4)
    v = p(instants(p))[1]
    assert np.all(v <= upper * (1 + PROMISE)) and np.all(v >= -lower * (1 + PROMISE))


def test_drake_joint_accelerations() -> None:
    a_max = 1.1 + 0.1 * np.arange(7)
    p = al.time_path(ARM, [START, END], a_max=a_max)
    assert p.duration == pytest.approx(least(END - START, np.inf, a_max), rel=1e-6)
    assert np.all(np.abs(p(instants(p))[2]) <= a_max * (1 + PROMISE))


def test_drake_path_speeds_at_the_ends() -> None:
    """Path speeds are 0.7 at the start and 0.4 at the end.

    The slope of this clamped spline is zero at both ends, so the joints start and stop at rest.
    """
    p = al.time_path(ARM, [START, END], spline="clamped", v_max=1.0, a_max=A_MAX, start_speed=0.7, end_speed=0.4)
    assert p.feasible and p.s_dot[[0, -1]] == pytest.approx([0.7, 0.4], rel=1e-12)
    _, v, a = p(instants(p))
    assert np.all(np.abs(v) <= 1.0 + PROMISE) and np.all(np.abs(a) <= A_MAX * (1 + PROMISE))


def test_drake_speed_of_a_frame() -> None:
    """A tip speed of 1.1 m/s gives one timing, whether it is a number, an array per waypoint or a function of s."""
    durations = []
    forms: list[Any] = [1.1, [1.1, 1.1], lambda s: 1.1]
    for limit in forms:
        p = al.time_path(ARM, [START, END], a_max=A_MAX, tip_speed=limit, frame=TOOL)
        speed = np.linalg.norm(moved(p, instants(p))[0], axis=1)
        # The error of the differences is proportional to h^4 and to the fifth derivative.
        assert p.feasible and speed.max() <= 1.1 * (1 + PROMISE) + 1e-9
        assert speed.max() > 1.1 * (1 - 1e-4)
        durations.append(p.duration)
    assert durations[0] == durations[1] == durations[2]


def test_drake_speed_of_a_frame_that_varies() -> None:
    """The limit of the tip speed is 1.1 m/s on the first half of the path and 2.2 m/s on the second.

    It changes over one step of a grid of 201 knots.
    """

    def limit(s: float) -> float:
        return 1.1 if s < 0.5 else 2.2

    def line(s: float) -> np.ndarray:
        return np.asarray(START + s * (END - START))

    p = al.time_path(ARM, line, a_max=A_MAX, tip_speed=limit, frame=TOOL)
    slow = al.time_path(ARM, line, a_max=A_MAX, tip_speed=1.1, frame=TOOL)
    t = instants(p)
    s = ((p(t)[0] - START) @ (END - START)) / np.sum((END - START) ** 2)
    speed = np.linalg.norm(moved(p, t)[0], axis=1)
    knots = np.linspace(0.0, 1.0, 201)
    assert np.all(speed <= np.interp(s, knots, [limit(x) for x in knots]) * (1 + PROMISE) + 1e-9)
    assert speed[s < 0.495].max() > 1.1 * (1 - 1e-3) and speed[s > 0.5].max() > 1.3
    assert p.duration < slow.duration


def test_drake_velocity_and_acceleration_of_a_frame() -> None:
    """drake bounds components of the tip's motion by -1.4 .. -1.6 and 2.4 .. 2.6.

    A norm of at most 1.4 (m/s or m/s^2) satisfies these bounds.
    """
    for name, part in (("tip_speed", 0), ("tip_acceleration", 1)):
        p = al.time_path(ARM, [START, END], a_max=A_MAX, frame=TOOL, **{name: 1.4})  # type: ignore[arg-type]
        values = moved(p, instants(p))[part]
        assert p.feasible and np.linalg.norm(values, axis=1).max() <= 1.4 * (1 + PROMISE) + 1e-7
        assert np.all(values >= [-1.4, -1.5, -1.6]) and np.all(values <= [2.4, 2.5, 2.6])


#: Waypoints of toppra's test of small joint moves, rad.
SMALL = np.outer(
    [-0.00038593, 0.00013093, 0.00064752, 0.00116383, 0.00167987, 0.00219563, 0.00271112, 0.00322633, 0.00374127, 0.00425594], [1.0] * 3
)
ISSUE_26 = np.outer(
    [
        *(-3.85929168e-04, -2.13610365e-04, -4.13223272e-05, 1.30934967e-04, 3.03161539e-04),
        *(4.75357412e-04, 6.47522605e-04, 8.19657141e-04, 9.91761041e-04, 1.16383433e-03),
    ],
    [1.0] * 3,
)


@pytest.mark.parametrize(
    ("q", "v_max", "a_max", "theirs"),
    # Each row: waypoints (rad), limits of speed (rad/s) and acceleration (rad/s^2), and durations (s) that toppra's file records for grids
    # of 51 and 101 points.
    [
        (SMALL, 100.0, 100.0, (0.016612985457, 0.015290573525)),
        (ISSUE_26, 1000.0, [1000.0, 2000.0, 10000.0], (0.0030355222659, 0.0027938926521)),
        ([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]], 100.0, 100.0, (0.21795131054, 0.20927765084)),
        ([[0.0, 0.0, 0.0], [0.0, 1e-4, 0.0]], 100.0, 100.0, (0.002179513104, 0.0020927765063)),
    ],
    ids=["small joint moves", "issue 26", "two points", "two near points"],
)
def test_toppra_short_moves(q: Any, v_max: Any, a_max: Any, theirs: tuple[float, float]) -> None:
    """armlet finds the optimal duration of straight lines: 0.2 s and 0.002 s according to toppra's file.

    toppra's durations decrease towards the optimum on a finer grid.
    """
    p = al.time_path(models.THREE_LINKS, q, v_max=v_max, a_max=a_max)
    d = np.asarray(q[-1]) - np.asarray(q[0])
    d = np.where(d == 0.0, 1e-300, d)
    # The waypoints of SMALL and ISSUE_26 deviate slightly from a line and from even spacing.
    assert p.duration == pytest.approx(least(d, v_max, a_max), rel=2e-3)
    assert p.duration < theirs[1] < theirs[0]
    _, v, a = p(instants(p))
    assert np.all(np.abs(v) <= np.asarray(v_max) * (1 + PROMISE)) and np.all(np.abs(a) <= np.asarray(a_max) * (1 + PROMISE))


#: Squares of the path speed at 51 places of toppra's cubic path, copied from toppra's test.
THEIRS = [
    0,
    0.00799999,
    0.01559927,
    0.02295854,
    0.03021812,
    0.0375065,
    0.04494723,
    0.05266502,
    0.06079176,
    0.06947278,
    0.07887417,
    0.08890758,
    0.08734253,
    0.08331795,
    0.07962036,
    0.07621324,
    0.0730652,
    0.07014912,
    0.06744149,
    0.06492187,
    0.06257243,
    0.06037763,
    0.05832396,
    0.05639983,
    0.05459562,
    0.05290406,
    0.05132157,
    0.04985237,
    0.04852316,
    0.04745693,
    0.04761904,
    0.0285715,
    0.05376003,
    0.04275653,
    0.04126188,
    0.04013804,
    0.03912958,
    0.03818766,
    0.03729606,
    0.0364472,
    0.03563649,
    0.03486069,
    0.03411724,
    0.03340395,
    0.03271895,
    0.03206054,
    0.02268897,
    0.01495547,
    0.00883489,
    0.00394282,
    0,
]


def test_toppra_cubic_path() -> None:
    """The path is the cubic through four points, with |v| <= 1 rad/s and |a| <= 0.2 rad/s^2. toppra publishes its profile at 51 points."""
    q = [[0.0, 0.0], [1.0, 3.0], [2.0, 4.0], [0.0, 0.0]]
    p = al.time_path(models.TWO_LINKS, q, knots=[0.0, 1.0, 2.0, 3.0], spline="not-a-knot", v_max=1.0, a_max=0.2)
    rate = np.sqrt(np.array(THEIRS))
    theirs = float(np.sum(2.0 * (3.0 / 50.0) / (rate[1:] + rate[:-1])))
    assert p.feasible and p.duration == pytest.approx(theirs, rel=2e-2)
    _, v, a = p(instants(p))
    assert np.abs(v).max() <= 1.0 + PROMISE and np.abs(a).max() <= 0.2 * (1 + PROMISE)
    # Away from corners of the profile, the speeds agree to the error of toppra's grid.
    s = np.linspace(0.0, 3.0, 51)
    ours = np.interp(s, p.s, p.s_dot)
    assert np.median(np.abs(ours - rate) / rate.max()) < 2e-2
