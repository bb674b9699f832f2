"""The null space of impedance laws on three arms of seven joints: equilibrium, motion of the tip, singularities, balances."""

from __future__ import annotations

from typing import Any

import models
import numpy as np
import pytest
from numpy.typing import NDArray

import armlet as al

Array = NDArray[np.float64]


def chain(offsets: list[list[float]], masses: list[float]) -> al.Arm:
    """An arm of seven axes, alternating between z and y. Bodies are like rods with some width."""
    joints = []
    for i, (offset, m) in enumerate(zip(offsets, masses, strict=True)):
        c, core = 0.12, 0.02 * m + 0.01
        phi = [m, 0.0, 0.0, m * c, core + m * c * c, 0.0, core + m * c * c, 0.0, 0.0, core]
        joints.append({"type": "R", "axis": [0, 0, 1] if i % 2 == 0 else [0, 1, 0], "xyz": offset, "phi": phi})
    return al.Arm.from_chain(joints).with_frame("tool", "link7", xyz=[0.0, 0.0, 0.15])


ARMS = {
    "example": (models.SEVEN_AXES, "tcp"),
    # Three axes intersect in the shoulder, and three in the wrist.
    "spherical": (
        chain([[0, 0, 0.34], [0, 0, 0], [0, 0, 0.2], [0, 0, 0.2], [0, 0, 0.2], [0, 0, 0.2], [0, 0, 0]], [4, 4, 4, 4, 1.5, 1.5, 1.5]),
        "tool",
    ),
    # Elbow and wrist are offset from the axes.
    "offset": (
        chain([[0, 0, 0.33], [0, 0, 0], [0, 0, 0.32], [0.08, 0, 0], [-0.08, 0, 0.38], [0, 0, 0], [0.09, 0, 0]], [4, 4, 3, 3, 3, 1.5, 0.8]),
        "tool",
    ),
}  # fmt: skip
Q0 = np.array([0.2, 0.6, 0.1, -1.3, 0.2, 0.9, 0.3])
POSTURE = al.NullSpace(Q0 + np.array([0.5, -0.2, -0.6, 0.2, 0.3, 0.2, -0.4]), stiffness=30.0, damping=12.0)


def law(name: str, axes: str = "xyz", nullspace: al.NullSpace = POSTURE, **options: Any) -> al.CartesianImpedance:
    """An impedance law whose target is the initial pose. So only the null-space torque moves the arm."""
    arm, frame = ARMS[name]
    target = arm.pose_vector(Q0, frame)[: 3 if axes == "xyz" else 6]
    return al.CartesianImpedance(arm, target, 400.0, 40.0, frame=frame, axes=axes, nullspace=nullspace, **options)


def run(name: str, made: al.CartesianImpedance, **options: Any) -> al.Run:
    settings = {"t_end": 8.0, "method": "dop853", "rtol": 1e-11, "atol": 1e-12, "t_eval": np.linspace(0.0, 8.0, 201)} | options
    return al.simulate(al.RigidArm(ARMS[name][0]), made, Q0, **settings)


@pytest.mark.parametrize("axes", ["xyz", "xyz rx ry rz"])
@pytest.mark.parametrize("name", ARMS)
def test_the_null_motion_comes_to_rest_and_the_tip_stays(name: str, axes: str) -> None:
    arm, frame = ARMS[name]
    for compensated in (True, False):
        made = law(name, axes, compensate_coupling=compensated)
        found = run(name, made, t_end=40.0, t_eval=np.linspace(0.0, 40.0, 201))
        kinetic, _ = arm.energy(found.q, found.v)
        assert kinetic.max() > 1e-3 and kinetic[-1] < 1e-9  # J
        moved = np.linalg.norm(arm.position(found.q, frame) - arm.position(Q0, frame), axis=-1)
        assert np.abs(found.q[-1] - Q0).max() > 0.05
        assert (moved.max() < 1e-6) == compensated  # m
        # At full rank the clamped inverse is exact.
        assert all(made.terms(0.0, q, v)["loss"] == 0.0 for q, v in zip(found.q[::20], found.v[::20], strict=True))
        assert np.abs(found.monitors["energy_balance"]).max() < 1e-9 * max(1.0, np.abs(found.monitors["energy"]).max())


