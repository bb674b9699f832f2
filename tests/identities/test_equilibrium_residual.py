"""The residual of an equilibrium: it is zero exactly at the states from which a run does not move."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest

import armlet as al

TIP: dict[str, Any] = {"frame": "link2", "axes": "xy"}
CART = {"type": "P", "axis": [1, 0, 0], "phi": [5, 0, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1]}
LINK = {"type": "R", "axis": [0, 0, 1], "phi": [2, 0.4, 0, 0, 0.02, 0, 0.12, 0, 0, 0.12]}
RAIL = al.Arm.from_chain([CART, LINK], gravity=[0.0, 0.0, -9.81]).with_frame("tip", "link2", xyz=[0.5, 0.0, 0.0])
ARM = models.TWO_LINKS
K, B, FULL = np.array([800.0, 500.0]), np.array([0.4, 0.25]), np.array([[0.4, 0.1], [0.1, 0.25]])
GAINS: Any = ([0.6, 0.4], [300.0, 200.0], [40.0, 30.0])


def moved(plant: al.Plant, law: al.Law, rest: al.Equilibrium, **force: Any) -> float:
    """The largest change of a position within 0.5 s from the equilibrium at rest."""
    motors = {} if rest.theta is None else {"theta0": rest.theta, "theta_dot0": np.zeros(len(rest.q))}
    run = al.simulate(plant, law, rest.q, t_end=0.5, method="rodas4", throw=False, check_limits=False, **motors, **force)
    return float(np.abs(run.q[-1] - rest.q).max())


@pytest.mark.parametrize("frame", ["tip", "link1"])
@pytest.mark.parametrize("elastic", [False, True])
def test_a_force_along_a_free_motion_has_no_equilibrium(frame: str, elastic: bool) -> None:
    """A rail is pushed by 10 N, and the law controls only the axis across the rail."""
    force: dict[str, Any] = {"force": [10.0, 0.0, 0.0], "force_frame": frame}
    axis: dict[str, Any] = {"frame": "tip", "axes": "y"}
    if elastic:
        plant: al.Plant = al.ElasticArm(RAIL, K, B)
        law: al.Law = al.ElasticImpedance(RAIL, [0.3], 300.0, 40.0, K, B, B / 10, **axis)
    else:
        plant, law = al.RigidArm(RAIL), al.CartesianImpedance(RAIL, [0.3], 300.0, 40.0, **axis)
    pushed = al.equilibrium(plant, law, q0=[0.0, 0.5], **force)
    assert moved(plant, law, pushed, **force) > 0.05
    # The elastic law amplifies the unbalanced joint torque by B / B0 = 10.
    np.testing.assert_allclose(pushed.residual, [100.0 if elastic else 10.0, 0.0], rtol=0.0, atol=1e-6)
    assert not pushed.stable and not pushed.reachable and not pushed.spurious
    across = {"force": [0.0, 10.0, 0.0], "force_frame": "tip"}
    rest = al.equilibrium(plant, law, q0=[0.0, 0.5], **across)
    assert np.abs(rest.residual).max() < 1e-9 and rest.reachable and rest.free_motions == 1
    assert moved(plant, law, rest, **across) < 1e-6


@pytest.mark.parametrize("tau_max", [[12.0, 40.0], [6.0, 5.0], [1e3, 1e3]])
@pytest.mark.parametrize("inertia", [B, FULL], ids=["diagonal", "full"])
def test_a_limited_motor_is_at_rest(inertia: Any, tau_max: Any) -> None:
    """With a full motor inertia, a motor at its limit changes the torque that the other motors balance."""
    plant = al.ElasticArm(ARM, K, inertia)
    law = al.ElasticImpedance(ARM, [0.8, 0.3], [900.0, 900.0], [40.0, 30.0], K, inertia, B / 20, **TIP, tau_max=tau_max)
    rest = al.equilibrium(plant, law, [-40.0, 10.0], q0=[0.3, 0.9])
    assert rest.theta is not None
    # The law's torque equals the torque of the springs, which equals the load.
    zero = np.zeros(2)
    load = ARM.gravity(rest.q) - ARM.jacobian(rest.q, "link2")[:2].T @ [-40.0, 10.0]
    np.testing.assert_allclose(rest.tau, load, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(K * (rest.theta - rest.q), load, rtol=0.0, atol=1e-9)
    # B / B0 multiplies rounding errors by up to 25.
    np.testing.assert_allclose(law(0.0, rest.q, zero, theta=rest.theta, theta_dot=zero), load, rtol=0.0, atol=1e-8)
    assert np.abs(rest.residual).max() < 1e-8


@pytest.mark.parametrize("integral", [None, 200.0])
@pytest.mark.parametrize("name", ["impedance", "joint"])
def test_a_law_with_a_wrong_joint_stiffness_is_at_rest(name: str, integral: float | None) -> None:
    """The law computes joint torques of 0.8 times the true ones, so it misses its target unless it has an integral."""
    plant = al.ElasticArm(ARM, K, FULL)
    more = {} if integral is None else {"integral_gain": integral}
    law: al.Law = al.ElasticImpedance(ARM, *GAINS, 0.8 * K, FULL, B / 4, **TIP, **more)
    if name == "joint":
        law = al.JointImpedance(ARM, [0.3, 1.0], 100.0, 8.0, 0.8 * K, FULL, B / 4)
    rest = al.equilibrium(plant, law, [4.0, -3.0, 0.0], q0=[0.3, 1.0], force_frame="link2")
    assert rest.theta is not None
    given = {} if rest.estimate is None else {"state": rest.estimate}
    zero = np.zeros(2)
    torque = law(0.0, rest.q, zero, theta=rest.theta, theta_dot=zero, **given)
    load = ARM.gravity(rest.q) - ARM.jacobian(rest.q, "link2")[:2].T @ [4.0, -3.0]
    np.testing.assert_allclose(K * (rest.theta - rest.q), load, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(torque, load, rtol=0.0, atol=1e-8)
    if rest.estimate is not None:
        np.testing.assert_allclose(ARM.position(rest.q, "link2")[:2], GAINS[0], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_a_residual_of_zero_means_that_nothing_moves(seed: int) -> None:
    """Random laws, limits, contacts and friction. Where the residual is zero, a run stays; else no flag is set."""
    rng = np.random.default_rng(seed)
    for arm in (RAIL, ARM):
        q0, tip = rng.uniform(-0.8, 1.2, 2), arm.frame_names[-1]
        frame, force = str(rng.choice(arm.frame_names)), rng.uniform(-15.0, 15.0, 3)
        target = arm.position(q0 + rng.uniform(-0.3, 0.3, 2), tip)[:2]
        contact: dict[str, Any] = {
            "wall": al.Wall(tip, [0.6, 0.0, 0.0], [-1.0, 0.0, 0.0], stiffness=2e3, damping=20.0) if seed % 3 == 0 else None,
            "stops": al.JointStops(500.0, 20.0, q0 - 0.05, q0 + 0.05) if seed % 3 == 1 else None,
        }
        more: dict[str, Any] = {"frame": tip, "axes": "xy" if seed % 2 else "y"}
        target = target[2 - len(more["axes"]) :]
        limits = {"tau_max": rng.uniform(5.0, 40.0, 2)} if seed % 2 else {}
        rigid, elastic = al.RigidArm(arm, **contact), al.ElasticArm(arm, K, FULL, motor_friction=[0.3, 0.2], **contact)
        loops: list[tuple[al.Plant, al.Law]] = [
            (rigid, al.CartesianImpedance(arm, target, 300.0, 40.0, **more, **limits)),
            (al.RigidArm(arm.with_drives(damping=[0.5, 0.5]), friction=True, **contact), al.PDGravity(arm, q0, [20.0, 10.0], 5.0)),
            (elastic, al.ElasticImpedance(arm, target, 300.0, 40.0, 0.9 * K, FULL, B / 5, **more, **limits)),
            (elastic, al.JointImpedance(arm, q0, 60.0, 8.0, K, FULL, B / 5)),
            (elastic, al.MotorPD(arm, q0, 150.0, 30.0, 0.9 * K, online=bool(seed % 2))),
            (elastic, al.StateFeedback(arm, q0, 150.0, 30.0, 1.0, 0.02, K)),
        ]
        for plant, law in loops:
            try:
                rest = al.equilibrium(plant, law, force, q0=q0, force_frame=frame)
            except al.SolveError:
                continue
            if np.abs(rest.residual).max() > 1e-6:
                assert not rest.stable and not rest.reachable and not rest.spurious
            elif rest.stable:
                assert moved(plant, law, rest, force=force, force_frame=frame) < 1e-6
