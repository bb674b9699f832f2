"""Identities of arms with mimic joints: energy, batches, compiled programs, identification, tasks, paths."""

from __future__ import annotations

import numpy as np
import pytest
from grippers import GRIPPER, following_joints
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]
ARM = al.load_urdf(GRIPPER)
Q0, V0 = [0.1, 0.2, 0.0], [0.5, -0.4, 0.6]


def test_energy_is_conserved_and_friction_dissipates_it() -> None:
    """`E(t) - E(0)` equals the work of input and friction. Without both it is zero, up to the error of the method."""
    law = al.PDGravity(ARM, Q0, 30.0, 4.0)
    for plant in (al.RigidArm(ARM), al.RigidArm(ARM, friction=True)):
        run = al.simulate(plant, law, q0=Q0, v0=V0, t_end=0.5, method="dop853", rtol=1e-11, atol=1e-12)
        assert np.abs(run.monitors["energy_balance"]).max() < 1e-8 * max(1.0, float(np.abs(run.monitors["energy"]).max()))
        assert np.abs(run.monitors["skewness"]).max() < 1e-12


def test_forward_dynamics_undo_inverse_dynamics_and_regressors_are_torques() -> None:
    rng = np.random.default_rng(2)
    for n in range(1, 6):
        arm = al.Arm.from_chain(following_joints(n, 1))
        q, v, a = rng.uniform(-2.0, 2.0, (3, 30, n))
        tau = arm.inverse_dynamics(q, v, a)
        scale = float(np.abs(tau).max())
        # The residual is compared as a torque, since M may be badly conditioned.
        back = np.einsum("kij,kj->ki", arm.mass_matrix(q), arm.forward_dynamics(q, v, tau) - a)
        assert np.abs(back).max() < 1e-12 * scale
        torque = arm.regressor(q, v, v, a) @ arm.parameters + arm.limits["armature"] * a
        assert np.abs(torque - tau).max() < 1e-12 * scale
        rate = (arm.mass_matrix(q + 1e-6 * v) - arm.mass_matrix(q - 1e-6 * v)) / 2e-6
        C = arm.coriolis_matrix(q, v)
        # Central differences with step 1e-6 have an error of at most 1e-9 of the largest entry.
        assert np.abs(rate - C - np.swapaxes(C, 1, 2)).max() < 1e-7 * max(1.0, float(np.abs(C).max()))


@pytest.mark.parametrize(
    "law", [al.ComputedTorque(ARM, al.Hold([0.4, -0.3, 0.2]), 100.0, 20.0), al.Adaptive(ARM, al.Hold(Q0), 40.0, 8.0, 0.2)]
)
def test_one_run_is_a_row_of_a_batch(law: al.Law) -> None:
    starts = np.array(Q0) + np.linspace(-0.1, 0.1, 9)[:, None]
    batch = al.simulate_batch(al.RigidArm(ARM), law, starts, t_end=0.2, dt=1e-3)
    for i in (0, 4, 8):
        run = al.simulate(al.RigidArm(ARM), law, q0=starts[i], t_end=0.2, dt=1e-3)
        # Batch and single run may use different numbers of SIMD lanes.
        np.testing.assert_allclose(batch.q[i], run.q, rtol=0.0, atol=1e-12)


def test_programs_give_the_bits_of_direct_calls() -> None:
    """A call with 1,000 rows runs as a compiled program, the first small calls directly."""
    q, v, a, w = np.random.default_rng(4).uniform(-2.0, 2.0, (4, 1000, ARM.n))
    functions = {
        "mass_matrix": (q,),
        "coriolis_matrix": (q, v),
        "inverse_dynamics": (q, v, a),
        "forward_dynamics": (q, v, a),
        "regressor": (q, v, w, a),
    }
    for name, inputs in functions.items():
        many = getattr(ARM, name)(*inputs)
        for i in (0, 999):
            fresh = al.load_urdf(GRIPPER)
            assert np.array_equal(getattr(fresh, name)(*(x[i] for x in inputs)), many[i]), name


