"""Trees of revolute and prismatic joints by homogeneous transforms (Uicker 1967), no recursion of forces.

    T_i = T_parent(i) place_i exp(xi_i q_i),    dT_i/dq_j = dT_parent/dq_j place_i exp(xi_i q_i),  and T_i xi_i for j = i
    kinetic   1/2 sum_i tr( T_i' P_i T_i'^T )   so   M_jk = sum_i tr( dT_i/dq_j  P_i  (dT_i/dq_k)^T )
    potential -sum_i gravity . (T_i P_i e_4)
    P_i = [[S, h], [h^T, m]],  S = 1/2 tr(I) 1 - I,  h = m c        (4 x 4 pseudo-inertia, linear in the ten parameters)

Parameters per link: m, m cx, m cy, m cz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz, inertia about the body-frame origin. A link behind a
fixed joint adds X P X^T to the body that carries it. The exponential is written in the half angle, which is analytic in q, so
that every derivative can be a complex step.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import STEP, Analytic, Array, Mechanism, vectors

Joint = Mapping[str, Any]


def _pseudo_basis() -> Array:
    """P for each of the ten unit parameters, (10, 4, 4)."""
    basis = np.zeros((10, 4, 4))
    basis[0, 3, 3] = 1.0
    for axis in range(3):
        basis[1 + axis, axis, 3] = basis[1 + axis, 3, axis] = 1.0
    for index, (row, column) in enumerate(((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))):
        inertia = np.zeros((3, 3))
        inertia[row, column] = inertia[column, row] = 1.0
        basis[4 + index, :3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    return basis


PSEUDO = _pseudo_basis()


def parameters_of(pseudo: Array) -> Array:
    """The ten parameters of a pseudo-inertia."""
    inertia = np.trace(pseudo[:3, :3]) * np.eye(3) - pseudo[:3, :3]
    return np.concatenate([[pseudo[3, 3]], pseudo[:3, 3], inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]])


def cross(w: Array) -> Array:
    """The matrix of w x."""
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def rotation(axis: int, angle: float) -> Array:
    """About a coordinate axis, (3, 3): the plane of the other two as complex numbers."""
    turned, (j, k), z = np.eye(3), ((axis + 1) % 3, (axis + 2) % 3), np.exp(1j * angle)
    turned[[j, k], [j, k]], turned[k, j], turned[j, k] = z.real, z.imag, -z.imag
    return turned


def placement(xyz: ArrayLike, rpy: ArrayLike) -> Array:
    """Rz(yaw) Ry(pitch) Rx(roll) and the offset, (4, 4)."""
    angles = np.asarray(rpy, dtype=np.float64)
    out = np.eye(4)
    for axis in (2, 1, 0):
        out[:3, :3] = out[:3, :3] @ rotation(axis, float(angles[axis]))
    out[:3, 3] = np.asarray(xyz, dtype=np.float64)
    return out


class Arm(Mechanism):
    """A tree of moving bodies; `frames` maps a name to (body, offset (4, 4)), body -1 being the base."""

    def __init__(
        self,
        parents: Sequence[int],
        places: Sequence[Array],
        twists: Sequence[Array],
        parameters: ArrayLike,
        frames: Mapping[str, tuple[int, Array]],
        gravity: ArrayLike = (0.0, 0.0, -9.81),
        armature: ArrayLike = 0.0,
    ) -> None:
        super().__init__(len(parents), parameters, armature)
        self.parents, self.places, self.twists = list(parents), list(places), list(twists)
        self.frames = dict(frames)
        self.gravity_vector: Array = np.array(gravity, dtype=np.float64)
        self._powers = [(place, place @ twist, place @ twist @ twist) for place, twist in zip(places, twists, strict=True)]
        self._walked: tuple[tuple[Any, ...], tuple[list[Analytic], list[Analytic]]] | None = None

    @classmethod
    def from_chain(cls, joints: Sequence[Joint], gravity: ArrayLike = (0.0, 0.0, -9.81), armature: ArrayLike = 0.0) -> Self:
        """Joints as dicts: type R | P | revolute | continuous | prismatic | fixed, axis, rpy, xyz, phi, and parent:
        the index of the joint that carries it (-1 the base; left out: the joint before)."""
        carrier: list[tuple[int, Array]] = []  # of each joint's frame: moving body and constant offset from it
        parents, places, twists = [], [], []
        inertias: list[Array] = []
        for index, joint in enumerate(joints):
            above = int(joint.get("parent", index - 1))
            body, offset = carrier[above] if above >= 0 else (-1, np.eye(4))
            offset = offset @ placement(joint.get("xyz", (0, 0, 0)), joint.get("rpy", (0, 0, 0)))
            pseudo = np.einsum("p,pij->ij", np.asarray(joint.get("phi", np.zeros(10)), dtype=np.float64), PSEUDO)
            kind = str(joint["type"]).lower()
            if kind == "fixed":
                if body >= 0:
                    inertias[body] = inertias[body] + offset @ pseudo @ offset.T
                carrier.append((body, offset))
                continue
            axis = np.asarray(joint["axis"], dtype=np.float64)
            axis = axis / np.linalg.norm(axis)
            twist = np.zeros((4, 4))
            if kind in ("r", "revolute", "continuous"):
                twist[:3, :3] = cross(axis)
            elif kind in ("p", "prismatic"):
                twist[:3, 3] = axis
            else:
                raise ValueError(f"from_chain: type is unknown: got {joint['type']!r} (joint {index})")
            parents.append(body)
            places.append(offset)
            twists.append(twist)
            inertias.append(pseudo)
            carrier.append((len(parents) - 1, np.eye(4)))
        frames = {f"link{index + 1}": frame for index, frame in enumerate(carrier)}
        return cls(parents, places, twists, np.concatenate([parameters_of(p) for p in inertias]), frames, gravity, armature)

    def with_parameters(self, parameters: ArrayLike) -> "Arm":
        """The same tree with other (10 n,) parameters."""
        return Arm(self.parents, self.places, self.twists, parameters, self.frames, self.gravity_vector, self.armature)

    def _joint(self, index: int, q: Analytic) -> Analytic:
        """place exp(xi q), (..., 4, 4): 1 + 2 c s xi + 2 s^2 xi^2 with the half angle's c and s, or 1 + q xi where xi^2 = 0."""
        place, first, second = self._powers[index]
        if not second.any():
            slid: Analytic = place + q[..., None, None] * first
            return slid
        c, s = np.cos(q / 2)[..., None, None], np.sin(q / 2)[..., None, None]
        turned: Analytic = place + (2 * c * s) * first + (2 * s * s) * second
        return turned

    def _walk(self, q: Analytic) -> tuple[list[Analytic], list[Analytic]]:
        """T_i (..., 4, 4) and dT_i/dq (..., n, 4, 4) of every body; the last point is kept, as pose and Jacobian share it."""
        key = (q.shape, q.dtype.char, q.tobytes())
        if self._walked is None or self._walked[0] != key:
            self._walked = (key, self._walk_anew(q))
        return self._walked[1]

    def _walk_anew(self, q: Analytic) -> tuple[list[Analytic], list[Analytic]]:
        base = np.broadcast_to(np.eye(4, dtype=q.dtype), (*q.shape[:-1], 4, 4))
        still = np.zeros((*q.shape, 4, 4), dtype=q.dtype)
        poses: list[Analytic] = []
        slopes: list[Analytic] = []
        for index, parent in enumerate(self.parents):
            step = self._joint(index, q[..., index])
            pose = (poses[parent] if parent >= 0 else base) @ step
            slope = (slopes[parent] if parent >= 0 else still) @ step[..., None, :, :]
            slope[..., index, :, :] = pose @ self.twists[index]
            poses.append(pose)
            slopes.append(slope)
        return poses, slopes

    def energy_basis(self, q: Analytic) -> tuple[Analytic, Analytic]:
        poses, slopes = self._walk(q)
        wide = np.stack(slopes, axis=-4)[..., :3, :]  # (..., link, j, row, b)
        flat = np.moveaxis(wide, -1, -2).reshape(*wide.shape[:-3], -1, 3)  # (..., link, j b, row)
        pairs = (flat @ np.swapaxes(flat, -1, -2)).reshape(*wide.shape[:-3], self.n, 4, self.n, 4)
        pairs = np.swapaxes(pairs, -3, -2).reshape(*wide.shape[:-3], self.n * self.n, 16)
        mass = np.swapaxes(pairs @ PSEUDO.reshape(10, 16).T, -1, -2)
        heights = -np.einsum("r,...rb->...b", self.gravity_vector, np.stack(poses, axis=-3)[..., :3, :])
        potential = heights @ PSEUDO[:, :, 3].T  # P e_4: the first moment and the mass
        lead = q.shape[:-1]
        return mass.reshape(*lead, -1, self.n, self.n), potential.reshape(*lead, -1)

    def _frame(self, q: Analytic, frame: str) -> tuple[Analytic, Analytic]:
        if frame not in self.frames:
            raise ValueError(f"frame is unknown: expected one of {list(self.frames)}, got {frame!r}")
        body, offset = self.frames[frame]
        if body < 0:
            fixed = np.broadcast_to(offset.astype(q.dtype), (*q.shape[:-1], 4, 4))
            return fixed, np.zeros((*q.shape, 4, 4), dtype=q.dtype)
        poses, slopes = self._walk(q)
        return poses[body] @ offset, slopes[body] @ offset

    def pose(self, q: ArrayLike, frame: str) -> Array:
        """X_WF, (..., 4, 4)."""
        (q,) = vectors(q, n=self.n)
        return np.array(self._frame(q, frame)[0])

    def position(self, q: ArrayLike, frame: str) -> Array:
        """p_WF, (..., 3)."""
        return np.array(self.pose(q, frame)[..., :3, 3])

    def _jacobian(self, q: Analytic, frame: str) -> Analytic:
        pose, slope = self._frame(q, frame)
        spin = slope[..., :3, :3] @ np.swapaxes(pose[..., :3, :3], -1, -2)[..., None, :, :]
        rows = [slope[..., 0, 3], slope[..., 1, 3], slope[..., 2, 3], spin[..., 2, 1], spin[..., 0, 2], spin[..., 1, 0]]
        return np.stack(rows, axis=-2)

    def jacobian(self, q: ArrayLike, frame: str) -> Array:
        """Geometric Jacobian [v; w] in world axes at the frame's origin, (..., 6, n)."""
        (q,) = vectors(q, n=self.n)
        return np.array(self._jacobian(q, frame))

    def jacobian_dot(self, q: ArrayLike, v: ArrayLike, frame: str) -> Array:
        """dJ/dt along v, (..., 6, n), one complex step in the direction of v."""
        q, v = vectors(q, v, n=self.n)
        return np.array(self._jacobian(q + 1j * STEP * v, frame).imag / STEP)


