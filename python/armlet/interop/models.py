"""Arms from models of other libraries, and a comparison with these models: `from_pinocchio`, `from_mujoco`, `verify`.

The other library is imported only when its model is used. Both libraries describe a tree of moving bodies. `arm.report` lists the parts
of the model that the arm lacks or has in another form. The table of `verify` lists numerical differences.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection, Mapping, Sequence
from importlib import import_module
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .._core import Arm, _restore_tree
from ..arguments import choice
from ..border import border
from ..callers import level_of_caller
from ..errors import InputError
from . import mujoco_model
from .verification import Verification, verify

__all__ = ["Verification", "from_mujoco", "from_pinocchio", "verify"]

_Array = NDArray[np.float64]
#: A mimic joint: index of its leader, multiplier and offset, with `q = multiplier q_leader + offset`.
Mimic = tuple[int, float, float]


def _unit(function: str, axis: _Array, name: str) -> list[float]:
    length = float(np.linalg.norm(axis))
    if not (np.isfinite(length) and length > 0.0):
        raise InputError(f"{function}: model has a joint without an axis: expected a direction, got {axis} (joint {name})")
    # An axis of norm one is not divided, because the division would add a rounding error.
    return [float(x) for x in (axis if abs(length - 1.0) < 1e-15 else axis / length)]


def _stored(rotation: _Array, translation: _Array) -> list[list[float]]:
    """Three columns of the rotation, then the translation: the form of a placement in a pickled arm."""
    return [*np.asarray(rotation, dtype=float).T.tolist(), np.asarray(translation, dtype=float).tolist()]


def _depth_first(parents: Sequence[int]) -> list[int]:
    """A depth-first order of joints: parents come first, subtrees are contiguous, siblings keep their order. Parent -1 is the base."""
    children: dict[int, list[int]] = {}
    for i, parent in enumerate(parents):
        children.setdefault(parent, []).append(i)
    order, stack = [], children.get(-1, [])[::-1]
    while stack:
        i = stack.pop()
        order.append(i)
        stack += children.get(i, [])[::-1]
    return order


def _build(name: str, joints: list[dict[str, Any]], frames: list[dict[str, Any]], gravity: _Array, report: list[str]) -> Arm:
    """Make an arm from joints in any order, and frames.

    The `parent` of a joint and the `body` of a frame are indices of joints; -1 is the base.
    """
    order = _depth_first([joint["parent"] for joint in joints])
    place = {old: new for new, old in enumerate(order)} | {-1: None}
    names = [joints[i]["name"] for i in order]
    if len(set(names)) < len(names):
        raise InputError(f"from_{name}: model has joints of the same name: expected names that differ, got {names}")
    stored = [
        (
            joint["name"],
            joint["type"],
            place[joint["parent"]],
            _stored(*joint["placement"]),
            joint["axis"],
            [float(joint.get(key, default)) for key, default in _DRIVE],
            np.asarray(joint["phi"], dtype=float).tolist(),
            _followed(joint.get("mimic"), place),
        )
        for joint in (joints[i] for i in order)
    ]
    kept, seen = [], set()
    for frame in frames:
        if frame["name"] not in seen:
            seen.add(frame["name"])
            kept.append((frame["name"], place[frame["body"]], _stored(*frame["placement"]), None))
    numbers = [joint[3] + [joint[4], joint[6]] for joint in stored] + [frame[2] for frame in kept]
    if not all(np.isfinite(row).all() for each in numbers for row in each):
        raise InputError(f"from_{name}: model is not finite: expected finite placements, axes and inertias")
    return _restore_tree((name, stored, kept, np.asarray(gravity, dtype=float).tolist(), report))


def _followed(mimic: Mimic | None, place: Mapping[int, int | None]) -> tuple[int, float, float] | None:
    """For a mimic joint: the index of its leader in the arm, the multiplier and the offset. None for other joints."""
    if mimic is None:
        return None
    leader = place[mimic[0]]
    assert leader is not None  # the leader is a joint, never the base
    return leader, float(mimic[1]), float(mimic[2])


_DRIVE = (
    ("lower", -np.inf),
    ("upper", np.inf),
    ("velocity", np.inf),
    ("effort", np.inf),
    ("armature", 0.0),
    ("damping", 0.0),
    ("friction", 0.0),
)


def _expect(model: Any, function: str, kind: str, attribute: str) -> None:
    if not hasattr(model, attribute):
        raise InputError(f"{function}: model is of another type: expected a {kind}, got {type(model).__name__}")


@border
def from_pinocchio(model: Any) -> Arm:
    """Make the arm of a `pinocchio.Model` with a fixed base: revolute, unbounded and prismatic joints, any axes, any tree.

    The arm has joint and frame names, placements, inertias, limits, armature, damping, friction and gravity. The entries of `q` are in
    depth-first order, which may differ from the order of Pinocchio on branched robots. A continuous joint has one coordinate in armlet and
    two in Pinocchio. A mimic joint (`buildModelFromUrdf(.., mimic=True)`) and its leader are one degree of freedom in both libraries.

    Args:
        model: a `pinocchio.Model`.

    Returns:
        The arm, with the units of the model: m, kg, rad.

    Raises:
        InputError: `model` is not a model, is not finite, or has two joints of the same name. It is also raised for a joint of another
            type (free flyer, spherical, screw).

    Source: docs/migration.md.
    """
    _expect(model, "from_pinocchio", "pinocchio.Model", "jointPlacements")
    joints, frames, report = [], [], []
    for i in range(1, model.njoints):
        joint, name = model.joints[i], model.names[i]
        kind = joint.shortname()
        mimic = _mimic(model, i) if "Mimic" in kind else None
        moves = _motion(joint) if mimic is None else _followed_motion(model, joint, mimic[1])
        if moves is None:
            problem = f"has a joint of another kind: expected revolute or prismatic, got {kind} (joint {name})"
            raise InputError(f"from_pinocchio: model {problem}")
        subspace, within = moves
        slide = bool(np.any(subspace[:3] != 0.0))
        placement = model.jointPlacements[i] if within is None else model.jointPlacements[i] * within
        at, row = joint.idx_q, joint.idx_v
        if mimic is not None:
            # A mimic joint gets no armature, damping, friction or limits, because those of its leader apply.
            own = {"name": name, "type": "prismatic" if slide else "continuous", "parent": model.parents[i] - 1, "mimic": mimic}
            axis = _unit("from_pinocchio", subspace[:3] if slide else subspace[3:], name)
            pose, phi = (placement.rotation, placement.translation), model.inertias[i].toDynamicParameters()
            joints.append(own | {"placement": pose, "axis": axis, "phi": phi})
            continue
        bounded = joint.nq == 1
        joints.append(
            {
                "name": name,
                "type": "prismatic" if slide else "revolute" if bounded else "continuous",
                "parent": model.parents[i] - 1,
                "placement": (placement.rotation, placement.translation),
                "axis": _unit("from_pinocchio", subspace[:3] if slide else subspace[3:], name),
                "phi": model.inertias[i].toDynamicParameters(),
                "lower": _bound(model.lowerPositionLimit[at], -1.0) if bounded else -np.inf,
                "upper": _bound(model.upperPositionLimit[at], 1.0) if bounded else np.inf,
                "velocity": _bound(_row(model, ("upperVelocityLimit", "velocityLimit"), row), 1.0),
                "effort": _bound(_row(model, ("upperEffortLimit", "effortLimit"), row), 1.0),
                "armature": model.armature[row],
                "damping": _row(model, ("damping",), row),
                "friction": _row(model, ("upperDryFrictionLimit", "friction"), row),
            }
        )
    # Frames of bodies come first, so that a body's frame is kept if a joint's frame has the same name.
    for frame in sorted(model.frames, key=lambda frame: "BODY" not in str(frame.type)):
        parent = frame.parentJoint if hasattr(frame, "parentJoint") else frame.parent
        frames.append({"name": frame.name, "body": parent - 1, "placement": (frame.placement.rotation, frame.placement.translation)})
    if any(joint["damping"] or joint["friction"] for joint in joints):
        report.append("damping and friction are kept; Pinocchio's rnea and aba ignore them")
    if np.any(model.gravity.angular != 0.0):
        report.append("angular acceleration of the base dropped (the angular part of gravity)")
    if any(joint["type"] == "continuous" for joint in joints):
        report.append("continuous joints have one coordinate here, two (cosine, sine) in Pinocchio")
    return _build("pinocchio", joints, frames, model.gravity.linear, report)


def _motion(joint: Any) -> tuple[_Array, Any] | None:
    """Motion of a revolute or prismatic joint: `[v; w]` per unit rate, and the placement inside a composite joint. Other joints: None."""
    if joint.nv != 1:
        return None
    data = joint.createData()
    joint.calc(data, np.array([1.0, 0.0]) if joint.nq == 2 else np.zeros(joint.nq))
    subspace = np.asarray(data.S, dtype=float).reshape(6)
    if np.any(subspace[:3] != 0.0) and np.any(subspace[3:] != 0.0):
        return None  # a screw joint
    return subspace, data.M if "Composite" in joint.shortname() else None


def _mimic(model: Any, i: int) -> Mimic:
    """The leader, multiplier and offset of the mimic joint `i`."""
    leader = dict(zip(model.mimicking_joints, model.mimicked_joints, strict=True))[i]
    of = model.joints[i].extract()
    return int(leader) - 1, float(of.scaling), float(of.offset)


def _followed_motion(model: Any, joint: Any, multiplier: float) -> tuple[_Array, Any] | None:
    """The result of `_motion` for a mimic joint, per unit rate of the mimic joint (not of its leader)."""
    if multiplier == 0.0:
        return None  # the motion is zero, so the axis is unknown
    data = joint.createData()
    # Pinocchio returns the motion per unit rate of the leader, which contains the multiplier as a factor.
    joint.calc(data, import_module("pinocchio").neutral(model))
    return np.asarray(data.S, dtype=float).reshape(6) / multiplier, None


def _row(model: Any, names: tuple[str, ...], row: int) -> float:
    """Return entry `row` of the first attribute in `names` that `model` has, or 0. The names depend on the version of Pinocchio."""
    for name in names:
        if hasattr(model, name):
            return float(getattr(model, name)[row])
    return 0.0


def _bound(value: float, sign: float) -> float:
    """A limit. Pinocchio's largest float means no limit, so it becomes infinity."""
    return sign * np.inf if not abs(value) < 1e300 else float(value)


