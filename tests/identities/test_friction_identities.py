"""What models of dry friction promise: joints that stay where they stick, Stribeck's curve, the stiffness before slip, the energy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import armlet as al

ARM = al.planar_arm([0.5, 0.4, 0.3])
PENDULUM = al.pendulum(0.5, 0.0)
METHODS: list[dict[str, Any]] = [{"dt": 1e-2}, {"dt": 1e-2, "method": "semi_implicit"}, {"dt": 5e-2, "method": "ros2"}]
METHODS += [{"method": name} for name in ("dopri5", "dop853", "radau5", "rodas4")]


def line(start: list[float], speed: list[float]) -> al.Table:
    """A motion at a constant speed for ten seconds."""
    ends = [start, [q + 10.0 * v for q, v in zip(start, speed, strict=True)]]
    return al.Table(10.0, ends, [speed] * 2, [[0.0] * len(speed)] * 2)


def named(options: dict[str, Any]) -> str:
    return str(options.get("method", "rk4"))


@pytest.mark.parametrize("options", METHODS, ids=named)
def test_a_stuck_joint_stays(options: dict[str, Any]) -> None:
    """A minute under random constant loads inside the limit: no joint moves at all."""
    rng = np.random.default_rng(3)
    friction = al.StickSlip(coulomb=[2.0, 1.5, 1.0], static=[3.0, 2.0, 1.2], stribeck_speed=0.05)
    arm = al.planar_arm([0.5, 0.4, 0.3], gravity=(0.0, 0.0))
    for _ in range(3):
        q0 = rng.uniform(-1.0, 1.0, 3)
        jacobian = arm.jacobian(q0, "link3")[:3]
        force = np.append(rng.uniform(-2.0, 2.0, 2), 0.0)
        torque = rng.uniform(-0.9, 0.9, 3) * np.array([3.0, 2.0, 1.2]) - jacobian.T @ force
        # kp = 1 and no damping: the torque of the law is `target - q0` as long as nothing moves.
        law = al.PDGravity(arm, q0 + torque, 1.0, 1e-300)
        run = al.simulate(
            al.RigidArm(arm, friction=friction), law, q0, t_end=60.0, force=force, force_frame="link3", check_limits=False, **options
        )
        assert np.abs(run.q - q0).max() == 0.0
        assert (run.v == 0.0).all()
        # The torque that holds a joint is what acts on it; roundings of a few N m.
        np.testing.assert_allclose(run.friction[-1], torque + jacobian.T @ force, atol=1e-13)


@pytest.mark.parametrize("options", [{"dt": 1e-3}, {"method": "radau5"}, {"method": "dopri5"}], ids=named)
def test_bristles_under_a_constant_load_rest(options: dict[str, Any]) -> None:
    """Once the bristles carry the load, a joint drifts by less than 1e-6 rad in a minute."""
    friction = al.LuGre(coulomb=2.0, static=3.0, stribeck_speed=0.05, stiffness=1e4, damping=150.0, viscous=1.0)
    law = al.PDGravity(PENDULUM, [1.8], 1.0, 1e-300)
    run = al.simulate(al.RigidArm(PENDULUM, friction=friction), law, [0.0], t_end=70.0, **options)
    after = run.q[run.t >= 10.0, 0]
    assert len(after) >= 2 and np.abs(after - after[0]).max() < 1e-6
    # Before slip the friction is a spring of stiffness sigma_0, apart from the little that bristles slip on the way.
    assert run.bristles[-1, 0] == pytest.approx(1.8 / 1e4, rel=1e-3)
    assert run.q[-1, 0] == pytest.approx(1.8 / 1e4, rel=0.6)


def test_stiffness_before_slip() -> None:
    """A load of a thousandth of the friction: the joint moves by load / sigma_0."""
    friction = al.LuGre(coulomb=2.0, stiffness=1e4, damping=100.0)
    law = al.PDGravity(PENDULUM, [2e-3], 1.0, 1e-300)
    run = al.simulate(al.RigidArm(PENDULUM, friction=friction), law, [0.0], t_end=2.0, method="radau5", rtol=1e-11, atol=1e-16)
    # z = q apart from sigma_0 |z| / (2 F_c), a part of 5e-4.
    assert run.q[-1, 0] == pytest.approx(2e-3 / 1e4, rel=1e-3)


@pytest.mark.parametrize("speed", [-0.5, -0.03, 0.01, 0.1, 2.0])
def test_steady_friction_is_the_curve(speed: float) -> None:
    """At a constant speed LuGre friction and stick-slip friction are `sign(v) h(v) + d v`."""
    numbers: dict[str, Any] = {"coulomb": 2.0, "static": 3.0, "stribeck_speed": 0.05, "viscous": 0.4}
    curve = np.sign(speed) * (2.0 + np.exp(-((speed / 0.05) ** 2))) + 0.4 * speed
    # The motion keeps the speed; a stiff law follows it.
    law = al.ComputedTorque(PENDULUM, line([0.0], [speed]), kp=1e6, kd=2e3)
    for friction in (al.StickSlip(**numbers), al.LuGre(stiffness=1e4, damping=0.0, **numbers)):
        run = al.simulate(
            al.RigidArm(PENDULUM, friction=friction), law, [0.0], v0=[speed], t_end=8.0, method="radau5", rtol=1e-9, atol=1e-13
        )
        assert run.friction[-1, 0] == pytest.approx(curve, abs=2e-5), type(friction).__name__


@pytest.mark.parametrize("method", ["dopri5", "radau5"])
def test_breakaway(method: str) -> None:
    """Under a torque that grows by 1 N m/s a joint breaks away at its static friction while another one sticks."""
    arm = al.planar_arm([0.5, 0.4], gravity=(0.0, 0.0))
    plant = al.RigidArm(arm, friction=al.StickSlip(coulomb=[1.0, 0.5], static=[3.0, 0.8], stribeck_speed=[0.1, 0.0]))
    law = al.PID(arm, line([0.0, 0.0], [0.0, 1.0]), 1.0, None, 1e-300)
    breaks = al.Event.speed(1, 1e-7, stop=True)
    run = al.simulate(plant, law, [0.0, 0.0], t_end=5.0, method=method, events=breaks)
    # PID feeds the velocity 1 rad/s forward with the gain 1e-300 alone; the error q_d - q = t is the torque.
    assert run.t[-1] == pytest.approx(0.8, abs=1e-6)
    assert (run.v[:-1, 0] == 0.0).all()


def test_load_holds_a_joint() -> None:
    """With `mu` a link under gravity sticks as long as the load that its weight makes is within `F_s + mu |L|`."""
    arm = al.pendulum(0.5, 5.0)
    for ratio, angle, sticks in ((0.0, 0.2, False), (0.0, 0.05, True), (0.7, 1.0, False), (0.9, 0.09, True)):
        # No torque: tau_f = -g is what holds the link, and the load is L = -tau_f.
        friction = al.StickSlip(coulomb=0.4, load_ratio=ratio)
        run = al.simulate(
            al.RigidArm(arm, friction=friction), al.PDGravity(al.pendulum(0.5, 0.0), [angle], 1.0, 1e-300), [angle], t_end=0.2, dt=1e-3
        )
        limit = 0.4 / (1.0 - ratio)
        assert (5.0 * np.sin(angle) <= limit) == sticks
        assert (run.v[-1, 0] == 0.0) == sticks


def test_gears_lose_a_part_of_what_they_transmit() -> None:
    """`F_c = 0`: the drive needs `(1 + mu)` of the load to lift it, and `(1 - mu)` of it to lower it."""
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
    """What friction takes and what bristles store close the balance to 1e-9 J, through slip and stick."""
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
        # Friction takes: its power is never negative.
        assert (run.friction * rate >= -1e-12).all()


def test_hunting() -> None:
    """PID and a friction that falls with speed: the joint sticks and slips around its target without end, and the run gets along."""
    plant = al.RigidArm(PENDULUM, friction=al.StickSlip(coulomb=1.0, static=2.0, stribeck_speed=0.05, viscous=0.1))
    law = al.PID(PENDULUM, [1.0], 30.0, 40.0, 8.0)
    run = al.simulate(plant, law, [0.0], t_end=40.0, method="dopri5")
    stuck = run.v[:, 0] == 0.0
    starts = np.flatnonzero(np.diff(stuck.astype(int)) < 0)
    assert len(starts) >= 4 and run.stats["steps"] < 20_000
    assert np.abs(run.monitors["energy_balance"]).max() < 1e-6


@pytest.mark.parametrize("method", ["dopri5", "radau5"])
def test_a_law_that_switches_does_not_hang(method: str) -> None:
    """A torque that flips with a tiny velocity chatters; the run comes to its end or to a status."""
    plant = al.RigidArm(ARM, friction=al.StickSlip(coulomb=0.2))
    run = al.simulate(
        plant, al.PDGravity(ARM, [0.5, 0.5, 0.5], 400.0, 40.0), [0.0] * 3, t_end=3.0, tau_max=[30.0, 12.0, 3.0], method=method, throw=False
    )
    assert run.status in (al.Status.SUCCESS, al.Status.STALLED)


@pytest.mark.parametrize("t_eval", [None, np.linspace(0.0, 20.0, 401)])
@pytest.mark.parametrize("method", ["radau5", "rodas4", "dopri5"])
def test_a_stuck_joint_is_exactly_at_rest_under_every_adaptive_method(method: str, t_eval: Any) -> None:
    """Implicit methods leave rounding in a velocity that is held, 1e-41 rad/s. Its sign once decided the friction of the record."""
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
    # The slide reaches its place first, and is held there while the others still creep towards theirs.
    stuck = run.v[:, 2] == 0.0
    first = int(np.argmax(np.abs(run.v[:, 2]) > 0.0)) if run.v[0, 2] == 0.0 else 0
    arrives = first + int(np.argmax(stuck[first:]))
    assert arrives > first and run.t[arrives] < 1.0 and stuck[arrives:].all()
    # At rest friction balances the spring of the law; gravity is compensated. What it held, rounds to 1e-9 N.
    held = run.t > run.t[arrives] + 10.0
    np.testing.assert_allclose(run.friction[held, 2], kp[2] * (goal - run.q[held])[:, 2], atol=1e-6)
    assert np.all(np.abs(run.friction[held, 2]) < static[2])
