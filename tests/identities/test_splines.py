"""Motions through uneven knots: continuity, jumps at which integrators restart, gradients, and points of a ROS trajectory."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline, CubicSpline

import armlet as al

ARM = models.TWO_LINKS
# The points of a trajectory, with their own times.
T = np.array([0.0, 0.35, 1.1, 1.8])
Q = np.array([[0.0, 0.0], [0.2, -0.1], [0.7, 0.3], [0.9, 0.2]])
V = np.array([[0.0, 0.0], [0.6, 0.1], [0.5, 0.2], [0.0, 0.0]])
A = np.array([[0.0, 0.0], [1.0, 0.5], [-0.5, 0.1], [0.0, 0.0]])
KINDS: dict[str, dict[str, Any]] = {
    "clamped": {},
    "natural": {"spline": "natural"},
    "not-a-knot": {"spline": "not-a-knot"},
    "cubic": {"v": V},
    "quintic": {"v": V, "a": A},
}


def motion(kind: str, **changed: Any) -> al.Motion:
    return al.Table.at(**({"t": T, "q": Q} | KINDS[kind] | changed))


@pytest.mark.parametrize("kind", KINDS)
def test_values_and_continuity(kind: str) -> None:
    m = motion(kind)
    q, v, a = m(T)
    np.testing.assert_allclose(q, Q, atol=1e-15)
    for name, part in (("v", v), ("a", a)):
        if name in KINDS[kind]:
            np.testing.assert_allclose(part, KINDS[kind][name], atol=1e-13)
    continuous = 2 if kind == "cubic" else 3
    for knot in T[1:-1]:
        before, after = m([knot - 1e-9, knot + 1e-9])[0], m([knot - 1e-9, knot + 1e-9])
        np.testing.assert_allclose(before[0], before[1], atol=1e-8)
        for part in after[:continuous]:
            np.testing.assert_allclose(part[0], part[1], atol=1e-6)
    if kind == "cubic":
        assert np.abs(m(T[1] - 1e-9)[2] - m(T[1])[2]).max() > 1.0
    if kind == "clamped":
        np.testing.assert_allclose(v[[0, -1]], 0.0, atol=1e-15)
    if kind == "natural":
        np.testing.assert_allclose(a[[0, -1]], 0.0, atol=1e-13)
    for time, row in ((-1.0, 0), (T[-1] + 1e-12, -1), (9.0, -1)):
        np.testing.assert_array_equal(m.derivatives(time, 2), [Q[row], [0.0, 0.0], [0.0, 0.0]])


def test_splines_of_scipy() -> None:
    """scipy has the same interpolants."""
    times = np.linspace(0.0, 1.8, 101)
    others = {kind: CubicSpline(T, Q, bc_type=kind) for kind in ("clamped", "natural", "not-a-knot")} | {
        "cubic": CubicHermiteSpline(T, Q, V)
    }
    for kind, other in others.items():
        for order, part in enumerate(motion(kind)(times)):
            np.testing.assert_allclose(part[:-1], other(times, order)[:-1], atol=1e-12, err_msg=kind)


def test_equal_steps_are_those_of_a_table() -> None:
    t = 0.2 * np.arange(4)
    for time in np.linspace(-0.1, 0.7, 41):
        np.testing.assert_allclose(al.Table.at(t, Q, V, A)(time), al.Table(0.2, Q, V, A)(time), atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_a_law_tracks_the_points(kind: str) -> None:
    law = al.ComputedTorque(ARM, motion(kind), 400.0, 40.0)
    run = al.simulate(al.RigidArm(ARM), law, Q[0], v0=motion(kind)(0.0)[1], t_end=2.5, dt=1e-3)
    reached = np.abs(run.q[-1] - Q[-1]).max()
    assert reached < 1e-6
    inner = run.t <= T[-1]
    # The exact model follows without error, up to the error of the steps, while the velocity does not jump.
    np.testing.assert_allclose(run.q[inner], motion(kind)(run.t[inner])[0], atol=1e-9)
    if kind in ("natural", "not-a-knot"):
        assert np.abs(motion(kind)(T[-1])[1]).max() > 0.01
    else:
        assert np.abs(run.q - motion(kind)(run.t)[0]).max() < 1e-9


def test_integrators_restart_at_jumps() -> None:
    """The order of a method is reached only if no step crosses a jump of the acceleration."""
    law = al.PID(ARM, motion("cubic"), 10.0, 5.0, 1.0)
    ends = []
    for dt in (8e-3, 4e-3, 1e-4):
        # 1.1 and 1.8 are no multiples of these steps.
        ends.append(al.simulate(al.RigidArm(ARM), law, Q[0], t_end=2.0, dt=dt * 0.997, t_eval=[2.0]).q[-1])
    coarse, fine = (np.abs(end - ends[-1]).max() for end in ends[:2])
    assert np.log2(coarse / fine) == pytest.approx(4.0, abs=0.4)
    adaptive = al.simulate(al.RigidArm(ARM), law, Q[0], t_end=2.0, method="dop853", rtol=1e-11, atol=1e-13, t_eval=[2.0])
    np.testing.assert_allclose(adaptive.q[-1], ends[-1], atol=1e-9)


@pytest.mark.parametrize(("kind", "name"), [("clamped", "q"), ("cubic", "q"), ("cubic", "v"), ("quintic", "a"), ("quintic", "t")])
@pytest.mark.parametrize("method", ["rk4", "dop853"])
def test_gradients_with_respect_to_the_knots(kind: str, name: str, method: str) -> None:
    """The knots are within steps, where the differences of runs see no kink. Rates of the last knot are zero, and a change is a kink."""
    plant, late = al.RigidArm(ARM), T + 0.0507
    options: dict[str, Any] = {"t_end": 2.0, "t_eval": np.linspace(0.1, 2.0, 20), "method": method}
    options |= {"dt": 2e-3} if method == "rk4" else {"rtol": 1e-11, "atol": 1e-13}
    value = {"t": late, "q": Q, "v": V, "a": A}[name]

    def law(**changed: Any) -> al.Law:
        return al.PID(ARM, motion(kind, **({"t": late} | changed)), 10.0, 5.0, 1.0)

    run = al.simulate(plant, law(), Q[0], sensitivity=f"law.target.{name}", **options)
    assert run.sensitivity is not None
    # An adaptive step passes over a jump of the jerk with the error of its tolerance, and the tangents have a larger one.
    h, near = 1e-5, 1e-5 if method == "rk4" else 2e-4
    for k in range(value.size if name in ("t", "q") else value.size - 2):
        step = h * np.eye(value.size)[k].reshape(value.shape)
        first, second = (al.simulate(plant, law(**{name: value + sign * step}), Q[0], **options).q for sign in (1.0, -1.0))
        difference = (first - second) / (2.0 * h)
        got = np.reshape(run.sensitivity[f"law.target.{name}"].q, (*difference.shape, value.size))[..., k]
        np.testing.assert_allclose(got, difference, rtol=0.0, atol=near * max(np.abs(difference).max(), 0.1), err_msg=str(k))


def test_a_jump_that_moves_has_no_derivative() -> None:
    law = al.PID(ARM, motion("cubic"), 10.0, 5.0, 1.0)
    with pytest.raises(al.InputError, match=r"law\.target\.t has no derivative: it moves an instant at which the motion jumps"):
        al.simulate(al.RigidArm(ARM), law, Q[0], t_end=2.0, dt=1e-3, sensitivity="law.target.t")


def test_elastic_joints_follow_a_smooth_spline() -> None:
    K, B = [800.0, 500.0], [0.4, 0.25]
    law = al.JointTracking(ARM, motion("quintic"), [50.0, 40.0], [5.0, 4.0], K, B)
    run = al.simulate(al.ElasticArm(ARM, K, B), law, Q[0], t_end=2.5, dt=1e-3)
    assert np.abs(run.q[-1] - Q[-1]).max() < 1e-3
    with pytest.raises(al.InputError, match="has no jerk and snap"):
        al.JointTracking(ARM, motion("cubic"), [50.0, 40.0], [5.0, 4.0], K, B)
    with pytest.raises(al.InputError, match="order is too high: expected at most 2 for a motion whose acceleration jumps, got 3"):
        motion("cubic").derivatives(0.5, 3)


def test_bad_knots() -> None:
    bad: list[tuple[dict[str, Any], str]] = [
        ({"t": [0.0, 0.35, 0.35, 1.8]}, r"t does not increase: expected increasing times, got 0.35 after 0.35 \(first bad index 2\)"),
        ({"t": [0.0, 0.35, 1.1, np.nan]}, r"t .*first bad index 3"),
        ({"t": T[:3]}, r"q has the wrong shape"),
        ({"t": T[:1], "q": Q[:1]}, r"t has too few knots: expected at least two, got 1"),
        ({"q": np.full((4, 2), np.inf)}, r"q .*first bad index \(0, 0\)"),
        ({"v": V[:, :1]}, r"v has the wrong shape"),
        ({"a": A}, r"a requires v"),
        ({"v": V, "spline": "natural"}, r"spline takes effect only without v"),
        ({"spline": "straight"}, r"spline is unknown"),
        ({"spline": 3}, r"spline "),
        ({"q": 1e308 * np.array([[1.0], [-1.0], [1.0], [-1.0]])}, r""),
    ]
    for changed, message in bad:
        for make, name in ((al.Spline, "Spline"), (al.Table.at, "Table.at")):
            with pytest.raises(al.InputError, match=rf"^{name}: {message}"):
                make(**({"t": T, "q": Q} | changed))
    assert repr(al.Table.at(T[:2], Q[:2])).startswith("Spline(t=[0.0, 0.35], q=[[0.0, 0.0], [0.2, -0.1]])")
    assert motion("cubic") == al.Spline(T, Q, V) != al.Spline(T, Q)
