"""Kinematics and energies of trees of revolute and prismatic joints, from homogeneous transforms (Uicker 1967).

    T_i = T_parent(i) place_i exp(xi_i q_i),    dT_i/dq_j = dT_parent/dq_j place_i exp(xi_i q_i),  and T_i xi_i for j = i
    kinetic   1/2 sum_i tr( dT_i/dt P_i (dT_i/dt)' )   so   M_jk = sum_i tr( dT_i/dq_j  P_i  (dT_i/dq_k)' )
    potential -sum_i gravity . (T_i P_i e_4),   e_4 = (0, 0, 0, 1)

T_i is the pose of body i in the world. place_i is the constant pose of joint i in its parent's body, and xi_i its twist, (4, 4). P_i is the
pseudo-inertia of body i (see `inertia`), linear in its ten parameters. A link behind a fixed joint, with the pose X in its parent's body
and the pseudo-inertia P, adds X P X' to this body. ' is the transpose. The exponential uses the half angle. It is analytic in q, so that
every derivative can be a complex step.

Under a gravity of 1 m/s^2 against a coordinate axis, the potential energy divided by the mass is this coordinate of the centre of mass. The
gravity torque divided by the mass is the row of this coordinate in the Jacobian.
"""

from collections.abc import Mapping, Sequence
from copy import copy
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from .inertia import PSEUDO, parameters_of, pseudo_inertia
from .lagrange import STEP, Analytic, Array, Mechanism, vectors

Joint = Mapping[str, Any]
Mover = tuple[int, float, float]
LIMITS = {"lower": -np.inf, "upper": np.inf, "velocity": np.inf}


def cross(w: Array) -> Array:
    """The skew-symmetric matrix S with S x = w x x (cross product), (3, 3)."""
    return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])


def rotation(axis: int, angle: float) -> Array:
    """The rotation about a coordinate axis, (3, 3), computed with complex numbers in the plane of the other two axes."""
    turned, (j, k), z = np.eye(3), ((axis + 1) % 3, (axis + 2) % 3), np.exp(1j * angle)
    turned[[j, k], [j, k]], turned[k, j], turned[j, k] = z.real, z.imag, -z.imag
    return turned


def placement(xyz: ArrayLike, rpy: ArrayLike) -> Array:
    """The transform (4, 4) with the rotation Rz(yaw) Ry(pitch) Rx(roll) and the offset xyz, m."""
    angles = np.asarray(rpy, dtype=np.float64)
    out = np.eye(4)
    for axis in (2, 1, 0):
        out[:3, :3] = out[:3, :3] @ rotation(axis, float(angles[axis]))
    out[:3, 3] = np.asarray(xyz, dtype=np.float64)
    return out


