"""The momentum observer: residual r_dot = K (tau_ext - r) in continuous runs, force estimates, touched links, refused arguments."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]
SIX = models.SIX_AXES
TWO = models.TWO_HEAVY_LINKS
TREE = al.load_urdf(al.example_urdf("two_arms"))


@pytest.mark.parametrize("arm", [TWO, SIX], ids=["2R", "six axes"])
def test_the_residual_is_the_filtered_torque_from_outside(arm: al.Arm) -> None:
    """Arm, observer and filter are one system. The residual K (p - p0 - int) obeys r_dot = K (tau_ext - r), up to the method's error."""
    n, frame = arm.n, arm.frame_names[-1]
    rng = np.random.default_rng(n)
    root = rng.standard_normal((n, n))
    K = 20.0 * (root @ root.T / n + 0.5 * np.eye(n))
    q0 = rng.uniform(-0.5, 0.5, n)
    F = np.array([8.0, -5.0, 3.0, 0.4, -0.2, 0.3])
    p0 = np.zeros(n)

    def residual(x: Array) -> Array:
        q, v, integral = x[:n], x[n : 2 * n], x[2 * n : 3 * n]
        return np.asarray(K @ (arm.mass_matrix(q) @ v - p0 - integral))

    def rhs(t: float, x: Array) -> Array:
        q, v, r = x[:n], x[n : 2 * n], x[3 * n :]
        tau = arm.gravity(q) + 10.0 * (np.sin(t) - q) - 5.0 * v
        outside = arm.jacobian(q, frame).T @ (F * np.sin(3.0 * t))
        known = tau + arm.coriolis_matrix(q, v).T @ v - arm.gravity(q)
        return np.concatenate([v, arm.forward_dynamics(q, v, tau + outside), known + residual(x), K @ (outside - r)])

    start = np.concatenate([q0, np.zeros(3 * n)])
    found = al.integrate(rhs, (0.0, 1.0), start, method="dop853", rtol=1e-11, atol=1e-12)
    states = np.asarray(found.y)
    for x in states:
        np.testing.assert_allclose(residual(x), x[3 * n :], rtol=0.0, atol=1e-9)
    assert np.abs(states[-1, 3 * n :]).max() > 0.1


@pytest.mark.parametrize("dt", [1e-3, 5e-4])
def test_samples_follow_the_filter(dt: float) -> None:
    """A force acts on a moving arm, and the observer is sampled. The error is of first order, since the integrand is held."""
    frame, F = "link2", np.array([4.0, -3.0, 0.0])
    law = al.PDGravity(TWO, [0.4, 0.6], 60.0, 15.0)
    sim = al.Simulator(al.RigidArm(TWO), law, [0.2, 0.3], dt=dt, sample_time=dt, force=F, force_frame=frame)
    observer = al.MomentumObserver(TWO, 40.0)
    observer.reset(sim.q, sim.v)
    expected = np.zeros(2)
    for _ in range(round(0.5 / dt)):
        before = TWO.jacobian(sim.q, frame)[:3].T @ F
        sim.step()
        r = observer.update(sim.q, sim.v, sim.tau, dt)
        expected += (1.0 - np.exp(-40.0 * dt)) * (before - expected)
    np.testing.assert_allclose(r, expected, atol=30.0 * dt)
    wrench, rest = observer.wrench(sim.q, frame), observer.unexplained(sim.q, frame)
    np.testing.assert_allclose(TWO.jacobian(sim.q, frame).T @ wrench + rest, r, atol=1e-12)


def test_a_wrench_at_the_tip_is_found() -> None:
    q, F = np.linspace(0.3, -0.8, 6), np.array([10.0, -4.0, 6.0, 0.5, 0.3, -0.7])
    frame = SIX.tip_frame
    assert frame is not None
    observer = al.MomentumObserver(SIX, 100.0)
    observer.reset(q, np.zeros(6))
    for _ in range(400):
        observer.update(q, np.zeros(6), SIX.gravity(q) - SIX.jacobian(q, frame).T @ F, 1e-3)
    # The transient has decayed to exp(-40), the size of a rounding error. J is regular here.
    np.testing.assert_allclose(observer.wrench(q, frame, eps=1e-9), F, atol=1e-8)
    np.testing.assert_allclose(observer.unexplained(q, frame, eps=1e-9), 0.0, atol=1e-9)


