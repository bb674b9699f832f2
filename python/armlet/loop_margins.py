"""Loop gain and stability margins of a control loop that is cut at the joint torques.

    x' = A x + B w,   u = C x,   L = -C (s I - A)^-1 B,   S = (I + L)^-1 = I + C (s I - A - B C)^-1 B

The matrices are those of the linear loop (`linear_loop.py`). `w` is the input of the plant and `u` the output of the law; the loop is
closed by `w = u`. `L` is the loop gain and `S` the sensitivity of the inputs. In a sampled loop, `z = e^(s h)` takes the place of `s`.
Joint i with the other joints closed has the loop gain `L_i = 1/S_ii - 1`. With the factor `f` at its input, the loop is at the border of
stability where `f L_i = -1`:

    gain    f real:                      Im S_ii = 0,     f = S_ii / (S_ii - 1)
    phase   f = e^(-j phi):              Re S_ii = 1/2,   phi = arg L_i + pi
    delay   f = e^(-j w T):              T = phi / w
    disc    f = (2 + d) / (2 - d):       |d| = 1 / |S_ii - 1/2|                (Seiler, Packard and Gahinet 2020)

The borders are found on a grid of frequencies that is dense at every eigenvalue of the loop, and then by bisection.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._core import Arm, Law, Plant
from .arguments import finite, number
from .border import border, bordered
from .errors import InputError
from .linear_loop import LinearLoop, sampling_of
from .pickling import sealed
from .run.sampling import Sampling

__all__ = ["LoopMargins", "loop_margins"]

Array: TypeAlias = NDArray[np.float64]
Complex: TypeAlias = NDArray[np.complex128]

#: Frequencies per decade of the grid, and the decades beyond the slowest and the fastest eigenvalue.
DENSITY, BEYOND = 200, 3
#: At each eigenvalue, the grid has this many frequencies, up to five times its damping to both sides.
NEAR = 41
#: An eigenvalue whose real part is below this part of the largest eigenvalue does not count as unstable: a constant estimate has the
#: eigenvalue zero, up to rounding.
FREE = 1e-8
#: This part of the lowest frequency is zero, but not an eigenvalue of a loop with constant states.
SLOW = 1e-4
#: Steps of a bisection: the grid's intervals become smaller than the rounding of a frequency.
STEPS = 60
#: A share of `|S - 1/2|` at the grid's largest values from which a maximum between the grid's frequencies is searched.
CLOSE = 0.9


@bordered
@sealed
@dataclass(frozen=True, eq=False)
class LoopMargins:
    """Stability margins of a loop at the joint torques. Each entry belongs to one joint, while the other joints do not change.

    Attributes:
        stable: whether the loop is stable. The margins of a loop that is not stable are 1 (gains) and 0.
        gain_low, gain_high: factors of the input of one joint, (n,). The loop is stable for every factor between both.
        phase: phase lag or lead of the input of one joint with which the loop is still stable, (n,), rad. It is pi without a border.
        delay: additional delay of the input of one joint with which the loop is still stable, (n,), s. It may be infinite. In a sampled
            loop, it is exact for whole periods.
        disc: disc margin, (n,), between 0 and 2: the loop is stable for every complex factor `(2 + d) / (2 - d)` with `|d| < disc`. So it
            tolerates gains between `(2 - disc) / (2 + disc)` and the inverse, phases of `2 atan(disc / 2)`, and both together.
        disc_all: disc margin for factors that differ from joint to joint and act together. It is a lower bound.

    Source: Seiler, Packard and Gahinet, An introduction to disk margins, IEEE Control Systems Magazine 40(5), 2020.
    """

    stable: bool
    gain_low: Array
    gain_high: Array
    phase: Array
    delay: Array
    disc: Array
    disc_all: float
    _matrices: tuple[Array, Array, Array] = field(repr=False)
    _period: float = field(repr=False)

    def loop_gain(self, frequency: ArrayLike) -> Complex:
        """The loop gain `L`, cut at the inputs of all joints.

        Args:
            frequency: angular frequencies, rad/s, > 0, scalar or (K,); in a sampled loop at most `pi / period`.

        Returns:
            Complex matrices, (n, n) or (K, n, n): output of the law with a minus sign, per input of the plant.

        Raises:
            InputError: a frequency is not positive, not finite, or above `pi / period`.

        >>> import armlet as al
        >>> arm = al.planar_arm([1.0], masses=[1.0], gravity=(0.0, 0.0))
        >>> margins = al.loop_margins(arm, al.PDGravity(arm, [0.0], 4.0, 2.0), [0.0])
        >>> complex(margins.loop_gain(2.0)[0, 0]).imag < 0.0
        True
        """
        given = finite("loop_gain", "frequency", _core.numbers("loop_gain", "frequency", frequency, (), ("K",)))
        highest = np.pi / self._period if self._period else np.inf
        if not ((given > 0.0) & (given <= highest * (1.0 + 1e-12))).all():
            raise InputError(f"loop_gain: frequency is out of range: expected numbers in (0, {highest}] rad/s")
        A, B, C = self._matrices
        return -_response(A, B, C, given, self._period)


@border
def loop_margins(
    plant: Plant | Arm, law: Law, x0: ArrayLike, *, t: float = 0.0, sample_time: float | Sampling | None = None
) -> LoopMargins:
    """Compute the stability margins of a loop about a state, and its loop gain. The loop is cut at the inputs of the plant.

    Args:
        plant: the plant, without a wall and without joint stops; an arm means `RigidArm(arm)`.
        law: the law of the loop.
        x0: an equilibrium of the loop: q, (n,), or all states. With q alone, the arm is at rest, the springs support gravity, and the law
            has the state of the start of a run.
        t: time of the law, s.
        sample_time: period of the samples, s, or a `Sampling` whose `delay` and `sensor_delay` count, without jitter, rate limit and torque
            sensor. None: continuous time.

    Returns:
        The margins of each joint.

    Raises:
        InputError: an argument has a wrong type, shape or value, or the plant has a wall, joint stops, `LuGre` or `StickSlip` friction.

    Source: Seiler, Packard and Gahinet, An introduction to disk margins, IEEE Control Systems Magazine 40(5), 2020.

    >>> import armlet as al
    >>> arm = al.planar_arm([1.0], masses=[1.0], gravity=(0.0, 0.0))
    >>> law = al.PDGravity(arm, [0.0], kp=100.0, kd=20.0)
    >>> al.loop_margins(arm, law, [0.0]).gain_high
    array([inf])
    >>> sampled = al.loop_margins(arm, law, [0.0], sample_time=al.Sampling(0.004, delay=0.004))
    >>> bool(sampled.gain_high[0] < 20.0 and sampled.delay[0] < 0.1)
    True
    """
    loop = LinearLoop("loop_margins", plant, law)
    if law is None:
        raise InputError("loop_margins: law is missing: expected a law, got None")
    sampling = sampling_of("loop_margins", sample_time, law)
    x = loop.state(x0)
    t = number("loop_margins", "t", t)
    matrices = loop.cut(t, x) if sampling is None else loop.cut_at_samples(t, x, sampling)
    return _margins(matrices, 0.0 if sampling is None else sampling.period)


def _response(A: Array, B: Array, C: Array, w: Array, period: float) -> Complex:
    """C (s I - A)^-1 B at the frequencies w, of any shape."""
    s = np.exp(1j * w * period) if period else 1j * w
    return np.asarray(C @ np.linalg.solve(s[..., None, None] * np.eye(len(A)) - A, B.astype(np.complex128)), dtype=np.complex128)


def _margins(matrices: tuple[Array, Array, Array], period: float) -> LoopMargins:
    A, B, C = matrices
    n, closed = B.shape[1], A + B @ C
    rates = _rates(closed, period)
    size = np.abs(rates).max(initial=1.0)
    if rates.real.max(initial=-np.inf) > FREE * size:
        still = np.zeros(n)
        return LoopMargins(False, still + 1.0, still + 1.0, still, still, still, 0.0, matrices, period)
    grid = _grid(np.concatenate([rates, _rates(A, period)]), period)
    S = np.eye(n) + _response(closed, B, C, grid, period)
    found = [_of_joint(i, grid, S[:, i, i], matrices, period) for i in range(n)]
    low, high, phase, delay, disc = (np.array(column) for column in zip(*found, strict=True))

    def largest(w: Array) -> Array:
        return np.asarray(np.linalg.norm(np.eye(n) / 2.0 + _response(closed, B, C, w, period), ord=2, axis=(-2, -1)))

    return LoopMargins(True, low, high, phase, delay, disc, 1.0 / _peak(largest, grid), matrices, period)


def _of_joint(
    i: int, grid: Array, S: Complex, matrices: tuple[Array, Array, Array], period: float
) -> tuple[float, float, float, float, float]:
    """Lowest and highest gain, phase, delay and disc margin of joint i. S is its sensitivity at the grid."""
    A, B, C = matrices
    closed, b, c = A + B @ C, B[:, i : i + 1], C[i : i + 1]

    def sensitivity(w: Array) -> Complex:
        return 1.0 + _response(closed, b, c, w, period)[..., 0, 0]

    # S is real at the frequency zero, and at half the frequency of samples.
    ends = np.array([SLOW * grid[0], *([np.pi / period] if period else [])])
    crossings = sensitivity(np.concatenate([_roots(lambda w: sensitivity(w).imag, grid, S.imag), ends])).real
    crossings = crossings[np.abs(crossings - 1.0) > 1e-12]
    gains = crossings / (crossings - 1.0)
    low, high = gains[(gains > 0.0) & (gains < 1.0)].max(initial=0.0), gains[gains > 1.0].min(initial=np.inf)
    low = 0.0 if low < 1e-6 else low

    w = _roots(lambda w: sensitivity(w).real - 0.5, grid, S.real - 0.5)
    lag = np.mod(np.angle(1.0 / sensitivity(w) - 1.0) + np.pi, 2.0 * np.pi)
    phase = np.minimum(lag, 2.0 * np.pi - lag).min(initial=np.pi)
    disc = 1.0 / _peak(lambda w: np.abs(sensitivity(w) - 0.5), grid)
    return float(low), float(high), float(phase), float((lag / w).min(initial=np.inf)), disc


def _rates(A: Array, period: float) -> Complex:
    """The eigenvalues, 1/s, without those of states that only store past values."""
    values = np.linalg.eigvals(A).astype(np.complex128)
    return np.asarray(np.log(values[np.abs(values) > 1e-12]) / period if period else values, dtype=np.complex128)


def _grid(rates: Complex, period: float) -> Array:
    """Frequencies that are dense at the eigenvalues `rates`, rad/s, in ascending order."""
    sizes = np.abs(rates)
    sizes = sizes[sizes > FREE * sizes.max(initial=1.0)]
    ends = (sizes.min(initial=1.0) / 10.0**BEYOND, sizes.max(initial=1.0) * 10.0**BEYOND)
    highest = np.pi / period if period else ends[1]
    decades = np.geomspace(min(ends[0], highest / 10.0), highest, 2 + int(DENSITY * np.log10(highest / min(ends[0], highest / 10.0))))
    near = np.abs(rates.imag)[:, None] + np.abs(rates.real)[:, None] * np.linspace(-5.0, 5.0, NEAR)
    all_of_them = np.concatenate([decades, near.ravel()])
    return np.unique(all_of_them[(all_of_them >= decades[0]) & (all_of_them <= highest)])


def _roots(f: Callable[[Array], Any], grid: Array, values: Array) -> Array:
    """The frequencies at which f is zero, by bisection between frequencies of the grid at which f has opposite signs."""
    at = np.flatnonzero(np.sign(values[1:]) * np.sign(values[:-1]) < 0.0)
    low, high, sign = grid[at], grid[at + 1], np.sign(values[at])
    for _ in range(STEPS if at.size else 0):
        middle = 0.5 * (low + high)
        same = np.sign(f(middle)) == sign
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return np.concatenate([0.5 * (low + high), grid[values == 0.0]])


def _peak(f: Callable[[Array], Array], grid: Array) -> float:
    """The largest value of f: on the grid, then by golden sections about the largest values."""
    values = f(grid)
    inner = np.flatnonzero((values[1:-1] >= values[:-2]) & (values[1:-1] >= values[2:]) & (values[1:-1] > CLOSE * values.max())) + 1
    low, high = grid[inner - 1], grid[inner + 1]
    golden = (np.sqrt(5.0) - 1.0) / 2.0
    best = values.max()
    for _ in range(STEPS if inner.size else 0):
        a, b = high - golden * (high - low), low + golden * (high - low)
        left, right = f(a), f(b)
        best = max(best, left.max(), right.max())
        low, high = np.where(left < right, a, low), np.where(left < right, high, b)
    return float(best)
