"""Desired motions m(t) -> q_d, v_d, a_d.

    Sinusoid:  q = offset + Im sum_k z_k,  z_k = amplitude_k exp(i (frequency_k t + phase_k));  d/dt multiplies z_k by i frequency_k
    Quintic:   q = q0 + (q1 - q0) p(x),  x = t/T,  p the quintic with p = 0, 1 and dp/dx = d^2p/dx^2 = 0 at the ends
               from a linear system
    BangBang:  d^2q/dt^2 = +A before T/2, -A after,  integrated as polynomials piece by piece;  A = 4 (q1 - q0)/T^2
    Table:     q, v, a at knots;   between two knots the Bezier curve of degree 5 with these values, h = dt
               points q_k,   q_k + h v_k/5,   q_k + 2 h v_k/5 + h^2 a_k/20,   and in the same form from the second knot
               derivatives   from differences of the points

`derivatives(t, order)` returns the position and its derivatives with respect to time up to `order`, (order + 1, n). Order 3 is the jerk,
and 4 the snap. Quintic and BangBang are at rest at q0 before t = 0, and at rest at q1 from t = T on. Accelerations that jump are continuous
from the right.
"""

from collections.abc import Callable
from math import factorial

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from .lagrange import Array

Sample = tuple[Array, Array, Array]
Motion = Callable[[float], Sample]
SNAP = 4  # the highest order of a derivative


class Hold:
    """A constant position q (n,)."""

    breaks: tuple[float, ...] = ()

    def __init__(self, q: ArrayLike) -> None:
        self.q: Array = np.array(q, dtype=np.float64)

    def __call__(self, t: float) -> Sample:
        return self.q.copy(), np.zeros_like(self.q), np.zeros_like(self.q)

    def derivatives(self, t: float, order: int) -> Array:
        return np.array([self.q, *np.zeros((order, self.q.size))])


class Sinusoid:
    """q_d = offset + sum amplitude sin(frequency t + phase). `amplitude` is (n,) or (n, k); frequency and phase broadcast to its shape."""

    breaks: tuple[float, ...] = ()

    def __init__(self, offset: ArrayLike, amplitude: ArrayLike, frequency: ArrayLike, phase: ArrayLike) -> None:
        amplitudes = np.asarray(amplitude, dtype=np.float64)
        shape = amplitudes.shape
        terms = shape if len(shape) == 2 else (*shape, 1)
        self.offset: Array = np.broadcast_to(np.asarray(offset, dtype=np.float64), shape[:1])
        self.frequency: Array = np.broadcast_to(np.asarray(frequency, dtype=np.float64), shape).reshape(terms)
        phases = np.broadcast_to(np.asarray(phase, dtype=np.float64), shape).reshape(terms)
        self.phasor = amplitudes.reshape(terms) * np.exp(1j * phases)

    def __call__(self, t: float) -> Sample:
        q, v, a = self.derivatives(t, 2)
        return q, v, a

    def derivatives(self, t: float, order: int) -> Array:
        turning = self.phasor * np.exp(1j * self.frequency * t)
        rows = np.array([((1j * self.frequency) ** k * turning).sum(axis=-1).imag for k in range(order + 1)])
        rows[0] += self.offset
        return rows


class _Piecewise:
    """q0 + (q1 - q0) p_j(t) on [breaks_j, breaks_{j+1}), at rest outside. The derivatives are derivatives of the polynomials p_j."""

    def __init__(self, q0: ArrayLike, q1: ArrayLike, breaks: tuple[float, ...], pieces: list[Polynomial]) -> None:
        self.q0: Array = np.array(q0, dtype=np.float64)
        self.q1: Array = np.array(q1, dtype=np.float64)
        if not breaks[-1] > breaks[0]:
            raise ValueError(f"duration is not positive: got {breaks[-1]}")
        self.breaks = breaks
        self.pieces = [[piece.deriv(k) for k in range(SNAP + 1)] for piece in pieces]

    def __call__(self, t: float) -> Sample:
        q, v, a = self.derivatives(t, 2)
        return q, v, a

    def derivatives(self, t: float, order: int) -> Array:
        rows = np.zeros((order + 1, self.q0.size))
        if not self.breaks[0] <= t < self.breaks[-1]:
            rows[0] = self.q0 if t < self.breaks[0] else self.q1
            return rows
        index = int(np.searchsorted(self.breaks, t, side="right")) - 1
        for k, piece in enumerate(self.pieces[index][: order + 1]):
            rows[k] = (self.q1 - self.q0) * piece(t)
        rows[0] += self.q0
        return rows


