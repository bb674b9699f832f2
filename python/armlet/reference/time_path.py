"""The fastest timing of a path, as a convex optimisation problem that an interior-point method solves.

    b_k = (ds/dt)^2 at s_k;   on a segment of length h:  u = (b_(k+1) - b_k)/(2 h),  m = (b_k + b_(k+1))/2
    minimise  T = sum 2 h / (b_k^1/2 + b_(k+1)^1/2)
    subject to, in the middle of each segment,   tau = A u + B m + g + d q' m^1/2 + c sign(q') within tau_max
                                                 a = q' u + q'' m within a_max,      and at each s_k  |q'| b_k^1/2 <= v_max
    of a frame's origin  |p' u + p'' m| <= tip_acceleration in the middle of each segment,  |p'| b_k^1/2 <= tip_speed at each s_k
    A = M q',  B = M q'' + C(q, q') q'
    by Newton's method on  T/mu - sum log(distance to each limit),  with a decreasing mu       (Verscheure et al. 2009)

' is the derivative with respect to s, p the position of the frame's origin, d and c are viscous and Coulomb friction. M, C and g are mass
matrix, Coriolis matrix and gravity torque. The core passes over the grid forwards and backwards. Stops divide the path into parts with
separate timings. The search starts with the arm nearly at rest. So it finds no timing for a path on which the arm cannot rest, even if a
faster motion is feasible.
"""

import itertools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array, Mechanism
from .path_limits import leaves_range, one_sided, tip_slopes, two_sided
from .timing import cubic_spline, positions

Path = Callable[[Array], tuple[Array, Array, Array]]


class Timing(NamedTuple):
    """A timing: its duration, s, path positions, and path speeds ds/dt at them. Without a timing they are NaN and empty."""

    duration: float
    s: Array
    s_dot: Array


class Rows(NamedTuple):
    """The limits of one part of the path, for the path acceleration u and the squared path speed.

    `low <= A u + B m + g + d m^1/2 <= high`, (segments, rows) each, with m in the middles of segments, and `b <= top` with b at the nodes.
    """

    A: Array
    B: Array
    g: Array
    d: Array
    low: Array
    high: Array
    top: Array
    h: Array
    tip: Array
    """dp/ds and d2p/ds2 divided by the acceleration limit of the frame, (2, segments, 3); zero without this limit."""


def path_of(path: Any, knots: ArrayLike | None, spline: str | None, samples: int) -> tuple[Path, Array]:
    """The function of s that returns q, dq/ds, d2q/ds2, and the path positions between which it is smooth."""
    if callable(path):
        ends = np.array([0.0, 1.0])
        if isinstance(path(0.0), tuple):
            return lambda s: tuple(np.array([np.asarray(path(float(x))[k]) for x in s]) for k in range(3)), ends  # type: ignore[return-value]
        places = np.linspace(0.0, 1.0, samples)
        return cubic_spline(places, np.array([path(float(x)) for x in places]), spline or "not-a-knot"), ends
    s = positions(path) if knots is None else np.asarray(knots, dtype=np.float64)
    return cubic_spline(s, path, spline or "natural"), s


def time_path(
    arm: Mechanism,
    path: Any,
    *,
    tau_max: ArrayLike | None = None,
    v_max: ArrayLike | None = None,
    a_max: ArrayLike | None = None,
    knots: ArrayLike | None = None,
    spline: str | None = None,
    stops: Sequence[int] = (),
    start_speed: float = 0.0,
    end_speed: float = 0.0,
    friction: bool | ArrayLike = False,
    grid: int = 301,
    samples: int = 201,
    q_min: ArrayLike | None = None,
    q_max: ArrayLike | None = None,
    tip_speed: ArrayLike | Callable[[float], float] | None = None,
    tip_acceleration: ArrayLike | Callable[[float], float] | None = None,
    frame: str | None = None,
) -> Timing:
    """The fastest timing of a path. The arguments have the meaning of those of `armlet.time_path`.

    The path is waypoints (K, n), which a cubic spline joins, or a callable on [0, 1] that returns q(s), or
    q, dq/ds, d2q/ds2. Limits that allow no timing give NaN.
    """
    at, smooth = path_of(path, knots, spline, samples)
    if leaves_range(lambda s: at(s)[0], smooth, q_min, q_max):
        return Timing(np.nan, np.zeros(0), np.zeros(0))
    origin = (lambda s: arm.position(at(s)[0], frame)) if frame is not None else None  # type: ignore[attr-defined]
    damping, coulomb = (arm.damping, arm.friction) if friction is True else (np.zeros(arm.n) if friction is False else friction, 0.0)
    parts = []
    cuts = [0, *sorted(stops), smooth.size - 1]
    for first, last in itertools.pairwise(cuts):
        inside = smooth[first : last + 1]
        counts = np.maximum(8, np.ceil(grid * np.diff(inside) / (smooth[-1] - smooth[0]))).astype(int)
        s = np.concatenate([[inside[0]], *(np.linspace(a, b, k + 1)[1:] for a, b, k in zip(inside[:-1], inside[1:], counts, strict=True))])
        ends = (start_speed if first == 0 else 0.0, end_speed if last == smooth.size - 1 else 0.0)
        limits = tuple(two_sided(limit, arm.n, 0.5 * (s[:-1] + s[1:]), smooth) for limit in (tau_max, a_max))
        rows = _rows(arm, at, s, limits, two_sided(v_max, arm.n, s, smooth)[1], np.asarray(damping), np.asarray(coulomb))
        if origin is not None:
            tips = [None if limit is None else one_sided(limit, x, smooth) for limit, x in ((tip_speed, s), (tip_acceleration, middles(s)))]
            rows = _with_tip(rows, origin, s, inside, tips)
        b = _fastest(rows, ends)
        if b is None:
            return Timing(np.nan, np.zeros(0), np.zeros(0))
        parts.append((s, np.sqrt(b)))
    duration = sum(float((2.0 * np.diff(s) / (r[:-1] + r[1:])).sum()) for s, r in parts)
    return Timing(duration, np.concatenate([s for s, _ in parts]), np.concatenate([r for _, r in parts]))


