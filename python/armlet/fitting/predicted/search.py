"""The prediction fit: the numbers of a plant that predict the recorded positions from the recorded torques, sample by sample.

    sum_k Z_k' W e_k = 0,   W = cov(e)^-1

`e_k` are the innovations of an observer (innovations.py), and `Z_k` their derivatives by the values along the filtered motion. The
derivatives along the predicted motion would have the noise of the torques. This noise is in the innovations too, and would bias the values
(instrumental variables [Ljung1999], section 7.6). The derivative by the delay of a held torque has the recorded torque, which is the
law's output. The steps are those of Gauss and Newton. States and values change together, and both are exact at the end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ..samples import NAME
from .innovations import Innovations, innovations
from .plant_numbers import PlantNumbers
from .recording import Observer, PredictedLog
from .transitions import Motion, Transitions, transitions

__all__ = ["Prediction", "predict"]

Array = NDArray[np.float64]

#: Samples of the search from several starts, and of the search for the noise.
SHORT, NOISE_SAMPLES = 4000, 20_000
#: Largest number of steps from a start, and of the last search.
FIRST_STEPS, STEPS = 4, 15
#: The search ends when a step is below the first fraction of the deviations, or below the second and no part of it lowers the cost.
SMALL, STALLED = 1e-2, 0.5
#: Largest relative rise of the sum of squares in a step: the equations are not exactly those of its minimum.
RISE = 1e-3
#: Singular values below this fraction of the largest one count as zero, after the columns have the length one.
RANK = 1e-6
#: Delays from which the search starts, in periods.
DELAYS = (0.0, -0.5, 0.5, 1.5, 3.0)
#: Longest time constant of the observer, s, and largest tracking index.
SLOWEST, LARGEST = 0.2, 10.0


@dataclass(frozen=True)
class Prediction:
    """The end of the search: values, innovations, their weight, and what the accuracy of the values requires."""

    beta: Array
    motion: Motion
    observer: Observer
    L: Array
    steps: Transitions
    found: Innovations
    used: NDArray[np.bool_]
    #: The factor `T` of `W = T T'`, the triangle of the scaled derivatives, and their lengths.
    whiten: Array
    triangle: Array
    lengths: Array
    cost: float
    converged: bool = False


class _Search:
    """Gauss-Newton steps on one log with one observer."""

    def __init__(self, log: PredictedLog, numbers: PlantNumbers) -> None:
        self.log, self.numbers = log, numbers
        self.moving = numbers.time is not None

    def delay(self, beta: Array) -> float:
        return float(self.numbers.all_of(beta)[self.numbers.late])

    def observer(self, beta: Array) -> Observer:
        return Observer(self.log, Motion(self.numbers, beta), self.delay(beta))

    def restarted(self, steps: Transitions) -> Transitions:
        """The transitions, with the filtered state after each interval at which the observer starts again."""
        steps.F[self.log.restarts] = self.log.states[self.log.restarts + 1]
        return steps

    def offset(self, motion: Motion) -> tuple[Array, Array]:
        """The offset of the measurements, (y,), and its derivative by the values, (y, P)."""
        place, others = self.numbers.places["encoder_offsets"], self.log.y.shape[1] - self.numbers.n
        return np.pad(motion.all[place], (0, others)), np.pad(self.numbers.D[place], ((0, others), (0, 0)))

    def evaluate(self, beta: Array, states: Array, observer: Observer, L: Array, whiten: Array | None) -> Prediction:
        """The innovations at `beta`, about `states` (K, d)."""
        log, numbers = self.log, self.numbers
        motion = Motion(numbers, beta)
        exact = self.moving and log.held
        pieces = log.pieces(self.delay(beta), exact)
        steps = transitions(motion if exact else Motion(numbers, beta, False), states[:-1], pieces, log.sign)
        smooth = transitions(motion, log.states[:-1], [log.smooth_piece(motion)], log.sign).G
        if exact:
            smooth[:, :, motion.late != 0.0] = steps.G[:, :, motion.late != 0.0]
        steps = self.restarted(Transitions(steps.F, steps.Phi, smooth))
        offset, by = self.offset(motion)
        found = innovations(steps, states[:-1], log.y, log.C, L, states[0], offset, by, log.restarts)
        used = log.used(observer.memory(L))
        if np.count_nonzero(used) * log.y.shape[1] <= 2 * len(beta) + 20:
            raise InputError(f"{NAME}: log is too short: expected more than {2 * len(beta) + 20} samples, got {len(log.t)}")
        error = found.error[used]
        if not np.all(np.isfinite(error)) or np.abs(error).max() > 1e6:
            raise FloatingPointError
        if whiten is None:
            whiten = _whitening(error, log.y)
        return Prediction(beta, motion, observer, L, steps, found, used, whiten, *_triangle(found, used, whiten))

    def step(self, at: Prediction) -> tuple[Array, float]:
        """The Gauss-Newton step, and its largest component in deviations."""
        b = len(at.beta)
        free = np.ones(b, dtype=bool)
        for _ in range(b + 1):
            # A value at its bound that would pass it stays.
            change = np.zeros(b)
            U, sigma, V = np.linalg.svd(at.triangle[:, :b][:, free], full_matrices=False)
            keep = sigma > RANK * sigma[:1]
            change[free] = -(V[keep].T @ ((U.T @ at.triangle[:, b])[keep] / sigma[keep])) / at.lengths[free]
            stuck = free & (at.beta <= self.numbers.low) & (change < 0.0)
            if not stuck.any():
                break
            free &= ~stuck
        count = max(1, np.count_nonzero(at.used) * self.log.y.shape[1] - b)
        size = np.sqrt(np.sum((at.triangle[:, :b] @ (change * at.lengths)) ** 2) / max(at.cost / count, 1e-300) / max(b, 1))
        return change, float(size)

    def run(self, at: Prediction, steps: int) -> Prediction:
        """At most `steps` Gauss-Newton steps with halving. The weight changes with every step."""
        for _ in range(steps):
            change, size = self.step(at)
            if size < SMALL:
                return replace(at, converged=True)
            share = 1.0
            while True:
                trial = np.maximum(at.beta + share * change, self.numbers.low)
                try:
                    # The same weight, so that the costs can be compared.
                    after = self.evaluate(trial, at.found.states, at.observer, at.L, at.whiten)
                except (FloatingPointError, InputError):
                    after = None
                if after is not None and after.cost <= at.cost * (1.0 + RISE):
                    break
                share *= 0.5
                if share < 1e-3:
                    return replace(at, converged=size < STALLED)
            at = self.weighted(after)
        return at

    def weighted(self, at: Prediction) -> Prediction:
        """The prediction whose weight is that of its innovations."""
        whiten = _whitening(at.found.error[at.used], self.log.y)
        triangle, lengths, cost = _triangle(at.found, at.used, whiten)
        return replace(at, whiten=whiten, triangle=triangle, lengths=lengths, cost=cost)

    def score(self, at: Prediction) -> float:
        """The logarithm of the determinant of the covariance of the innovations, which does not depend on the weight."""
        return -2.0 * float(np.linalg.slogdet(at.whiten)[1])


def _triangle(found: Innovations, used: NDArray[np.bool_], whiten: Array) -> tuple[Array, Array, float]:
    """The triangle of the whitened derivatives, of length one, and innovations; the lengths; the sum of squares."""
    flat = (whiten.T @ found.slopes[used]).reshape(-1, found.slopes.shape[2])
    lengths = np.linalg.norm(flat, axis=0)
    lengths[lengths == 0.0] = 1.0
    right = (found.error[used] @ whiten).reshape(-1)
    triangle: Array = np.asarray(np.linalg.qr(np.column_stack([flat / lengths, right]), mode="r"))
    return triangle, lengths, float(right @ right)


def _whitening(error: Array, y: Array) -> Array:
    """The matrix `T` with `error @ T` of unit covariance. A floor of rounding errors keeps exact logs finite."""
    floor = np.diag((1e-11 * (1.0 + np.ptp(y, axis=0))) ** 2)
    covariance = error.T @ error / len(error) + floor
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)).T)


def predict(log: PredictedLog, numbers: PlantNumbers, starts: Sequence[Array]) -> Prediction:
    """Search from several starts on the begin of the log, choose the best, find the noise, and finish on the whole log."""
    short = _Search(log.begin(SHORT), numbers)
    index = np.full(numbers.n, 0.5)
    best: Prediction | None = None
    score = np.inf
    for beta in _with_delays(starts, numbers, log.period):
        try:
            observer = short.observer(beta)
            L = observer.gain(index)
            at = short.run(short.evaluate(beta, short.log.states, observer, L, None), FIRST_STEPS)
        except (FloatingPointError, InputError) as error:
            if isinstance(error, InputError) and "too short" in str(error):
                raise
            continue
        if short.score(at) < score:
            best, score = at, short.score(at)
    if best is None:
        raise InputError(f"{NAME}: model is too far from the log: no start has finite predictions")
    middle = _Search(log.begin(NOISE_SAMPLES), numbers)
    beta = best.beta
    for _ in range(2):
        observer = middle.observer(beta)
        index = _indices(middle, beta, observer, index)
        at = middle.run(middle.evaluate(beta, middle.log.states, observer, observer.gain(index), None), 2)
        beta = at.beta
    whole = _Search(log, numbers)
    observer = whole.observer(beta)
    return whole.run(whole.evaluate(beta, log.states, observer, observer.gain(index), None), STEPS)


def _with_delays(starts: Sequence[Array], numbers: PlantNumbers, period: float) -> list[Array]:
    if numbers.time is None:
        return list(starts)
    place = numbers.names.index(numbers.time)
    made = []
    for beta in starts:
        for periods in DELAYS:
            other = beta.copy()
            other[place] += periods * period * (1.0 if numbers.time == "delay" else -1.0)
            made.append(other)
    return made


def _indices(search: _Search, beta: Array, observer: Observer, index: Array) -> Array:
    """The tracking index of each joint whose innovations have the smallest variance, by golden sections of all joints at once."""
    log, n = search.log, search.numbers.n
    about = search.evaluate(beta, log.states, observer, observer.gain(index), None)
    states = about.found.states
    pieces = log.pieces(search.delay(beta), False)
    bare = search.restarted(transitions(Motion(search.numbers, beta, False), states[:-1], pieces, log.sign))
    offset, _ = search.offset(about.motion)
    used = log.used(1.0 / 7.0 * min(0.1 * len(log.t), SLOWEST / log.period))

    def spread(logs: Array) -> Array:
        L = observer.gain(np.exp(logs))
        found = innovations(bare, states[:-1], log.y, log.C, L, states[0], offset, np.zeros((len(offset), 0)), log.restarts)
        each = np.log(np.mean(found.error[used] ** 2, axis=0) + 1e-300)
        return np.asarray(each.reshape(-1, n).sum(axis=0))

    low = np.full(n, 2.0 * np.log(log.period / SLOWEST))
    high = np.full(n, np.log(LARGEST))
    low = np.minimum(low, high - 1.0)
    ratio = 0.5 * (np.sqrt(5.0) - 1.0)
    inner, outer = high - ratio * (high - low), low + ratio * (high - low)
    at_inner, at_outer = spread(inner), spread(outer)
    for _ in range(9):
        left = at_inner < at_outer
        high, low = np.where(left, outer, high), np.where(left, low, inner)
        inner, outer = high - ratio * (high - low), low + ratio * (high - low)
        # One of the two points of each joint is known; both are computed, because the joints interact.
        at_inner, at_outer = spread(inner), spread(outer)
    return np.asarray(np.exp(0.5 * (low + high)))