@pytest.mark.parametrize("projection", ["consistent", "static"])
@pytest.mark.parametrize("name", ARMS)
def test_the_tip_acceleration_follows_the_equation(name: str, projection: Any) -> None:
    """`x_ddot = J M^-1 (J'F + N'tau_0 - C v) + J_dot v`. Without compensated coupling `x_ddot = L^-1 F - (J M^-1 C v - J_dot v)`."""
    arm, frame = ARMS[name]
    posture = al.NullSpace(POSTURE.q_d, 30.0, 12.0, projection=projection)
    made = law(name, nullspace=posture)
    found = run(name, made, t_end=1.0, t_eval=np.linspace(0.0, 1.0, 11))
    for q, v, tau in zip(found.q, found.v, found.tau, strict=True):
        parts, M = made.terms(0.0, q, v), arm.mass_matrix(q)
        J, J_dot = arm.jacobian(q, frame)[:3], arm.jacobian_dot(q, v, frame)[:3]
        x_ddot = J @ arm.forward_dynamics(q, v, tau) + J_dot @ v
        spread = J @ np.linalg.inv(M)
        pushed = spread @ parts["null_torque"]
        coupling = spread @ arm.coriolis_matrix(q, v) @ v - J_dot @ v
        # Rounding is amplified by the inverses of M and L. The accelerations agree to 3e-14 m/s^2 or rad/s^2.
        np.testing.assert_allclose(x_ddot, spread @ J.T @ parts["force"] - coupling + pushed, atol=1e-9)
        if projection == "consistent":
            assert np.abs(pushed).max() < 1e-10
        # The static null-space torque has no component `J'F` of a wrench F at the frame.
        else:
            assert np.abs(J @ parts["null_torque"]).max() < 1e-11
            assert np.abs(J @ (parts["tau_0"] - parts["null_torque"])).max() > 1e-3


