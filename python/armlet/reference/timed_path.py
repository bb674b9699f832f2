"""A path with a timing, q(s(t)), on a grid of path positions s_i, path speeds r_i and times t_i.

    s'' = u + b x,  x = s - s_i,  u = (r_1^2 - r_0^2) / (2 h) - b h / 2,  h = s_1 - s_0        (path acceleration linear in s)
    x(t) = sum x_k t^k,   x_0 = 0,  x_1 = r_0,  x_2 = u / 2,  x_(k+2) = b x_k / ((k+1)(k+2))
        b by bisection from the mean speed:   2 h / ((r_0 + r_1)(t_1 - t_0)) = tanh(y)/y,   y = b^1/2 (t_1 - t_0)/2  (b < 0: tan)
    or x(t) the cubic with these positions and speeds at both ends                           (path acceleration linear in time)
    q, q_s, q_ss of the path at s:   v = q_s s',  a = q_s s'' + q_ss s'^2
    jerk and snap from powers of the Taylor polynomial  y = s(t + d) - s(t):   q(s(t + d)) = q + q_s y + q_ss y^2/2 + q_sss y^3/6

' is the time derivative, and q_s, q_ss are derivatives with respect to s. 0 and 1 are the ends of an interval of s. The motion is at rest
at the start before time 0, and at rest at the end after the last time.
"""

from collections.abc import Callable
from math import factorial

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from .lagrange import Array
from .motion import Sample

Path = Callable[[Array], tuple[Array, Array, Array]]
STEP = 1e-6  # of s, for the slope of q_ss
TERMS = 40  # number of terms of the series: (b t^2)^20 / 40! is below the rounding error of the sum for b t^2 < 50


def _series(rate: float, u: float, b: float) -> Polynomial:
    x = [0.0, rate, u / 2.0]
    for k in range(1, TERMS):
        x.append(b * x[k] / ((k + 1) * (k + 2)))
    return Polynomial(x)


def _slowness(z: float) -> float:
    """tanh(y) / y with y^2 = z, or tan(y) / y with y^2 = -z for negative z. It decreases from infinity at z = -(pi/2)^2 to zero."""
    y = np.sqrt(abs(z))
    return 1.0 - z / 3.0 if y < 1e-5 else float((np.tanh(y) if z > 0.0 else np.tan(y)) / y)


def _linear_in_position(rates: tuple[float, float], h: float, T: float) -> Polynomial:
    """The polynomial x(t) on an interval of the length h and the duration T, s, with the path speeds `rates` at its ends."""
    share = 2.0 * h / ((rates[0] + rates[1]) * T)
    low, high = -((np.pi / 2.0) ** 2), 4.0 / share**2 + 1.0
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if _slowness(middle) > share else (low, middle)
    b = 4.0 * low / T**2
    return _series(rates[0], (rates[1] ** 2 - rates[0] ** 2) / (2.0 * h) - b * h / 2.0, b)


def _linear_in_time(rates: tuple[float, float], h: float, T: float) -> Polynomial:
    ends = np.array([[T**2, T**3], [2 * T, 3 * T**2]])
    return Polynomial([0.0, rates[0], *np.linalg.solve(ends, [h - rates[0] * T, rates[1] - rates[0]])])


class TimedPath:
    """The motion along a path with a timing. The path is a function of s (K,) that returns q, q_s, q_ss, (K, n) each.

    If `cubic`, the path acceleration is linear in time, otherwise it is linear in s.
    """

    def __init__(self, path: Path, s: ArrayLike, s_dot: ArrayLike, t: ArrayLike, *, cubic: bool = False) -> None:
        self.path = path
        self.s, self.s_dot, self.t = (np.asarray(x, dtype=np.float64) for x in (s, s_dot, t))
        self.cubic = cubic
        self.breaks: tuple[float, ...] = tuple(float(x) for x in self.t)

    def _at(self, s: float, rate: float, u: float) -> Sample:
        q, slope, curvature = (rows[0] for rows in self.path(np.array([s])))
        return q, slope * rate, slope * u + curvature * rate**2

    def __call__(self, t: float) -> Sample:
        if not 0.0 <= t <= self.t[-1]:
            return self._at(float(self.s[0 if t < 0.0 else -1]), 0.0, 0.0)
        start, x, d = self._segment(t)
        at_rest = t == self.t[-1] and (self.cubic or self.s_dot[-1] == 0.0)  # from the last time on, the motion is at rest
        return self._at(start + float(x(d)), float(x.deriv()(d)), 0.0 if at_rest else float(x.deriv(2)(d)))

    def _segment(self, t: float) -> tuple[float, Polynomial, float]:
        """The start s_i of the segment at time t, the polynomial x, and the time since the start of the segment."""
        i = min(int(np.searchsorted(self.t, t, side="right")), self.t.size - 1) - 1
        h, T = float(self.s[i + 1] - self.s[i]), float(self.t[i + 1] - self.t[i])
        linear = _linear_in_time if self.cubic else _linear_in_position
        return float(self.s[i]), linear((float(self.s_dot[i]), float(self.s_dot[i + 1])), h, T), float(t - self.t[i])

    def derivatives(self, t: float, order: int) -> Array:
        """The position and its derivatives up to `order`, (order + 1, n), for a path of cubic polynomials in s, before the last time."""
        if not 0.0 <= t < self.t[-1]:
            return np.array([self(t)[0], *np.zeros((order, self(t)[0].size))])
        start, x, d = self._segment(t)
        y = Polynomial(x(Polynomial([d, 1.0])).coef[: order + 1])
        s = start + float(y.coef[0])
        y.coef[0] = 0.0
        q, slope, curvature = (rows[0] for rows in self.path(np.array([s])))
        # q_ss is linear in s up to the next knot.
        third = (self.path(np.array([s + STEP]))[2][0] - curvature) / STEP
        rows: Array = np.zeros((order + 1, q.size))
        for k, coefficient in enumerate((q, slope, curvature / 2.0, third / 6.0)):
            power = (y**k).coef[: order + 1]
            rows[: power.size] += power[:, None] * coefficient
        rows *= np.array([factorial(k) for k in range(order + 1)])[:, None]
        return rows
