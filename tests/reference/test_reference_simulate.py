"""Closed loops of the reference: sampling, records, saturation, force jumps and velocity control."""

from typing import Any

import models
import numpy as np
import pytest

from armlet import reference as ref


def double_integrators() -> tuple[Any, Any]:
    """Return two uncoupled masses, 2 and 0.5, under PD. The sampled motion has a closed form."""
    arm = ref.planar_pr(2.0, 0.0, 0.5)
    return arm, ref.PDGravity(arm, [1.0, -1.0], [8.0, 3.0], [4.0, 1.0])


def sampled_by_hand(T: float, count: int) -> np.ndarray:
    m, target, kp, kd = (np.array(x) for x in ([2.0, 0.5], [1.0, -1.0], [8.0, 3.0], [4.0, 1.0]))
    q, v, rows = np.zeros(2), np.array([0.5, 0.0]), []
    for _ in range(count + 1):
        u = (kp * (target - q) - kd * v) / m
        rows.append([*q, *v, *(m * u)])
        q, v = q + T * v + T * T / 2 * u, v + T * u
    return np.array(rows)


@pytest.mark.parametrize("method", ["rk4", "gbs"])
def test_a_sampled_loop_holds_its_input(method: str) -> None:
    arm, law = double_integrators()
    T, count = 0.05, 20
    by_hand = sampled_by_hand(T, count)
    options: dict[str, Any] = {"t_eval": T * np.arange(count + 1)} | ({"dt": 0.01} if method == "rk4" else {})
    run = ref.simulate(ref.RigidArm(arm), law, [0.0, 0.0], v0=[0.5, 0.0], t_end=T * count, sample_time=T, method=method, **options)
    got = np.hstack([run["q"], run["v"], run["tau"]])
    # The torque is constant between samples, so both methods are exact except for rounding.
    np.testing.assert_allclose(got, by_hand, atol=1e-12)
    free = ref.simulate(ref.RigidArm(arm), law, [0.0, 0.0], v0=[0.5, 0.0], t_end=T * count, t_eval=[T * count], method="gbs")
    assert np.abs(free["q"][-1] - by_hand[-1, :2]).max() > 1e-3


def test_a_sampled_estimate_has_a_constant_rate() -> None:
    arm = models.REFERENCE_PR
    law = ref.Adaptive(arm, ref.Quintic([0.0, 0.0], [1.0, 1.5], 3.0), [40.0, 20.0], [20.0, 10.0], 5.0)
    run = ref.simulate(ref.RigidArm(arm), law, [0.1, 0.0], t_end=0.04, dt=0.01, sample_time=0.02)
    # Between samples the estimate changes at a constant rate. At a sample this rate changes.
    steps = np.diff(run["estimate"], axis=0)
    np.testing.assert_allclose(steps[0], steps[1], rtol=1e-12, atol=1e-18)
    np.testing.assert_allclose(steps[2], steps[3], rtol=1e-12, atol=1e-18)
    assert np.abs(steps[2] - steps[1]).max() > 1e-6
    assert np.array_equal(run["tau"][0], run["tau"][1]) and not np.array_equal(run["tau"][1], run["tau"][2])


def test_records() -> None:
    arm, law = double_integrators()
    plant = ref.RigidArm(arm)
    every = ref.simulate(plant, law, [0.0, 0.0], t_end=0.105, dt=0.01)
    third = ref.simulate(plant, law, [0.0, 0.0], t_end=0.105, dt=0.01, record_every=3)
    np.testing.assert_allclose(third["t"], [0.0, 0.03, 0.06, 0.09, 0.105], atol=1e-15)
    assert np.array_equal(third["q"], every["q"][[0, 3, 6, 9, 11]])
    asked = ref.simulate(plant, law, [0.0, 0.0], t_end=0.105, dt=0.01, t_eval=[0.0, 0.025, 0.03, 0.1, 0.105])
    assert np.array_equal(asked["t"], [0.0, 0.025, 0.03, 0.1, 0.105])
    assert np.array_equal(asked["q"][[0, 2, 3, 4]], every["q"][[0, 3, 10, 11]])
    exact = ref.simulate(plant, law, [0.0, 0.0], t_end=0.105, t_eval=[0.025], method="gbs")
    # RK4 over 0.025 s with rates of 2 to 4 per second errs by about (4 * 0.01)^4 * 0.025 = 6e-8.
    np.testing.assert_allclose(asked["q"][1], exact["q"][0], atol=1e-7)


def test_torque_is_clipped_and_accounted_for() -> None:
    arm, law = double_integrators()
    run = ref.simulate(ref.RigidArm(arm), law, [0.0, 0.0], t_end=1.0, dt=1e-3, tau_max=[1.0, 0.5])
    assert run["tau"].max(axis=0)[0] == 1.0 and run["tau"].min(axis=0)[1] == -0.5
    # The balance uses the clipped torque. A kink of the torque inside a step costs RK4 an error of h^2.
    assert np.abs(run["energy_balance"]).max() <= 1e-6 < run["energy"].max()
    np.testing.assert_allclose(run["q"][500], [0.5 * 0.5 * 0.25, -0.5 * 1.0 * 0.25], rtol=1e-9)  # still saturated at 0.5 s