class Quintic(_Piecewise):
    """Rest-to-rest motion from q0 to q1 in `duration`, with zero acceleration at the ends."""

    def __init__(self, q0: ArrayLike, q1: ArrayLike, duration: float) -> None:
        powers = np.arange(6)
        rows = []
        for x in (0.0, 1.0):
            rows += [x**powers, powers * x ** np.maximum(powers - 1, 0), powers * (powers - 1) * x ** np.maximum(powers - 2, 0)]
        # The exact solution of the Hermite conditions has integer coefficients, so rounding restores it.
        shape = Polynomial(np.round(np.linalg.solve(np.array(rows), [0.0, 0.0, 0.0, 1.0, 0.0, 0.0])))
        super().__init__(q0, q1, (0.0, float(duration)), [shape(Polynomial([0.0, 1.0 / duration]))])


class BangBang(_Piecewise):
    """Rest-to-rest motion from q0 to q1 in `duration` with acceleration +A, then -A."""

    def __init__(self, q0: ArrayLike, q1: ArrayLike, duration: float) -> None:
        T = float(duration)
        rise = Polynomial([4.0 / T**2]).integ(2)
        fall = 1.0 - rise(Polynomial([T, -1.0]))
        super().__init__(q0, q1, (0.0, T / 2, T), [rise, fall])

    def derivatives(self, t: float, order: int) -> Array:
        if order > 2:
            raise ValueError(f"the acceleration jumps: expected an order of at most 2, got {order}")
        return super().derivatives(t, order)


class Table:
    """A motion through q, v, a (K, n) at the knots start + k dt. It is at rest before the first knot and after the last one."""

    breaks: tuple[float, ...] = ()

    def __init__(self, dt: float, q: ArrayLike, v: ArrayLike, a: ArrayLike, *, start: float = 0.0) -> None:
        self.start, self.dt = start, float(dt)
        self.q, self.v, self.a = (np.asarray(x, dtype=np.float64) for x in (q, v, a))

    def __call__(self, t: float) -> Sample:
        q, v, a = self.derivatives(t, 2)
        return q, v, a

    def derivatives(self, t: float, order: int) -> Array:
        """At a knot, derivatives of order 3 and 4 are those after it; at the last knot, those before it."""
        u, last = (t - self.start) / self.dt, len(self.q) - 1
        knot = int(np.clip(np.round(u), 0, last))
        on_knot = abs(u - knot) < 1e-9
        rows = np.zeros((order + 1, self.q.shape[1]))
        if not (on_knot or 0.0 < u < last) or last == 0:
            rows[0] = self.q[0 if u < 0.0 else last]
        else:
            k = min(knot, last - 1) if on_knot else int(u)
            rows = self._between(k, u - k, order)
        if on_knot:
            rows[:3] = np.array([self.q[knot], self.v[knot], self.a[knot]])[: order + 1]
        return rows

    def _between(self, k: int, x: float, order: int) -> Array:
        points, h = [], self.dt
        for row, step in ((k, h), (k + 1, -h)):
            second = self.q[row] + 2 * step * self.v[row] / 5 + step**2 * self.a[row] / 20
            points.append([self.q[row], self.q[row] + step * self.v[row] / 5, second])
        hull = np.array([*points[0], *points[1][::-1]])
        # The control points of a derivative are differences of the control points.
        hulls = [hull] + [factorial(5) / factorial(5 - d) * np.diff(hull, d, axis=0) / h**d for d in range(1, order + 1)]
        return np.array([_casteljau(points, x) for points in hulls])


def _casteljau(points: Array, x: float) -> Array:
    """The value at x in [0, 1] of the Bezier curve with these control points."""
    while len(points) > 1:
        points = (1.0 - x) * points[:-1] + x * points[1:]
    return np.asarray(points[0])
