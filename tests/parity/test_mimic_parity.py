"""Arms with mimic joints against the reference, and against the projected dynamics of the same arm with independent joints.

armlet projects the quantities of the bodies. The reference differentiates the energies of the tree by its independent coordinates.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from grippers import GRIPPER, following_joints
from numpy.typing import NDArray
from trees import close

import armlet as al
from armlet import reference as ref

Array = NDArray[np.float64]


def projection(arm: al.Arm) -> tuple[Array, Array]:
    """Return `G` (joints, n) and `c` (joints,) of the map from independent to all joints, `q_joints = G q + c`."""
    offset = arm.file_positions(np.zeros(arm.n))
    return (arm.file_positions(np.eye(arm.n)) - offset).T, offset


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("n", range(1, 6))
def test_against_the_reference(n: int, seed: int) -> None:
    joints = following_joints(n, seed)
    gravity = np.random.default_rng([n, seed, 8]).normal(size=3)
    arm, reference = al.Arm.from_chain(joints, gravity=gravity), ref.Arm.from_chain(joints, gravity=gravity)
    assert arm.n == reference.n == n and len(arm.file_joint_names) == n + 3
    place = np.array([reference.joint_names.index(name) for name in arm.joint_names])
    names = [joint["name"] for joint in joints if joint["type"] != "fixed"]
    assert sorted(arm.file_joint_names) == sorted(names)
    there, (rows, columns) = np.argsort(place), np.ix_(place, place)
    q, v, a, v_r, a_r = np.random.default_rng([n, seed, 9]).uniform(-2.0, 2.0, (5, 3, n))
    Q, V, A, V_r, A_r = (x[:, there] for x in (q, v, a, v_r, a_r))
    mass = reference.mass_matrix(Q)[:, rows, columns]
    scale = float(np.abs(mass).max())
    close(arm.mass_matrix(q), mass)
    close(arm.coriolis_matrix(q, v), reference.coriolis_matrix(Q, V)[:, rows, columns], scale)
    close(arm.christoffel(q), reference.christoffel(Q)[np.ix_(range(3), place, place, place)], scale)
    close(arm.gravity(q), reference.gravity(Q)[:, place], scale)
    for friction in (False, True):
        close(arm.bias(q, v, friction=friction), reference.bias(Q, V, friction=friction)[:, place], scale)
    frame = f"link{len(joints)}"
    wrench = np.array([1.0, -2.0, 3.0, 0.5, -0.4, 0.3])
    tau = reference.inverse_dynamics(Q, V, A, wrench=wrench, wrench_frame=frame)[:, place]
    close(arm.inverse_dynamics(q, v, a, wrench=wrench, wrench_frame=frame), tau, scale)
    largest = max(scale, float(np.abs(tau).max()))
    close(np.einsum("kij,kj->ki", mass, arm.forward_dynamics(q, v, tau, wrench=wrench, wrench_frame=frame) - a), np.zeros((3, n)), largest)
    order = [names.index(name) for name in arm.file_joint_names]
    close(arm.file_positions(q), np.stack([m * Q[:, k] + c for k, m, c in (reference.movers[j] for j in order)], axis=-1))
    close(arm.file_joint_poses(q), reference.file_joint_poses(Q)[:, order])
    assert arm.file_joint_parents == tuple(-1 if reference.parents[j] < 0 else order.index(reference.parents[j]) for j in order)
    bodies = [reference.frames[frame][0] for frame in arm.frame_names]
    assert arm.frame_joints == tuple(-1 if body < 0 else order.index(body) for body in bodies)
    blocks = np.concatenate([np.arange(10 * j, 10 * j + 10) for j in order])
    close(arm.parameters, reference.parameters[blocks])
    close(arm.regressor(q, v, v_r, a_r), reference.regressor(Q, V, V_r, A_r)[:, place][:, :, blocks])
    for mine, theirs in zip(arm.energy(q, v), reference.energy(Q, V), strict=True):
        close(mine, theirs, scale)
    close(arm.center_of_mass(q), reference.center_of_mass(Q))
    close(arm.center_of_mass_jacobian(q), reference.center_of_mass_jacobian(Q)[:, :, place])
    for k in range(len(joints)):
        frame = f"link{k + 1}"
        close(arm.pose(q, frame), reference.pose(Q, frame))
        close(arm.jacobian(q, frame), reference.jacobian(Q, frame)[:, :, place])
        close(arm.jacobian_dot(q, v, frame), reference.jacobian_dot(Q, V, frame)[:, :, place], 10.0)
    limits = arm.limits
    for key, other in (("q_min", "lower"), ("q_max", "upper"), ("v_max", "velocity")):
        close(limits[key], reference.limits[other][place])
    for key in ("armature", "damping", "friction"):
        close(limits[key], getattr(reference, key)[place])


def test_the_projection_of_a_file() -> None:
    """Every function of a gripper equals the projected function of its independent joints, except for rounding."""
    arm, free = al.load_urdf(GRIPPER), al.load_urdf(GRIPPER, mimic="independent")
    assert arm.joint_names == ("shoulder", "elbow", "left") and arm.file_joint_names == free.joint_names
    G, c = projection(arm)
    order = [arm.file_joint_names.index(name) for name in ("left", "right", "turn_left", "turn_right")]
    np.testing.assert_allclose(G[order, 2], [1.0, -1.0, -1.5, -3.0], rtol=1e-15)
    np.testing.assert_allclose(c[order], [0.0, 0.0, 0.3, 0.5], rtol=1e-15)
    q, v, a, w = np.random.default_rng(5).uniform(-2.0, 2.0, (4, 20, 3))
    Q, V, A, W = q @ G.T + c, v @ G.T, a @ G.T, w @ G.T
    mass = G.T @ free.mass_matrix(Q) @ G
    close(arm.mass_matrix(q), mass)
    close(arm.coriolis_matrix(q, v), G.T @ free.coriolis_matrix(Q, V) @ G)
    close(arm.inverse_dynamics(q, v, a, friction=True), free.inverse_dynamics(Q, V, A, friction=True) @ G)
    close(arm.forward_dynamics(q, v, w), np.linalg.solve(mass, (w - free.bias(Q, V) @ G)[..., None])[..., 0])
    close(arm.regressor(q, v, w, a), np.einsum("ij,kip->kjp", G, free.regressor(Q, V, W, A)))
    of_q, of_v, of_a = arm.inverse_dynamics_derivatives(q, v, a)
    for mine, theirs in zip((of_q, of_v, of_a), free.inverse_dynamics_derivatives(Q, V, A), strict=True):
        close(mine, G.T @ theirs @ G)
    by_q, by_v, by_tau = arm.forward_dynamics_derivatives(q, v, w)
    accelerated = arm.forward_dynamics(q, v, w)
    close(by_tau, np.linalg.inv(mass))
    slopes = G.T @ free.inverse_dynamics_derivatives(Q, V, accelerated @ G.T)[0] @ G
    close(by_q, -np.linalg.solve(mass, slopes))
    close(by_v, -np.linalg.solve(mass, of_v))
    for frame in arm.frame_names:
        close(arm.pose(q, frame), free.pose(Q, frame))
        close(arm.jacobian(q, frame), free.jacobian(Q, frame) @ G)
        close(arm.jacobian_dot(q, v, frame), free.jacobian_dot(Q, V, frame) @ G, 10.0)
    # A leader adds the armature and damping of its mimic joints, times the square of the multiplier. It adds the Coulomb friction of its
    # mimic joints, times the magnitude of the multiplier.
    squares, sizes = (G**2).sum(axis=0), np.abs(G).sum(axis=0)
    np.testing.assert_allclose(arm.limits["armature"], 0.03 * squares, rtol=1e-14)
    np.testing.assert_allclose(arm.limits["damping"], 0.2 * squares, rtol=1e-14)
    np.testing.assert_allclose(arm.limits["friction"], 0.1 * sizes, rtol=1e-14)
    columns = arm.regressor(q, v, v, a, armature=True, friction=True)
    pi = np.concatenate([arm.parameters, arm.limits["armature"], arm.limits["damping"], arm.limits["friction"]])
    close(columns @ pi, arm.inverse_dynamics(q, v, a, friction=True))


def test_limits_of_all_joints_hold() -> None:
    """The limits of a joint keep all its mimic joints within theirs, for example -2 <= 2 turn_left - 0.1 <= 2.

    The effort limit does not include those of the mimic joints.
    """
    arm, free = al.load_urdf(GRIPPER), al.load_urdf(GRIPPER, mimic="independent")
    low, high = arm.limits["q_min"], arm.limits["q_max"]
    inside, outside = np.linspace(low, high, 101), np.vstack([low - 1e-9, high + 1e-9])

    def within(q: Array) -> Array:
        positions = arm.file_positions(q)
        kept: Array = ((positions >= free.limits["q_min"] - 1e-12) & (positions <= free.limits["q_max"] + 1e-12)).all(-1)
        return kept

    assert within(inside).all() and not within(outside).any()
    assert arm.limits["v_max"].tolist() == [3.0, 3.0, 1.0] and arm.limits["effort"].tolist() == [10.0, 10.0, 10.0]


LAWS: dict[str, Any] = {
    "computed torque": lambda lib, arm: lib.ComputedTorque(arm, lib.Quintic([0.1, 0.2, 0.0], [0.5, -0.4, 0.2], 0.1), 100.0, 20.0),
    "PD": lambda lib, arm: lib.PDGravity(arm, [0.3, 0.1, 0.1], 60.0, 12.0),
    "adaptive": lambda lib, arm: lib.Adaptive(arm, lib.Quintic([0.1, 0.2, 0.0], [0.5, -0.4, 0.2], 0.1), 40.0, 8.0, 0.2),
}
STATE = {"q0": [0.1, 0.2, 0.0], "v0": [0.2, -0.1, 0.3]}


@pytest.mark.parametrize("method", ["rk4", "dopri5"])
@pytest.mark.parametrize("name", LAWS)
def test_loops_are_those_of_the_projected_arm(name: str, method: str) -> None:
    """Runs agree with a loop in numpy, which scipy integrates.

    The loop projects the dynamics of the arm with independent joints, such as `G' M G`.
    """
    scipy_integrate = pytest.importorskip("scipy.integrate")
    arm, free = al.load_urdf(GRIPPER), al.load_urdf(GRIPPER, mimic="independent")
    G, c = projection(arm)
    law = LAWS[name](al, arm)
    initial = np.concatenate([STATE["q0"], STATE["v0"], np.zeros(60 if name == "adaptive" else 0)])

    def slope(t: float, x: Array) -> Array:
        q, v, state = x[:3], x[3:6], x[6:]
        # The torque of the law follows from its equation with projected matrices.
        Q, V = G @ q + c, G @ v
        mass, bias, weight = G.T @ free.mass_matrix(Q) @ G, free.bias(Q, V) @ G, free.gravity(Q) @ G
        rate = np.zeros(0)
        if name == "PD":
            tau = 60.0 * (np.array([0.3, 0.1, 0.1]) - q) - 12.0 * v + weight
        else:
            q_d, v_d, a_d = law.motion(t)
            if name == "computed torque":
                tau = mass @ (a_d + 100.0 * (q_d - q) + 20.0 * (v_d - v)) + bias
            else:
                ratio = 40.0 / 8.0
                v_r, a_r = v_d + ratio * (q_d - q), a_d + ratio * (v_d - v)
                s = v_r - v
                Y = G.T @ free.regressor(Q, V, G @ v_r, G @ a_r)
                # The law knows the armature.
                tau, rate = Y @ state + arm.limits["armature"] * a_r + 8.0 * s, 0.2 * Y.T @ s
        return np.concatenate([v, np.linalg.solve(mass, tau - bias), rate])

    tight = {"rtol": 1e-11, "atol": 1e-12}
    run = al.simulate(al.RigidArm(arm), law, **STATE, t_end=0.2, method=method, **({"dt": 2e-5} if method == "rk4" else tight))
    wanted = scipy_integrate.solve_ivp(slope, (0.0, 0.2), initial, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(run.q[-1], wanted[:3], rtol=0.0, atol=2e-9)
    np.testing.assert_allclose(run.v[-1], wanted[3:6], rtol=0.0, atol=2e-8)


def test_symbolic_formulas() -> None:
    """The symbolic formulas of a small gripper, evaluated with numbers, agree with the functions of the arm."""
    pytest.importorskip("sympy")
    joints = following_joints(1, 0)[:]
    arm = al.Arm.from_chain([{**joint, "xyz": np.round(joint["xyz"], 1), "rpy": np.zeros(3), "axis": [0, 0, 1]} for joint in joints])
    formulas = arm.symbolic()
    q, v, v_r, a_r = np.random.default_rng(3).uniform(-1.0, 1.0, (4, arm.n))
    close(formulas.function("M")(q), arm.mass_matrix(q))
    close(formulas.function("C")(q, v), arm.coriolis_matrix(q, v))
    close(formulas.function("g")(q), arm.gravity(q))
    close(formulas.function("Y")(q, v, v_r, a_r), arm.regressor(q, v, v_r, a_r))