class Arm(Mechanism):
    """A tree of moving bodies. `frames` maps the name of a frame to its body (-1 is the base) and its offset (4, 4) from the body frame."""

    def __init__(
        self,
        parents: Sequence[int],
        places: Sequence[Array],
        twists: Sequence[Array],
        parameters: ArrayLike,
        frames: Mapping[str, tuple[int, Array]],
        gravity: ArrayLike = (0.0, 0.0, -9.81),
        armature: ArrayLike = 0.0,
        movers: Sequence[Mover] | None = None,
    ) -> None:
        #: For each joint: the coordinate that moves it, the multiplier and the offset.
        self.movers = list(movers or [(index, 1.0, 0.0) for index in range(len(parents))])
        super().__init__(len({coordinate for coordinate, *_ in self.movers}), parameters, armature)
        self.parents, self.places, self.twists = list(parents), list(places), list(twists)
        self.frames = dict(frames)
        self.gravity_vector: Array = np.array(gravity, dtype=np.float64)
        self._powers = [(place, place @ twist, place @ twist @ twist) for place, twist in zip(places, twists, strict=True)]
        turns = [bool(second.any()) for _, _, second in self._powers]
        self.angles: Any = np.array([turns[self.movers.index((k, 1.0, 0.0))] for k in range(self.n)])
        self.joint_names: tuple[str, ...] = tuple(f"joint{index + 1}" for index in range(self.n))
        self.limits: dict[str, Array] = {key: np.full(self.n, value) for key, value in LIMITS.items()}  # rad or m; velocity per s
        self._walked: tuple[tuple[Any, ...], tuple[list[Analytic], list[Analytic]]] | None = None

    @classmethod
    def from_chain(cls, joints: Sequence[Joint], gravity: ArrayLike = (0.0, 0.0, -9.81), armature: ArrayLike | None = None) -> Self:
        """An arm from a list of joints, with the keys of `armlet.Arm.from_chain`.

        Each joint is a dict. `type` is R, P, revolute, continuous, prismatic or fixed. `axis`, `rpy`, `xyz` and `phi` are its geometry and
        inertia. `parent` is the index of the parent joint: -1 is the base, and the default is the previous joint. `name`, `lower`,
        `upper`, `velocity`, `armature`, `damping` and `friction` are optional. `mimic` contains the index `joint` of its leader,
        `multiplier` and `offset`.
        """
        carrier: list[tuple[int, Array]] = []  # for the frame of each joint: its moving body, and the constant offset from the body
        parents: list[int] = []
        places, twists, moving = [], [], []
        seats: dict[int, int] = {}  # for the list index of each moving joint: its index among the moving joints
        inertias: list[Array] = []
        for index, joint in enumerate(joints):
            above = int(joint.get("parent", index - 1))
            body, offset = carrier[above] if above >= 0 else (-1, np.eye(4))
            offset = offset @ placement(joint.get("xyz", (0, 0, 0)), joint.get("rpy", (0, 0, 0)))
            pseudo = pseudo_inertia(joint.get("phi", np.zeros(10)))
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
            seats[index] = len(parents)
            parents.append(body)
            places.append(offset)
            twists.append(twist)
            inertias.append(pseudo)
            moving.append(joint)
            carrier.append((len(parents) - 1, np.eye(4)))
        frames = {f"link{index + 1}": frame for index, frame in enumerate(carrier)}
        leads = [k for k, joint in enumerate(moving) if "mimic" not in joint]
        movers = [_mover(moving, seats, leads, k) for k in range(len(moving))]
        arm = cls(parents, places, twists, np.concatenate([parameters_of(p) for p in inertias]), frames, gravity, 0.0, movers)
        arm.joint_names = tuple(str(moving[k].get("name", f"joint{k + 1}")) for k in leads)
        low, high, fast = ([float(joint.get(key, value)) for joint in moving] for key, value in LIMITS.items())
        G = np.array([[m * (k == column) for column in range(len(leads))] for k, m, _ in movers]).reshape(len(moving), len(leads))
        for column in range(len(leads)):
            # The range of a coordinate is the intersection of the ranges that its joints allow.
            rows = [(k, *movers[k][1:]) for k in np.flatnonzero(G[:, column])]
            ends = [sorted(((low[k] - c) / m, (high[k] - c) / m)) for k, m, c in rows]
            arm.limits["lower"][column], arm.limits["upper"][column] = max(low for low, _ in ends), min(high for _, high in ends)
            arm.limits["velocity"][column] = min(fast[k] / abs(m) for k, m, _ in rows)
        drives = {key: np.array([float(joint.get(key, 0.0)) for joint in moving]) for key in ("armature", "damping", "friction")}
        weights = {"armature": G**2, "damping": G**2, "friction": np.abs(G)}
        return arm.with_drives(**{key: value @ weights[key] for key, value in drives.items()}).with_drives(armature=armature)

    def with_gravity(self, gravity: ArrayLike) -> Self:
        """A copy of the arm with another gravity (3,), m/s^2."""
        other = copy(self)
        other.gravity_vector, other._last = np.array(gravity, dtype=np.float64), None
        return other

    def _joint(self, index: int, q: Analytic) -> Analytic:
        """The transform place exp(xi q) of a joint, (..., 4, 4).

        exp(xi q) = 1 + 2 c s xi + 2 s^2 xi^2 with c = cos(q/2) and s = sin(q/2), or 1 + q xi for a prismatic joint.
        """
        place, first, second = self._powers[index]
        if not second.any():
            slid: Analytic = place + q[..., None, None] * first
            return slid
        c, s = np.cos(q / 2)[..., None, None], np.sin(q / 2)[..., None, None]
        turned: Analytic = place + (2 * c * s) * first + (2 * s * s) * second
        return turned

    def _walk(self, q: Analytic) -> tuple[list[Analytic], list[Analytic]]:
        """T_i (..., 4, 4) and dT_i/dq (..., n, 4, 4) of every body. The last result is stored for later calls at the same q."""
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
            coordinate, multiplier, offset = self.movers[index]
            step = self._joint(index, multiplier * q[..., coordinate] + offset)
            pose = (poses[parent] if parent >= 0 else base) @ step
            slope = (slopes[parent] if parent >= 0 else still) @ step[..., None, :, :]
            slope[..., coordinate, :, :] += multiplier * (pose @ self.twists[index])
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
        potential = heights @ PSEUDO[:, :, 3].T  # the column P e_4 is the first moment and the mass
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

    def file_joint_poses(self, q: ArrayLike) -> Array:
        """The pose T_i of every moving joint, including mimic joints, (..., joints, 4, 4)."""
        (q,) = vectors(q, n=self.n)
        return np.array(np.stack(self._walk(q)[0], axis=-3))

    def center_of_mass(self, q: ArrayLike) -> Array:
        """The centre of mass in world axes, (..., 3), m."""
        heights = [self.with_gravity(-axis).energy(q, np.zeros(self.n))[1] for axis in np.eye(3)]
        return np.asarray(np.stack(heights, axis=-1) / self.parameters[::10].sum())

    def center_of_mass_jacobian(self, q: ArrayLike) -> Array:
        """The Jacobian of the centre of mass, (..., 3, n)."""
        rows = [self.with_gravity(-axis).gravity(q) for axis in np.eye(3)]
        return np.asarray(np.stack(rows, axis=-2) / self.parameters[::10].sum())

    def pose(self, q: ArrayLike, frame: str) -> Array:
        """The pose X_WF of a frame in the world, (..., 4, 4)."""
        (q,) = vectors(q, n=self.n)
        return np.array(self._frame(q, frame)[0])

    def position(self, q: ArrayLike, frame: str) -> Array:
        """The position p_WF of a frame's origin in the world, (..., 3), m."""
        return np.array(self.pose(q, frame)[..., :3, 3])

    def _load(self, q: Array, wrench: Array, frame: str) -> Array:
        return np.array(np.einsum("...ij,...i->...j", self._jacobian(q, frame), wrench))

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
        """The time derivative dJ/dt of the Jacobian for dq/dt = v, (..., 6, n), by a complex step in the direction of v."""
        q, v = vectors(q, v, n=self.n)
        return np.array(self._jacobian(q + 1j * STEP * v, frame).imag / STEP)


