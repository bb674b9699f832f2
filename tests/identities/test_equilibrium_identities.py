"""Equilibria of elastic arms under laws of motors, against walls and at stops.

They are compared with the end of a long run. The flags of an equilibrium are checked too.
"""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest

import armlet as al

ARM = models.TWO_HEAVY_LINKS
K, B = np.array([800.0, 500.0]), np.array([0.4, 0.25])
FULL_K = np.array([[800.0, 50.0], [50.0, 500.0]])
FORCE = np.array([10.0, -15.0, 0.0])
START = [0.2, 1.1]
WALL = al.Wall("link2", [0.6, 0.0, 0.0], [-1.0, 0.0, 0.0], stiffness=5e3, damping=50.0)

LAWS: dict[str, al.Law] = {
    "motor": al.MotorPD(ARM, [0.3, 1.0], 150.0, 30.0, K),
    "online": al.MotorPD(ARM, [0.3, 1.0], 150.0, 30.0, K, online=True),
    "state": al.StateFeedback(ARM, [0.3, 1.0], 150.0, 30.0, 1.0, 0.02, K),
    "full": al.StateFeedback(ARM, [0.3, 1.0], [[150.0, 20.0], [20.0, 120.0]], 30.0, [[1.0, 0.2], [0.2, 0.5]], 0.02, FULL_K),
    "joint": al.JointImpedance(ARM, [0.3, 1.0], 100.0, 8.0, K, B, B / 10),
}


def settled(plant: al.Plant, law: al.Law, force: Any = None, frame: str | None = "link2") -> al.Run:
    return al.simulate(
        plant,
        law,
        START,
        t_end=60.0,
        method="radau5",
        rtol=1e-8,
        atol=1e-10,
        t_eval=[60.0],
        force=force,
        force_frame=frame if force is not None else None,
    )


