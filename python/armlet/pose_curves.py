"""Curves through poses: straight lines, arcs and geodesics, with rounded corners, or one smooth spline.

length of a segment:  l = sqrt(|dp|^2 + (0.1 m/rad angle)^2),   s = (sum of the lengths before) / (total length)
arc through a, b, c:  p = m + r (cos phi e_1 + sin phi e_2),   |a - m| = |b - m| = |c - m| = r;   in l, the arc length replaces |dp|
corner between lines: lerp(lerp(A, C, t), lerp(C, B, t), t),   A and B on the lines at the length h before and after the corner C,
                      h = min(blend, l/2 of both segments),   t from 0 to 1
spline:               natural cubic of positions and quaternions over s, quaternions normalised

Here dp is the difference of two positions, and angle the angle between two rotations. An arc has the centre m and the radius r, and e_1 and
e_2 are orthogonal unit vectors of its plane. lerp(A, C, t) is the interpolation from A to C at the fraction t: linear for positions, along
the geodesic for rotations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import _core, rotations

__all__ = ["NoCircleError", "PoseCurve", "columns_of", "cubic"]

_Array = NDArray[Any]
# Length that counts as much as a rotation by one radian, m.
_ARM = 0.1


# Three points are on one line if the sine of the angle at the last point is below this value.
_LINE = 1e-9


def columns_of(axes: str) -> list[int]:
    """Columns of [p; rotation vector], 0 to 5, that the letters of `axes` name."""
    columns, turned = [], 0
    for letter in axes.replace(" ", "").replace(",", ""):
        if letter == "r":
            turned = 3
            continue
        columns.append(turned + "xyz".index(letter))
        turned = 0
    return columns


class NoCircleError(ValueError):
    """Three positions are on one line. The argument is the index of the middle position."""


class _Arc(NamedTuple):
    """Part of a circle from the angle `first` to the angle `last`, rad.

    `axes` are two orthogonal vectors with the circle's radius as norm.
    """

    centre: _Array
    axes: _Array
    first: float
    last: float

    @property
    def length(self) -> float:
        return float(np.linalg.norm(self.axes[0])) * (self.last - self.first)

    def at(self, u: _Array) -> _Array:
        """Points (M, d) of the arc at fractions `u` (M,) of its length."""
        angle = self.first + u * (self.last - self.first)
        return np.asarray(self.centre + np.cos(angle)[:, None] * self.axes[0] + np.sin(angle)[:, None] * self.axes[1])


def _arcs(a: _Array, b: _Array, c: _Array) -> tuple[_Arc, _Arc] | None:
    """The arcs from a to b and from b to c of the circle through three points (d,). None if the points are on one line."""
    u, w = a - c, b - c
    gram = np.array([[u @ u, u @ w], [u @ w, w @ w]])
    area = gram[0, 0] * gram[1, 1] - gram[0, 1] ** 2
    if not area > _LINE**2 * gram[0, 0] * gram[1, 1]:
        return None
    weights = np.linalg.solve(gram, 0.5 * np.diagonal(gram))
    centre = c + weights[0] * u + weights[1] * w
    first = a - centre
    across = [p - centre - first * ((p - centre) @ first) / (first @ first) for p in (b, c)]
    # Of b and c, the point further from the diameter through a defines the second axis. The other point may be on this diameter.
    second = max(across, key=np.linalg.norm)
    second = second * (np.linalg.norm(first) / np.linalg.norm(second))
    middle, last = (float(np.arctan2((p - centre) @ second, (p - centre) @ first)) % (2.0 * np.pi) for p in (b, c))
    if last < middle:
        second, middle, last = -second, 2.0 * np.pi - middle, 2.0 * np.pi - last
    axes = np.stack([first, second])
    return _Arc(centre, axes, 0.0, middle), _Arc(centre, axes, middle, last)


def cubic(s: _Array, q: _Array, d: _Array, at: _Array) -> tuple[_Array, _Array, _Array]:
    """Value, first and second derivative at `at` (M,) of piecewise cubics with values `q` and slopes `d`, (K, n), at knots `s` (K,)."""
    k = np.clip(np.searchsorted(s, at, side="right") - 1, 0, s.size - 2)
    h = (s[k + 1] - s[k])[:, None]
    x = (at - s[k])[:, None] / h
    step, first, last = q[k + 1] - q[k], h * d[k], h * d[k + 1]
    c2, c3 = 3.0 * step - 2.0 * first - last, first + last - 2.0 * step
    return q[k] + x * (first + x * (c2 + x * c3)), (first + x * (2.0 * c2 + 3.0 * x * c3)) / h, (2.0 * c2 + 6.0 * x * c3) / h**2


@dataclass(frozen=True, eq=False)
class PoseCurve:
    """A curve through poses.

    Attributes:
        rows: the poses, `(K, m)`.
        turns: columns of all three parts of the rotation vector; an empty list if the poses have no rotation vector.
        single: columns of single angles, rad.
        smooth: whether the curve is a spline; otherwise it consists of lines and arcs.
        blend: largest length h of the curve from the beginning of a rounding to its corner, m. h is also at most half of each segment.
        arcs: indices of poses in the middle of arcs.
    """

    rows: _Array
    turns: list[int]
    single: list[int]
    smooth: bool
    blend: float
    arcs: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        places = [k for k in range(self.rows.shape[1]) if k not in self.turns]
        scale = np.array([_ARM if k in self.single else 1.0 for k in places])
        moved = np.diff(self.rows[:, places] * scale, axis=0)
        straight = [k for k in places if k not in self.single]
        circles: dict[int, _Arc] = {}
        for k in self.arcs:
            found = _arcs(*self.rows[k - 1 : k + 2, straight])
            if found is None:
                raise NoCircleError(k)
            circles[k - 1], circles[k] = found
        lengths = np.square(moved).sum(axis=1)
        for k, arc in circles.items():
            chord = np.square(np.diff(self.rows[k : k + 2, straight], axis=0)).sum()
            lengths[k] += arc.length**2 - chord
        quaternions = rotations.of_vector(self.rows[:, self.turns]) if self.turns else np.zeros((self.rows.shape[0], 4))
        if self.turns:
            for k in range(1, quaternions.shape[0]):
                if quaternions[k] @ quaternions[k - 1] < 0.0:
                    quaternions[k] *= -1.0
            lengths = lengths + np.square(_ARM * rotations.angle(quaternions[:-1], quaternions[1:]))
        along = np.concatenate([[0.0], np.cumsum(np.sqrt(lengths))])
        values = {"places": places, "quaternions": quaternions, "along": along, "circles": circles}
        for name, value in values.items():
            object.__setattr__(self, name, value)

    places: Any = None
    quaternions: Any = None
    along: Any = None
    circles: Any = None

    @property
    def length(self) -> float:
        """Length of the curve, m."""
        return float(self.along[-1])

    @property
    def corners(self) -> _Array:
        """Path positions of the poses, 0 to 1, `(K,)`."""
        return np.asarray(self.along / self.along[-1])

    def at(self, s: _Array) -> _Array:
        """Poses (M, m) at path positions `s` (M,)."""
        l = s * self.length
        if self.smooth and self.along.size > 2:
            return self._spline(l)
        place, turn = self._line(l)
        for k in range(1, self.along.size - 1):
            if k in self.circles or k - 1 in self.circles:
                continue
            r = min(self.blend, *(0.5 * np.diff(self.along)[k - 1 : k + 1]))
            near = np.abs(l - self.along[k]) < r
            if r > 0.0 and near.any():
                place[near], turn[near] = self._corner(k, r, l[near])
        return self._joined(place, turn)

    def _joined(self, place: _Array, turn: _Array) -> _Array:
        rows = np.empty((place.shape[0], self.rows.shape[1]))
        rows[:, self.places] = place
        if self.turns:
            rows[:, self.turns] = rotations.vector(turn)
        return rows

    def _line(self, l: _Array) -> tuple[_Array, _Array]:
        k = np.clip(np.searchsorted(self.along, l, side="right") - 1, 0, self.along.size - 2)
        u = (l - self.along[k]) / (self.along[k + 1] - self.along[k])
        place = self.rows[:, self.places]
        place = place[k] + u[:, None] * (place[k + 1] - place[k])
        straight = [i for i, column in enumerate(self.places) if column not in self.single]
        for segment, arc in self.circles.items():
            on = k == segment
            place[np.ix_(on, straight)] = arc.at(u[on])
        return place, rotations.slerp(self.quaternions[k], self.quaternions[k + 1], u) if self.turns else self.quaternions[k]

    def _corner(self, k: int, r: float, l: _Array) -> tuple[_Array, _Array]:
        t = (l - self.along[k] + r) / (2.0 * r)
        ends = self._line(np.array([self.along[k] - r, self.along[k] + r]))
        (a, b), c = ends[0], self.rows[k, self.places]
        u = t[:, None]
        place = (1 - u) ** 2 * a + 2 * u * (1 - u) * c + u**2 * b
        corner = np.broadcast_to(self.quaternions[k], (t.size, 4))
        if not self.turns:
            return place, corner
        first, last = (np.broadcast_to(end, (t.size, 4)) for end in ends[1])
        return place, rotations.slerp(rotations.slerp(first, corner, t), rotations.slerp(corner, last, t), t)

    def _spline(self, l: _Array) -> _Array:
        values = np.concatenate([self.rows[:, self.places], self.quaternions], axis=1)
        found = cubic(self.along, values, _core._spline_slopes(self.along, values, "natural"), l)[0]
        turn = found[:, len(self.places) :]
        return self._joined(found[:, : len(self.places)], turn / np.linalg.norm(turn, axis=1, keepdims=True) if self.turns else turn)