@border
def from_mujoco(model: Any, *, mimic: Literal["joined", "independent"] = "joined") -> Arm:
    """Make the arm of a `mujoco.MjModel`: hinges and slides, any tree, also bodies with several joints.

    The arm has joint and body names, placements, reference positions, inertias, position limits and gravity. It has the limits of the
    actuators' force on a joint, armature, damping (including that of actuators on the joint) and dry friction. Every body and every site
    has a frame. `arm.report` lists the parts that are dropped. These are other effects of actuators, springs, tendons, other equality
    constraints and gravity compensation. They also include fluid forces, nonlinear damping, and sites with the name of a body. A dropped
    constraint that is active, such as a loop (connect, weld), also causes a `UserWarning`, because the arm moves in another way.

    Args:
        model: a `mujoco.MjModel`.
        mimic: "joined": two joints that an active, linear equality constraint connects become one degree of freedom. "independent": both
            joints stay independent, and the constraint is dropped.

    Returns:
        The arm, with the units of the model: m, kg, rad.

    Raises:
        InputError: `model` is not a model, is not finite, or has two joints of the same name. It is also raised for a free or ball joint.

    Source: docs/interop.md.
    """
    _expect(model, "from_mujoco", "mujoco.MjModel", "body_parentid")
    choice("from_mujoco", "mimic", mimic, ("joined", "independent"))
    followers, used = mujoco_model.followers(model)
    if mimic == "independent":
        followers = {}
    joints, frames = [], []
    armature, damping = mujoco_model.motors(model)
    carrier: list[tuple[int, _Array, _Array]] = [(-1, np.eye(3), np.zeros(3))]  # for each body: its joint and its pose in the joint
    frames.append({"name": _name(model, "body", 0), "body": -1, "placement": (np.eye(3), np.zeros(3))})
    for body in range(1, model.nbody):
        parent, turn, at = carrier[model.body_parentid[body]]
        # Pose of the body frame at the reference position, in the axes of the joint that moves the parent body.
        at = at + turn @ model.body_pos[body]
        turn = turn @ _rotation(model.body_quat[body])
        first, count = model.body_jntadr[body], model.body_jntnum[body]
        for j in range(first, first + max(count, 0)):
            name, kind = _name(model, "joint", j), int(model.jnt_type[j])
            if kind not in (2, 3):
                kinds = {0: "free", 1: "ball"}
                raise InputError(
                    f"from_mujoco: model has a joint of another kind: expected hinge or slide, got {kinds.get(kind, kind)} (joint {name})"
                )
            slide, axis, anchor = kind == 2, np.array(model.jnt_axis[j]), np.array(model.jnt_pos[j])
            dof, zero = model.jnt_dofadr[j], float(model.qpos0[model.jnt_qposadr[j]])
            # MuJoCo's reference position is q = qpos0, armlet's is q = 0. So the joint frame is rotated or moved back by qpos0.
            origin, rotation = at + turn @ anchor, turn
            if slide:
                origin = origin - turn @ axis * zero
            elif zero:
                rotation = turn @ _about(axis, -zero)
            limited = bool(model.jnt_limited[j])
            # Limits of the sum of the actuators' forces. Of the lower and the upper limit, the one with the smaller magnitude applies.
            forced = bool(model.jnt_actfrclimited[j])
            joints.append(
                {
                    "name": name,
                    "type": "prismatic" if slide else "revolute" if limited else "continuous",
                    "parent": parent,
                    "placement": (rotation, origin),
                    "axis": _unit("from_mujoco", axis, name),
                    "phi": np.zeros(10),
                    "lower": model.jnt_range[j, 0] if limited else -np.inf,
                    "upper": model.jnt_range[j, 1] if limited else np.inf,
                    "effort": float(np.abs(model.jnt_actfrcrange[j]).min()) if forced else np.inf,
                    "armature": model.dof_armature[dof] + armature[j],
                    "damping": model.dof_damping[dof] + damping[j],
                    "friction": model.dof_frictionloss[dof],
                    "mimic": followers.get(j),
                }
            )
            parent, turn, at = len(joints) - 1, np.eye(3), -anchor
        carrier.append((parent, turn, at))
        if parent >= 0:
            joints[parent]["phi"] = joints[parent]["phi"] + _parameters(model, body, turn, at)
        frames.append({"name": _name(model, "body", body), "body": parent, "placement": (turn, at)})
    bodies = {frame["name"] for frame in frames}
    for site in range(model.nsite):
        parent, turn, at = carrier[model.site_bodyid[site]]
        placement = (turn @ _rotation(model.site_quat[site]), at + turn @ model.site_pos[site])
        frames.append({"name": _name(model, "site", site), "body": parent, "placement": placement})
    report = _dropped(model, bodies, len(followers))
    # With "independent", the caller drops the constraints between joints.
    if lost := mujoco_model.lost_constraints(model, used):
        warnings.warn(
            f"from_mujoco: the arm lacks active constraints of model, so it moves in another way: {', '.join(lost)}",
            stacklevel=level_of_caller(),
        )
    if followers:
        report.append("constraints between joints are rigid here; MuJoCo's are soft")
    return _build("mujoco", joints, frames, mujoco_model.gravity(model), report)