def middles(s: Array) -> Array:
    """The middles of the segments between the path positions s."""
    return np.asarray(0.5 * (s[:-1] + s[1:]))


def _with_tip(rows: Rows, origin: Callable[[Array], Array], s: Array, inside: Array, limits: list[Array | None]) -> Rows:
    """Add the limits of a frame's origin to the rows: of its speed at s, and of its acceleration in the middles of the segments."""
    speed, most = limits

    def slopes(x: Array) -> Array:
        # The differences are computed piece by piece, because the third derivative of the path jumps between pieces.
        found = np.zeros((2, x.size, 3))
        for a, b in itertools.pairwise(inside):
            here = (x >= a) & (x <= b)
            found[:, here] = tip_slopes(origin, x[here], (float(a), float(b)))
        return found

    top, tip = rows.top, rows.tip
    if speed is not None:
        with np.errstate(divide="ignore"):
            top = np.minimum(top, np.square(speed / np.linalg.norm(slopes(s)[0], axis=1)))
    if most is not None:
        tip = slopes(middles(s)) / most[:, None]
    return rows._replace(top=top, tip=tip)


def _rows(arm: Mechanism, at: Path, s: Array, limits: Any, v_max: Array, damping: Array, coulomb: Array) -> Rows:
    h = np.diff(s)
    q, dq, ddq = at(0.5 * (s[:-1] + s[1:]))
    mass = arm.mass_matrix(q)
    turning = np.einsum("kij,kj->ki", mass, ddq) + np.einsum("kij,kj->ki", arm.coriolis_matrix(q, dq), dq)
    low, high = (np.concatenate(pair, axis=1) for pair in zip(*limits, strict=True))
    used = (np.isfinite(low) | np.isfinite(high)).any(axis=0)
    A = np.concatenate([np.einsum("kij,kj->ki", mass, dq), dq], axis=1)
    g = np.concatenate([arm.gravity(q) + coulomb * np.sign(dq), np.zeros_like(dq)], axis=1)
    B, d = np.concatenate([turning, ddq], axis=1), np.concatenate([damping * dq, np.zeros_like(dq)], axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        slow = np.square(v_max / np.abs(at(s)[1])).min(axis=1)
    tip = np.zeros((2, h.size, 3))
    return Rows(A[:, used], B[:, used], g[:, used], d[:, used], low[:, used], high[:, used], slow, h, tip)


def _fastest(rows: Rows, ends: tuple[float, float]) -> Array | None:
    """The optimal b at the nodes; None if a nearly resting arm exceeds a limit."""
    nodes = rows.h.size + 1
    line = np.linspace(ends[0] ** 2, ends[1] ** 2, nodes)
    b: Array = line
    # The speed of the initial guess decreases until the guess satisfies every limit.
    for scale in 10.0 ** -np.arange(0.0, 14.0):
        b = line + scale * np.minimum(1.0, np.where(np.isfinite(rows.top), rows.top, 1.0)).min() * np.sin(np.linspace(0, np.pi, nodes)) ** 2
        b[0], b[-1] = line[0], line[-1]
        if _barrier(rows, b, 1.0) < np.inf:
            break
    else:
        return None
    mu = 10.0
    while mu > 1e-9:
        mu *= 0.2
        for _ in range(60):
            step, gain = _newton(rows, b, mu)
            size, before = 1.0, _barrier(rows, b, mu)
            while size > 1e-10 and not _barrier(rows, b + size * step, mu) < before:
                size *= 0.5
            b = b + (size if size > 1e-10 else 0.0) * step
            if gain < 1e-8 or size <= 1e-10:
                break
    return b


def _distances(rows: Rows, b: Array) -> tuple[Array, Array, Array]:
    """The distances to the lower and upper limits, (segments, rows) each, and the distance of b to its upper limit at each node."""
    u, m = np.diff(b) / (2.0 * rows.h), 0.5 * (b[:-1] + b[1:])
    value = rows.A * u[:, None] + rows.B * m[:, None] + rows.g + rows.d * np.sqrt(np.maximum(m, 0.0))[:, None]
    return value - rows.low, rows.high - value, rows.top - b


def _tip(rows: Rows, b: Array) -> tuple[Array, Array]:
    """The acceleration of the frame's origin as a fraction f of its limit, (segments, 3), and 1 - |f|^2."""
    u, m = np.diff(b) / (2.0 * rows.h), 0.5 * (b[:-1] + b[1:])
    w = rows.tip[0] * u[:, None] + rows.tip[1] * m[:, None]
    return w, 1.0 - np.square(w).sum(axis=1)


def _barrier(rows: Rows, b: Array, mu: float) -> float:
    inner = b[1:-1]
    found = [inner, *_distances(rows, b)[:2], _distances(rows, b)[2][1:-1], _tip(rows, b)[1]]
    if min(float(part.min(initial=np.inf)) for part in found) <= 0.0:
        return float("inf")
    r = np.sqrt(b)
    logs = sum(float(np.log(part[np.isfinite(part)]).sum()) for part in found)
    return float((2.0 * rows.h / (r[:-1] + r[1:])).sum()) / mu - logs


def _newton(rows: Rows, b: Array, mu: float) -> tuple[Array, float]:
    """The Newton step of b, which is zero at the ends, and minus its product with the gradient.

    The second derivative of friction is neglected.
    """
    h, r = rows.h, np.sqrt(b)
    total = r[:-1] + r[1:]
    m = 0.5 * (b[:-1] + b[1:])
    gradient, H = np.zeros(b.size), np.zeros((b.size, b.size))
    k = np.arange(h.size)
    with np.errstate(divide="ignore", invalid="ignore"):
        for near, p in ((k, r[:-1]), (k + 1, r[1:])):
            np.add.at(gradient, near, -h / (total**2 * p) / mu)
            np.add.at(H, (near, near), (h / (2.0 * total**2 * p**3) + h / (total**3 * p**2)) / mu)
        across = h / (total**3 * r[:-1] * r[1:]) / mu
        # Each limit depends on b at the two nodes of its segment.
        slope = 0.5 * rows.B + 0.25 * rows.d / np.sqrt(m)[:, None]
        pair = slope - rows.A / (2.0 * h)[:, None], slope + rows.A / (2.0 * h)[:, None]
        below, above, top = _distances(rows, b)
        first, second = 1.0 / above - 1.0 / below, 1.0 / above**2 + 1.0 / below**2
    w, left = _tip(rows, b)
    moves = [rows.tip[1] / 2 + side * rows.tip[0] / (2.0 * h)[:, None] for side in (-1.0, 1.0)]
    slopes = [2.0 * (w * move).sum(axis=1) / left for move in moves]
    ball = [[slopes[i] * slopes[j] + 2.0 * (moves[i] * moves[j]).sum(axis=1) / left for j in range(2)] for i in range(2)]
    for i, near in enumerate((k, k + 1)):
        np.add.at(gradient, near, slopes[i])
        np.add.at(H, (near, near), ball[i][i])
    for x, near in zip(pair, (k, k + 1), strict=True):
        np.add.at(gradient, near, (first * x).sum(axis=1))
        np.add.at(H, (near, near), (second * x * x).sum(axis=1))
    across = across + (second * pair[0] * pair[1]).sum(axis=1) + ball[0][1]
    H[k, k + 1] += across
    H[k + 1, k] += across
    inner = slice(1, -1)
    gradient[inner] += 1.0 / top[inner] - 1.0 / b[inner]
    H[np.arange(b.size), np.arange(b.size)] += np.concatenate([[0.0], 1.0 / top[inner] ** 2 + 1.0 / b[inner] ** 2, [0.0]])
    step = np.zeros_like(b)
    step[inner] = np.linalg.solve(H[inner, inner], -gradient[inner])
    return step, float(-gradient[inner] @ step[inner])
