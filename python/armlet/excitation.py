"""Periodic motions that determine the parameters of an arm well: finite Fourier series within limits (Swevers et al. 1997).

    q(t) = o + sum_l (A_l sin(l w t) + B_l cos(l w t)),   w = 2 pi / duration,   l = 1 .. harmonics
    F = sum_k Y_b(t_k)' diag(noise)^-2 Y_b(t_k);   the search maximises log det F (D-optimality)

Here `Y_b(t)` is the regressor of the base parameters at `q(t), v(t), a(t)`, `noise` the standard deviation of the torques, and `'` the
transpose. Each joint's series is divided by a smooth maximum of position, speed and acceleration, each relative to its limit. So for all
coefficients the samples respect these limits. Torque limits enter the cost as a penalty. For arms without mimic joints, the gradient is
exact: `Y_b` is linear in `a`, and quadratic in `v` (except Coulomb friction) and in the position of a prismatic joint. As a function of the
angle of a revolute joint, `Y_b` is a trigonometric polynomial of degree two. Its derivative follows from four values (Riesz 1914).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._core import Arm, Sinusoid
from .arguments import instance, integer, number, positive
from .border import border
from .errors import InputError
from .extras import extra

__all__ = ["ExcitingMotion", "exciting_motion"]

_NAME = "exciting_motion"
_Array = NDArray[np.float64]
# Exponents of the smooth maximum. The search runs once for each exponent, starting from the previous result.
_POWERS = 16, 64, 256
# Weight of the penalty on torques, relative to log det F, and the fraction of a torque limit above which the penalty is positive.
_PENALTY, _SHARE = 1e3, 0.97
# Pairs (weight, step): sum(weight f(x + step)) is the derivative f'(x). The first rule is exact for parabolas, the second one for
# trigonometric polynomials of degree two (Riesz 1914).
_SLIDE = (0.5, 1.0), (-0.5, -1.0)
_TURN = tuple(((-1) ** i / (8.0 * np.sin(x / 2.0) ** 2), x) for i, x in enumerate(np.pi / 4.0 * np.array([1, 3, 5, 7])))
# Number of points per period and harmonic at which the limits of the result are checked.
_CHECKED = 64
# Valid periods are between `_LEAST` and its inverse, s. Valid finite limits are at most `_MOST`.
_LEAST, _MOST = 1e-6, 1e9


class ExcitingMotion(Sinusoid):
    """A `Sinusoid` with period `duration` that determines the base parameters of an arm, made by `exciting_motion`.

    Attributes:
        duration: the period, s.
        condition: condition number of the regressor of one period, with rows divided by `noise` and columns scaled to norm one.
        deviations: standard deviations of the base parameters after one period of samples, `(b,)`.
    """

    duration: float
    condition: float
    deviations: _Array

    def __new__(
        cls,
        offset: ArrayLike,
        amplitude: ArrayLike,
        frequency: ArrayLike,
        phase: ArrayLike,
        duration: float,
        condition: float,
        deviations: ArrayLike,
    ) -> ExcitingMotion:
        self = super().__new__(cls, offset, amplitude, frequency, phase)
        name = "ExcitingMotion"
        self.duration, self.condition = positive(name, "duration", duration), number(name, "condition", condition)
        self.deviations = _core.numbers(name, "deviations", deviations, ("b",)).copy()
        return self

    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]:
        nothing, keywords = super().__getnewargs_ex__()
        return nothing, keywords | {"duration": self.duration, "condition": self.condition, "deviations": self.deviations}

    def __repr__(self) -> str:
        return f"<ExcitingMotion: {self.n} joints, period {self.duration:g} s, condition {self.condition:.3g}>"


class _Limits(NamedTuple):
    """Limits of each joint, `(n,)`: middle and half width of its range, speed, acceleration and torque."""

    middle: _Array
    half: _Array
    speed: _Array
    acceleration: _Array
    torque: _Array


def _refuse(name: str, values: _Array, bad: NDArray[np.bool_], problem: str) -> None:
    """Raise an InputError that names the first bad number of a limit."""
    if bad.any():
        k = int(np.argmax(bad))
        raise InputError(f"{_NAME}: limits[{name!r}] {problem}, got {values.flat[k]} (first bad index {k})")


def _limits(arm: Arm, given: Any) -> _Limits:
    """Combine the limits of the argument `given` with the arm's limits, which apply to names that the argument omits."""
    n = arm.n
    own = {name: np.asarray(values) for name, values in arm.limits.items()}
    default = {"q_min": -np.inf, "q_max": np.inf, "v_max": np.inf, "a_max": np.inf, "effort": np.inf}
    found = {name: np.array(own.get(name, np.full(n, value))) for name, value in default.items()}
    if given is not None and not isinstance(given, Mapping):
        raise InputError(f"{_NAME}: limits is of the wrong type: expected a dict of {', '.join(default)}, got {type(given).__name__}")
    for name, value in (given or {}).items():
        if name not in default:
            raise InputError(f"{_NAME}: limits has an unknown name: expected one of {', '.join(default)}, got {name!r}")
        array = _core.numbers(_NAME, f"limits[{name!r}]", value, (), (n,))
        kind = "a number" if name.startswith("q_") else "a number > 0"
        _refuse(name, array, np.isnan(array) | (kind == "a number > 0") & (array <= 0.0), f"is not {kind}: expected {kind}")
        _refuse(name, array, np.isfinite(array) & (np.abs(array) > _MOST), f"is too large: expected at most {_MOST:g}")
        found[name] = np.broadcast_to(array, (n,)).copy()
    for name, what in (("v_max", "velocity"), ("effort", "effort")):
        if not (found[name] > 0.0).all():
            bad = int(np.argmin(found[name] > 0.0))
            problem = f"allows no motion of joint {arm.joint_names[bad]}, whose {what} limit in its file is {found[name][bad]:g}"
            raise InputError(f"{_NAME}: limits[{name!r}] {problem}: expected a number > 0 in limits (first bad index {bad})")
    lower, upper = found["q_min"], found["q_max"]
    whole = np.isfinite(lower) & np.isfinite(upper)
    # A joint with fewer than two position limits moves about zero. If its only limit excludes zero, `half` is zero, which is refused below.
    middle = np.where(whole, 0.5 * (np.where(whole, lower, 0.0) + np.where(whole, upper, 0.0)), np.clip(0.0, lower, upper))
    half = np.minimum(upper - middle, middle - lower)
    for k in range(n):
        if not half[k] > 0.0:
            raise InputError(
                f"{_NAME}: limits leave joint {arm.joint_names[k]} no range (first bad index {k}): expected q_min < 0 < q_max or a range"
            )
        if not np.isfinite([half[k], found["v_max"][k], found["a_max"][k]]).any():
            raise InputError(
                f"{_NAME}: limits do not bound joint {arm.joint_names[k]} (first bad index {k}): expected q_min and q_max, v_max or a_max"
            )
    return _Limits(middle, half, found["v_max"], found["a_max"], found["effort"])


