"""Cartesian coordinates of a frame: selected rows of position and orientation.

    e = x_d - p_WF for the letters x y z,   e = log(R_d R') for rx ry rz,  R_d = exp(target)
    e_dot = -J v for positions and a constant target;  J the corresponding rows of the geometric Jacobian in world axes

p_WF and R are position and rotation matrix of the frame, x_d the target and ' the transpose. log comes from a unit quaternion: the
eigenvector of Bar-Itzhack's matrix (2000) for the largest eigenvalue. This needs no special case at the angle pi.
"""

import re

import numpy as np
from numpy.typing import ArrayLike

from .arm import Arm, cross
from .lagrange import Array

ROWS = ("x", "y", "z", "rx", "ry", "rz")


def parse_axes(axes: str) -> list[int]:
    """The row indices, in the 6 rows [v; w], of axes such as "xyz", "xy", "rx ry rz" or "xyz rz"."""
    if re.sub(r"r[xyz]|[xyz]|[\s,]", "", axes) or not axes.strip():
        raise ValueError(f"axes is not made of x y z rx ry rz: got {axes!r}")
    rows = [ROWS.index(name) for name in re.findall(r"r[xyz]|[xyz]", axes)]
    if len(set(rows)) != len(rows):
        raise ValueError(f"axes repeats a letter: got {axes!r}")
    return rows


def rotation_vector(R: Array) -> Array:
    """The rotation vector log R, rad: the axis times the angle in [0, pi]."""
    K = np.empty((4, 4))
    K[:3, :3] = R + R.T - np.trace(R) * np.eye(3)
    K[:3, 3] = K[3, :3] = (R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])
    K[3, 3] = np.trace(R)
    quaternion = np.linalg.eigh(K)[1][:, -1]
    quaternion = quaternion * (1.0 if quaternion[3] >= 0 else -1.0)
    length = float(np.linalg.norm(quaternion[:3]))
    angle = 2.0 * np.arctan2(length, quaternion[3])
    vector: Array = quaternion[:3] * (angle / length if length > 0.0 else 2.0)
    return vector


def rotation_matrices(vector: Array, scales: ArrayLike) -> Array:
    """The rotation exp(s vector) of each s in `scales`, (k, 3, 3).

    The skew-symmetric matrix of the vector times i is Hermitian, so one decomposition into eigenvalues gives all of them.
    """
    angles, U = np.linalg.eigh(1j * cross(vector))
    R: Array = ((U * np.exp(-1j * np.multiply.outer(scales, angles))[:, None, :]) @ U.conj().T).real
    return R


def rotation_matrix(vector: Array) -> Array:
    """The rotation exp(vector), (3, 3)."""
    R: Array = rotation_matrices(vector, [1.0])[0]
    return R


def pose_error(X: Array, target: Array, rows: list[int]) -> Array:
    """The rows `rows` of p_d - p and log(R_d R') for a pose X (4, 4). Rows of orientation that are not in `rows` have the target zero."""
    full = np.zeros(6)
    full[rows] = target
    turn = rotation_vector(rotation_matrix(full[3:]) @ X[:3, :3].T) if max(rows) > 2 else np.zeros(3)
    return np.concatenate([full[:3] - X[:3, 3], turn])[rows]


def pose_vector(arm: Arm, q: ArrayLike, frame: str) -> Array:
    """The position and the rotation vector [p; log R] of a frame, (..., 6), m and rad."""
    X = arm.pose(q, frame)
    turns = [rotation_vector(R) for R in X[..., :3, :3].reshape(-1, 3, 3)]
    return np.concatenate([X[..., :3, 3], np.reshape(turns, (*X.shape[:-2], 3))], axis=-1)


class Coordinates:
    """Selected rows of the pose of a frame of an arm, with a target of one number per row."""

    def __init__(self, arm: Arm, target: ArrayLike, frame: str, axes: str) -> None:
        self.arm, self.frame, self.rows = arm, frame, parse_axes(axes)
        self.target: Array = np.array(target, dtype=np.float64)
        if self.target.shape != (len(self.rows),):
            raise ValueError(f"target is misshapen: expected ({len(self.rows)},), got {self.target.shape}")

    def error(self, q: Array, target: Array | None = None) -> Array:
        """The error e, (rows,). If the argument `target` is not None, it replaces the target of the object."""
        return pose_error(self.arm.pose(q, self.frame), self.target if target is None else target, self.rows)

    def jacobian(self, q: Array) -> Array:
        """The Jacobian of the rows, (rows, n)."""
        chosen: Array = self.arm.jacobian(q, self.frame)[self.rows]
        return chosen

    def load(self, q: Array, F: Array) -> Array:
        """The joint torque J'F, (n,), of a force F in the rows, (rows,)."""
        torque: Array = self.jacobian(q).T @ F
        return torque