def _mover(moving: Sequence[Joint], seats: Mapping[int, int], leads: Sequence[int], index: int) -> Mover:
    """The coordinate that moves a joint, the multiplier and the offset, found through its chain of leaders."""
    multiplier, offset = 1.0, 0.0
    while (follows := moving[index].get("mimic")) is not None:
        offset += multiplier * float(follows.get("offset", 0.0))
        multiplier *= float(follows.get("multiplier", 1.0))
        index = seats[int(follows["joint"])]
    return leads.index(index), multiplier, offset


def planar_arm(
    lengths: ArrayLike,
    masses: ArrayLike | None = None,
    coms: ArrayLike | None = None,
    inertias: ArrayLike | None = None,
    gravity: ArrayLike = (0.0, -9.81),
) -> Arm:
    """A planar arm of n revolute joints in the x-y plane, with q1 measured from the x axis. Its frames are at the link tips.

    `coms` are distances from the joints, m, and `inertias` are about the centres of mass, kg m^2. By default, the links are uniform
    rods with 1 kg per metre.
    """
    L = np.asarray(lengths, dtype=np.float64)
    m = L if masses is None else np.asarray(masses, dtype=np.float64)
    c = L / 2 if coms is None else np.asarray(coms, dtype=np.float64)
    I = m * L**2 / 12 if inertias is None else np.asarray(inertias, dtype=np.float64)
    joints = []
    for k in range(L.size):
        phi = np.zeros(10)
        phi[[0, 1]], phi[[6, 9]] = (m[k], m[k] * c[k]), I[k] + m[k] * c[k] ** 2  # the inertias about y and z are equal
        joints.append({"type": "R", "axis": (0, 0, 1), "xyz": (L[k - 1] if k else 0.0, 0.0, 0.0), "phi": phi})
    arm = Arm.from_chain(joints, gravity=(*np.asarray(gravity, dtype=np.float64), 0.0))
    for k in range(L.size):
        arm.frames[f"link{k + 1}"] = (k, placement((L[k], 0.0, 0.0), (0.0, 0.0, 0.0)))
    return arm
