"""A motion through knots at their own times, from one linear system for all polynomials of a joint.

    q(t) = sum_d c_pd (t - t_p)^d    on [t_p, t_(p+1)],   degree 3 or 5
    positions          each piece has its two positions; v and a are equal on both sides of each inner knot; two end conditions
    with velocities    each piece has positions and velocities at both ends
    with accelerations each piece has all three at both ends

The unknowns are the coefficients c_pd of all pieces. Before the first knot and after the last one, the motion rests.
"""

from math import factorial

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array
from .motion import Sample

__all__ = ["Spline"]


class Spline:
    """A motion through q (K, n) at the times t (K,), with velocities v and accelerations a (K, n) if they are known."""

    def __init__(
        self, t: ArrayLike, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None, *, spline: str = "clamped"
    ) -> None:
        self.t: Array = np.asarray(t, dtype=np.float64)
        given = [np.asarray(x, dtype=np.float64) for x in (q, v, a) if x is not None]
        self.q = given[0]
        self.degree = 5 if len(given) == 3 else 3
        rows: list[Array] = []
        values: list[Array] = []
        pieces = len(self.t) - 1
        for p in range(pieces):
            for order, known in enumerate(given):
                for end in (p, p + 1):
                    rows.append(self._row(p, self.t[end], order))
                    values.append(known[end])
        if len(given) == 1:
            for p in range(pieces - 1):
                for order in (1, 2):
                    rows.append(self._row(p, self.t[p + 1], order) - self._row(p + 1, self.t[p + 1], order))
            rows += self._end_conditions(spline)
            values += [np.zeros(self.q.shape[1])] * (len(rows) - len(values))
        self.coefficients = np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)[0].reshape(pieces, self.degree + 1, -1)
        self.stops = not given[1][-1].any() if len(given) > 1 else spline == "clamped"
        self.breaks = tuple(float(time) for time in self.t)

    def _end_conditions(self, spline: str) -> list[Array]:
        last = len(self.t) - 2
        if spline == "not-a-knot":
            if last < 2:
                # With fewer than four knots, the motion is one polynomial of a degree below the number of knots.
                return [self._row(p, self.t[p], order) for p in range(last + 1) for order in range(last + 2, 4)]
            return [self._row(p, self.t[p + 1], 3) - self._row(p + 1, self.t[p + 1], 3) for p in (0, last - 1)]
        order = {"clamped": 1, "natural": 2}[spline]
        return [self._row(0, self.t[0], order), self._row(last, self.t[-1], order)]

    def _row(self, p: int, t: float, order: int) -> Array:
        """The row of the derivative of this order at the time t in piece p."""
        row = np.zeros((len(self.t) - 1, self.degree + 1))
        for d in range(order, self.degree + 1):
            row[p, d] = factorial(d) / factorial(d - order) * (t - self.t[p]) ** (d - order)
        return row.reshape(-1)

    def __call__(self, t: float) -> Sample:
        q, v, a = self.derivatives(t, 2)
        return q, v, a

    def derivatives(self, t: float, order: int) -> Array:
        """At a knot, derivatives that jump are those after it; at a last knot with a velocity, those before it."""
        rows = np.zeros((order + 1, self.q.shape[1]))
        if not self.t[0] <= t <= self.t[-1] or (t == self.t[-1] and self.stops):
            rows[0] = self.q[0 if t < self.t[0] else -1]
            return rows
        p = min(int(np.searchsorted(self.t, t, side="right")), len(self.t) - 1) - 1
        for k in range(order + 1):
            row = self._row(p, t, k).reshape(-1, self.degree + 1)[p]
            rows[k] = row @ self.coefficients[p]
        return rows
