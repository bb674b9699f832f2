"""`verify`: compare the quantities of an arm and of a model of another library at random states. Joints are matched by name."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .._core import Arm
from ..arguments import instance, integer, number
from ..border import border, bordered
from ..errors import InputError
from ..pickling import sealed
from . import mujoco_model

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Row:
    """One line of the table: the largest difference over all states, relative to the size of the quantity.

    The differences of poses, Jacobians, gravity vectors and armatures are absolute.
    """

    quantity: str
    difference: float
    #: Joint or frame with the largest difference.
    where: str
    #: Explanation, or the quantity that is compared instead.
    remark: str
    agrees: bool


@bordered
@sealed
@dataclass(frozen=True)
class Verification:
    """The differences between an arm and a model of another library. `str(verification)` is a table. `bool(verification)`
    is True if all numbers agree."""

    rows: tuple[Row, ...]
    #: Differences of convention, which are not errors.
    conventions: tuple[str, ...]

    @property
    def agrees(self) -> bool:
        return all(row.agrees for row in self.rows)

    def __bool__(self) -> bool:
        return self.agrees

    def __str__(self) -> str:
        wide = max(len(row.quantity) for row in self.rows)
        lines = [f"{'quantity':{wide}}  {'difference':>10}  {'':8}  where"]
        for row in self.rows:
            verdict = "agrees" if row.agrees else "DIFFERS"
            tail = f"{row.where}  {row.remark}" if row.remark else row.where
            lines.append(f"{row.quantity:{wide}}  {row.difference:10.1e}  {verdict:8}  {tail}".rstrip())
        return "\n".join([*lines, *(f"convention: {text}" for text in self.conventions)])


class Peer(Protocol):
    """A model of another library. Its results have armlet's order of joints and armlet's conventions."""

    n: int
    conventions: list[str]
    gravity: _Array
    armature: _Array

    def frames(self) -> list[str]: ...
    def at(self, q: _Array, v: _Array) -> None: ...
    def pose(self, frame: str) -> _Array: ...
    def jacobian(self, frame: str) -> _Array: ...
    def mass_matrix(self) -> _Array: ...
    def coriolis_matrix(self) -> _Array | None: ...
    def inverse_dynamics(self, v: _Array, a: _Array) -> _Array: ...
    def forward_dynamics(self, tau: _Array) -> _Array: ...


def _array(x: Any) -> _Array:
    array: _Array = np.array(x, dtype=float)
    return array


def _match(ours: tuple[str, ...], theirs: dict[str, Any], library: str) -> None:
    missing = [name for name in ours if name not in theirs]
    if missing:
        got = ", ".join(theirs) or "none"
        raise InputError(f"verify: against lacks joints of the arm: expected {', '.join(missing)}, got {got} ({library})")


class _Pinocchio:
    def __init__(self, arm: Arm, model: Any) -> None:
        self.pin, self.model, self.data = import_module("pinocchio"), model, model.createData()
        joints = {model.names[i]: model.joints[i] for i in range(1, model.njoints) if model.joints[i].nv == 1}
        # A model with mimic joints has the degrees of freedom of the arm. In another model, every joint of the robot file is independent.
        self.mimics = any("Mimic" in joint.shortname() for joint in model.joints)
        names = arm.joint_names if self.mimics else arm.file_joint_names
        _match(names, joints, "pinocchio")
        self.joints = [joints[name] for name in names]
        self.rows = np.array([joint.idx_v for joint in self.joints], dtype=np.intp)
        self.n, self.gravity = len(self.joints), np.array(model.gravity.linear)
        self.armature = np.array(model.armature)[self.rows]
        self.conventions = []
        if list(self.rows) != list(range(model.nv)):
            self.conventions.append(f"joint order: armlet's joints are rows {self.rows.tolist()} of the model's {model.nv}")
        if len(self.rows) < model.nv:
            self.conventions.append(f"{model.nv - len(self.rows)} further joints of the model are held at their neutral position")
        if any(joint.nq == 2 for joint in self.joints):
            self.conventions.append("continuous joints have two coordinates (cosine, sine) in the model")
        if np.any(np.array(getattr(model, "damping", 0.0)) != 0.0):
            self.conventions.append("the model's rnea and aba ignore its damping: compared without friction")

    def frames(self) -> list[str]:
        # A joint and a body may have frames with one name. Then the name means the body's frame, so frames of joints are not listed.
        kinds = self.pin.FrameType
        return [frame.name for frame in self.model.frames if frame.type in (kinds.BODY, kinds.OP_FRAME)]

    def _frame(self, name: str) -> int:
        kinds = self.pin.FrameType
        kind = kinds.BODY if self.model.existFrame(name, kinds.BODY) else kinds.OP_FRAME
        return int(self.model.getFrameId(name, kind))

    def _full(self, x: _Array) -> _Array:
        full = np.zeros(self.model.nv)
        full[self.rows] = x
        return full

    def at(self, q: _Array, v: _Array) -> None:
        self.q, self.v = self.pin.neutral(self.model), self._full(v)
        for joint, angle in zip(self.joints, q, strict=True):
            self.q[joint.idx_q : joint.idx_q + joint.nq] = [np.cos(angle), np.sin(angle)] if joint.nq == 2 else [angle]
        self.pin.computeJointJacobians(self.model, self.data, self.q)
        self.pin.framesForwardKinematics(self.model, self.data, self.q)

    def pose(self, frame: str) -> _Array:
        return _array(self.data.oMf[self._frame(frame)].homogeneous)

    def jacobian(self, frame: str) -> _Array:
        if self.model.nv == 0:
            return np.zeros((6, 0))  # Pinocchio would crash here
        axes = self.pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        # If the model has one joint, Pinocchio returns a vector instead of a matrix.
        full = self.pin.getFrameJacobian(self.model, self.data, self._frame(frame), axes)
        return _array(full).reshape(6, self.model.nv)[:, self.rows]

    def mass_matrix(self) -> _Array:
        upper = np.triu(self.pin.crba(self.model, self.data, self.q))
        full = upper + np.triu(upper, 1).T
        return _array(full[np.ix_(self.rows, self.rows)])

    def coriolis_matrix(self) -> _Array | None:
        if self.mimics:
            return None  # Pinocchio 4.1 does not project C of mimic joints: C v differs from the bias of rnea
        full = self.pin.computeCoriolisMatrix(self.model, self.data, self.q, self.v)
        return _array(np.array(full)[np.ix_(self.rows, self.rows)])

    def inverse_dynamics(self, v: _Array, a: _Array) -> _Array:
        return _array(np.array(self.pin.rnea(self.model, self.data, self.q, self._full(v), self._full(a)))[self.rows])

    def forward_dynamics(self, tau: _Array) -> _Array:
        # `pin.aba` cannot hold joints fixed, and refuses mimic joints. For such models the equations of the free joints are solved.
        if len(self.rows) == self.model.nv and not self.mimics:
            return _array(np.array(self.pin.aba(self.model, self.data, self.q, self.v, self._full(tau)))[self.rows])
        rest = tau - self.inverse_dynamics(self.v[self.rows], np.zeros(self.n))
        return _array(np.linalg.solve(self.mass_matrix(), rest))


class _MuJoCo:
    def __init__(self, arm: Arm, model: Any) -> None:
        self.mj, self.model = import_module("mujoco"), model
        self.data = self.mj.MjData(model)
        joints = {model.joint(j).name or f"joint{j}": j for j in range(model.njnt)}
        _match(arm.file_joint_names, joints, "mujoco")
        index = np.array([joints[name] for name in arm.file_joint_names], dtype=np.intp)
        self.rows = np.array(model.jnt_dofadr)[index]
        self.coordinates = np.array(model.jnt_qposadr)[index]
        self.n, self.gravity = len(index), mujoco_model.gravity(model)
        self.armature = np.array(model.dof_armature)[self.rows] + mujoco_model.motors(model)[0][index]
        self.conventions = []
        if list(self.rows) != list(range(model.nv)):
            self.conventions.append(f"joint order: armlet's joints are rows {self.rows.tolist()} of the model's {model.nv}")
        if len(self.rows) < model.nv:
            self.conventions.append(f"{model.nv - len(self.rows)} further joints of the model are held at their reference position")
        if np.any(model.dof_damping != 0.0) or np.any(model.dof_frictionloss != 0.0):
            self.conventions.append("passive forces are apart in the model: compared without friction")

    def frames(self) -> list[str]:
        return [self.model.body(i).name or f"body{i}" for i in range(self.model.nbody)]

    def _body(self, name: str) -> int:
        return self.frames().index(name)

    def at(self, q: _Array, v: _Array) -> None:
        self.data.qpos[:] = self.model.qpos0
        self.data.qvel[:] = 0.0
        self.data.qpos[self.coordinates], self.data.qvel[self.rows] = q, v
        self.mj.mj_forward(self.model, self.data)

    def pose(self, frame: str) -> _Array:
        pose = np.eye(4)
        pose[:3, :3] = self.data.xmat[self._body(frame)].reshape(3, 3)
        pose[:3, 3] = self.data.xpos[self._body(frame)]
        return pose

    def jacobian(self, frame: str) -> _Array:
        linear, angular = np.zeros((3, self.model.nv)), np.zeros((3, self.model.nv))
        self.mj.mj_jacBody(self.model, self.data, linear, angular, self._body(frame))
        return _array(np.vstack([linear, angular])[:, self.rows])

    def mass_matrix(self) -> _Array:
        full = np.zeros((self.model.nv, self.model.nv))
        for j in range(self.model.nv):
            self.mj.mj_mulM(self.model, self.data, full[j], np.eye(self.model.nv)[j])
        return _array(full[np.ix_(self.rows, self.rows)])

    def coriolis_matrix(self) -> _Array | None:
        return None

    def inverse_dynamics(self, v: _Array, a: _Array) -> _Array:
        self.data.qvel[:] = 0.0
        self.data.qvel[self.rows] = v
        self.mj.mj_fwdVelocity(self.model, self.data)
        self.data.qacc[:] = 0.0
        self.data.qacc[self.rows] = a
        result = np.zeros(self.model.nv)
        self.mj.mj_rne(self.model, self.data, 1, result)
        # mj_rne does not include the armature.
        return _array(result[self.rows] + self.armature * a)

    def forward_dynamics(self, tau: _Array) -> _Array:
        v = np.array(self.data.qvel)[self.rows]
        return _array(np.linalg.solve(self.mass_matrix(), tau - self.inverse_dynamics(v, np.zeros(self.n))))


class _Joined:
    """A model with independent joints that are mimic joints in the arm, `q_joints = G q + c`.

    Its quantities are converted to the arm's coordinates. For example, its mass matrix `M` becomes `G' M G`.
    """

    def __init__(self, arm: Arm, peer: Peer) -> None:
        self.peer, self.arm, self.n = peer, arm, arm.n
        offset = arm.file_positions(np.zeros(arm.n))
        self.G = np.array(arm.file_positions(np.eye(arm.n)) - offset).T
        self.gravity, self.armature = peer.gravity, peer.armature @ self.G**2
        self.conventions = peer.conventions
        self.conventions.append(f"{len(self.G) - arm.n} joints of the model follow others in the arm: compared by projection")

    def frames(self) -> list[str]:
        return self.peer.frames()

    def at(self, q: _Array, v: _Array) -> None:
        self.v = v
        self.peer.at(self.arm.file_positions(q), self.G @ v)

    def pose(self, frame: str) -> _Array:
        return self.peer.pose(frame)

    def jacobian(self, frame: str) -> _Array:
        return _array(self.peer.jacobian(frame) @ self.G)

    def mass_matrix(self) -> _Array:
        return _array(self.G.T @ self.peer.mass_matrix() @ self.G)

    def coriolis_matrix(self) -> _Array | None:
        matrix = self.peer.coriolis_matrix()
        return None if matrix is None else _array(self.G.T @ matrix @ self.G)

    def inverse_dynamics(self, v: _Array, a: _Array) -> _Array:
        return _array(self.G.T @ self.peer.inverse_dynamics(self.G @ v, self.G @ a))

    def forward_dynamics(self, tau: _Array) -> _Array:
        return _array(np.linalg.solve(self.mass_matrix(), tau - self.inverse_dynamics(self.v, np.zeros(len(tau)))))


def _peer(arm: Arm, model: Any) -> Peer:
    own = _own_peer(arm, model)
    return own if own.n == arm.n else _Joined(arm, own)


def _own_peer(arm: Arm, model: Any) -> Peer:
    module = getattr(type(model), "__module__", "")
    library = module.split(".")[0] if isinstance(module, str) else ""
    if library == "pinocchio":
        return _Pinocchio(arm, model)
    if library == "mujoco":
        return _MuJoCo(arm, model)
    raise InputError(f"verify: against is of the wrong type: expected a pinocchio.Model or a mujoco.MjModel, got {type(model).__name__}")


@border
def verify(arm: Arm, *, against: Any, samples: int = 5, seed: int = 0, rtol: float = 1e-10) -> Verification:
    """Compare an arm with a `pinocchio.Model` or a `mujoco.MjModel`: poses, Jacobians, `M`, `C`, `g`, inverse and forward dynamics.

    Joints are matched by name. Further joints of the model are held at their neutral position.

    Args:
        arm: an arm whose joints have the names of joints of the model.
        against: the model (keyword only).
        samples, seed: number of random states, and seed of their generator (keyword only).
        rtol: largest difference that counts as agreement, relative to the size of the quantity (keyword only). Differences of poses and
            Jacobians are not divided by this size. Gravity vectors and armatures must be equal. Accelerations of forward dynamics are
            multiplied by `M` and compared as torques.

    Returns:
        A `Verification`, true if all numbers agree, with `.rows` and `.conventions`. Its text is a table.

    Raises:
        InputError: `against` is of another type, or lacks a joint of the arm.
        ImportError: the library is not installed.

    Source: docs/arms.md.
    """
    instance("verify", "arm", arm, Arm, "an Arm")
    samples, seed, rtol = integer("verify", "samples", samples, 1), integer("verify", "seed", seed), number("verify", "rtol", rtol)
    peer = _peer(arm, against)
    frames = [name for name in peer.frames() if name in arm.frame_names]
    worst: dict[str, tuple[float, str, str]] = {}

    def compare(quantity: str, ours: _Array, theirs: _Array, where: str, remark: str = "", scale: float | None = None) -> None:
        size = max(float(np.abs(theirs).max(initial=0.0)), 1e-300) if scale is None else scale
        difference = float(np.abs(ours - theirs).max(initial=0.0)) / size
        if not where and ours.size:
            # The joint of the entry with the largest difference; in a matrix, the joint of its row.
            where = arm.joint_names[int(np.abs(ours - theirs).reshape(arm.n, -1).max(axis=1).argmax())]
        if quantity not in worst or not difference <= worst[quantity][0]:
            worst[quantity] = (difference, where, remark)

    rng, singular = np.random.default_rng(seed), False
    for _ in range(samples):
        q, v, a = rng.uniform(-1.0, 1.0, (3, arm.n))
        peer.at(q, v)
        for frame in frames:
            # The differences of poses and Jacobians are absolute (m), because a frame at the base has the position zero.
            compare("pose", arm.pose(q, frame), peer.pose(frame), frame, scale=1.0)
            compare("jacobian", arm.jacobian(q, frame), peer.jacobian(frame), frame, scale=1.0)
        mass = peer.mass_matrix()
        compare("mass_matrix", arm.mass_matrix(q), mass, "")
        gravity = peer.inverse_dynamics(np.zeros(arm.n), np.zeros(arm.n))
        size = max(float(np.abs(gravity).max(initial=0.0)), float(np.abs(mass).max(initial=0.0)), 1e-300)
        compare("gravity", arm.gravity(q), gravity, "", scale=size)
        tau = peer.inverse_dynamics(v, a)
        compare("inverse_dynamics", arm.inverse_dynamics(q, v, a), tau, "", scale=max(size, float(np.abs(tau).max(initial=0.0))))
        peer.at(q, v)
        theirs = peer.coriolis_matrix()
        ours = arm.coriolis_matrix(q, v)
        bias = peer.inverse_dynamics(v, np.zeros(arm.n)) - gravity
        compare("coriolis_matrix v", ours @ v, bias, "", "C v, from the model's inverse dynamics", scale=size)
        if theirs is not None:
            rate = theirs + theirs.T
            largest = max(size, float(np.abs(rate).max(initial=0.0)))
            compare("dM/dt = C + C'", ours + ours.T, rate, "", "the same for every skew factorisation", scale=largest)
            apart = float(np.abs(ours - theirs).max(initial=0.0))
            if apart > 1e3 * rtol * size and not any("factorisation" in text for text in peer.conventions):
                peer.conventions.append("the model's Coriolis matrix is another factorisation: C v and C + C' are compared")
        # If massless bodies end the chain, the mass matrix is singular, and the acceleration for a torque is not unique.
        if arm.n and np.linalg.eigvalsh(mass)[0] <= arm.n * np.finfo(float).eps * np.abs(mass).max():
            singular = True
            continue
        peer.at(q, v)
        accelerated = peer.forward_dynamics(tau)
        compare("forward_dynamics", mass @ arm.forward_dynamics(q, v, tau), mass @ accelerated, "", "as the torque M a", scale=size)
    rows = [Row(quantity, difference, where, remark, difference <= rtol) for quantity, (difference, where, remark) in worst.items()]
    for name, own, other in (("gravity vector", arm.gravity_vector, peer.gravity), ("armature", arm.limits["armature"], peer.armature)):
        if own is not None:
            difference = float(np.abs(own - other).max(initial=0.0))
            remark = "" if difference == 0.0 else f"{own.tolist()} against {other.tolist()}"
            rows.append(Row(name, difference, "", remark, difference == 0.0))
    if singular:
        peer.conventions.append("the mass matrix is singular: forward dynamics are not compared")
    absent = [name for name in peer.frames() if name not in arm.frame_names]
    conventions = peer.conventions + ([f"{len(absent)} frames of the model are not in the arm, such as {absent[0]}"] if absent else [])
    return Verification(tuple(rows), tuple(conventions))
