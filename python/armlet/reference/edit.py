"""Arms from Denavit-Hartenberg rows, and changes of arms: tools, payloads, locked joints.

    standard  T_i = Rz(theta) Tz(d) Tx(a) Rx(alpha),   modified  T_i = Rx(alpha) Tx(a) Rz(theta) Tz(d)       (q adds to theta, or to d)
    payload   P_body += X P X',   X the pose of the frame in its body,   P the pseudo-inertia of the load in the axes of the frame:
              P = m [r; 1][r; 1]' + [[S, 0], [0, 0]],   m the mass, r the centre of mass,   S = tr(I)/2 1 - I, I the inertia about r
    locked    X, the pose of body k in its parent's body, is constant. Body k becomes a part of that body: P_parent += X P_k X'.
              A frame with the pose F in body k gets the pose X F.

' is the transpose. Arms are rebuilt from homogeneous transforms of their parts. The parallel-axis theorem is not used.
"""

from collections.abc import Mapping, Sequence
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .arm import Arm, placement
from .inertia import parameters_of, pseudo_inertia
from .lagrange import Array

TURN, SLIDE = np.zeros((4, 4)), np.zeros((4, 4))
TURN[0, 1], TURN[1, 0], SLIDE[2, 3] = -1.0, 1.0, 1.0  # twists of a rotation about z, and of a translation along z


def from_dh(rows: Sequence[Any], *, convention: str = "standard", gravity: ArrayLike = (0.0, 0.0, -9.81)) -> Arm:
    """An arm from rows (a, alpha, d, theta), m and rad, or dicts with these keys, `type` and `phi`. Frames "link1" .. are the DH frames."""
    places, twists, bodies, frames = [], [], [], {}
    before = np.eye(4)
    for index, row in enumerate(rows):
        named = row if isinstance(row, Mapping) else dict(zip(("a", "alpha", "d", "theta"), row, strict=True))
        a, alpha, d, theta = (float(named.get(key, 0.0)) for key in ("a", "alpha", "d", "theta"))
        along_x, along_z = placement((a, 0, 0), (alpha, 0, 0)), placement((0, 0, d), (0, 0, theta))
        # The transform of a Denavit-Hartenberg row is `first`, then the joint's motion, then `last`. The link's frame is after `last`.
        first, last = (along_z, along_x) if convention == "standard" else (along_x @ along_z, np.eye(4))
        places.append(before @ first)
        twists.append(SLIDE if str(named.get("type", "R")).lower() in ("p", "prismatic") else TURN)
        bodies.append(parameters_of(last @ pseudo_inertia(named.get("phi", np.zeros(10))) @ last.T))
        frames[f"link{index + 1}"] = (index, last)
        before = last
    return Arm(range(-1, len(rows) - 1), places, twists, np.concatenate(bodies), frames, gravity)


def with_frame(arm: Arm, name: str, parent: str, *, xyz: ArrayLike = (0, 0, 0), rpy: ArrayLike = (0, 0, 0)) -> Arm:
    """A copy of the arm with a new frame, fixed to an existing frame."""
    other = copy(arm)
    body, offset = arm.frames[parent]
    other.frames = arm.frames | {name: (body, offset @ placement(xyz, rpy))}
    return other


def with_payload(arm: Arm, frame: str, mass: float, com: ArrayLike | None = None, inertia: ArrayLike | None = None) -> Arm:
    """A copy of the arm with a load fixed to a frame. `inertia` (3, 3), kg m^2, is about the centre of mass, in the axes of the frame."""
    body, offset = arm.frames[frame]
    central = np.zeros((3, 3)) if inertia is None else np.asarray(inertia, dtype=np.float64)
    r = np.append(np.zeros(3) if com is None else np.asarray(com, dtype=np.float64), 1.0)
    P = mass * np.outer(r, r)
    P[:3, :3] += 0.5 * np.trace(central) * np.eye(3) - central
    parameters = arm.parameters.reshape(-1, 10).copy()
    if body >= 0:
        parameters[body] += parameters_of(offset @ P @ offset.T)
    return arm.with_parameters(parameters.reshape(-1))


def locked(arm: Arm, joints: Mapping[str, float]) -> Arm:
    """A copy of the arm with joints locked at the positions `joints`, by name, rad or m. q has no entries for them."""
    pseudo = pseudo_inertia(arm.parameters.reshape(-1, 10))
    remaining = [k for k in range(arm.n) if arm.joint_names[k] not in joints]
    carrier: list[tuple[int, Array]] = []  # for each old body: the new body of which it is a part, and its pose there
    places, parents, merged = [], [], []
    for k in range(arm.n):
        body, X = carrier[arm.parents[k]] if arm.parents[k] >= 0 else (-1, np.eye(4))
        if k in remaining:
            parents.append(body)
            places.append(X @ arm.places[k])
            merged.append(pseudo[k])
            carrier.append((len(places) - 1, np.eye(4)))
        else:
            X = X @ np.asarray(arm._joint(k, np.array(float(joints[arm.joint_names[k]]))))
            if body >= 0:
                merged[body] = merged[body] + X @ pseudo[k] @ X.T
            carrier.append((body, X))
    seat = [(-1, np.eye(4)), *carrier]
    frames = {name: (seat[body + 1][0], seat[body + 1][1] @ offset) for name, (body, offset) in arm.frames.items()}
    parameters = np.concatenate([parameters_of(P) for P in merged])
    other = Arm(parents, places, [arm.twists[k] for k in remaining], parameters, frames, arm.gravity_vector)
    other.joint_names = tuple(arm.joint_names[k] for k in remaining)
    other.limits = {key: value[remaining] for key, value in arm.limits.items()}
    return other.with_drives(armature=arm.armature[remaining], damping=arm.damping[remaining], friction=arm.friction[remaining])
