"""The inverse fit: the parameters of an arm from the torques of a log.

    F[tau] = W beta + e,   W = base columns of [Y, diag(a), diag(v), sign v, exp(-(v/v_s)^2) sign v, 1],   F = low-pass filter

`q`, `v` and `a` are the filtered positions and their derivatives; columns that jump pass the filter too. Errors of sensors (sensors.py) are
not linear: steps of Gauss and Newton vary them and `beta` together.

Samples that are closer than the filter's memory are correlated. So the covariance has the sandwich form with the autocovariance of the
scores (Newey and West 1987):

    cov = A^-1 (G_0 + sum_l (1 - l/(L + 1)) (G_l + G_l')) A^-1,   A = W'W,   G_l = sum_k g_k g_(k+l)',   g_k = W_k' e_k
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..errors import InputError
from ..logs.log import Log
from .columns import columns_of, known_torque
from .fit import LogFit
from .samples import NAME, Samples, samples_of
from .sensors import Sensors, one_time

__all__ = ["inverse_fit"]

Array = NDArray[np.float64]

#: Number of lags of the autocovariance. The filter's memory has fewer samples.
LAGS = 8
#: Singular values below this fraction of the largest one count as zero, after the columns have the length one.
RANK = 1e-6
#: Largest number of steps for errors of sensors, and the size of the last step in deviations of white noise.
STEPS, SMALL = 30, 1e-3
#: Largest relative rise of the mean square in a step, and the smallest part of a step.
RISE, LEAST_SHARE = 1e-3, 1e-3


def inverse_fit(
    arm: _core.Arm, log: Log, kinds: Sequence[str], cutoff: float | None, speed: float, consistent: bool, delay: float
) -> LogFit:
    """Fit the `kinds` of parameters of an arm to the torques of a log, as `fit_log` describes."""
    one_time(kinds)
    fit = _Search(arm, log, kinds, cutoff, speed, delay).fit()
    if not consistent or "inertia" not in kinds:
        return fit
    possible = fit.arm.with_parameters(fit.arm.project_parameters(fit.arm.parameters))
    others = tuple(kind for kind in kinds if kind != "inertia")
    if others:
        return _Search(possible, log, others, cutoff, speed, delay).fit(fit)
    return _at(possible, samples_of(log, cutoff, delay), fit)


@dataclass(frozen=True)
class _Solution:
    """The least-squares solution of `W x = e` with the least change of the columns that are not independent."""

    values: Array
    #: Singular values, right singular vectors, and lengths of the weighted columns; `rank` of them are independent.
    sigma: Array
    V: Array
    lengths: Array
    rank: int


def _solved(W: Array, target: Array, noise: Array) -> _Solution:
    count, n, b = W.shape
    rows = (W / noise[:, None]).reshape(count * n, b)
    lengths = np.linalg.norm(rows, axis=0)
    lengths[lengths == 0.0] = 1.0
    # The triangle of the columns and the torque has all that the solution requires, in few rows.
    both = np.column_stack([rows / lengths, (target / noise).reshape(-1)])
    triangle: Array = np.asarray(np.linalg.qr(both, mode="r"))
    U, sigma, V = np.linalg.svd(triangle[:b, :b])
    rank = int(np.count_nonzero(sigma > RANK * sigma[0]))
    values = (V[:rank].T @ ((U[:, :rank].T @ triangle[:b, b]) / sigma[:rank])) / lengths
    return _Solution(values, sigma, V, lengths, rank)


def _noise(error: Array, samples: Samples) -> Array:
    # A joint that the model describes exactly has the noise of rounding.
    return np.asarray(np.maximum(np.sqrt(np.mean(error**2, axis=0)), 1e-12 * (1.0 + np.abs(samples.tau).max())))


class _Search:
    """The search for the parameters of an arm and the errors of the sensors."""

    def __init__(self, arm: _core.Arm, log: Log, kinds: Sequence[str], cutoff: float | None, speed: float, delay: float) -> None:
        self.arm, self.log, self.kinds, self.cutoff, self.speed = arm, log, tuple(kinds), cutoff, speed
        self.sensors = Sensors.start(kinds, arm.n, delay)
        self.raw = samples_of(log, cutoff, delay)
        self._prepare()

    def _prepare(self) -> None:
        """The samples, the columns of the arm and the torque that they explain, with the present sensors."""
        if self.sensors.moves:
            self.raw = samples_of(self.log, self.cutoff, self.sensors.delay)
        self.samples = self.sensors.corrected(self.raw)
        self.W, self.base, self.chosen, self.labels = columns_of(self.arm, self.samples, self.kinds, self.speed)
        self.target = self.samples.tau - known_torque(self.arm, self.samples, self.kinds)

    def model(self, values: Array) -> _core.Arm:
        return _model(self.arm, self.base, self.chosen, self.kinds, values, self.labels)

    def columns(self, values: Array, error: Array) -> Array:
        """The columns of all values, (K, n, b)."""
        if not self.sensors.kinds:
            return self.W
        sensors = self.sensors.columns(self.model(values), self.samples, self.kinds, self.samples.tau - error)
        return np.concatenate([self.W, sensors], axis=2)

    def linear(self) -> tuple[Array, Array]:
        """The parameters of the arm with the present sensors, and the noise of the joints, which is the weight."""
        noise = np.ones(self.arm.n)
        values = np.zeros(self.W.shape[2])
        for _ in range(2):
            if values.size:
                values = _solved(self.W, self.target, noise).values
            noise = _noise(self.target - self.W @ values, self.samples)
        return values, noise

    def improve(self, values: Array, noise: Array) -> tuple[Array, Array]:
        """Vary the sensors and the parameters of the arm together."""
        error = self.target - self.W @ values
        for _ in range(STEPS):
            columns = self.columns(values, error)
            change = _solved(columns, error, noise).values
            size = np.sqrt(np.sum((columns @ change / noise) ** 2) / columns.shape[2])
            before, sensors, cost = values, self.sensors, np.mean((error / noise) ** 2)
            share = 1.0
            while True:
                self.sensors = sensors.moved(share * change[values.size :])
                values = before + share * change[: before.size]
                self._prepare()
                error = self.target - self.W @ values
                if np.mean((error / noise) ** 2) <= cost * (1.0 + RISE) or share < LEAST_SHARE:
                    break
                share *= 0.5
            noise = _noise(error, self.samples)
            if size < SMALL or share < LEAST_SHARE:
                break
        return values, noise

    def fit(self, before: LogFit | None = None) -> LogFit:
        """The fit; `before` is that of an arm whose bodies were not possible."""
        count, n, b = self.W.shape
        b += len(self.sensors.values)
        if count * n <= 2 * b:
            raise InputError(f"{NAME}: log is too short: expected more than {2 * b // max(n, 1)} samples after the filter, got {count}")
        values, noise = self.linear()
        if self.sensors.kinds:
            values, noise = self.improve(values, noise)
        made, samples, error = self.model(values), self.samples, self.target - self.W @ values
        columns = self.columns(values, error)
        at = _solved(columns, error, noise)
        covariance, deviations = _accuracy(at, columns, error, noise)
        joints = self.arm.joint_names
        return LogFit(
            names=(*self.labels, *self.sensors.names(joints)), values=np.concatenate([values, self.sensors.values]), deviations=deviations,
            covariance=covariance, rank=at.rank, condition=float(at.sigma[0] / at.sigma[-1]) if at.rank == b else math.inf,
            residuals=np.sqrt(np.mean(error**2, axis=0)), model=made, arm=made, kinds=self.kinds, joints=self.log.names, t=samples.t,
            measured=samples.tau, residual=error, ranges=np.ptp(samples.q, axis=0), cutoff=samples.cutoff, log=self.log,
            stribeck_speed=self.speed, delay=self.sensors.delay, before=before,
        )  # fmt: skip


def _accuracy(at: _Solution, W: Array, error: Array, noise: Array) -> tuple[Array, Array]:
    """The covariance of the values, and their deviations: infinite for those that the log does not determine."""
    count, n, _ = W.shape
    rank = at.rank
    back = at.V[:rank].T / at.sigma[:rank] / at.lengths[:, None]
    scores = np.einsum("kjb,kj->kb", W / noise[:, None], error / noise) @ (back @ back.T)
    spread = scores.T @ scores
    for lag in range(1, min(LAGS, count - 1) + 1):
        shifted = scores[:-lag].T @ scores[lag:]
        spread += (1.0 - lag / (LAGS + 1)) * (shifted + shifted.T)
    covariance = spread * count * n / (count * n - rank)
    hidden = np.any(np.abs(at.V[rank:]) > 1e-3, axis=0)
    return covariance, np.where(hidden, np.inf, np.sqrt(np.maximum(np.diag(covariance), 0.0)))


def _at(arm: _core.Arm, samples: Samples, fit: LogFit) -> LogFit:
    """The fit with the projected model, whose residuals are computed again."""
    error = samples.tau - known_torque(arm, samples, ("projected",))
    return replace(fit, model=arm, arm=arm, residual=error, residuals=np.sqrt(np.mean(error**2, axis=0)))


def _model(arm: _core.Arm, base: Any, chosen: list[int], kinds: Sequence[str], values: Array, labels: Sequence[str]) -> _core.Arm:
    """The arm with the fitted parameters. Of all inertial parameters with these base parameters, those nearest to the arm's are taken."""
    n = arm.n
    drives = {kind: np.array(arm.limits[kind]) for kind in ("armature", "damping", "friction")}
    if chosen:
        joints = [drives["armature"]] * base.armature + [np.zeros(n)] * (2 * base.friction + base.offset)
        own = np.concatenate([arm.parameters, *joints])
        rows = base.projection[chosen]
        every = own + np.linalg.lstsq(rows, values[: len(chosen)] - rows @ own, rcond=None)[0]
        named = dict(zip(base.names, every, strict=True))
        arm = arm.with_parameters(every[: arm.parameters.size])
    else:
        named = dict(zip(labels, values, strict=True))
    for column, kind in (("armature", "rotors"), ("damping", "viscous"), ("friction", "coulomb")):
        if kind in kinds:
            drives[column] = np.array([named[f"{column}[{joint}]"] for joint in arm.joint_names])
    return arm.with_drives(**drives)