@pytest.mark.parametrize("name", ARMS)
def test_the_storage_of_the_law_balances_with_the_projected_power(name: str) -> None:
    """`d/dt (v'Mv/2 + e'Ke/2) = v'N'tau_0 - x_dot'D x_dot`, and with the coupling compensated also `+ v'Cv - (J v)'L J_dot v`."""
    arm, frame = ARMS[name]
    for compensated in (False, True):
        made = law(name, compensate_coupling=compensated)
        found = al.simulate(al.RigidArm(arm), made, Q0, t_end=0.2, dt=1e-4)

        def power(q: Array, v: Array, compensated: bool = compensated, made: Any = made) -> float:
            parts = made.terms(0.0, q, v)
            x_dot = parts["x_dot"]
            total = v @ parts["null_torque"] - x_dot @ (40.0 * x_dot)
            if compensated:
                total += v @ arm.coriolis_matrix(q, v) @ v - x_dot @ parts["L"] @ arm.jacobian_dot(q, v, frame)[:3] @ v
            return float(total)

        def stored(q: Array, v: Array, made: Any = made) -> float:
            e = made.terms(0.0, q, v)["e"]
            return float(arm.energy(q, v)[0] + 0.5 * e @ (400.0 * e))

        # Boole's rule has an error proportional to h^6, here at most 7e-10 J.
        each = np.array([power(q, v) for q, v in zip(found.q, found.v, strict=True)])
        weights = np.tile([14.0, 32.0, 12.0, 32.0], len(each) // 4 + 1)[: len(each)]
        weights[[0, -1]] = 7.0
        work = float(weights @ each) * 2e-4 / 45.0
        assert abs(stored(found.q[-1], found.v[-1]) - stored(found.q[0], found.v[0]) - work) < 1e-9  # J
        assert abs(work) > 1e-4


def test_elastic_joints_with_a_null_space_keep_their_balance() -> None:
    """The monitor balances the law's storage function with the power of the projected torque. The arm comes to rest."""
    arm, frame = ARMS["spherical"]
    K_J, B = np.full(7, 3000.0), np.full(7, 0.5)
    target = arm.position(Q0, frame)
    given = (arm, target, 400.0, 60.0, K_J, B, 0.1)
    for compensated in (False, True):
        made = al.ElasticImpedance(
            *given, frame=frame, relative_damping=True, nullspace=POSTURE, feedforward=[3.0, 0.0, -2.0], compensate_coupling=compensated
        )
        options: dict[str, Any] = {"method": "dop853", "rtol": 1e-11, "atol": 1e-12}
        found = al.simulate(al.ElasticArm(arm, K_J, B), made, Q0, t_end=1.0, **options)
        assert "passivity" in found.monitors
        assert np.abs(found.monitors["energy_balance"]).max() < 1e-9 * max(1.0, np.abs(found.monitors["energy"]).max())
        assert np.ptp(found.monitors["energy"]) > 1e-2  # J


# Poses whose Jacobian has a smallest singular value below 5e-5. The test moves all joints through these poses.
SINGULAR = {
    "example": [-0.72, 0.0, -0.83, -0.45, 0.0, -0.36, 0.3],
    "spherical": [-0.3, 0.0, 1.27, 0.0, 1.1, 0.78, 1.4],
    "offset": [1.18, 0.0272, -1.612, 0.413, -1.5708, -1.589, 0.918],
}


@pytest.mark.parametrize("projection", ["consistent", "static"])
@pytest.mark.parametrize("name", ARMS)
def test_the_torque_is_bounded_and_continuous_through_a_singularity(name: str, projection: Any) -> None:
    """All joints move along a line through a singular pose. Without the clamped inverse, `L` would be infinite there."""
    made = law(name, "xyz rx ry rz", al.NullSpace(POSTURE.q_d, 30.0, 12.0, projection=projection), compensate_coupling=True, eps=0.1)
    along = np.array([0.1, 0.5, -0.2, 0.6, 0.4, 0.3, -0.1])
    v = np.array([0.3, -0.2, 0.4, 1.0, 0.2, -0.5, 0.3])

    def torques(places: Array) -> Array:
        return np.array([made(0.0, SINGULAR[name] + place * along, v) for place in places])

    losses = [float(made.terms(0.0, SINGULAR[name] + place * along, v)["loss"]) for place in (-0.6, 0.0, 0.6)]
    assert losses[1] > 0.99 and losses[0] < losses[1]
    tau = torques(np.linspace(-0.6, 0.6, 4001))
    largest = np.abs(tau).max()
    # The largest torque is at most 1.02 times that at the ends of the motion. Differences of torque decrease with those of the angles.
    assert largest < 10.0 * np.abs(tau[[0, -1]]).max()
    assert np.abs(np.diff(tau, axis=0)).max() < 0.02 * largest
    assert np.ptp(torques(np.array([-1e-7, -1e-12, 0.0, 1e-12, 1e-7])), axis=0).max() < 1e-4 * largest


@pytest.mark.parametrize(("options", "most"), [({}, 50.0), ({"compensate_coupling": True, "eps": 0.3}, 150.0)])
def test_a_run_through_a_singularity(options: dict[str, Any], most: float) -> None:
    """The target leaves the workspace and returns. The arm stretches, the torque is bounded, and the arm reaches the target."""
    arm, frame = ARMS["spherical"]
    start = arm.position(Q0, frame)
    out = al.Table(2.0, [start, start + 0.6 * (start - np.array([0.0, 0.0, 0.34])), start], np.zeros((3, 3)), np.zeros((3, 3)))
    made = al.CartesianImpedance(arm, out, 400.0, 60.0, frame=frame, nullspace=POSTURE, **options)
    found = run("spherical", made, method="dopri5", rtol=1e-7, atol=1e-9)
    singular = [np.linalg.svd(arm.jacobian(q, frame)[:3])[1][-1] for q in found.q]
    assert min(singular) < 0.02 and np.abs(found.tau).max() < most  # N m
    assert np.linalg.norm(arm.position(found.q[-1], frame) - start) < 1e-5


def test_the_tip_follows_a_moving_pose_exactly() -> None:
    """With compensated coupling `L (x_ddot - x_d_ddot) = F`. An arm that starts on a moving pose stays on it."""
    arm, frame = ARMS["offset"]
    pose = arm.pose_vector(Q0, frame)
    motion = al.Quintic(pose, pose + np.array([0.05, -0.08, 0.05, 0.3, -0.2, 0.4]), 1.0)
    made = al.CartesianImpedance(arm, motion, 400.0, 40.0, frame=frame, axes="xyz rx ry rz", nullspace=POSTURE, compensate_coupling=True)
    found = run("offset", made, t_end=1.0, t_eval=np.linspace(0.0, 1.0, 21))
    errors = [made.terms(t, q, v)["e"] for t, q, v in zip(found.t, found.q, found.v, strict=True)]
    assert np.abs(errors).max() < 1e-8 < np.abs(found.v).max()  # m and rad
    plain = al.CartesianImpedance(arm, motion, 400.0, 40.0, frame=frame, axes="xyz rx ry rz")
    late = run("offset", plain, t_end=1.0, t_eval=np.linspace(0.0, 1.0, 21))
    assert np.abs([plain.terms(t, q, v)["e"] for t, q, v in zip(late.t, late.q, late.v, strict=True)]).max() > 1e-3


def test_integral_action_removes_a_force_and_does_not_wind_up() -> None:
    """Under a constant force F the spring alone deflects by F/K. With limits the integral stops, and returns without delay."""
    arm, frame = ARMS["spherical"]
    plant, force = al.RigidArm(arm), [0.0, 15.0, -10.0]
    made = {
        gain: al.CartesianImpedance(
            arm, arm.position(Q0, frame), 400.0, 60.0, frame=frame, nullspace=al.NullSpace(Q0, 30.0, 12.0), integral_gain=gain
        )
        for gain in (0.0, 800.0)
    }
    misses = []
    for each in made.values():
        found = al.simulate(plant, each, Q0, t_end=12.0, dt=2e-3, force=force, record_every=100)
        misses.append(float(np.abs(each.terms(0.0, found.q[-1], found.v[-1], state=found.estimate[-1])["e"]).max()))
        if each is made[800.0]:
            np.testing.assert_allclose(found.estimate[-1], [0.0, -15.0, 10.0], atol=1e-3)  # N
    assert misses[0] > 0.02 and misses[1] < 1e-5  # m
    # The target is out of reach. With an integral and a limited wrench, the arm stays where the limit is reached.
    far = al.CartesianImpedance(arm, [3.0, 0.0, 0.3], 50.0, 60.0, frame=frame, integral_gain=200.0, wrench_max=[40.0, 40.0, 40.0])
    found = al.simulate(plant, far, Q0, t_end=3.0, dt=1e-3, record_every=50)
    assert np.abs(found.estimate).max() < 80.0
    free = al.CartesianImpedance(arm, [3.0, 0.0, 0.3], 50.0, 60.0, frame=frame, integral_gain=200.0)
    assert np.abs(al.simulate(plant, free, Q0, t_end=3.0, dt=1e-3, record_every=50).estimate).max() > 400.0


@pytest.mark.parametrize("projection", ["consistent", "static"])
@pytest.mark.parametrize("bend", [0.003, 0.01])
def test_the_clamp_does_not_depend_on_the_unit_of_mass(bend: float, projection: Any) -> None:
    """Near a singularity, masses of a hundredth leave the loss and the projector unchanged, and `L` has a hundredth of its value.

    The rows of `J M^-1/2` are scaled to a root mean square of one. So `sigma` has no unit, and `eps` limits a pure number.
    """
    q = np.array([0.3, bend, bend])
    found = []
    for scale in (1.0, 0.01):
        arm = al.planar_arm([0.5, 0.4, 0.3], masses=scale * np.array([3.0, 2.0, 1.0]))
        posture = al.NullSpace([0.0, 0.5, 0.5], 20.0, 4.0, projection=projection)
        made = al.CartesianImpedance(arm, [1.1, 0.2], 300.0, 40.0, frame="link3", axes="xy", nullspace=posture, eps=0.2)
        found.append(made.terms(0.0, q, np.zeros(3)))
    assert 0.05 < found[0]["loss"] < 1.0
    np.testing.assert_allclose(found[1]["loss"], found[0]["loss"], rtol=1e-9)
    np.testing.assert_allclose(found[1]["null_torque"], found[0]["null_torque"], rtol=0.0, atol=1e-9)
    ratio = 0.01 if projection == "consistent" else 1.0
    np.testing.assert_allclose(found[1]["L"], ratio * found[0]["L"], rtol=1e-8, atol=1e-9 * ratio * np.abs(found[0]["L"]).max())
