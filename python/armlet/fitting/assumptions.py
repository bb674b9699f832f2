"""The columns that wrong assumptions would leave in the residual of the inverse fit.

    friction of joint j       v_j,  F[sign v_j],  F[exp(-(v_j/v_s)^2) sign v_j]
    rotor, offset             a_j,  1
    torque constant           tau_j
    saturation at c           (|tau_j| - c)+ sign tau_j
    jump at time s            1 for t > s
    elasticity                d/de f(q - e tau_j, v - e tau_j', a - e tau_j''),  if the motor has the position sensor
    gravity direction         torque of an acceleration of gravity across the assumed one
    payload from time s       mass and first moments of the last body for t > s
    delay, clock drift        tau',  t tau'

`f` and `tau` are the torques of the fitted model, because the noise of measured torques would bias the tests. Only the saturation has the
measured torque `tau + e`. Its column `h(tau + e)` is correlated with the noise by `E[h e] = E[e^2] E[h']`, which the test subtracts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..logs.filters import low_pass_rates
from .samples import ORDER, Samples
from .sensors import torque_rate

__all__ = ["Assumption", "assumptions"]

Array = NDArray[np.float64]

#: Quantiles of the torque at which it may saturate, and parts of the log after which the model may change.
LEVELS, TIMES = np.linspace(0.5, 0.95, 10), np.linspace(0.2, 0.8, 7)
#: Relative step of the difference quotient of the elasticity.
STEP = 1e-6
#: Cutoff of the second filter of the elasticity, as a share of the cutoff.
SMOOTH = 0.5


@dataclass(frozen=True)
class Assumption:
    """An assumption with the columns that would be in the residual if it were wrong."""

    name: str
    #: Index of the joint; None for an assumption on the whole arm.
    joint: int | None
    #: Alternatives, (K, n, d) each, and the values that distinguish them: a torque or a time.
    columns: Sequence[Array]
    values: Sequence[float] = ()
    #: For each alternative, the derivative of the column by the measured torque, (K, n).
    slopes: Sequence[Array] = field(default=())


def assumptions(model: _core.Arm, samples: Samples, kinds: Sequence[str], speed: float, explained: Array) -> Iterator[Assumption]:
    """The assumptions that are not fitted. `explained` is the torque of the fitted model, (K, n)."""
    n, ones = model.n, np.ones_like(samples.v)
    every = samples.motion[1]
    single = {"viscous": samples.v, "rotors": samples.a, "offsets": ones, "torque_constant": explained}
    single |= {"coulomb": samples.filtered(np.sign(every))}
    single |= {"stribeck": samples.filtered(np.exp(-((every / speed) ** 2)) * np.sign(every))}
    for name, values in single.items():
        if name not in kinds:
            for j in range(n):
                yield Assumption(name, j, [_of_joint(values, j)])
    yield from _saturation(samples)
    yield from _changes(model, samples)
    bare = model.with_drives(armature=np.zeros(model.n))
    deflections = _deflections(bare, samples)
    for j in range(n):
        yield Assumption("elasticity", j, [_elasticity(bare, samples, j, deflections)])
    rate = torque_rate(model, samples, kinds)
    yield Assumption("delay", None, [rate[:, :, None]])
    yield Assumption("clock_drift", None, [((samples.t - samples.t[0])[:, None] * rate)[:, :, None]])
    across = _across(model)
    if across is not None:
        torques = [_gravity(model, direction, samples) for direction in across]
        yield Assumption("gravity", None, [np.stack(torques, axis=2)])


def _of_joint(values: Array, joint: int) -> Array:
    """A column (K, n, 1) with the values of one joint, and zeros for the others."""
    column = np.zeros((*values.shape, 1))
    column[:, joint, 0] = values[:, joint]
    return column


def _saturation(samples: Samples) -> Iterator[Assumption]:
    for j in range(samples.tau.shape[1]):
        size = np.abs(samples.tau[:, j])
        levels = np.quantile(size, LEVELS)
        columns, slopes = [], []
        for level in levels:
            column, slope = np.zeros((*samples.tau.shape, 1)), np.zeros_like(samples.tau)
            column[:, j, 0] = np.maximum(size - level, 0.0) * np.sign(samples.tau[:, j])
            slope[:, j] = size > level
            columns.append(column)
            slopes.append(slope)
        yield Assumption("saturation", j, columns, levels.tolist(), slopes)


def _changes(model: _core.Arm, samples: Samples) -> Iterator[Assumption]:
    times = samples.t[0] + TIMES * (samples.t[-1] - samples.t[0])
    after = [(samples.t > time).astype(np.float64) for time in times]
    for j in range(model.n):
        yield Assumption("jump", j, [_of_joint(np.tile(step[:, None], (1, model.n)), j) for step in after], times.tolist())
    last = slice(10 * (model.n - 1), 10 * (model.n - 1) + 4)
    body = np.asarray(model.regressor(samples.q, samples.v, samples.v, samples.a))[..., last]
    yield Assumption("payload", None, [step[:, None, None] * body for step in after], times.tolist())


def _deflections(bare: _core.Arm, samples: Samples) -> tuple[Array, Array, Array]:
    """The torque of the bodies with its first and second derivatives at every time of the log.

    The noise of the positions is in the second derivative and in the residual. A second filter removes most of this common noise.
    """
    return low_pass_rates(np.asarray(bare.inverse_dynamics(*samples.motion)), samples.period, SMOOTH * samples.cutoff, ORDER)


def _elasticity(bare: _core.Arm, samples: Samples, j: int, deflections: tuple[Array, Array, Array]) -> Array:
    step = STEP / max(np.abs(deflections[0][samples.rows, j]).max(), 1e-300)

    def effect(*series: Array) -> Array:
        moved = [values.copy() for values in series[:3]]
        for values, torque in zip(moved, series[3:], strict=True):
            values[:, j] -= step * torque[:, j]
        return np.asarray((bare.inverse_dynamics(*moved) - bare.inverse_dynamics(*series[:3])) / step)

    return samples.sampled(effect, *samples.motion, *deflections)[:, :, None]


def _across(model: _core.Arm) -> tuple[Array, Array] | None:
    """Two unit vectors that are orthogonal to gravity; None without gravity."""
    gravity = model.gravity_vector
    if gravity is None or not np.linalg.norm(gravity) > 0.0:
        return None
    _, _, V = np.linalg.svd(np.asarray(gravity)[None, :])
    return V[1], V[2]


def _gravity(model: _core.Arm, direction: Array, samples: Samples) -> Array:
    return np.asarray(model.with_gravity(direction).gravity(samples.q))