def test_identification_finds_the_parameters() -> None:
    """The base parameters of an arm with mimic joints are identified from its torques.

    Damping, friction and armature belong to coordinates, not to joints.
    """
    rng = np.random.default_rng(6)
    q, v, a = rng.uniform(-1.5, 1.5, (3, 400, ARM.n))
    tau = ARM.inverse_dynamics(q, v, a, friction=True)
    found = ARM.with_parameters(0.9 * ARM.parameters).identify(q, v, a, tau, armature=True, friction=True)
    assert found.residuals.max() < 1e-9
    base = ARM.base_parameters(armature=True, friction=True)
    assert found.rank == len(found.values) < len(base.names) == 10 * len(ARM.file_joint_names) + 3 * ARM.n
    assert "Ixx[turn_left]" in base.names and "damping[left]" in base.names and "damping[right]" not in base.names


def test_linear_models_are_slopes_of_the_dynamics() -> None:
    q, v, tau = np.array(Q0), np.array(V0), np.array([1.0, 2.0, -1.0])
    by_q, by_v, by_tau = ARM.forward_dynamics_derivatives(q, v, tau)
    for matrix, at in ((by_q, 0), (by_v, 1), (by_tau, 2)):
        for k, unit in enumerate(np.eye(3)):
            inputs = [[x + (i == at) * side * 1e-6 * unit for i, x in enumerate((q, v, tau))] for side in (1.0, -1.0)]
            slope = (ARM.forward_dynamics(*inputs[0]) - ARM.forward_dynamics(*inputs[1])) / 2e-6
            assert np.abs(matrix[:, k] - slope).max() < 1e-6 * max(1.0, float(np.abs(slope).max()))


def test_tasks_see_the_joints_that_follow() -> None:
    """Inverse kinematics finds targets of a frame on a mimic finger. A priority law moves the frame and the centre of mass to theirs."""
    goal = np.array([0.3, -0.2, 0.1])
    task = al.Task("k2", "xyz", ARM.position(goal, "k2"))
    found = al.inverse_kinematics(ARM, [task], Q0)
    assert bool(found) and np.abs(ARM.position(found.q, "k2") - ARM.position(goal, "k2")).max() < 1e-6
    law = al.PriorityVelocity(ARM, [al.Task("k2", "xyz", ARM.position(goal, "k2"), 5.0)])
    run = al.simulate(al.VelocityArm(ARM), law, q0=goal + np.array([0.1, -0.1, 0.05]), t_end=3.0, dt=1e-3)
    assert np.abs(ARM.position(run.q[-1], "k2") - ARM.position(goal, "k2")).max() < 1e-5
    centre = al.PriorityVelocity(ARM, [al.CentreOfMassTask("xz", ARM.center_of_mass(goal)[[0, 2]], 5.0)])
    run = al.simulate(al.VelocityArm(ARM), centre, q0=goal + np.array([0.1, -0.1, 0.05]), t_end=3.0, dt=1e-3)
    assert np.abs((ARM.center_of_mass(run.q[-1]) - ARM.center_of_mass(goal))[[0, 2]]).max() < 1e-5


def test_a_timed_path_keeps_the_limits_of_all_joints() -> None:
    free = al.load_urdf(GRIPPER, mimic="independent")
    timed = al.time_path(ARM, [[0.0, 0.0, -0.3], [0.4, -0.3, 0.3], [0.8, 0.2, 0.0]], tau_max=[60.0, 60.0, 20.0], v_max=ARM.limits["v_max"])
    t = np.linspace(0.0, timed.duration, 400)
    states = [timed(each) for each in t]
    q, v, a = (np.array([state[k] for state in states]) for k in range(3))
    tau = ARM.inverse_dynamics(q, v, a)
    assert (np.abs(tau) <= np.array([60.0, 60.0, 20.0]) * (1.0 + 1e-6)).all()
    rates = (ARM.file_positions(q[1:]) - ARM.file_positions(q[:-1])) / np.diff(t)[:, None]
    assert (np.abs(rates) <= free.limits["v_max"] * (1.0 + 1e-6)).all()


def test_a_contact_of_a_finger_is_reported_at_its_coordinate() -> None:
    """A force on a knuckle is reported at the coordinate of the gripper, the outermost coordinate."""
    observer = al.MomentumObserver(ARM, 50.0, threshold=0.5)
    q, v = np.array(Q0), np.zeros(3)
    push = ARM.jacobian(q, "k2").T @ np.array([8.0, 0.0, 5.0, 0.0, 0.0, 0.0])
    for _ in range(400):
        observer.update(q, v, ARM.gravity(q) - push, 1e-3)
    np.testing.assert_allclose(observer.residual, push, atol=1e-6)
    assert observer.contact() == 2
