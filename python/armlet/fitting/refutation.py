"""Tests of the assumptions of an inverse fit with its residual.

    e = C gamma + noise,   C orthogonal to the columns W of the fit,   F = gamma' S V^-1 S gamma / d,   S = C'C

`C` has the d columns that an assumption would leave if it were wrong, and `V` is the covariance of the sum of their scores. Of the
assumptions that Holm's correction refutes, the one that explains most of the residual is the first entry. Its columns join those of the
fit, and the tests are repeated. So a later entry states what the earlier ones do not explain.

Two more tests concern the residual itself: its correlation at lags beyond the filter's memory (Ljung and Box 1978), and its power.
The power is balanced if its mean is zero in each part of the log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .assumptions import Assumption
from .samples import DENSITY, MEMORY
from .statistics import covariance_of_sum, f_tail, holm

__all__ = ["BLOCK_LAGS", "LAGS", "LEVEL", "Finding", "Residual", "refute"]

Array = NDArray[np.float64]

#: Family level of the tests.
LEVEL = 0.05
#: Number of lags of the covariance of scores: of filtered samples, and of blocks. Both are longer than the memory of the samples.
LAGS, BLOCK_LAGS = 8, 4
#: A column whose part outside of the fitted columns is shorter than this fraction belongs to the span of the fit.
SPAN = 0.03
#: Number of lags of the test of whiteness, and of parts of the log in the test of power.
WHITE, PARTS = 5, 8


@dataclass(frozen=True)
class Finding:
    """A refuted assumption, without words."""

    name: str
    joint: int | None
    p_value: float
    statistic: float
    #: Share of the residual's sum of squares that the columns explain: of the joint, or of the whole arm.
    share: float
    #: Coefficients of the columns, (d,), their standard deviations, and the value of the best alternative.
    size: tuple[float, ...] = ()
    deviation: tuple[float, ...] = ()
    value: float | None = None


class Residual:
    """The residual of a fit, (K, n), in units of its noise, and an orthonormal basis of the fitted columns.

    It is correlated over at most `lags` samples.
    """

    def __init__(self, W: Array, error: Array, noise: Array, lags: int) -> None:
        self.noise, self.lags = noise, lags
        self.error = error / noise
        rows = (W / noise[:, None]).reshape(error.size, -1)
        lengths = np.linalg.norm(rows, axis=0)
        U, sigma, _ = np.linalg.svd(rows / np.where(lengths > 0.0, lengths, 1.0), full_matrices=False)
        self.basis: Array = U[:, sigma > 1e-6 * sigma[:1]]

    def outside(self, alternatives: Sequence[Array]) -> list[Array | None]:
        """The independent columns (K, n, d) of the part of each alternative that is orthogonal to the fit; None if all are in its span."""
        flat = (np.concatenate(alternatives, axis=2) / self.noise[:, None]).reshape(self.error.size, -1)
        length = np.linalg.norm(flat, axis=0)
        flat = flat / np.where(length > 0.0, length, 1.0)
        flat -= self.basis @ (self.basis.T @ flat)
        ends = np.cumsum([each.shape[2] for each in alternatives])[:-1]
        return [self._independent(part, scale) for part, scale in zip(np.split(flat, ends, axis=1), np.split(length, ends), strict=True)]

    def _independent(self, flat: Array, scale: Array) -> Array | None:
        squares, V = np.linalg.eigh(flat.T @ flat)
        kept = squares > SPAN**2
        if not kept.any():
            return None
        # Columns that are independent keep their units.
        return np.asarray((flat * scale if kept.all() else flat @ V[:, kept]).reshape(*self.error.shape, -1))

    def explained(self, outside: Array) -> float:
        """The reduction of the sum of squares by columns that are orthogonal to the fit."""
        flat = outside.reshape(self.error.size, -1)
        score = flat.T @ self.error.reshape(-1)
        return float(score @ np.linalg.solve(flat.T @ flat, score))

    def add(self, outside: Array) -> None:
        """Fit the columns too."""
        flat = outside.reshape(self.error.size, -1)
        U, sigma, _ = np.linalg.svd(flat, full_matrices=False)
        U = U[:, sigma > 1e-9 * sigma[:1]]
        self.basis = np.column_stack([self.basis, U])
        self.error = self.error - (U @ (U.T @ self.error.reshape(-1))).reshape(self.error.shape)


@dataclass(frozen=True)
class _Test:
    """The result of a test of an assumption: the best alternative, and the reduction of the sum of squares without what noise explains."""

    assumption: Assumption
    finding: Finding
    reduction: float
    outside: Array


def refute(residual: Residual, candidates: Sequence[Assumption], speeds: Array) -> tuple[list[Finding], list[Assumption]]:
    """The refuted assumptions, and those in the span of the fitted columns. `speeds` are the velocities, (K, n)."""
    tests = [_tested(residual, each) for each in candidates]
    hidden = [each for each, test in zip(candidates, tests, strict=True) if test is None]
    left = [test for test in tests if test is not None]
    findings: list[Finding] = []
    family = 0
    while True:
        general = _general(residual, speeds)
        family = max(family, len(left) + len(general))
        p = [test.finding.p_value for test in left] + [each.p_value for each in general]
        judged = holm(p + [1.0] * (family - len(p)), LEVEL)
        bad = [test for test, is_bad in zip(left, judged, strict=False) if is_bad]
        if not bad:
            rest = judged[len(left) : len(p)]
            return findings + [each for each, is_bad in zip(general, rest, strict=True) if is_bad], hidden
        groups = {test.finding.name: [other for other in bad if other.finding.name == test.finding.name] for test in bad}
        name = max(groups, key=lambda each: sum(test.reduction for test in groups[each]))
        chosen = sorted(groups[name], key=lambda test: -test.reduction)
        findings += [test.finding for test in chosen]
        for test in chosen:
            residual.add(test.outside)
        again = (_tested(residual, test.assumption) for test in left if test.finding.name != name)
        left = [test for test in again if test is not None]


def _tested(residual: Residual, assumption: Assumption) -> _Test | None:
    """Test an assumption. The probability of the best of several alternatives is multiplied with their number."""
    outside = residual.outside(assumption.columns)
    found = [(residual.explained(each), k) for k, each in enumerate(outside) if each is not None]
    if not found:
        return None
    _, k = max(found)
    best = outside[k]
    assert best is not None
    return _wald(residual, assumption, k, best)


def _wald(residual: Residual, assumption: Assumption, k: int, outside: Array) -> _Test:
    count, n, d = outside.shape
    flat = outside.reshape(count * n, d)
    S = flat.T @ flat
    score = flat.T @ residual.error.reshape(-1)
    if assumption.slopes:
        # The column has the measured torque, whose noise is part of the residual.
        noise = residual.error - outside[:, :, 0] * (score / S[0, 0])
        score = score - np.sum(np.mean(noise**2, axis=0) * assumption.slopes[k])
    gamma = np.linalg.solve(S, score)
    left = residual.error - outside @ gamma
    V = covariance_of_sum(np.einsum("kjd,kj->kd", outside, left), residual.lags)
    covariance = np.linalg.solve(S, np.linalg.solve(S, V).T)
    deviation = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    # Scaled columns keep the solution accurate.
    correlation = covariance / np.outer(deviation, deviation)
    scaled = gamma / deviation
    statistic = float(scaled @ np.linalg.pinv(correlation, hermitian=True) @ scaled) / d
    p = min(1.0, _tail(statistic, np.linalg.norm(outside, axis=1), residual.lags) * len(assumption.columns))
    explained = float(gamma @ S @ gamma)
    joint = assumption.joint
    whole = float(np.sum(residual.error**2) if joint is None else np.sum(residual.error[:, joint] ** 2))
    value = assumption.values[k] if assumption.values else None
    share = min(1.0, max(0.0, explained / max(whole, 1e-300)))
    finding = Finding(assumption.name, joint, p, statistic, share, tuple(gamma.tolist()), tuple(deviation.tolist()), value)
    return _Test(assumption, finding, explained - float(np.trace(np.linalg.solve(S, V))), outside)


def _general(residual: Residual, speeds: Array) -> list[Finding]:
    """The tests of whiteness of each joint, and of the power balance of the arm."""
    error = residual.error
    step = round(MEMORY * DENSITY)
    found = []
    for j in range(error.shape[1]):
        lags = [step * (k + 1) for k in range(WHITE) if step * (k + 2) < len(error) // 2]
        if not lags:
            continue
        products = np.stack([np.concatenate([error[lag:, j] * error[:-lag, j], np.zeros(lag)]) for lag in lags], axis=1)
        found.append(_chi(residual, "whiteness", j, products))
    scale = residual.noise / residual.noise.max()
    power = np.sum(error * scale * speeds, axis=1)
    part = np.arange(len(power)) * PARTS // max(len(power), 1)
    sums = np.stack([np.where(part == k, power, 0.0) for k in range(PARTS)], axis=1)
    return [*found, _chi(residual, "power", None, sums)]


def _chi(residual: Residual, name: str, joint: int | None, scores: Array) -> Finding:
    """Whether the sums of scores (K, d) are zero."""
    total, V = scores.sum(axis=0), covariance_of_sum(scores, residual.lags)
    statistic = float(total @ np.linalg.pinv(V, hermitian=True) @ total) / scores.shape[1]
    return Finding(name, joint, _tail(statistic, np.ones_like(scores), residual.lags), statistic, 0.0)


def _tail(statistic: float, scores: Array, lags: int) -> float:
    """The probability of a larger statistic of scores (K, d), as that of Hotelling, because their covariance is estimated.

    Scores that are large in a part of the log count as fewer samples, by the participation ratio of their squares. The factor 1.5 counts
    the samples of a sinusoid fully.
    """
    squares, d = np.sum(scores**2, axis=1), scores.shape[1]
    count = min(float(len(scores)), 1.5 * float(np.sum(squares) ** 2 / max(float(np.sum(squares**2)), 1e-300)))
    degrees = max(d + 2.0, count / (lags * 4.0 / 3.0))
    left = degrees - d + 1.0
    return f_tail(statistic * left / degrees, d, left)