class _Series(NamedTuple):
    """The terms of a Fourier series with N harmonics at K times of one period, and their derivatives, `(K, 2 N + 1)` each.

    For the coefficients `c`, the position is `terms @ c`, the speed `rates @ c`, and the acceleration `accelerations @ c`.
    """

    terms: _Array
    rates: _Array
    accelerations: _Array


def _series(duration: float, harmonics: int, count: int) -> _Series:
    t = np.arange(count) * (duration / count)
    w = 2.0 * np.pi / duration * np.arange(1, harmonics + 1)
    sin, cos = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    one = np.ones((count, 1))
    return _Series(
        np.hstack([one, sin, cos]), np.hstack([0.0 * one, w * cos, -w * sin]), np.hstack([0.0 * one, -w * w * sin, -w * w * cos])
    )


class _Problem:
    """The cost, minus log det F plus a penalty on torques, and its gradient with respect to unscaled coefficients `(n, 2 N + 1)`."""

    def __init__(self, arm: Arm, limits: _Limits, series: _Series, noise: _Array, armature: bool, friction: bool) -> None:
        self.arm, self.limits, self.series, self.noise = arm, limits, series, noise
        self.base = arm.base_parameters(armature=armature, friction=friction)
        self.slides = [kind == "prismatic" for kind in arm.joint_types]
        self.power = _POWERS[0]
        # A closed-form arm has no friction. It is recognised by its missing limits.
        self.rubs = bool(arm.limits)

    def scaled(self, c: _Array) -> tuple[_Array, Any]:
        """Scale the coefficients `c` so that the samples respect the limits of position, speed and acceleration.

        Also return a function that converts a gradient with respect to scaled coefficients to a gradient with respect to `c`.
        """
        limits, p = self.limits, self.power
        weights = [np.where(np.isfinite(limit), 1.0 / limit, 0.0)[:, None] for limit in (limits.half, limits.speed, limits.acceleration)]
        shares = np.hstack([weight * (c @ rows.T) for weight, rows in zip(weights, self.series, strict=True)])
        # `shares` are values relative to their limits. Division by the largest one prevents overflow of their powers.
        peak = np.abs(shares).max(axis=1, keepdims=True)
        parts = np.abs(shares / peak)
        size = np.sum(parts**p, axis=1, keepdims=True)
        norm = peak * size ** (1.0 / p)
        slopes = np.split(np.sign(shares) * parts ** (p - 1) * (size ** (1.0 / p - 1.0)), 3, axis=1)
        slope = np.sum([weight * (each @ rows) for weight, each, rows in zip(weights, slopes, self.series, strict=True)], axis=0)

        def gradient_of(g: _Array) -> _Array:
            found: _Array = (g - np.sum(g * c, axis=1, keepdims=True) / norm * slope) / norm
            return found

        return c / norm, gradient_of

    def motion(self, c: _Array, series: _Series | None = None) -> tuple[_Array, _Array, _Array]:
        """Positions, speeds and accelerations `(K, n)` of scaled coefficients `c`."""
        terms, rates, accelerations = series or self.series
        return self.limits.middle + terms @ c.T, rates @ c.T, accelerations @ c.T

    def regressor(self, q: _Array, v: _Array, a: _Array) -> _Array:
        """The weighted regressor `Y_b / noise`, `(..., n, b)`."""
        found: _Array = self.base.regressor(q, v, v, a) / self.noise[:, None]
        return found

    def slopes(self, G: _Array, q: _Array, v: _Array, a: _Array) -> tuple[_Array, _Array, _Array]:
        """For each time, the derivatives of the inner product of a constant `G` and `Y_b / noise`.

        They are derivatives with respect to `q`, `v` and `a`, `(K, n)` each.
        """
        out = np.zeros((3, *q.shape))
        for k, unit in enumerate(np.eye(q.shape[1])):
            by_position = sum(w * self.regressor(q + step * unit, v, a) for w, step in (_SLIDE if self.slides[k] else _TURN))
            by_acceleration = 0.5 * (self.regressor(q, v, a + unit) - self.regressor(q, v, a - unit))
            for i, slope in enumerate((by_position, self._by_speed(q, v, a, unit), by_acceleration)):
                out[i, :, k] = np.einsum("kib,kib->k", G, slope)
        return out[0], out[1], out[2]

    def _by_speed(self, q: _Array, v: _Array, a: _Array, unit: _Array) -> _Array:
        """Derivative of the weighted regressor, `(..., n, b)`, with respect to the speed of the joint with the unit vector `unit`.

        The columns of Coulomb friction have the derivative zero. All other columns are quadratic in the speed.
        """
        difference = 0.5 * (self.regressor(q, v + unit, a) - self.regressor(q, v - unit, a))
        if self.base.friction:
            first = len(self.base.names) - q.shape[1]
            difference[..., self.base.columns >= first] = 0.0
        return difference

    def cost(self, flat: _Array) -> tuple[float, _Array]:
        """Minus log det F plus the penalty on torques, and the gradient of this cost."""
        c = flat.reshape(len(self.limits.half), -1)
        scaled, gradient_of = self.scaled(c)
        q, v, a = self.motion(scaled)
        W = self.regressor(q, v, a)
        F = np.einsum("kib,kic->bc", W, W)
        sign, logdet = np.linalg.slogdet(F)
        if not sign > 0.0 or not np.isfinite(logdet):
            return 1e10, np.zeros_like(flat)
        gq, gv, ga = self.slopes(-2.0 * (W @ np.linalg.inv(F)), q, v, a)
        value = -float(logdet)
        bounded = np.isfinite(self.limits.torque)
        if bounded.any():
            limit = np.where(bounded, self.limits.torque, 1.0)
            tau = self.arm.inverse_dynamics(q, v, a, friction=self.rubs)
            over = np.where(bounded, np.maximum(np.abs(tau) / limit - _SHARE, 0.0), 0.0)
            value += _PENALTY / len(q) * float(np.sum(over**2))
            push = 2.0 * _PENALTY / len(q) * over * np.sign(tau) / limit
            for g, J in zip((gq, gv, ga), self.arm.inverse_dynamics_derivatives(q, v, a, friction=self.rubs), strict=True):
                g += np.einsum("ki,kij->kj", push, J)
        terms, rates, accelerations = self.series
        return value, gradient_of(gq.T @ terms + gv.T @ rates + ga.T @ accelerations).ravel()

    def fitted(self, c: _Array, duration: float, harmonics: int) -> _Array:
        """Scale the coefficients of each joint up to its limits, and then all coefficients by one factor that respects the torque limits.

        Position, speed and acceleration are within their limits at every time, torques at `_CHECKED` points per harmonic.
        """
        count = _CHECKED * harmonics
        series = _series(duration, harmonics, count)
        # Between the samples a trigonometric polynomial exceeds its largest sample by at most this factor (Ehlich and Zeller 1964).
        beyond = 1.0 / np.cos(np.pi * harmonics / count)
        limits = self.limits
        shares = [np.abs(c @ rows.T).max(axis=1) * beyond / limit for rows, limit in zip(series, limits[1:4], strict=True)]
        c = c / np.max(shares, axis=0)[:, None] * (1.0 - 1e-12)

        def within(share: float) -> bool:
            q, v, a = self.motion(share * c, series)
            tau = np.abs(self.arm.inverse_dynamics(q, v, a, friction=self.rubs))
            return bool((tau <= limits.torque * (1.0 - 1e-3)).all())

        if within(1.0):
            return c
        if not within(0.0):
            g = np.abs(self.arm.inverse_dynamics(limits.middle, 0.0 * limits.middle, 0.0 * limits.middle))
            k = int(np.argmax(g / limits.torque))
            raise InputError(
                f"{_NAME}: limits leave joint {self.arm.joint_names[k]} no torque (first bad index {k}): "
                f"expected an effort above {g[k]:.3g}, to hold the arm in mid range, got {limits.torque[k]:.3g}"
            )
        low, high = 0.0, 1.0
        for _ in range(40):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if within(middle) else (low, middle)
        return low * c


