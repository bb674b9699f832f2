"""Rest-to-rest motions of joints that arrive together, under limits of speed, acceleration and jerk.

    |v_j| <= v_max_j,   |a_j| <= a_max_j,   |da_j/dt| <= j_max_j,   q_j(t) a cubic in each of at most seven phases

Ruckig (Berscheid and Kroger 2021, MIT licence) computes the time-optimal phases. It is an optional extra, imported when the function is
called. The problem is first scaled to distances and durations of order one. The result is checked. If it exceeds a limit by a rounding
error, the motion is slowed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._core import TimedPath, _restore_time_path
from .arguments import finite
from .border import border
from .errors import InputError, SolveError
from .extras import extra
from .status import Status

__all__ = ["point_to_point"]

_NAME = "point_to_point"
_Array = NDArray[np.float64]
# Number of coefficients per piece and joint of a path, lowest power first.
_TERMS = 6
# Largest limits of speed, acceleration and jerk, in scaled units, that are passed to Ruckig. With larger limits, phases can be shorter than
# rounding errors, and Ruckig may find no motion. If Ruckig finds none with the first row, it is called with the second row, and so on. The
# limits of the three rows lengthen the motion by at most 2e-6, 2e-4 and 7e-3 scaled units of time.
_CAPS = (1e6, 1e9, 1e12), (1e4, 1e6, 1e8), (1e3, 1e4, 1e5)


def _vector(name: str, value: ArrayLike, n: int | None, positive: bool) -> _Array:
    """Check numbers and return them as `(n,)`. If `positive`, one number for all joints is also valid.

    `n` is None for the first argument, whose length is the number of joints.
    """
    shapes: tuple[tuple[int | str, ...], ...] = (("n",),) if n is None else ((n,),) if not positive else ((), (n,))
    array = finite(_NAME, name, _core.numbers(_NAME, name, value, *shapes))
    if n is None and not array.size:
        raise InputError(f"{_NAME}: {name} has the wrong shape: expected at least one joint, got {array.shape}")
    if positive and not (array > 0.0).all():
        k = int(np.argmax(np.atleast_1d(array) <= 0.0))
        raise InputError(f"{_NAME}: {name} is not positive: expected numbers > 0, got {array.flat[k]} (first bad index {k})")
    return np.full(n, float(array)) if n is not None and array.ndim == 0 else array.copy()


@border
def point_to_point(q0: ArrayLike, q1: ArrayLike, v_max: ArrayLike, a_max: ArrayLike, j_max: ArrayLike) -> TimedPath:
    """Compute the fastest motion from rest at `q0` to rest at `q1` in which all joints arrive together, each within its limits.

    It requires Ruckig (extra `ruckig`). The motion ignores the dynamics; `time_path` respects limits of torque.

    Args:
        q0, q1: start and end, `(n,)`, rad or m.
        v_max, a_max, j_max: limits of speed, acceleration and jerk: number or `(n,)`, rad or m per s, s^2 and s^3.

    Returns:
        A `TimedPath` whose path position `s` is the time. Its `margin` is the smallest relative distance to a limit.

    Raises:
        ImportError: Ruckig is not installed.
        InputError: a shape is wrong, a number is not finite, a limit is not positive.
        SolveError: Ruckig finds no motion, or its motion exceeds a limit.

    Source: Berscheid and Kroger, Jerk-limited real-time trajectory generation with arbitrary target states, RSS 2021.

    >>> import armlet as al
    >>> p = al.point_to_point([0.0, 0.0], [1.0, 0.5], v_max=1.0, a_max=4.0, j_max=40.0)
    >>> round(p.duration, 6)
    1.35
    >>> q, v, a = p(0.5 * p.duration)
    >>> [round(float(x), 6) for x in (*q, *v)]
    [0.5, 0.25, 1.0, 0.438447]
    """
    start = _vector("q0", q0, None, False)
    n = start.size
    end = _vector("q1", q1, n, False)
    limits = np.stack([_vector(name, value, n, True) for name, value in (("v_max", v_max), ("a_max", a_max), ("j_max", j_max))])
    ruckig = extra(_NAME, "ruckig", "ruckig")
    displacement = end - start
    length = float(np.abs(displacement).max())
    if not np.isfinite(length):
        raise InputError(f"{_NAME}: q1 is too far from q0: expected a finite distance, got {length}")
    if length == 0.0:
        coefficients = np.zeros((1, _TERMS, n))
        coefficients[0, 0] = start
        return _motion(np.array([0.0, 1.0]), coefficients, end, np.inf, 1.0)
    # Scaled problem: every moving joint has the distance one. The time unit is the largest time that a single limit requires.
    powers = np.array([[1.0], [2.0], [3.0]])
    lengths = np.where(displacement == 0.0, 1.0, np.abs(displacement))
    unit = float(((np.abs(displacement) / limits) ** (1.0 / powers)).max())
    limits = limits / lengths * unit**powers
    t, coefficients = _phases(ruckig, np.sign(displacement), limits)
    # A motion that is slower by the factor k has its derivatives divided by k, k^2, k^3.
    used = _largest(t, coefficients) / limits
    k = max(1.0, float((used ** (1.0 / powers)).max()))
    # Ruckig guarantees an accuracy of about 1e-8.
    if not k < 1.0 + 1e-6:
        raise SolveError(f"{_NAME}: the motion found is beyond its limits by {k - 1.0:.1e} of them", Status.INFEASIBLE, 0.0)
    coefficients *= lengths
    coefficients[:, 0] += start
    return _motion(t * unit * k, coefficients, end, 1.0, 1.0 - float((used / k**powers).max()))


def _phases(ruckig: Any, displacement: _Array, limits: _Array) -> tuple[_Array, _Array]:
    """Return times `(P + 1,)` and coefficients `(P, 6, n)` of polynomials in `(t - t_p) / (t_(p+1) - t_p)`."""
    n = displacement.size
    given = ruckig.InputParameter(n)
    given.current_position, given.target_position = [0.0] * n, displacement.tolist()
    answer = ruckig.Trajectory(n)
    reason = ""
    for cap in _CAPS:
        given.max_velocity, given.max_acceleration, given.max_jerk = np.minimum(limits, np.array(cap)[:, None]).tolist()
        try:
            result = ruckig.Ruckig(n).calculate(given, answer)
        except ruckig.RuckigError as error:
            reason = str(error).strip().splitlines()[0]
            continue
        if result not in (ruckig.Result.Working, ruckig.Result.Finished):
            reason = str(result)
            continue
        t, coefficients = _pieces(answer)
        reached = coefficients[-1].sum(axis=0)
        # Ruckig guarantees an accuracy of about 1e-8. The error is larger if `_pieces` drops a phase that changes the motion.
        if (np.abs(reached - displacement) < 1e-6).all():
            # Scaling makes the end exact to rounding.
            moving = displacement != 0.0
            coefficients[:, :, moving] *= displacement[moving] / reached[moving]
            return t, coefficients
        reason = "a phase is shorter than rounding errors"
    raise SolveError(f"{_NAME}: ruckig finds no motion: {reason}", Status.INFEASIBLE, 0.0)


def _pieces(answer: Any) -> tuple[_Array, _Array]:
    """Return the times and coefficients of Ruckig's phases, as `_phases` does. Phases shorter than rounding errors are dropped."""
    (profiles,) = answer.profiles
    ends = [np.minimum(np.cumsum(profile.t), answer.duration) for profile in profiles]
    t = np.unique(np.concatenate([[0.0, answer.duration], *ends]))
    t = t[np.concatenate([[True], np.diff(t) > 1e-12 * answer.duration])]
    t[-1] = answer.duration
    h = np.diff(t)
    coefficients = np.zeros((h.size, _TERMS, len(profiles)))
    for j, (profile, until) in enumerate(zip(profiles, ends, strict=True)):
        # The phases are integrated one after the other from the start. So q, v and a are continuous to rounding.
        jerk = np.append(np.array(profile.j), 0.0)[np.searchsorted(until, t[:-1] + 0.5 * h, side="right")]
        q = v = a = 0.0
        for p in range(h.size):
            coefficients[p, :4, j] = q, h[p] * v, h[p] ** 2 * a / 2, h[p] ** 3 * jerk[p] / 6
            q += h[p] * (v + h[p] * (a / 2 + h[p] * jerk[p] / 6))
            v += h[p] * (a + h[p] * jerk[p] / 2)
            a += h[p] * jerk[p]
    return t, coefficients