def _dropped(model: Any, bodies: Collection[object], followers: int) -> list[str]:
    """The lines of the report about the parts of a MuJoCo model that the arm lacks."""
    report = []
    for what, dropped in (
        ("actuators", model.nu),
        ("tendons", model.ntendon),
        ("equality constraints", model.neq - followers),
        ("joint springs", int(np.count_nonzero(model.jnt_stiffness))),
        ("bodies with gravity compensation", int(np.count_nonzero(model.body_gravcomp))),
        ("fluid forces", int(model.opt.density != 0.0 or model.opt.viscosity != 0.0)),
        ("joints' damping beyond the linear", int(np.count_nonzero(getattr(model, "dof_dampingpoly", np.zeros((1, 1))).any(axis=1)))),
        ("sites of a body's name", sum(_name(model, "site", site) in bodies for site in range(model.nsite))),
    ):
        if dropped:
            report.append(f"{what} dropped ({dropped})")
    return report


def _name(model: Any, kind: str, index: int) -> str:
    return str(getattr(model, kind)(index).name) or f"{kind}{index}"


def _rotation(quaternion: _Array) -> _Array:
    """Rotation matrix (3, 3) of a quaternion `(w, x, y, z)` with any norm except zero."""
    w, x, y, z = np.asarray(quaternion, dtype=float) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _about(axis: _Array, angle: float) -> _Array:
    return _rotation(np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis / np.linalg.norm(axis)]))


def _parameters(model: Any, body: int, turn: _Array, at: _Array) -> _Array:
    """The ten inertial parameters of a body in the frame of its joint."""
    mass = float(model.body_mass[body])
    axes = turn @ _rotation(model.body_iquat[body])
    com = at + turn @ model.body_ipos[body]
    inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T + mass * (com @ com * np.eye(3) - np.outer(com, com))
    return np.concatenate([[mass], mass * com, inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]])
