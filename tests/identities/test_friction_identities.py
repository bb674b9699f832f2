"""Models of dry friction: stuck joints do not move, sliding follows Stribeck's curve, stiffness before slip, energy balance."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest

import armlet as al

ARM = models.THREE_LINKS
PENDULUM = al.pendulum(0.5, 0.0)
METHODS: list[dict[str, Any]] = [{"dt": 1e-2}, {"dt": 1e-2, "method": "semi_implicit"}, {"dt": 5e-2, "method": "ros2"}]
METHODS += [{"method": name} for name in ("dopri5", "dop853", "radau5", "rodas4")]


def line(start: list[float], speed: list[float]) -> al.Table:
    """A motion at constant velocity for ten seconds."""
    ends = [start, [q + 10.0 * v for q, v in zip(start, speed, strict=True)]]
    return al.Table(10.0, ends, [speed] * 2, [[0.0] * len(speed)] * 2)


def named(options: dict[str, Any]) -> str:
    return str(options.get("method", "rk4"))


@pytest.mark.parametrize("options", METHODS, ids=named)
def test_a_stuck_joint_stays(options: dict[str, Any]) -> None:
    """Under random constant loads within static friction, no joint moves during one minute."""
    rng = np.random.default_rng(3)
    friction = al.StickSlip(coulomb=[2.0, 1.5, 1.0], static=[3.0, 2.0, 1.2], stribeck_speed=0.05)
    arm = al.planar_arm([0.5, 0.4, 0.3], gravity=(0.0, 0.0))
    for _ in range(3):
        q0 = rng.uniform(-1.0, 1.0, 3)
        jacobian = arm.jacobian(q0, "link3")[:3]
        force = np.append(rng.uniform(-2.0, 2.0, 2), 0.0)
        torque = rng.uniform(-0.9, 0.9, 3) * np.array([3.0, 2.0, 1.2]) - jacobian.T @ force
        # With kp = 1 and no damping, the law's torque is `target - q0` while the joint does not move.
        law = al.PDGravity(arm, q0 + torque, 1.0, 1e-300)
        run = al.simulate(
            al.RigidArm(arm, friction=friction), law, q0, t_end=60.0, force=force, force_frame="link3", check_limits=False, **options
        )
        assert np.abs(run.q - q0).max() == 0.0
        assert (run.v == 0.0).all()
        # The friction torque equals the applied torque, at most 2.6 N m, up to rounding.
        np.testing.assert_allclose(run.friction[-1], torque + jacobian.T @ force, atol=1e-13)


@pytest.mark.parametrize("method", ["dopri5", "dop853", "radau5", "rodas4"])
def test_the_friction_before_a_stop_opposes_the_motion(method: str) -> None:
    """At the located time of a stop, the velocity is zero up to rounding, and no record has the friction of the other direction."""
    arm = models.TWO_LINKS
    friction = al.StickSlip(coulomb=[2.0, 1.0], static=[3.0, 1.5], stribeck_speed=0.05)
    law = al.PDGravity(arm, [0.5, -0.3], kp=60.0, kd=8.0)
    run = al.simulate(al.RigidArm(arm, friction=friction), law, [0.0, 0.0], t_end=2.0, method=method)
    stop = 1 + int(np.argmax(run.v[1:, 0] == 0.0))
    assert stop > 10 and (run.v[1:stop, 0] > 0.0).all()
    assert (run.friction[1 : stop + 1, 0] > 0.0).all()


@pytest.mark.parametrize("options", [{"dt": 1e-3}, {"method": "radau5"}, {"method": "dopri5"}], ids=named)
def test_bristles_under_a_constant_load_rest(options: dict[str, Any]) -> None:
    """After the bristles have deflected, a joint drifts by less than 1e-6 rad in one minute."""
    friction = al.LuGre(coulomb=2.0, static=3.0, stribeck_speed=0.05, stiffness=1e4, damping=150.0, viscous=1.0)
    law = al.PDGravity(PENDULUM, [1.8], 1.0, 1e-300)
    run = al.simulate(al.RigidArm(PENDULUM, friction=friction), law, [0.0], t_end=70.0, **options)
    after = run.q[run.t >= 10.0, 0]
    assert len(after) >= 2 and np.abs(after - after[0]).max() < 1e-6
    # The deflection of the bristles is the load divided by sigma_0. The joint moves further, because the bristles also slip a little.
    assert run.bristles[-1, 0] == pytest.approx(1.8 / 1e4, rel=1e-3)
    assert run.q[-1, 0] == pytest.approx(1.8 / 1e4, rel=0.6)


def test_stiffness_before_slip() -> None:
    """Under a load of a thousandth of the friction, the joint moves by load / sigma_0 with the stiffness sigma_0 of the bristles."""
    friction = al.LuGre(coulomb=2.0, stiffness=1e4, damping=100.0)
    law = al.PDGravity(PENDULUM, [2e-3], 1.0, 1e-300)
    run = al.simulate(al.RigidArm(PENDULUM, friction=friction), law, [0.0], t_end=2.0, method="radau5", rtol=1e-11, atol=1e-16)
    # z = q except for a relative difference sigma_0 |z| / (2 F_c) = 5e-4.
    assert run.q[-1, 0] == pytest.approx(2e-3 / 1e4, rel=1e-3)


@pytest.mark.parametrize("speed", [-0.5, -0.03, 0.01, 0.1, 2.0])
def test_steady_friction_is_the_curve(speed: float) -> None:
    """At constant velocity, LuGre friction and stick-slip friction equal `sign(v) h(v) + d v`.

    `h` is Stribeck's curve and `d` the viscous coefficient.
    """
    numbers: dict[str, Any] = {"coulomb": 2.0, "static": 3.0, "stribeck_speed": 0.05, "viscous": 0.4}
    curve = np.sign(speed) * (2.0 + np.exp(-((speed / 0.05) ** 2))) + 0.4 * speed
    # The reference has constant velocity, and a stiff law tracks it.
    law = al.ComputedTorque(PENDULUM, line([0.0], [speed]), kp=1e6, kd=2e3)
    for friction in (al.StickSlip(**numbers), al.LuGre(stiffness=1e4, damping=0.0, **numbers)):
        run = al.simulate(
            al.RigidArm(PENDULUM, friction=friction), law, [0.0], v0=[speed], t_end=8.0, method="radau5", rtol=1e-9, atol=1e-13
        )
        assert run.friction[-1, 0] == pytest.approx(curve, abs=2e-5), type(friction).__name__


@pytest.mark.parametrize("method", ["dopri5", "radau5"])
def test_breakaway(method: str) -> None:
    """Under a torque that grows by 1 N m/s, a joint slips at its static friction while another joint sticks."""
    arm = al.planar_arm([0.5, 0.4], gravity=(0.0, 0.0))
    plant = al.RigidArm(arm, friction=al.StickSlip(coulomb=[1.0, 0.5], static=[3.0, 0.8], stribeck_speed=[0.1, 0.0]))
    law = al.PID(arm, line([0.0, 0.0], [0.0, 1.0]), 1.0, None, 1e-300)
    breaks = al.Event.speed(1, 1e-7, stop=True)
    run = al.simulate(plant, law, [0.0, 0.0], t_end=5.0, method=method, events=breaks)
    # The velocity 1 rad/s enters PID only with the gain 1e-300. So the torque is the error q_d - q = t.
    assert run.t[-1] == pytest.approx(0.8, abs=1e-6)
    assert (run.v[:-1, 0] == 0.0).all()


def test_load_holds_a_joint() -> None:
    """A link under gravity sticks as long as the torque of its weight is at most `F_s + mu |L|`.

    `F_s` is the static friction, `mu` the load ratio and `L` the transmitted torque.
    """
    arm = al.pendulum(0.5, 5.0)
    for ratio, angle, sticks in ((0.0, 0.2, False), (0.0, 0.05, True), (0.7, 1.0, False), (0.9, 0.09, True)):
        # Without torque, friction holds the link: tau_f = -g. The transmitted torque is L = -tau_f.
        friction = al.StickSlip(coulomb=0.4, load_ratio=ratio)
        run = al.simulate(
            al.RigidArm(arm, friction=friction), al.PDGravity(al.pendulum(0.5, 0.0), [angle], 1.0, 1e-300), [angle], t_end=0.2, dt=1e-3
        )
        limit = 0.4 / (1.0 - ratio)
        assert (5.0 * np.sin(angle) <= limit) == sticks
        assert (run.v[-1, 0] == 0.0) == sticks


def test_gears_lose_a_part_of_what_they_transmit() -> None:
    """Without Coulomb friction, the drive needs `(1 + mu)` times the load to lift it, and `(1 - mu)` times the load to lower it."""
    arm, mu = al.pendulum(0.5, 5.0), 0.25
    plant = al.RigidArm(arm, friction=al.StickSlip(coulomb=0.0, load_ratio=mu))
    for direction in (1.0, -1.0):
        law = al.ComputedTorque(arm, line([0.8], [0.1 * direction]), kp=1e6, kd=2e3)
        run = al.simulate(plant, law, [0.8], v0=[0.1 * direction], t_end=3.0, method="radau5")
        load = arm.gravity(run.q[-1])[0]
        assert run.tau[-1, 0] == pytest.approx((1.0 + direction * mu) * load, rel=1e-4)


@pytest.mark.parametrize("friction", ["LuGre", "StickSlip"])
@pytest.mark.parametrize("elastic", [False, True])
def test_energy_balances(friction: str, elastic: bool) -> None:
    """With the losses of friction and the energy of bristles, the balance is zero to 1e-9 J, during slip and stick."""
    numbers: dict[str, Any] = {
        "coulomb": [2.0, 1.0, 0.5],
        "static": [2.5, 1.5, 0.6],
        "stribeck_speed": 0.1,
        "viscous": 0.2,
        "load_ratio": 0.1,
    }
    model = al.LuGre(stiffness=2e3, damping=5.0, **numbers) if friction == "LuGre" else al.StickSlip(**numbers)
    target, K = [0.8, -0.4, 0.3], [2000.0, 1500.0, 900.0]
    if elastic:
        plant: al.Plant = al.ElasticArm(ARM, K, [0.4, 0.3, 0.2], motor_friction=model)
        law: al.Law = al.MotorPD(ARM, target, 60.0, 2.0, K)
    else:
        plant, law = al.RigidArm(ARM, friction=model), al.PDGravity(ARM, target, 60.0, 2.0)
    run = al.simulate(plant, law, [0.0, 0.0, 0.0], t_end=4.0, method="dop853", rtol=1e-12, atol=1e-13)
    assert np.abs(run.monitors["energy_balance"]).max() < 1e-9
    assert run.monitors["energy"].max() - run.monitors["energy"].min() > 0.1
    rate = run.theta_dot if elastic else run.v
    if friction == "StickSlip":
        assert (rate[-1] == 0.0).all()
        # Friction dissipates: the power that it takes from the joints or motors is never negative.
        assert (run.friction * rate >= -1e-12).all()


def test_hunting() -> None:
    """Under PID and friction that decreases with speed, the joint sticks and slips around its target forever. The run must not stall."""
    plant = al.RigidArm(PENDULUM, friction=al.StickSlip(coulomb=1.0, static=2.0, stribeck_speed=0.05, viscous=0.1))
    law = al.PID(PENDULUM, [1.0], 30.0, 40.0, 8.0)
    run = al.simulate(plant, law, [0.0], t_end=40.0, method="dopri5")
    stuck = run.v[:, 0] == 0.0
    starts = np.flatnonzero(np.diff(stuck.astype(int)) < 0)
    assert len(starts) >= 4 and run.stats["steps"] < 20_000
    assert np.abs(run.monitors["energy_balance"]).max() < 1e-6


@pytest.mark.parametrize("method", ["dopri5", "radau5"])
def test_a_law_that_switches_does_not_hang(method: str) -> None:
    """A torque that depends on the sign of a tiny velocity chatters. The run reaches its end or ends with a status."""
    plant = al.RigidArm(ARM, friction=al.StickSlip(coulomb=0.2))
    run = al.simulate(
        plant, al.PDGravity(ARM, [0.5, 0.5, 0.5], 400.0, 40.0), [0.0] * 3, t_end=3.0, tau_max=[30.0, 12.0, 3.0], method=method, throw=False
    )
    assert run.status in (al.Status.SUCCESS, al.Status.STALLED)


@pytest.mark.parametrize("t_eval", [None, np.linspace(0.0, 20.0, 401)])
@pytest.mark.parametrize("method", ["radau5", "rodas4", "dopri5"])
def test_a_stuck_joint_is_exactly_at_rest_under_every_adaptive_method(method: str, t_eval: Any) -> None:
    """Implicit methods must not leave a rounding error in a stuck velocity: its sign would change the recorded friction."""
    bodies = (
        [5, 1.0, 0, 0.1, 0.1, 0, 0.3, 0, 0, 0.3],
        [3, 0.5, 0, 0, 0.03, 0, 0.15, 0, 0, 0.15],
        [1.5, 0, 0, -0.3, 0.08, 0, 0.08, 0, 0, 0.01],
    )
    joints = zip("RRP", ([0, 0, 0.4], [0.4, 0, 0], [0.3, 0, 0]), bodies, strict=True)
    arm = al.Arm.from_chain([{"type": kind, "axis": [0, 0, 1], "xyz": xyz, "phi": phi} for kind, xyz, phi in joints])
    goal, kp, static = np.array([0.4, 0.7, -0.02]), np.array([230.0, 170.0, 950.0]), np.array([4.0, 3.0, 12.0])
    law = al.PDGravity(arm, goal, kp, [60.0, 40.0, 100.0])
    friction = al.StickSlip(coulomb=[3.0, 2.0, 8.0], static=static, stribeck_speed=0.03, viscous=[1.0, 1.0, 5.0])
    run = al.simulate(al.RigidArm(arm, friction=friction), law, [0.3, 0.8, -0.05], t_end=20.0, method=method, t_eval=t_eval)
    # The prismatic joint reaches its target first and sticks there while the other joints still move.
    stuck = run.v[:, 2] == 0.0
    first = int(np.argmax(np.abs(run.v[:, 2]) > 0.0)) if run.v[0, 2] == 0.0 else 0
    arrives = first + int(np.argmax(stuck[first:]))
    assert arrives > first and run.t[arrives] < 1.0 and stuck[arrives:].all()
    # At rest, friction balances the spring of the law, since gravity is compensated.
    held = run.t > run.t[arrives] + 10.0
    np.testing.assert_allclose(run.friction[held, 2], kp[2] * (goal - run.q[held])[:, 2], atol=1e-6)
    assert np.all(np.abs(run.friction[held, 2]) < static[2])


def test_an_arm_that_rests_on_its_bristles_does_not_stop_newton() -> None:
    """At rest, Newton's increments are rounding errors, and one may be larger than the one before."""
    arm = models.TWO_LINKS
    friction = al.LuGre(coulomb=[2.0, 1.0], static=[3.0, 1.5], stribeck_speed=0.05, stiffness=1e5, damping=300.0, viscous=0.5)
    law = al.PDGravity(arm, [0.5, -0.3], kp=60.0, kd=8.0)
    starts = [[0.001 * k, 0.0] for k in range(40)]
    batch = al.simulate_batch(al.RigidArm(arm, friction=friction), law, starts, t_end=60.0, method="radau5", keep="final")
    assert (batch.status == al.Status.SUCCESS).all()
