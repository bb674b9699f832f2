"""Arms read from public URDF files against Pinocchio, to 1e-10, with joints matched by name.

Pinocchio's rnea includes the armature and its regressor does not. Its rnea and aba ignore the damping of the file.
On branched robots Pinocchio orders joints differently, and a continuous joint has two coordinates.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from robots import ROBOTS, folder, path

import armlet as al

Array = NDArray[np.float64]

# The largest difference, relative to the largest number.
TOLERANCE = 1e-10


def close(got: Array, want: Array, scale: float = 0.0, tolerance: float = TOLERANCE) -> None:
    size = max(float(np.abs(want).max(initial=0.0)), scale)
    assert got.shape == want.shape
    assert float(np.abs(got - want).max(initial=0.0)) <= tolerance * size


class Peer:
    """A Pinocchio model with functions that convert joint vectors from the order of an arm."""

    def __init__(self, arm: al.Arm, model: Any) -> None:
        self.model, self.data = model, model.createData()
        self.joints = [model.joints[model.getJointId(name)] for name in arm.joint_names]
        self.ids = [model.getJointId(name) for name in arm.joint_names]
        self.rows = np.array([joint.idx_v for joint in self.joints])
        assert len(self.rows) == model.nv == arm.n

    def q(self, q: Array) -> Array:
        full = pin.neutral(self.model)
        for joint, angle in zip(self.joints, q, strict=True):
            full[joint.idx_q : joint.idx_q + joint.nq] = [np.cos(angle), np.sin(angle)] if joint.nq == 2 else [angle]
        return full

    def v(self, v: Array) -> Array:
        full = np.zeros(self.model.nv)
        full[self.rows] = v
        return full


@pytest.fixture(scope="module", params=ROBOTS)
def pair(request: pytest.FixtureRequest) -> tuple[al.Arm, Peer]:
    text = str(path(request.param))
    arm = al.load_urdf(text, mimic="independent")
    return arm, Peer(arm, pin.buildModelFromUrdf(text))


def states(arm: al.Arm, count: int, rows: int) -> Array:
    return np.random.default_rng(arm.n).uniform(-1.0, 1.0, (rows, count, arm.n))


def test_dynamics(pair: tuple[al.Arm, Peer]) -> None:
    arm, peer = pair
    model, data, rows = peer.model, peer.data, peer.rows
    q, v, a = states(arm, 4, 3)
    batch = {
        "M": arm.mass_matrix(q),
        "C": arm.coriolis_matrix(q, v),
        "g": arm.gravity(q),
        "tau": arm.inverse_dynamics(q, v, a),
    }
    for i in range(len(q)):
        at, rate, acceleration = peer.q(q[i]), peer.v(v[i]), peer.v(a[i])
        upper = np.triu(pin.crba(model, data, at))
        mass = (upper + np.triu(upper, 1).T)[np.ix_(rows, rows)]
        scale = float(np.abs(mass).max())
        gravity = np.array(pin.computeGeneralizedGravity(model, data, at))[rows]
        coriolis = np.array(pin.computeCoriolisMatrix(model, data, at, rate))[np.ix_(rows, rows)]
        tau = np.array(pin.rnea(model, data, at, rate, acceleration))[rows]
        # The test compares a single call and one row of a batch.
        for m, c, g, t in (
            (arm.mass_matrix(q[i]), arm.coriolis_matrix(q[i], v[i]), arm.gravity(q[i]), arm.inverse_dynamics(q[i], v[i], a[i])),
            (batch["M"][i], batch["C"][i], batch["g"][i], batch["tau"][i]),
        ):
            close(m, mass)
            close(g, gravity, scale)
            # The Coriolis matrices differ, but C v and C + C' = dM/dt are equal for both factorisations.
            close(c @ v[i], coriolis @ v[i], scale)
            close(c + c.T, coriolis + coriolis.T, scale)
            close(t, tau, scale)
        # M may be badly conditioned, so the test multiplies accelerations by M and compares torques.
        accelerated = np.array(pin.aba(model, data, at, rate, peer.v(tau)))[rows]
        ours = arm.forward_dynamics(q[i], v[i], tau)
        close(mass @ ours, mass @ accelerated, max(scale, float(np.abs(tau).max())))


def test_kinematics(pair: tuple[al.Arm, Peer]) -> None:
    arm, peer = pair
    model, data, rows = peer.model, peer.data, peer.rows
    (q,), (v,) = states(arm, 1, 2)
    at, rate = peer.q(q), peer.v(v)
    pin.computeJointJacobians(model, data, at)
    pin.computeJointJacobiansTimeVariation(model, data, at, rate)
    pin.framesForwardKinematics(model, data, at)
    axes, checked = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED, 0
    for name in arm.frame_names:
        if not model.existFrame(name, pin.FrameType.BODY):
            continue
        frame = model.getFrameId(name, pin.FrameType.BODY)
        checked += 1
        close(arm.pose(q, name), np.array(data.oMf[frame].homogeneous))
        close(arm.jacobian(q, name), np.array(pin.getFrameJacobian(model, data, frame, axes))[:, rows], 1.0)
        close(arm.jacobian_dot(q, v, name), np.array(pin.getFrameJacobianTimeVariation(model, data, frame, axes))[:, rows], 1.0)
    assert checked > arm.n
    close(arm.center_of_mass(q), np.array(pin.centerOfMass(model, data, at)), 1.0)
    close(arm.center_of_mass_jacobian(q), np.array(pin.jacobianCenterOfMass(model, data, at))[:, rows], 1.0)


def test_regressor_by_polarisation(pair: tuple[al.Arm, Peer]) -> None:
    """`regressor(q, v, v_r, a_r)` follows from Pinocchio's regressor W(q, v, a).

    W is quadratic in v, and its bilinear form at (v, v_r) gives the Coriolis part.
    """
    arm, peer = pair
    (q,), (v,), (v_r,), (a_r,) = states(arm, 1, 4)
    zero = np.zeros(arm.n)

    def classical(v: Array, a: Array) -> Array:
        full = np.array(pin.computeJointTorqueRegressor(peer.model, peer.data, peer.q(q), peer.v(v), peer.v(a)))
        columns = np.concatenate([np.arange(10 * (i - 1), 10 * i) for i in peer.ids])
        return full[np.ix_(peer.rows, columns)]

    gravity = classical(zero, zero)
    bias = lambda x: classical(x, zero) - gravity  # noqa: E731
    want = classical(zero, a_r) + 0.5 * (bias(v + v_r) - bias(v) - bias(v_r))
    got = arm.regressor(q, v, v_r, a_r)
    close(got, want)
    close(arm.regressor(q, v, v, a_r), classical(v, a_r))
    parameters = np.concatenate([peer.model.inertias[i].toDynamicParameters() for i in peer.ids])
    # Both libraries move inertias to the joint's frame, with a few roundings of the largest number.
    close(arm.parameters, parameters, 1.0, 1e-13)
    armature = np.array(peer.model.armature)[peer.rows]
    tau = np.array(pin.rnea(peer.model, peer.data, peer.q(q), peer.v(v), peer.v(a_r)))[peer.rows]
    close(arm.regressor(q, v, v, a_r) @ arm.parameters + armature * a_r, tau, float(np.abs(want).max()))


def test_derivatives(pair: tuple[al.Arm, Peer]) -> None:
    arm, peer = pair
    (q,), (v,), (a,) = states(arm, 1, 3)
    pick = np.ix_(peer.rows, peer.rows)
    at, rate = peer.q(q), peer.v(v)
    by_q, by_v, by_a = pin.computeRNEADerivatives(peer.model, peer.data, at, rate, peer.v(a))
    upper = np.triu(np.array(by_a))
    ours = arm.inverse_dynamics_derivatives(q, v, a)
    scale = float(np.abs(by_q).max())
    for got, want in zip(ours, (np.array(by_q), np.array(by_v), upper + np.triu(upper, 1).T), strict=True):
        close(got, want[pick], scale)
    tau = arm.inverse_dynamics(q, v, a)
    theirs = [np.array(x)[pick] for x in pin.computeABADerivatives(peer.model, peer.data, at, rate, peer.v(tau))[:2]]
    for got, want in zip(arm.forward_dynamics_derivatives(q, v, tau)[:2], theirs, strict=True):
        # M may be ill-conditioned, so the test multiplies by M and compares torques.
        close(ours[2] @ got, ours[2] @ want, scale)


def test_from_pinocchio_and_verify(pair: tuple[al.Arm, Peer]) -> None:
    arm, peer = pair
    again = al.from_pinocchio(peer.model)
    assert set(again.joint_names) == set(arm.joint_names)
    place = [again.joint_names.index(name) for name in arm.joint_names]
    assert [again.joint_types[i] for i in place] == list(arm.joint_types)
    for name in ("q_min", "q_max", "v_max", "effort", "damping", "friction", "armature"):
        np.testing.assert_allclose(again.limits[name][place], arm.limits[name], rtol=1e-15)
    for candidate in (arm, again):
        report = al.verify(candidate, against=peer.model, samples=2)
        assert report, str(report)
        compared = {row.quantity for row in report.rows}
        assert {"pose", "jacobian", "mass_matrix", "gravity", "inverse_dynamics", "forward_dynamics"} <= compared
    heavier = arm.parameters
    heavier[10 * (arm.n - 1)] += 1e-3
    report = al.verify(arm.with_parameters(heavier), against=peer.model, samples=2)
    assert not report and "DIFFERS" in str(report)
    assert {row.quantity for row in report.rows if not row.agrees} >= {"mass_matrix", "gravity", "inverse_dynamics"}
    assert all(row.agrees for row in report.rows if row.quantity in ("pose", "jacobian"))


def test_differences_of_convention_are_listed() -> None:
    text = str(path("baxter"))
    report = al.verify(al.load_urdf(text), against=pin.buildModelFromUrdf(text), samples=1)
    assert any("joint order" in line for line in report.conventions) and any("damping" in line for line in report.conventions)
    text = str(path("kinova"))
    model = pin.buildModelFromUrdf(text)
    report = al.verify(al.load_urdf(text), against=model, samples=1)
    assert any("two coordinates" in line for line in report.conventions)
    report = al.verify(al.load_urdf(text, gravity=[0.0, 0.0, 0.0]), against=model, samples=1)
    assert {row.quantity for row in report.rows if not row.agrees} == {"gravity", "inverse_dynamics", "gravity vector", "forward_dynamics"}


def test_locked_joints_and_missing_joints() -> None:
    text = str(path("panda"))
    arm, model = al.load_urdf(text), pin.buildModelFromUrdf(text)
    fingers = {name: 0.0 for name in arm.joint_names if "finger" in name}
    report = al.verify(arm.locked(fingers), against=model, samples=2)
    assert report and any("2 further joints" in line for line in report.conventions), str(report)
    with pytest.raises(al.InputError, match="against lacks joints of the arm: expected panda_joint1"):
        al.verify(arm, against=pin.buildModelFromUrdf(str(path("ur5"))))
    with pytest.raises(al.InputError, match="of another kind: expected revolute or prismatic, got JointModelFreeFlyer"):
        al.from_pinocchio(pin.buildModelFromUrdf(str(path("anymal")), pin.JointModelFreeFlyer()))


#: Files of the package that armlet refuses, with a part of the error message.
REFUSED = {
    "romeo_laas_small.urdf": "negative principal moment",
    "ur3.urdf": "has no links",
    "alex_psyonic_hands.urdf": "mimics index_q1, which is no joint",
}


@pytest.mark.parametrize("file", sorted(folder().rglob("*.urdf")), ids=lambda file: file.stem)
def test_every_robot_of_the_package(file: Path) -> None:
    """`al.verify` agrees for every file of the package.

    The files have mimic and continuous joints, flat inertias, links without mass, a singular mass matrix, or no joint.
    """
    if file.name in REFUSED:
        with pytest.raises(al.ModelError, match=REFUSED[file.name]) as caught:
            al.load_urdf(str(file))
        assert caught.value.line and caught.value.file == str(file)
        return
    arm = al.load_urdf(str(file))
    found = al.verify(arm, against=pin.buildModelFromUrdf(str(file)), samples=2)
    assert found, str(found)
    assert ("singular" in str(found)) == (file.name == "romeo.urdf")


def made_of(*joints: Any) -> Any:
    model, parent = pin.Model(), 0
    for i, joint in enumerate(joints):
        parent = model.addJoint(parent, joint, pin.SE3.Random(), f"q{i}")
        model.appendBodyToJoint(parent, pin.Inertia.Random(), pin.SE3.Random())
        model.addFrame(pin.Frame(f"b{i}", parent, 0, pin.SE3.Random(), pin.FrameType.BODY))
    return model


@pytest.mark.parametrize("count", [0, 1])
def test_models_with_one_joint_and_without_joints(count: int) -> None:
    model = made_of(*[pin.JointModelRY()] * count)
    arm = al.from_pinocchio(model)
    report = al.verify(arm, against=model)
    assert arm.n == count and report, str(report)


def test_a_joint_inside_another_keeps_its_place() -> None:
    inside = pin.JointModelComposite()
    inside.addJoint(pin.JointModelRX(), pin.SE3.Random())
    model = made_of(pin.JointModelRZ(), inside, pin.JointModelPY())
    report = al.verify(al.from_pinocchio(model), against=model)
    assert report, str(report)
    twice = pin.JointModelComposite()
    for joint in (pin.JointModelRX(), pin.JointModelRY()):
        twice.addJoint(joint)
    axis = np.array([0.6, 0.0, 0.8])
    screws = (pin.JointModelHX(0.3), pin.JointModelHelicalUnaligned(axis, 0.2))
    for joint in (*screws, twice, pin.JointModelSpherical(), pin.JointModelPlanar()):
        with pytest.raises(al.InputError, match=r"of another kind: expected revolute or prismatic, got .* \(joint q1\)"):
            al.from_pinocchio(made_of(pin.JointModelRZ(), joint))


def test_angular_gravity_is_reported() -> None:
    model = made_of(pin.JointModelRX(), pin.JointModelRY())
    model.gravity = pin.Motion(np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.0, 0.0]))
    arm = al.from_pinocchio(model)
    assert arm.report == ("angular acceleration of the base dropped (the angular part of gravity)",)
    assert not al.verify(arm, against=model)


@pytest.mark.parametrize("name", ["six_axis", "two_arms"])
def test_pinocchio_reads_the_written_urdf(name: str) -> None:
    """Pinocchio reads a URDF from `to_urdf` and ignores the extra attributes, which store exact parameters."""
    arm = al.load_urdf(al.example_urdf(name))
    frame = arm.frame_names[-1]
    arm = arm.with_frame("tool", frame, rpy=[0.3, 0.4, 0.5]).with_payload("tool", 1.0, [0.1, 0.2, 0.3])
    text, _ = arm.to_urdf()
    assert ' parameters="' in text or ' rotation="' in text
    report = al.verify(arm, against=pin.buildModelFromXML(text))
    differ = {row.quantity for row in report.rows if not row.agrees}
    # Pinocchio reads no armature from a URDF, so quantities with armature may differ.
    assert differ <= {"armature", "mass_matrix", "inverse_dynamics", "forward_dynamics"}, str(report)