def _largest(t: _Array, coefficients: _Array) -> _Array:
    """Largest magnitudes of speed, acceleration and jerk of every joint, `(3, n)`, in scaled units."""
    h = np.diff(t)[:, None]
    _, v, a, j = (coefficients[:, k] * scale / h**k for k, scale in ((0, 1), (1, 1), (2, 2), (3, 6)))
    # The largest speed of a phase is at its start, at its end, or where the acceleration is zero.
    with np.errstate(divide="ignore", invalid="ignore"):
        at = np.where(j == 0.0, 0.0, np.clip(-a / np.where(j == 0.0, 1.0, j), 0.0, h))
    speeds = [v + x * (a + x * j / 2) for x in (np.zeros_like(at), at, np.broadcast_to(h, at.shape))]
    largest = [np.abs(values).max(axis=(0, 1)) for values in (np.stack(speeds), np.stack([a, a + h * j]), j[None])]
    return np.stack(largest)


def _motion(t: _Array, coefficients: _Array, end: _Array, speed: float, margin: float) -> TimedPath:
    """Make the motion as a `TimedPath` whose path position is the time."""
    n = end.size
    parts = [t, coefficients.reshape(-1), end, t, np.full(t.size, speed), np.zeros(t.size - 1), np.zeros(0), np.zeros(0)]
    assert coefficients.shape == (t.size - 1, _TERMS, n)
    return _restore_time_path(parts, margin, None)
