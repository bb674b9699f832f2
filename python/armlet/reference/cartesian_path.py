"""Joint positions along a curve through poses, at path positions s. Newton steps of inverse kinematics go from each s to the next.

    lines:    p = p_0 + u dp,   R = R_0 (R_0' R_1)^u by the eigenvalues of R_0' R_1
    arcs:     p = m + turn(n, phi) (a - m), a turn by the angle phi about the normal n of the plane, a the start, m the centre
    corners:  p = C + (1 - t)^2 (A - C) + t^2 (B - C), R = lerp(lerp(R_A, R_C, t), lerp(R_C, R_B, t), t), t from 0 to 1
    spline:   natural cubic of positions and of quaternions, which are eigenvectors of a matrix of R (Bar-Itzhack 2000)
    q <- q + J^+ e

p and R are position and rotation matrix at the fraction u of a segment from p_0, R_0 to p_1, R_1, and dp = p_1 - p_0. ' is the transpose. C
is a corner between two lines. A and B are the points at the length r before and after C. lerp interpolates rotations along a geodesic. r is
the blend, but at most half the length of each line. The length of a line is (distance^2 + (ARM angle)^2)^1/2, with the angle between the
rotations. The constant ARM, 0.1 m/rad, makes angles comparable with distances. e is the error of position and rotation. J^+ is the
pseudo-inverse of the Jacobian.

`armlet.cartesian_path` makes a joint spline whose knots depend on the error, and represents rotations by quaternions.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .arm import Arm
from .lagrange import Array
from .timing import cubic_spline

ARM = 0.1  # m/rad, which makes angles of rotation comparable with distances
STEPS = 50


def power(R: Array, u: float) -> Array:
    """The power R^u of a rotation: u times its angle about the same axis."""
    values, vectors = np.linalg.eig(R)
    return np.array(np.real(vectors @ np.diag(np.exp(1j * u * np.angle(values))) @ np.linalg.inv(vectors)))


def rotation_angle(R: Array) -> float:
    return float(np.abs(np.angle(np.linalg.eigvals(R))).max())


def geodesic(a: Array, b: Array, u: float) -> Array:
    return np.array(a @ power(a.T @ b, u))


def quaternion(R: Array) -> Array:
    """The quaternion [w, x, y, z] of a rotation R.

    It is an eigenvector, for the largest eigenvalue, of a symmetric 4 x 4 matrix that is linear in R.
    """
    K = np.empty((4, 4))
    K[0, 0] = np.trace(R)
    K[0, 1:] = K[1:, 0] = [R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]
    K[1:, 1:] = R + R.T - np.trace(R) * np.eye(3)
    return np.array(np.linalg.eigh(K)[1][:, -1])


def matrix(q: Array) -> Array:
    w, v = q[0], q[1:]
    skew = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.array(np.eye(3) + 2.0 * w * skew + 2.0 * skew @ skew)


def about(n: Array, phi: float, v: Array) -> Array:
    """The vector v after a rotation by phi about the unit vector n (Rodrigues)."""
    return np.array(np.cos(phi) * v + np.sin(phi) * np.cross(n, v) + (1.0 - np.cos(phi)) * (n @ v) * n)


def circle(a: Array, b: Array, c: Array) -> tuple[Array, Array, float, float]:
    """Centre and normal of the circle through three points, and the angles from a to b and from b to c."""
    n = np.cross(b - a, c - b)
    n = n / np.linalg.norm(n)
    rows = np.stack([b - a, c - b, n])
    m = np.array(np.linalg.solve(rows, [(b - a) @ (a + b) / 2, (c - b) @ (b + c) / 2, n @ a]), dtype=np.float64)
    # Seen from the tip of the normal, the points a, b, c follow each other counterclockwise.
    first, second = (float(np.arctan2(np.cross(x - m, y - m) @ n, (x - m) @ (y - m))) % (2 * np.pi) for x, y in ((a, b), (b, c)))
    return m, n, first, second


def curve(poses: Array, s: Array, kind: str, blend: float, arcs: Sequence[int] = ()) -> list[tuple[Array, Array]]:
    """The position and the rotation of the curve through poses (K, 4, 4) at each path position s from 0 to 1."""
    p, R = poses[:, :3, 3], poses[:, :3, :3]
    distances = [float(np.linalg.norm(p[k + 1] - p[k])) for k in range(len(p) - 1)]
    turns: dict[int, tuple[Array, Array, float]] = {}
    for k in arcs:
        m, n, *angles = circle(*p[k - 1 : k + 2])
        for at, angle in zip((k - 1, k), angles, strict=True):
            turns[at] = m, n, angle
            distances[at] = float(np.linalg.norm(p[at] - m)) * angle
    lengths = [np.hypot(way, ARM * rotation_angle(R[k].T @ R[k + 1])) for k, way in enumerate(distances)]
    along = np.concatenate([[0.0], np.cumsum(lengths)])

    def line(l: float) -> tuple[Array, Array]:
        k = min(int(np.searchsorted(along, l, side="right")) - 1, len(lengths) - 1)
        u = (l - along[k]) / lengths[k]
        if k in turns:
            m, n, angle = turns[k]
            return m + about(n, u * angle, p[k] - m), geodesic(R[k], R[k + 1], u)
        return p[k] + u * (p[k + 1] - p[k]), geodesic(R[k], R[k + 1], u)

    def point(l: float) -> tuple[Array, Array]:
        for k in range(1, len(lengths)):
            if k in turns or k - 1 in turns:
                continue
            r = min(blend, lengths[k - 1] / 2, lengths[k] / 2)
            if abs(l - along[k]) < r:
                t = (l - along[k] + r) / (2 * r)
                (A, first), (B, last) = line(along[k] - r), line(along[k] + r)
                turned = geodesic(geodesic(first, R[k], t), geodesic(R[k], last, t), t)
                return p[k] + (1 - t) ** 2 * (A - p[k]) + t**2 * (B - p[k]), turned
        return line(l)

    if kind == "lines" or len(p) == 2:
        return [point(float(x) * along[-1]) for x in s]
    quaternions = [quaternion(R[0])]
    for turn in R[1:]:
        new = quaternion(turn)
        quaternions.append(new if new @ quaternions[-1] >= 0.0 else -new)
    values = cubic_spline(along, np.concatenate([p, quaternions], axis=1))(s * along[-1])[0]
    return [(row[:3], matrix(row[3:] / np.linalg.norm(row[3:]))) for row in values]


def cartesian_path(
    arm: Arm,
    poses: ArrayLike,
    q0: ArrayLike,
    s: ArrayLike,
    *,
    frame: str,
    rows: Sequence[int] = range(6),
    kind: str = "lines",
    blend: float = 0.0,
    arcs: Sequence[int] = (),
) -> Array:
    """Joint positions (M, n) at s (M,) along poses (K, 4, 4), for the rows `rows` of [position; rotation]. NaN after a failure."""
    s, q, chosen = np.asarray(s, dtype=np.float64), np.asarray(q0, dtype=np.float64), np.asarray(list(rows))
    found = np.full((s.size, q.size), np.nan)
    for i, (p, R) in enumerate(curve(np.asarray(poses, dtype=np.float64), s, kind, blend, arcs)):
        for _ in range(STEPS):
            pose = arm.pose(q, frame)
            off = R @ pose[:3, :3].T
            axis: Any = 0.5 * np.array([off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1]])
            # The error uses the sine of the angle, which equals the angle to first order where the steps end.
            error = np.concatenate([p - pose[:3, 3], axis])[chosen]
            if np.abs(error).max() < 1e-12:
                break
            q = q + np.linalg.pinv(arm.jacobian(q, frame)[chosen]) @ error
        else:
            if np.abs(error).max() > 1e-9:
                return found
        found[i] = q
    return found
