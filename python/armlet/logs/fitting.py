"""`fit_log`: the parameters of an arm from the torques of a log (inverse fit).

    F[tau] = W beta + e,   W = base columns of [Y, diag(a), diag(v), sign v, exp(-(v/v_s)^2) sign v, 1],   F = low-pass filter

`q`, `v` and `a` are the filtered positions and their derivatives; columns that jump pass the filter too. Samples that are closer than the
filter's memory are correlated. So the covariance has the sandwich form with the autocovariance of the scores (Newey and West 1987):

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
from ..arguments import choice, entries, instance, positive
from ..border import border
from ..errors import InputError
from .filters import low_pass, low_pass_rates
from .fit import LogFit
from .log import Log

__all__ = ["KINDS", "fit_log"]

Array = NDArray[np.float64]

_NAME = "fit_log"
#: The kinds of parameters, with the part of a column's name before the joint. Other columns are inertial parameters.
KINDS = ("inertia", "rotors", "viscous", "coulomb", "stribeck", "offsets")
_OF_COLUMN = {"armature": "rotors", "damping": "viscous", "friction": "coulomb", "stribeck": "stribeck", "offset": "offsets"}
#: The default cutoff, Hz, and the largest share of the sample rate.
CUTOFF, SHARE = 10.0, 0.1
#: Order of the filter, its memory in periods of the cutoff, and samples per period of the cutoff after decimation.
ORDER, MEMORY, DENSITY = 2, 2.0, 4.0
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

    Returns:
        A `LogFit`: `.values`, `.deviations`, `.unidentifiable`, `.correlated`, `.model`, `.residuals`.

    Raises:
        InputError: an argument is not valid, the log has no torques, or it is too short.

    Source: [gautier1992exciting]; docs/logs.md.

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
    arm, record = instance(_NAME, "model", model, _core.Arm, "an arm"), instance(_NAME, "log", log, Log, "an armlet.Log")
    kinds = tuple(choice(_NAME, "names", each, KINDS) for each in entries(_NAME, "names", names, 100))
    if not kinds or len(set(kinds)) < len(kinds):
        raise InputError(f"{_NAME}: names are not different: expected at least one kind, each once, got {list(kinds)}")
    if record.tau is None or record.n != arm.n:
        found = "no torques" if record.tau is None else f"{record.n} joints"
        raise InputError(f"{_NAME}: log does not fit the model: expected torques of {arm.n} joints, got {found}")
    speed = positive(_NAME, "stribeck_speed", stribeck_speed)
    instance(_NAME, "consistent", consistent, bool, "True or False")
    samples = _samples(record, None if cutoff is None else positive(_NAME, "cutoff", cutoff))
    fit = _fitted(arm, samples, kinds, speed, record.names)
    if not consistent or "inertia" not in kinds:
        return fit
    possible = fit.model.with_parameters(fit.model.project_parameters(fit.model.parameters))
    others = tuple(kind for kind in kinds if kind != "inertia")
    return _fitted(possible, samples, others, speed, record.names, fit) if others else _at(possible, samples, fit)


@dataclass(frozen=True)
class _Samples:
    """Filtered samples at a reduced rate, without gaps and ends."""

    t: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    #: Filter a column of the friction, (K, n), that is known at every sample of the log; the rows of the samples.
    speeds: Array
    rows: NDArray[np.intp]
    period: float
    cutoff: float

    def filtered(self, column: Array) -> Array:
        """The rows of the samples of a filtered column (K, n)."""
        return low_pass(column, self.period, self.cutoff, ORDER)[self.rows]


def _samples(log: Log, cutoff: float | None) -> _Samples:
    period = log.report.period
    if not len(log.t) > 2 or not period > 0.0:
        raise InputError(f"{_NAME}: log is too short: expected at least three samples, got {len(log.t)}")
    even = log.resample(period) if log.report.uneven or log.report.gaps or len(log.report.clock_jumps) else log
    frequency = min(CUTOFF, SHARE / period) if cutoff is None else cutoff
    if not frequency * period < 0.25:
        most = f"less than a quarter of the sample rate, {0.25 / period:g} Hz"
        raise InputError(f"{_NAME}: cutoff is too high: expected {most}, got {frequency:g}")
    assert even.tau is not None
    q, v, a = low_pass_rates(even.q, period, frequency, ORDER)
    tau = low_pass(even.tau, period, frequency, ORDER)
    memory = MEMORY / frequency
    used = (even.t >= even.t[0] + memory) & (even.t <= even.t[-1] - memory)
    for start, missing in log.report.gaps:
        used &= (even.t <= start - memory) | (even.t >= start + (missing + 1) * period + memory) | (missing <= 2)
    stride = max(1, math.floor(1.0 / (DENSITY * frequency * period)))
    rows = np.flatnonzero(used)[::stride]
    return _Samples(even.t[rows], q[rows], v[rows], a[rows], tau[rows], v, rows, period, frequency)


def _columns(arm: _core.Arm, samples: _Samples, kinds: Sequence[str], speed: float) -> tuple[Array, Any, list[int], tuple[str, ...]]:
    """The columns W, (K, n, b), the base parameters, the indices of its columns in W, and the names of all columns."""
    rubs = "viscous" in kinds or "coulomb" in kinds
    base = arm.base_parameters(armature="rotors" in kinds, friction=rubs, offset="offsets" in kinds)
    of_column = [_OF_COLUMN.get(name.partition("[")[0], "inertia") for name in base.names]
    if "inertia" in kinds:
        chosen = [int(k) for k, column in enumerate(base.columns) if of_column[column] in kinds]
        places, labels = [int(base.columns[k]) for k in chosen], [base.grouping[k] for k in chosen]
    else:
        # Without inertial parameters, every column of a joint is independent.
        chosen, places = [], [k for k, kind in enumerate(of_column) if kind in kinds]
        labels = [base.names[k] for k in places]
    full = arm.regressor(samples.q, samples.v, samples.v, samples.a, armature=base.armature, friction=base.friction, offset=base.offset)
    n = arm.n
    first = {kind: of_column.index(kind) for kind in ("coulomb",) if kind in of_column}
    if "coulomb" in first:
        full[:, np.arange(n), first["coulomb"] + np.arange(n)] = samples.filtered(np.sign(samples.speeds))
    W = full[..., places]
    if "stribeck" in kinds:
        extra = samples.filtered(np.exp(-((samples.speeds / speed) ** 2)) * np.sign(samples.speeds))
        W = np.concatenate([W, np.eye(n) * extra[:, None, :]], axis=2)
        labels += [f"stribeck[{name}]" for name in arm.joint_names]
    return W, base, chosen, tuple(labels)


def _known(arm: _core.Arm, samples: _Samples, kinds: Sequence[str]) -> Array:
    """The torque of the parameters that are not fitted: rotors, and all bodies without "inertia". Friction that is not fitted is zero."""
    n, still = arm.n, np.zeros(arm.n)
    rotors = np.zeros_like(samples.a) if "rotors" in kinds else np.array(arm.limits["armature"]) * samples.a
    if "inertia" in kinds:
        return rotors
    bare = arm.with_drives(armature=still) if n else arm
    return np.asarray(bare.inverse_dynamics(samples.q, samples.v, samples.a) + rotors)


def _fitted(
    arm: _core.Arm, samples: _Samples, kinds: Sequence[str], speed: float, joints: tuple[str, ...], before: LogFit | None = None
) -> LogFit:
    W, base, chosen, labels = _columns(arm, samples, kinds, speed)
    target = samples.tau - _known(arm, samples, kinds)
    count, n, b = W.shape
    if count * n <= 2 * b:
        raise InputError(f"{_NAME}: log is too short: expected more than {2 * b // max(n, 1)} samples after the filter, got {count}")
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
        residuals=np.sqrt(np.mean(error**2, axis=0)), model=made, kinds=tuple(kinds), joints=joints, t=samples.t, measured=samples.tau,
        residual=error, ranges=moves, cutoff=samples.cutoff, before=before,
    )  # fmt: skip


def _at(arm: _core.Arm, samples: _Samples, fit: LogFit) -> LogFit:
    """The fit with the projected model, whose residuals are computed again."""
    error = samples.tau - _known(arm, samples, ("projected",))
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