def planar_arm(
    lengths: ArrayLike,
    masses: ArrayLike | None = None,
    coms: ArrayLike | None = None,
    inertias: ArrayLike | None = None,
    gravity: ArrayLike = (0.0, -9.81),
) -> Arm:
    """Planar nR in the x-y plane, q1 from the x axis; coms from each joint, inertias about the com; frames at the link tips.

    Left out: uniform rods of 1 kg/m.
    """
    L = np.asarray(lengths, dtype=np.float64)
    m = L if masses is None else np.asarray(masses, dtype=np.float64)
    c = L / 2 if coms is None else np.asarray(coms, dtype=np.float64)
    I = m * L**2 / 12 if inertias is None else np.asarray(inertias, dtype=np.float64)
    joints = []
    for k in range(L.size):
        phi = np.zeros(10)
        phi[[0, 1, 9]] = m[k], m[k] * c[k], I[k] + m[k] * c[k] ** 2
        joints.append({"type": "R", "axis": (0, 0, 1), "xyz": (L[k - 1] if k else 0.0, 0.0, 0.0), "phi": phi})
    arm = Arm.from_chain(joints, gravity=(*np.asarray(gravity, dtype=np.float64), 0.0))
    for k in range(L.size):
        arm.frames[f"link{k + 1}"] = (k, placement((L[k], 0.0, 0.0), (0.0, 0.0, 0.0)))
    return arm
