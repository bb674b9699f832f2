"""`fit_log`: the parameters of an arm from the torques of a log (inverse fit).

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
from ..arguments import choice, entries, instance, number, positive
from ..border import border
from ..errors import InputError
from ..logs.log import Log
from .columns import KINDS, columns_of, known_torque
from .fit import LogFit
from .samples import NAME, Samples, samples_of

__all__ = ["fit_log"]

Array = NDArray[np.float64]

#: Number of lags of the autocovariance. The filter's memory has fewer samples.
LAGS = 8
#: Singular values below this fraction of the largest one count as zero, after the columns have the length one.
RANK = 1e-6


@border
def fit_log(
    model: _core.Arm,
    log: Log,
    names: Sequence[str] = ("inertia", "rotors", "viscous", "coulomb", "offsets"),
    *,
    cutoff: float | None = None,
    stribeck_speed: float = 0.1,
    consistent: bool = False,
    delay: float = 0.0,
) -> LogFit:
    """Fit the parameters of an arm to the measured torques of a log.

    Positions and torques pass the same filter without phase, and velocities and accelerations are derivatives of the filtered positions. So
    the log requires only positions and torques. Gaps of the log, and both ends, are omitted.

    Args:
        model: the arm. Parameters that are not fitted keep its values.
        log: the log, with torques.
        names: kinds of parameters: "inertia" (base parameters), "rotors", "viscous", "coulomb" and "stribeck" friction, and "offsets" of
            the torques.
        cutoff: cutoff frequency of the filter, Hz; the smaller of 10 Hz and a tenth of the sample rate if None (keyword only).
        stribeck_speed: `v_s` of "stribeck", rad/s or m/s (keyword only).
        consistent: whether the inertial parameters of `fit.model` are projected on physically possible ones (keyword only). Then the other
            parameters are fitted again.
        delay: time from the record of a torque to its effect, s (keyword only).

    Returns:
        A `LogFit`: `.values`, `.deviations`, `.refuted`, `.unidentifiable`, `.correlated`, `.model`, `.residuals`.

    Raises:
        InputError: an argument is not valid, the log has no torques, or it is too short.

    Source: [gautier1992exciting]; docs/fit.md.

    >>> import numpy as np
    >>> import armlet as al
    >>> arm = al.planar_arm([0.5, 0.4])
    >>> t = np.arange(0.0, 20.0, 0.005)
    >>> q, v, a = al.Sinusoid([0.0, 0.0], [1.0, 1.2], [1.3, 2.1], [0.0, 1.0])(t)
    >>> tau = arm.with_drives(damping=[0.8, 0.5]).inverse_dynamics(q, v, a, friction=True)
    >>> fit = al.fit_log(arm, al.Log(t, q, tau=tau, names=arm.joint_names), ("inertia", "viscous"))
    >>> fit.model.limits["damping"].round(3)
    array([0.8, 0.5])
    """
    arm, record = instance(NAME, "model", model, _core.Arm, "an arm"), instance(NAME, "log", log, Log, "an armlet.Log")
    kinds = tuple(choice(NAME, "names", each, KINDS) for each in entries(NAME, "names", names, 100))
    if not kinds or len(set(kinds)) < len(kinds):
        raise InputError(f"{NAME}: names are not different: expected at least one kind, each once, got {list(kinds)}")
    if record.tau is None or record.n != arm.n:
        found = "no torques" if record.tau is None else f"{record.n} joints"
        raise InputError(f"{NAME}: log does not fit the model: expected torques of {arm.n} joints, got {found}")
    speed = positive(NAME, "stribeck_speed", stribeck_speed)
    instance(NAME, "consistent", consistent, bool, "True or False")
    late = number(NAME, "delay", delay)
    if not math.isfinite(late):
        raise InputError(f"{NAME}: delay is not finite: expected a finite number, got {late}")
    samples = samples_of(record, None if cutoff is None else positive(NAME, "cutoff", cutoff), late)
    fit = _fitted(arm, samples, kinds, speed, record, late)
    if not consistent or "inertia" not in kinds:
        return fit
    possible = fit.model.with_parameters(fit.model.project_parameters(fit.model.parameters))
    others = tuple(kind for kind in kinds if kind != "inertia")
    return _fitted(possible, samples, others, speed, record, late, fit) if others else _at(possible, samples, fit)


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
        residuals=np.sqrt(np.mean(error**2, axis=0)), model=made, kinds=tuple(kinds), joints=log.names, t=samples.t, measured=samples.tau,
        residual=error, ranges=moves, cutoff=samples.cutoff, log=log, stribeck_speed=speed, delay=delay,
        before=before,
    )  # fmt: skip


def _at(arm: _core.Arm, samples: Samples, fit: LogFit) -> LogFit:
    """The fit with the projected model, whose residuals are computed again."""
    error = samples.tau - known_torque(arm, samples, ("projected",))
    return replace(fit, model=arm, residual=error, residuals=np.sqrt(np.mean(error**2, axis=0)))


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