@pytest.mark.parametrize("dt", [0.1, 0.25, 1.0])
def test_a_force_jump_inside_a_step_is_landed_on(dt: float) -> None:
    """RK4 steps end at the jumps of a piecewise constant force on free masses, 2 and 0.5, so the result is exact."""
    arm = ref.planar_pr(2.0, 0.0, 0.5)
    law = ref.PDGravity(arm, [0.0, 0.0], 0.0, 0.0)
    force = [(0.0, [4.0, 0.0]), (0.37, [-2.0, 1.0]), (0.75, [0.0, 0.0])]
    run = ref.simulate(ref.RigidArm(arm), law, [0.0, 0.0], t_end=1.0, dt=dt, force=force, load=lambda q, F: F)
    v1, q1 = 2.0 * 0.37, 0.37**2
    v2 = np.array([v1 - 0.38, 2.0 * 0.38])
    q2 = np.array([q1 + v1 * 0.38 - 0.5 * 0.38**2, 0.38**2])
    np.testing.assert_allclose(run["v"][-1], v2, atol=1e-14)
    np.testing.assert_allclose(run["q"][-1], q2 + 0.25 * v2, atol=1e-14)
    assert np.abs(run["energy_balance"]).max() <= 1e-14


def test_a_constant_force_moves_the_impedance_to_its_equilibrium() -> None:
    arm = models.REFERENCE_TWO_LINKS
    K, F = np.array([200.0, 100.0]), np.array([5.0, -4.0])
    law = ref.CartesianImpedance(arm, [0.5, 0.3], K, [40.0, 30.0], frame="link2", axes="xy")
    run = ref.simulate(ref.RigidArm(arm), law, [0.3, 1.2], t_end=4.0, dt=0.005, force=F, record_every=800)
    # The tip rests at x_E = x_d + K_m^-1 F. The slowest mode decays at least by exp(-3 * 4).
    np.testing.assert_allclose(arm.position(run["q"][-1], "link2")[:2], [0.5, 0.3] + F / K, atol=1e-4)
    assert np.abs(run["v"][-1]).max() < 1e-3


def test_computed_torque_makes_the_error_linear() -> None:
    arm = ref.planar_arm([0.5, 0.4, 0.2])
    motion = ref.Sinusoid([0.1, 0.2, 0.3], [0.5, 0.4, 0.3], [1.0, 2.0, 3.0], 0.0)
    law = ref.ComputedTorque(arm, motion, 16.0, 8.0)
    times = np.array([0.0, 0.2, 0.7, 1.5])
    run = ref.simulate(ref.RigidArm(arm), law, [0.4, 0.0, 0.1], t_end=1.5, t_eval=times, method="gbs", rtol=1e-10, atol=1e-10)
    error = np.array([motion(float(t))[0] for t in times]) - run["q"]
    e0, r0 = error[0], motion(0.0)[1]
    expected = np.exp(-4 * times)[:, None] * (e0 + np.outer(times, r0 + 4 * e0))  # double root at -4
    np.testing.assert_allclose(error, expected, atol=1e-8)


def test_velocity_loop_follows_its_tasks_in_order() -> None:
    arm = ref.planar_arm([1.0, 1.0, 0.25, 0.25])
    q0 = np.array([0.1, 0.9, -0.8, 1.2])
    start = [arm.position(q0, f"link{k}")[:2] for k in (4, 2)]
    tasks = [
        ref.Task("link4", "xy", target=start[0] + [0.02, -0.03], gain=2.0),
        ref.Task("link2", "xy", motion=ref.Quintic(start[1], start[1] + [0.0, 0.05], 1.0), gain=2.0),
    ]
    law = ref.PriorityVelocity(arm, tasks, eps=[0.05, 0.02])
    run = ref.simulate(ref.VelocityArm(arm), law, q0, t_end=1.5, dt=0.01)
    tips = arm.position(run["q"], "link4")[:, :2]
    # No singularity occurs, so the error of the first task is e0 exp(-2 t), to the accuracy of RK4.
    wanted = start[0] + np.outer(1.0 - np.exp(-2.0 * run["t"]), [0.02, -0.03])
    np.testing.assert_allclose(tips, wanted, atol=1e-7)
    np.testing.assert_allclose(arm.position(run["q"][-1], "link2")[:2], start[1] + [0.0, 0.05], atol=1e-4)


def test_orientation_task_turns_to_its_target() -> None:
    rng = np.random.default_rng(8)
    joints = [{"type": "R", "axis": axis, "xyz": rng.normal(size=3) * 0.2} for axis in np.vstack([np.eye(3), np.eye(3)[::-1]])]
    arm = ref.Arm.from_chain(joints)
    target = np.array([0.3, -0.5, 0.8])
    law = ref.PriorityVelocity(arm, [ref.Task("link6", "rx ry rz", target=target, gain=3.0)])
    run = ref.simulate(ref.VelocityArm(arm), law, rng.normal(size=6) * 0.3, t_end=6.0, dt=0.02, record_every=300)
    from armlet.reference import task

    turned = arm.pose(run["q"][-1], "link6")[:3, :3]
    np.testing.assert_allclose(turned, task.rotation_matrix(target), atol=1e-6)  # exp(-18) = 1.5e-8 of the start


def test_misuse() -> None:
    arm, law = double_integrators()
    with pytest.raises(ValueError, match="dt is missing"):
        ref.simulate(ref.RigidArm(arm), law, [0.0, 0.0], t_end=1.0)
    with pytest.raises(ValueError, match="rk4"):
        ref.simulate(ref.RigidArm(arm), law, [0.0, 0.0], t_end=1.0, dt=0.1, method="rk5")
    with pytest.raises(ValueError, match="no frame"):
        ref.simulate(ref.RigidArm(arm), law, [0.0, 0.0], t_end=1.0, dt=0.1, force=[1.0, 0.0])
    with pytest.raises(ValueError, match="motion or target"):
        ref.PriorityVelocity(ref.planar_arm([1.0]), [ref.Task("link1", "xy")])