def test_the_residual_of_motors_is_their_friction() -> None:
    arm, stiffness, inertia = TWO, np.array([800.0, 600.0]), np.array([0.4, 0.3])
    plant = al.ElasticArm(arm, stiffness, inertia, motor_friction=[1.5, 0.8])
    sim = al.Simulator(plant, al.MotorPD(arm, [0.5, 0.2], 300.0, 40.0, stiffness), [0.0, 0.0], dt=2e-4, sample_time=2e-4)
    links, motors = al.MomentumObserver(arm, 60.0), al.MomentumObserver(arm, 60.0, motor_inertia=inertia)
    assert sim.theta is not None and sim.theta_dot is not None
    links.reset(sim.q, sim.v)
    motors.reset(sim.theta, sim.theta_dot)
    wanted, worst = np.zeros(2), 0.0
    for _ in range(2000):
        spring, rubbing = stiffness * (sim.theta - sim.q), -np.array([1.5, 0.8]) * sim.theta_dot
        sim.step()
        links.update(sim.q, sim.v, spring, 2e-4)
        r = motors.update(sim.theta, sim.theta_dot, sim.tau - spring, 2e-4)
        wanted += 60.0 * 2e-4 * (rubbing - wanted)
        worst = max(worst, float(np.abs(r - wanted).max()))
    assert links.residual is not None
    # The observer holds the integrand for one step. The error is K dt / 2 times the change of the joint torque in the time 1/K. This change
    # is at most 32 N m.
    assert worst <= 0.2 and np.abs(links.residual).max() <= 0.2
    with pytest.raises(al.InputError, match="observer of links"):
        motors.wrench(sim.theta, "link2")


def test_friction_of_the_model_is_taken_off() -> None:
    chain = [{"type": "R", "axis": [0, 0, 1], "phi": [1, 0.3, 0, 0, 0.01, 0, 0.1, 0, 0, 0.1], "damping": 0.7, "friction": 0.4}]
    arm = al.Arm.from_chain(chain)
    known, unknown = al.MomentumObserver(arm, 50.0, friction=True), al.MomentumObserver(arm, 50.0)
    for _ in range(500):
        found = [each.update([0.1], [0.8], [0.7 * 0.8 + 0.4], 1e-3) for each in (known, unknown)]
    # At constant velocity the motor balances only friction.
    np.testing.assert_allclose(found[0], [0.0], atol=1e-9)
    np.testing.assert_allclose(found[1], [-0.96], atol=1e-8)


def test_the_touched_link_is_reported() -> None:
    """A force on link k loads only the joints up to k. On a tree with two arms, the touched link is on the correct arm."""
    q = np.full(TREE.n, 0.3)
    observer = al.MomentumObserver(TREE, 100.0, threshold=1e-3)
    for joint, name in enumerate(TREE.joint_names):
        frame = next(frame for frame in TREE.frame_names if np.any(TREE.jacobian(q, frame)[:, joint]) and _last(frame, q) == joint)
        observer.reset(q, np.zeros(TREE.n))
        load = TREE.jacobian(q, frame).T @ np.array([3.0, 4.0, 5.0, 2.0, 1.0, 3.0])
        observer.update(q, np.zeros(TREE.n), TREE.gravity(q) - load, 0.1)
        assert observer.contact() == joint, name
    observer.update(q, np.zeros(TREE.n), TREE.gravity(q), 100.0)
    assert observer.contact() == -1


def _last(frame: str, q: Array) -> int:
    return int(np.flatnonzero(np.any(TREE.jacobian(q, frame) != 0.0, axis=0))[-1])


def test_rows_are_arms_side_by_side() -> None:
    rng = np.random.default_rng(8)
    together = al.MomentumObserver(TWO, 30.0, threshold=1.0)
    apart = [al.MomentumObserver(TWO, 30.0, threshold=1.0) for _ in range(4)]
    for _ in range(5):
        q, v, tau = rng.normal(size=(3, 4, 2))
        rows = together.update(q, v, tau, 0.01)
        for k, one in enumerate(apart):
            np.testing.assert_array_equal(one.update(q[k], v[k], tau[k], 0.01), rows[k])
    np.testing.assert_array_equal(together.contact(), [one.contact() for one in apart])
    np.testing.assert_array_equal(together.wrench(q, "link2"), [one.wrench(q[k], "link2") for k, one in enumerate(apart)])


@pytest.mark.parametrize("back", [lambda x: pickle.loads(pickle.dumps(x)), copy.copy, copy.deepcopy])
def test_a_copy_continues_from_the_state_of_the_observer(back: Any) -> None:
    rng = np.random.default_rng(9)
    observer = al.MomentumObserver(TWO, [30.0, 40.0], friction=True)
    observer.calibrate(rng.normal(size=(10, 2)))
    q, v, tau = rng.normal(size=(3, 3, 2))
    observer.update(q[0], v[0], tau[0], 0.01)
    observer.update(q[1], v[1], tau[1], 0.01)
    other = back(observer)
    assert repr(other) == repr(observer) and "gain=[30.0, 40.0]" in repr(observer)
    np.testing.assert_array_equal(other.threshold, observer.threshold)
    np.testing.assert_array_equal(other.update(q[2], v[2], tau[2], 0.01), observer.update(q[2], v[2], tau[2], 0.01))


