"""The inverse fit: the parameters of an arm from the torques of a log.

    F[tau] = W beta + e,   W = base columns of [Y, diag(a), diag(v), sign v, exp(-(v/v_s)^2) sign v, 1],   F = low-pass filter

`q`, `v` and `a` are the filtered positions and their derivatives; columns that jump pass the filter too. Samples that are closer than the
filter's memory are correlated. So the covariance has the sandwich form with the autocovariance of the scores (Newey and West 1987):

    cov = A^-1 (G_0 + sum_l (1 - l/(L + 1)) (G_l + G_l')) A^-1,   A = W'W,   G_l = sum_k g_k g_(k+l)',   g_k = W_k' e_k
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..errors import InputError
from ..logs.log import Log
from .columns import columns_of, known_torque
from .fit import LogFit
from .samples import NAME, Samples, samples_of

__all__ = ["inverse_fit"]

Array = NDArray[np.float64]

#: Number of lags of the autocovariance. The filter's memory has fewer samples.
LAGS = 8
#: Singular values below this fraction of the largest one count as zero, after the columns have the length one.
RANK = 1e-6


def inverse_fit(
    arm: _core.Arm, log: Log, kinds: Sequence[str], cutoff: float | None, speed: float, consistent: bool, delay: float
) -> LogFit:
    """Fit the `kinds` of parameters of an arm to the torques of a log, as `fit_log` describes."""
    samples = samples_of(log, cutoff, delay)
    fit = _fitted(arm, samples, kinds, speed, log, delay)
    if not consistent or "inertia" not in kinds:
        return fit
    possible = fit.arm.with_parameters(fit.arm.project_parameters(fit.arm.parameters))
    others = tuple(kind for kind in kinds if kind != "inertia")
    return _fitted(possible, samples, others, speed, log, delay, fit) if others else _at(possible, samples, fit)


def _fitted(
    arm: _core.Arm, samples: Samples, kinds: Sequence[str], speed: float, log: Log, delay: float, before: LogFit | None = None
) -> LogFit:
    W, base, chosen, labels = columns_of(arm, samples, kinds, speed)
    target = samples.tau - known_torque(arm, samples, kinds)
    count, n, b = W.shape
    if count * n <= 2 * b:
        raise InputError(f"{NAME}: log is too short: expected more than {2 * b // max(n, 1)} samples after the filter, got {count}")
    noise = np.ones(n)
    for _ in range(2):
        rows = (W / noise[:, None]).reshape(count * n, b)
        lengths = np.linalg.norm(rows, axis=0)
        lengths[lengths == 0.0] = 1.0
        # The triangle of the columns and the torque has all that the solution requires, in few rows.
        both = np.column_stack([rows / lengths, (target / noise).reshape(-1)])
        triangle: Array = np.asarray(np.linalg.qr(both, mode="r"))
        U, sigma, V = np.linalg.svd(triangle[:b, :b])
        rank = int(np.count_nonzero(sigma > RANK * sigma[0]))
        values = (V[:rank].T @ ((U[:, :rank].T @ triangle[:b, b]) / sigma[:rank])) / lengths
        error = target - W @ values
        # A joint that the model describes exactly has the noise of rounding.
        noise = np.maximum(np.sqrt(np.mean(error**2, axis=0)), 1e-12 * (1.0 + np.abs(samples.tau).max()))
    back = V[:rank].T / sigma[:rank] / lengths[:, None]
    scores = np.einsum("kjb,kj->kb", W / noise[:, None], error / noise) @ (back @ back.T)
    spread = scores.T @ scores
    for lag in range(1, min(LAGS, count - 1) + 1):
        shifted = scores[:-lag].T @ scores[lag:]
        spread += (1.0 - lag / (LAGS + 1)) * (shifted + shifted.T)
    covariance = spread * count * n / (count * n - rank)
    hidden = np.any(np.abs(V[rank:]) > 1e-3, axis=0)
    deviations = np.where(hidden, np.inf, np.sqrt(np.maximum(np.diag(covariance), 0.0)))
    condition = float(sigma[0] / sigma[-1]) if rank == b else math.inf
    made = _model(arm, base, chosen, kinds, values, labels)
    moves = np.ptp(samples.q, axis=0)
    return LogFit(
        names=labels, values=values, deviations=deviations, covariance=covariance, rank=rank, condition=condition,
        residuals=np.sqrt(np.mean(error**2, axis=0)), model=made, arm=made, kinds=tuple(kinds), joints=log.names, t=samples.t,
        measured=samples.tau, residual=error, ranges=moves, cutoff=samples.cutoff, log=log, stribeck_speed=speed, delay=delay,
        before=before,
    )  # fmt: skip


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