@pytest.mark.parametrize("wall", [None, WALL])
@pytest.mark.parametrize("name", LAWS)
def test_the_rest_is_where_a_run_ends(name: str, wall: al.Wall | None) -> None:
    plant = al.ElasticArm(ARM, FULL_K if name == "full" else K, B, wall=wall)
    rest = al.equilibrium(plant, LAWS[name], FORCE, q0=START, force_frame="link2")
    end = settled(plant, LAWS[name], FORCE)
    # The run has converged.
    np.testing.assert_allclose(rest.q, end.q[-1], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(rest.theta, end.theta[-1], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(rest.tau, end.tau[-1], rtol=0.0, atol=1e-3)
    assert rest.stable and not rest.spurious and rest.theta is not None
    # The equilibrium is exact: the law's torque equals the torque of the springs, which balances gravity, force and wall.
    zero = np.zeros(2)
    np.testing.assert_allclose(LAWS[name](0.0, rest.q, zero, theta=rest.theta, theta_dot=zero), rest.tau, rtol=0.0, atol=1e-9)
    push = np.zeros(3) if rest.wall_force is None else rest.wall_force
    load = ARM.gravity(rest.q) - ARM.jacobian(rest.q, "link2")[:3].T @ (FORCE + push)
    np.testing.assert_allclose(rest.tau, load, rtol=0.0, atol=1e-9)
    if wall is not None:
        assert push[0] < 0.0 and not rest.reachable
        np.testing.assert_allclose(push, [5e3 * (0.6 - ARM.position(rest.q, "link2")[0]), 0.0, 0.0], rtol=0.0, atol=1e-9)


def test_unforced_laws_of_motors_rest_at_their_target() -> None:
    for name in ("motor", "online", "state"):
        rest = al.equilibrium(al.ElasticArm(ARM, K, B), LAWS[name], q0=START)
        np.testing.assert_allclose(rest.q, [0.3, 1.0], rtol=0.0, atol=1e-12)
        assert rest.reachable and rest.stable and not rest.spurious


def test_a_weak_law_of_motors_rests_where_it_should_not() -> None:
    # kp is below the largest derivative of gravity, 5 N m/rad, so there are equilibria other than the target.
    link = models.PENDULUM
    plant = al.ElasticArm(link, 500.0, 0.2)
    law = al.MotorPD(link, [0.5], 0.2, 1.0, 500.0)
    rest = al.equilibrium(plant, law, q0=[6.5])
    assert rest.spurious and abs(rest.q[0] - 0.5) > 1.0
    home = al.equilibrium(plant, law, q0=[0.4])
    assert not home.spurious and home.stable and abs(home.q[0] - 0.5) < 1e-12


def test_an_impedance_against_a_wall_is_two_springs_in_series() -> None:
    law = al.ElasticImpedance(ARM, [0.7, 0.3], [300.0, 200.0], [40.0, 30.0], K, B, B / 10, frame="link2", axes="xy")
    plant = al.ElasticArm(ARM, K, B, wall=WALL)
    rest = al.equilibrium(plant, law, q0=START)
    assert rest.wall_force is not None and rest.stable and not rest.spurious and not rest.reachable
    x = (300.0 * 0.7 + 5e3 * 0.6) / 5300.0
    np.testing.assert_allclose(rest.x, [x, 0.3], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(rest.wall_force[0], -300.0 * (0.7 - x), rtol=1e-9)
    # Far from the wall, the equilibrium is that without a wall.
    away = al.ElasticImpedance(ARM, [0.5, 0.3], [300.0, 200.0], [40.0, 30.0], K, B, B / 10, frame="link2", axes="xy")
    free = al.equilibrium(plant, away, q0=START)
    assert free.reachable and not free.spurious and not np.any(free.wall_force)
    np.testing.assert_array_equal(free.q, al.equilibrium(al.ElasticArm(ARM, K, B), away, q0=START).q)


def test_a_wall_at_the_elbow_holds_the_tip_back() -> None:
    elbow = al.Wall("link1", [0.0, 0.2, 0.0], [0.0, -1.0, 0.0], stiffness=1e4)
    law = al.CartesianImpedance(ARM, [0.3, 0.75], 300.0, 40.0, frame="link2", axes="xy")
    rest = al.equilibrium(al.RigidArm(ARM, wall=elbow), law, q0=[0.3, 1.2])
    assert rest.wall_force is not None and rest.wall_force[1] < 0.0 and not rest.reachable
    # The wall at the elbow balances the tip's spring at the joints. So the equilibrium is not spurious.
    assert not rest.spurious and np.max(np.abs(rest.x - [0.3, 0.75])) > 1e-3


def test_a_stop_holds_a_joint() -> None:
    stops = al.JointStops(1e4, upper=[0.25, 3.0])
    law = al.PDGravity(ARM, [0.5, 1.0], 100.0, 20.0)
    rest = al.equilibrium(al.RigidArm(ARM, stops=stops), law, q0=[0.0, 1.0])
    np.testing.assert_allclose(rest.q, [(100.0 * 0.5 + 1e4 * 0.25) / 10100.0, 1.0], rtol=0.0, atol=1e-12)
    assert not rest.reachable and rest.stable and not rest.spurious


@pytest.mark.parametrize("plant", ["rigid", "elastic"])
def test_bristles_without_a_load_leave_the_rest(plant: str) -> None:
    bristles = al.LuGre(coulomb=1.0, static=2.0, stribeck_speed=0.1, stiffness=300.0, damping=1.0)
    if plant == "rigid":
        law: al.Law = al.PDGravity(ARM, target=[0.3, 1.0], kp=80.0, kd=10.0)
        smooth, dry = al.RigidArm(ARM), al.RigidArm(ARM, friction=bristles)
    else:
        law = LAWS["joint"]
        smooth, dry = al.ElasticArm(ARM, K, B), al.ElasticArm(ARM, K, B, motor_friction=bristles)
    want, got = (al.equilibrium(p, law, q0=START) for p in (smooth, dry))
    np.testing.assert_array_equal(got.q, want.q)
    assert got.stable and got.eigenvalues.size == want.eigenvalues.size + 2
    # A bristle at rest acts as a spring. Its damping sigma_1 reduces the sum of all eigenvalues.
    assert got.eigenvalues.real.sum() < want.eigenvalues.real.sum()


RAIL = [
    {"type": "P", "axis": [1, 0, 0], "xyz": [0, 0, 0], "phi": [6, 0, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1]},
    *(
        {"type": "R", "axis": [0, 0, 1], "xyz": [length, 0, 0], "phi": [2, 0.4, 0, 0, 0.02, 0, 0.12, 0, 0, 0.12]}
        for length in (0.0, 0.5, 0.4, 0.3)
    ),
]


@pytest.mark.parametrize("elastic", [False, True])
@pytest.mark.parametrize("axes", ["x", "xy", "xy rz"])
def test_null_motions_are_free_and_counted(axes: str, elastic: bool) -> None:
    """Without a posture, the target of m rows leaves n - m motions free.

    Damping alone does not change this number. A null-space spring reduces it to zero.
    """
    arm = al.Arm.from_chain(RAIL, gravity=(0.0, -9.81, 0.0)).with_frame("tip", "link5", xyz=[0.2, 0.0, 0.0])
    q0 = np.array([0.1, 0.3, 0.5, -0.4, 0.6])
    rows = {"x": [0], "xy": [0, 1], "xy rz": [0, 1, 5]}[axes]
    target = arm.pose_vector(q0, "tip")[rows]
    share = np.array([1.0, 1.0, 0.05])[: len(rows)]  # factor of the gains: the last row is an orientation
    springs, motors = np.array([2e4, 900.0, 800.0, 700.0, 600.0]), np.array([3.0, 0.4, 0.3, 0.2, 0.1])

    def rest(posture: al.NullSpace | None, kp: float = 300.0, **force: Any) -> al.Equilibrium:
        more: dict[str, Any] = {"frame": "tip", "axes": axes, "nullspace": posture}
        if elastic:
            law: al.Law = al.ElasticImpedance(arm, target, kp * share, 40.0 * share, springs, motors, motors / 5.0, **more)
            return al.equilibrium(al.ElasticArm(arm, springs, motors), law, q0=q0, **force)
        return al.equilibrium(al.RigidArm(arm), al.CartesianImpedance(arm, target, kp * share, 40.0 * share, **more), q0=q0, **force)

    free, states = 5 - len(rows), 20 if elastic else 10
    still = np.zeros(5)
    for found in (rest(None), rest(None, force=np.full(len(rows), 4.0)), rest(al.NullSpace(q0, still, still)), rest(None, kp=3.0)):
        assert found.stable and found.free_motions == free
        # Without damping, a free motion has two eigenvalues zero. Motors always have damping.
        zeros = int((np.abs(found.eigenvalues) < 1e-9 * np.abs(found.eigenvalues).max()).sum())
        assert zeros == (free if elastic else 2 * free) and found.eigenvalues.shape == (states,)
    damped = rest(al.NullSpace(q0, still, 5.0))
    assert damped.stable and damped.free_motions == free
    bound = rest(al.NullSpace(q0 + 0.1, 20.0, 5.0))
    assert bound.stable and bound.free_motions == 0 and bound.eigenvalues.real.max() < -1e-2


def test_free_motions_do_not_hide_what_is_unstable() -> None:
    """A stretched arm of three joints cannot reach its target.

    It leaves this pose, so the equilibrium is unstable despite its free motions.
    """
    arm = al.planar_arm([0.5, 0.4, 0.3], gravity=(0.0, 0.0))
    law = al.CartesianImpedance(arm, [0.9], 300.0, 40.0, frame="link3", axes="x")
    stretched = al.equilibrium(al.RigidArm(arm), law, q0=[0.0, 0.0, 0.0])
    assert not stretched.stable and stretched.spurious and stretched.eigenvalues.real.max() > 1.0
    bent = al.equilibrium(al.RigidArm(arm), law, q0=[0.2, 0.5, 0.4])
    assert bent.stable and bent.free_motions == 2
    # A law of joint positions has no free motion.
    assert al.equilibrium(al.RigidArm(arm), al.PDGravity(arm, [0.1, 0.2, 0.3], 50.0, 8.0), q0=[0.0, 0.0, 0.0]).free_motions == 0