def test_bad_arguments() -> None:
    def refused(message: str, call: Any) -> None:
        with pytest.raises(al.InputError, match=message):
            call()

    refused("gain", lambda: al.MomentumObserver(TWO, -1.0))
    refused("gain", lambda: al.MomentumObserver(TWO, [1.0, 2.0, 3.0]))
    refused("arm", lambda: al.MomentumObserver(3, 1.0))  # type: ignore[arg-type]
    refused("motor_inertia", lambda: al.MomentumObserver(TWO, 1.0, motor_inertia=[0.0, 1.0]))
    refused("threshold is not positive", lambda: al.MomentumObserver(TWO, 1.0, threshold=0.0))
    refused("friction", lambda: al.MomentumObserver(models.PR, 1.0, friction=True))
    refused("friction goes with no motor_inertia", lambda: al.MomentumObserver(TWO, 1.0, friction=True, motor_inertia=0.1))
    observer = al.MomentumObserver(TWO, 1.0)
    refused("comes too early", lambda: observer.wrench([0.1, 0.2], "link2"))
    refused("threshold is missing", observer.contact)
    observer.reset([0.1, 0.2], [0.0, 0.0])
    refused("dt is not positive", lambda: observer.update([0.1, 0.2], [0.0, 0.0], [0.0, 0.0], 0.0))
    refused("dt", lambda: observer.update([0.1, 0.2], [0.0, 0.0], [0.0, 0.0], np.nan))
    refused("tau .*first bad index", lambda: observer.update([0.1, 0.2], [0.0, 0.0], [0.0, np.nan], 0.1))
    refused("v has another shape", lambda: observer.update([[0.1, 0.2]], [0.0, 0.0], [0.0, 0.0], 0.1))
    refused("q has another shape than before", lambda: observer.update([[0.1, 0.2]], [[0.0, 0.0]], [[0.0, 0.0]], 0.1))
    refused("frame", lambda: observer.wrench([0.1, 0.2], "nowhere"))
    refused("eps is not positive", lambda: observer.wrench([0.1, 0.2], "link2", eps=0.0))
    refused("residuals", lambda: observer.calibrate([[0.0, 1.0]]))
    refused("residuals have no noise", lambda: observer.calibrate(np.zeros((5, 2))))
    refused("sigmas", lambda: observer.calibrate(np.ones((5, 2)), sigmas=0.0))


@pytest.mark.parametrize("gain", [20.0, [[20.0, 1.0], [1.0, 30.0]]], ids=["diagonal", "full"])
@pytest.mark.parametrize("rows", [None, 3])
def test_a_sample_that_overflows_is_refused(gain: Any, rows: int | None) -> None:
    """A sample whose residual would not be finite is refused with name and index, and does not change the state."""
    shape, at, index = ((2,), 1, "1") if rows is None else ((rows, 2), (2, 1), r"\(2, 1\)")
    observer, other = al.MomentumObserver(TWO, gain), al.MomentumObserver(TWO, gain)
    zero, large, one = np.zeros(shape), np.zeros(shape), np.ones(shape)
    large[at] = 1e308
    fast = large + 1e10

    def refused(argument: str, call: Any) -> None:
        with pytest.raises(
            al.InputError, match=rf"{argument} is too large: expected a finite residual, got 1e308 \(first bad index {index}\)"
        ):
            call()

    refused("v", lambda: observer.update(one, fast, zero, 1e-3))
    assert observer.residual is None
    for each in (observer, other):
        each.reset(zero, zero)
        each.update(zero, one, zero, 1e-3)
    refused("v", lambda: observer.reset(one, fast))
    refused("v", lambda: observer.update(one, fast, zero, 1e-3))
    refused("tau", lambda: observer.update(zero, zero, large, 1e3))
    with pytest.raises(al.InputError, match="tau is too large"):
        observer.update(zero, zero, zero + 1e308, 1e3)
    with pytest.raises(al.InputError, match="dt is too large for this gain"):
        observer.update(zero, zero, zero, 1e308)
    again = pickle.loads(pickle.dumps(observer))
    for each in (observer, again):
        np.testing.assert_array_equal(each.residual, other.residual)
    expected = other.update(one, zero, one, 1e-3)
    for each in (observer, again):
        np.testing.assert_array_equal(each.update(one, zero, one, 1e-3), expected)


def test_no_rows_are_refused() -> None:
    observer, none = al.MomentumObserver(TWO, 20.0), np.zeros((0, 2))
    for call in (lambda: observer.reset(none, none), lambda: observer.update(none, none, none, 1e-3)):
        with pytest.raises(al.InputError, match="q has no rows: expected at least one row of 2"):
            call()
    assert observer.residual is None


def test_motors_have_no_friction_of_the_model() -> None:
    with pytest.raises(al.InputError, match="friction goes with no motor_inertia: expected False"):
        al.MomentumObserver(TWO, 20.0, motor_inertia=1.0, friction=True)
    assert al.MomentumObserver(TWO, 20.0, motor_inertia=1.0, friction=False).residual is None
