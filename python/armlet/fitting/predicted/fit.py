"""The result of a prediction fit: accuracy of the values, the fitted plant, and the residual as torques.

An innovation is a position. A constant torque `w` that the model does not have would lead to the innovations `C Psi^-1 B w`. Here
`Psi = I - Phi (I - L C)`, and `B` is the effect of a torque during a sample. The inverse of `C Psi^-1 B` converts
the mean innovations of blocks of samples to torques, which the tests of assumptions use. The blocks are longer than the memory of the
observer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ... import _core
from ...errors import InputError
from ...logs.log import Log
from ..assumptions import SMOOTH
from ..evidence import Blocks, Evidence
from ..fit import LogFit
from ..inverse import inverse_fit
from ..samples import CUTOFF, DENSITY, MEMORY, SHARE
from ..statistics import covariance_of_sum
from .plant_numbers import PlantNumbers
from .recording import PredictedLog, predicted_log
from .search import RANK, Prediction, predict

__all__ = ["predicted_fit"]

Array = NDArray[np.float64]

#: Number of lags of the autocovariance of the blocks, whose length exceeds the memory of the observer.
LAGS = 4


def predicted_fit(
    plant: _core.Plant, log: Log, kinds: Sequence[str], cutoff: float | None, speed: float, consistent: bool, delay: float, held: bool,
    changed: Callable[[_core.Plant, float], Any], before: LogFit | None = None,
) -> LogFit:  # fmt: skip
    """Fit the `kinds` of numbers of a plant to a log. `changed` makes the model of the result from the fitted plant and the delay."""
    numbers = PlantNumbers(plant, kinds, delay)
    record = predicted_log(log, numbers, cutoff, held)
    at = predict(record, numbers, _starts(numbers, log, cutoff, delay))
    fit = _result(at, record, numbers, cutoff, speed, changed, before)
    if not consistent or "inertia" not in kinds:
        return fit
    possible = fit.arm.with_parameters(fit.arm.project_parameters(fit.arm.parameters))
    others = tuple(kind for kind in kinds if kind != "inertia")
    made = numbers.plant_of(at.motion.all)
    made = type(made)(**{**made.__getnewargs_ex__()[1], "arm": possible})
    return predicted_fit(made, log, others, cutoff, speed, False, delay, held, changed, fit)


def _starts(numbers: PlantNumbers, log: Log, cutoff: float | None, delay: float) -> list[Array]:
    """The values of the plant, and those of the inverse fit of a rigid arm."""
    common = tuple(kind for kind in ("inertia", "rotors", "viscous", "coulomb", "offsets") if kind in numbers.kinds)
    if numbers.elastic or not common:
        return [numbers.first]
    try:
        fit = inverse_fit(numbers.arm, log, common, cutoff, 0.1, False, delay)
        return [numbers.first, numbers.beta_of(fit.arm, fit.offsets)]
    except InputError:
        return [numbers.first]


def _result(
    at: Prediction, record: PredictedLog, numbers: PlantNumbers, cutoff: float | None, speed: float,
    changed: Callable[[_core.Plant, float], Any], before: LogFit | None,
) -> LogFit:  # fmt: skip
    log, b = record.log, len(at.beta)
    _, sigma, V = np.linalg.svd(at.triangle[:, :b])
    rank = int(np.count_nonzero(sigma > RANK * sigma[:1])) if b else 0
    hidden = np.any(np.abs(V[rank:]) > 1e-3, axis=0)
    size = _block_size(at, record)
    covariance = _covariance(at, V[:rank].T / sigma[:rank] / at.lengths[:, None], size)
    deviations = np.where(hidden, np.inf, np.sqrt(np.maximum(np.diag(covariance), 0.0)))
    plant = numbers.plant_of(at.motion.all)
    late = float(at.motion.all[numbers.late])
    frequency = min(CUTOFF, SHARE / record.period) if cutoff is None else cutoff
    blocks, residual, columns = _blocks(at, record, numbers, size, frequency)
    model = at.motion.torque(record.states, record.acceleration, np.concatenate([record.sign, record.sign[-1:]]))
    evidence = Evidence(_rigid(at, numbers), blocks, columns, blocks.filtered(model), _untested(numbers))
    return LogFit(
        names=numbers.names, values=at.beta, deviations=deviations, covariance=covariance, rank=rank,
        condition=float(sigma[0] / sigma[-1]) if rank == b else np.inf, residuals=np.sqrt(np.mean(residual**2, axis=0)),
        model=changed(plant, late), arm=plant.arm, kinds=numbers.kinds, joints=log.names, t=blocks.t, measured=blocks.tau,
        residual=residual, ranges=np.ptp(log.q, axis=0), cutoff=frequency, log=log, stribeck_speed=speed, delay=late, before=before,
        evidence=evidence,
    )  # fmt: skip


def _block_size(at: Prediction, record: PredictedLog) -> int:
    """Samples per block: the memory of the observer, and the density of the samples of the inverse fit."""
    memory = 2.0 * at.observer.memory(at.L)
    return int(np.ceil(max(memory, 1.0 / (DENSITY * CUTOFF * record.period), 2.0)))


def _covariance(at: Prediction, root: Array, size: int) -> Array:
    """The covariance of the values in the sandwich form, from sums of the scores over blocks. `root root'` inverts their Hessian."""
    error = at.found.error * at.used[:, None]
    scores = np.einsum("kyp,ky->kp", at.found.slopes, error @ (at.whiten @ at.whiten.T))
    sums = np.add.reduceat(scores, np.arange(0, len(scores), size), axis=0)
    scale = np.linalg.norm(sums, axis=0)
    scale[scale == 0.0] = 1.0
    spread = covariance_of_sum(sums / scale, LAGS) * np.outer(scale, scale)
    count = np.count_nonzero(at.used) * error.shape[1]
    inverse = root @ root.T
    return np.asarray(inverse @ spread @ inverse * count / max(count - root.shape[1], 1))


def _blocks(at: Prediction, record: PredictedLog, numbers: PlantNumbers, size: int, frequency: float) -> tuple[Blocks, Array, Array]:
    """The blocks, the residual as torques (M, n), and the columns of the values in it, (M, n, P)."""
    n, count = numbers.n, len(record.t) // size
    used = at.used[: count * size].reshape(count, size)
    kept = np.count_nonzero(used, axis=1) >= max(1, size // 2)
    # The memories of the filter of the motion, and of the second filter of the test of elasticity.
    own = 0.5 / (size * record.period)
    smooth = record.smooth(MEMORY / frequency + MEMORY / (SMOOTH * own))
    kept &= np.all(smooth[: count * size].reshape(count, size), axis=1)
    begins = np.flatnonzero(kept) * size
    weights = used[kept] / np.count_nonzero(used[kept], axis=1)[:, None]
    states = at.found.states
    place = slice(2 * n, 4 * n) if numbers.elastic else slice(0, 2 * n)
    # The filtered motion does not have the noise of the torques, which is in the residual.
    motor = record.states[:, place]
    motion = (motor[:, :n], motor[:, n:], record.acceleration)
    blank = np.zeros(0)
    centre = np.minimum(begins + size // 2, len(record.t) - 2)
    maker = Blocks(blank, blank, blank, blank, blank, motion, centre, record.period, own, begins, weights)
    tau = record.log.tau
    assert tau is not None
    t, q, v, acceleration, torque = (maker.filtered(each) for each in (record.t, *motion, tau))
    blocks = Blocks(t, q, v, acceleration, torque, motion, centre, record.period, maker.cutoff, begins, weights)
    rows = slice(n, 2 * n) if record.y.shape[1] > n else slice(0, n)
    Phi, C = at.steps.Phi[centre], record.C
    B = record.period * at.motion.inputs(states[centre])[0]
    B = B + 0.5 * (Phi - np.eye(Phi.shape[1])) @ B
    Psi = np.eye(Phi.shape[1]) - Phi @ (np.eye(Phi.shape[1]) - at.L @ C)
    effect = C[rows] @ np.linalg.solve(Psi, B)
    error = maker.filtered(at.found.error[:, rows])
    columns = maker.filtered(at.found.slopes[:, rows])
    return blocks, np.asarray(-np.linalg.solve(effect, error[:, :, None])[:, :, 0]), np.asarray(-np.linalg.solve(effect, columns))


def _rigid(at: Prediction, numbers: PlantNumbers) -> _core.Arm:
    """The arm with the rotors and the friction of the plant, as if its joints were rigid."""
    of = at.motion.of
    return numbers.arm_of(at.motion.all).with_drives(armature=of["rotors"], damping=of["viscous"], friction=of["coulomb"])


def _untested(numbers: PlantNumbers) -> tuple[str, ...]:
    """The assumptions that the fit replaces by values, or that the plant does not have."""
    late = ("delay",) if numbers.time else ()
    scaled = ("torque_constant",) if "torque_constants" in numbers.kinds else ()
    return (*late, *scaled, *(("elasticity",) if numbers.elastic else ()))