@border
def exciting_motion(
    arm: Arm,
    duration: float,
    *,
    limits: Mapping[str, ArrayLike] | None = None,
    harmonics: int = 5,
    samples: int | None = None,
    noise: ArrayLike = 1.0,
    armature: bool = False,
    friction: bool = False,
    starts: int = 1,
    iterations: int = 200,
    seed: int = 0,
) -> ExcitingMotion:
    """Search for the periodic motion within limits whose record determines the base parameters best (D-optimality).

    It requires scipy (extra `tune`). The result is the best of the local optima that the search finds from random starts.

    The limits of position, speed and acceleration are respected at every time. The limits of torque are respected at 64 points per
    harmonic, for the arm's present parameters and friction.

    Args:
        arm: an arm; its inertial parameters affect the result only through limits of torque.
        duration: the period, s.
        limits: `q_min`, `q_max` (rad or m), `v_max` (per s), `a_max` (per s^2), `effort` (N m or N), each a number or `(n,)`. They
            replace the arm's limits; an arm has no `a_max`. Each joint needs a bound other than `effort`.
        harmonics: number of harmonics of the fundamental frequency `2 pi / duration`, at most 1,000.
        samples: number of samples of one period in the record, at least 4 per harmonic; None: 20 per harmonic.
        noise: standard deviation of the measured torque, N m or N: a number or `(n,)`.
        armature, friction: whether the parameters include rotor inertias, and damping and Coulomb friction, as for `Arm.regressor`.
        starts: number of random starts of the search, at most 1,000; the best result is returned.
        iterations: largest number of iterations of each of the three successive minimisations from one start.
        seed: seed of the random starts.

    Returns:
        An `ExcitingMotion` with `duration`, `condition` and `deviations` of `arm.base_parameters(armature=armature, friction=friction)`.

    Raises:
        InputError: an argument has a wrong type, shape or value, or a joint is not bounded. It is also raised if the torque limits are too
            small to hold the arm in the middle of its range.
        ImportError: scipy is not installed.

    Source: Swevers, Ganseman, Tukel, de Schutter and van Brussel, Optimal robot excitation and identification, IEEE T-RA 13, 1997.

    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> m = al.exciting_motion(arm, 5.0, limits={"q_min": -1.5, "q_max": 1.5, "v_max": 3.0, "a_max": 10.0}, harmonics=3)
    >>> m.condition < 20.0, m.deviations.shape
    (True, (6,))
    """
    instance(_NAME, "arm", arm, Arm, "an Arm")
    duration = positive(_NAME, "duration", duration)
    if not _LEAST <= duration <= 1.0 / _LEAST:
        raise InputError(f"{_NAME}: duration is out of range: expected {_LEAST:g} to {1.0 / _LEAST:g} s, got {duration:g}")
    harmonics, starts = integer(_NAME, "harmonics", harmonics, 1, 1000), integer(_NAME, "starts", starts, 1, 1000)
    iterations, seed = integer(_NAME, "iterations", iterations, 1, 1_000_000), integer(_NAME, "seed", seed)
    samples = 20 * harmonics if samples is None else integer(_NAME, "samples", samples, 4 * harmonics, 1_000_000)
    sigma = np.broadcast_to(_core.numbers(_NAME, "noise", noise, (), (arm.n,)), (arm.n,))
    if not (sigma > 0.0).all() or not np.isfinite(sigma).all():
        k = int(np.argmax(~((sigma > 0.0) & np.isfinite(sigma))))
        raise InputError(f"{_NAME}: noise is not positive: expected finite numbers > 0, got {sigma[k]} (first bad index {k})")
    for name, value in (("armature", armature), ("friction", friction)):
        instance(_NAME, name, value, (bool, np.bool_), "True or False")
    bounds = _limits(arm, limits)
    optimize = extra(_NAME, "scipy.optimize", "tune")
    problem = _Problem(arm, bounds, _series(duration, harmonics, samples), sigma, bool(armature), bool(friction))
    best: tuple[float, _Array] | None = None
    for start in range(starts):
        flat = np.random.default_rng([seed, start]).normal(size=arm.n * (2 * harmonics + 1))
        for problem.power in _POWERS:
            flat = optimize.minimize(problem.cost, flat, jac=True, method="L-BFGS-B", options={"maxiter": iterations}).x
        fitted = problem.fitted(problem.scaled(flat.reshape(arm.n, -1))[0], duration, harmonics)
        W = problem.regressor(*problem.motion(fitted))
        logdet = float(np.linalg.slogdet(np.einsum("kib,kic->bc", W, W))[1])
        if best is None or logdet > best[0]:
            best = logdet, fitted
    assert best is not None
    return _motion(problem, best[1], duration, harmonics)


def _motion(problem: _Problem, c: _Array, duration: float, harmonics: int) -> ExcitingMotion:
    """The motion with the coefficients `c`, with the condition number of its regressor and the deviations of the parameters."""
    q, v, a = problem.motion(c)
    W = problem.regressor(q, v, a).reshape(-1, problem.base.count)
    lengths = np.linalg.norm(W, axis=0)
    R = np.linalg.qr(W / np.where(lengths > 0.0, lengths, 1.0), mode="r")
    singular = np.linalg.svd(R, compute_uv=False)
    seen = singular[-1] > 1e-13 * singular[0]
    deviations = np.linalg.norm(np.linalg.inv(R), axis=1) / lengths if seen else np.full(problem.base.count, np.inf)
    sin, cos = c[:, 1 : harmonics + 1], c[:, harmonics + 1 :]
    frequency = np.broadcast_to(2.0 * np.pi / duration * np.arange(1, harmonics + 1), sin.shape)
    offset = problem.limits.middle + c[:, 0]
    condition = float(singular[0] / singular[-1]) if seen else np.inf
    return ExcitingMotion(offset, np.hypot(sin, cos), frequency, np.arctan2(cos, sin), duration, condition, deviations)
