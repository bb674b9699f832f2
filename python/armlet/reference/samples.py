"""Samples for concurrent learning, written from the equations (Chowdhary and Johnson 2010; Parikh, Kamalapurkar and Dixon 2019).

samples   W_j = Y(q_j, v_j, v_j, a_j), tau_j the torque without the torque of known rotors
windows   W_j = [Y_M] + int Y_D dt,  [Y_M] the change of Y_M over the window,  M v = Y_M pi,  g - C' v = Y_D pi,
          Y_D = Y(q, v, v, 0) - d/dt Y_M(q, v fixed);   Simpson's rule, and dM/dt v by differences
selection a chosen sample is replaced by another sample   while this increases sigma_r of the stacked chosen W_j

Y is the regressor, pi are the parameters, and ' is the transpose. sigma_r is the r-th largest singular value, with the rank r of the
stacked W_j of all samples.
"""

from typing import Any

import numpy as np

from .adaptive import columns
from .lagrange import Array

STEP = 1e-4


def sample_rows(law: Any, q: Array, v: Array, a: Array, tau: Array) -> tuple[Array, Array]:
    """The regressors W (K, n, p) of samples with the accelerations `a`, and the torques (K, n) without the torque of known rotors."""
    arm = law.arm
    rows = [
        np.hstack([arm.regressor(*state, state[1], x)[:, law.columns], columns(state[1], x, law.v_s, law.kinds)])
        for state, x in zip(zip(q, v, strict=True), a, strict=True)
    ]
    known = np.zeros_like(a) if "armature" in law.kinds else arm.armature * a
    return np.array(rows), tau - known


def _momentum(law: Any, q: Array, v: Array) -> Array:
    still = np.zeros_like(v)
    arm = law.arm
    return np.asarray((arm.regressor(q, still, still, v) - arm.regressor(q, still, still, still))[:, law.columns])


def _drift(law: Any, q: Array, v: Array) -> Array:
    """The regressor columns of g - C' v, which are the columns of C v + g minus the columns of dM/dt v. Here C' is the transpose."""
    moved = [_momentum(law, q + k * STEP * v, v) for k in (-2, -1, 1, 2)]
    rate = (moved[0] - 8.0 * moved[1] + 8.0 * moved[2] - moved[3]) / (12.0 * STEP)
    return np.asarray(law.arm.regressor(q, v, v, np.zeros_like(v))[:, law.columns] - rate)


def window_rows(law: Any, t: Array, q: Array, v: Array, tau: Array, window: float, held: bool = False) -> tuple[Array, Array]:
    """W and tau, integrated over windows of the length `window`, s. Successive windows overlap by half.

    If `held`, tau is constant between two records.
    """
    h = float(t[1] - t[0])
    half = max(1, round(0.5 * window / h))
    simpson = np.ones(2 * half + 1)
    simpson[1:-1:2], simpson[2:-1:2] = 4.0, 2.0
    held_weights = np.r_[np.full(2 * half, h), 0.0]
    armature = law.arm.armature if "armature" not in law.kinds else np.zeros(law.arm.n)
    rows, torques = [], []
    for first in range(0, len(t) - 2 * half, half):
        at = range(first, first + 2 * half + 1)
        inertial = _momentum(law, q[at[-1]], v[at[-1]]) - _momentum(law, q[first], v[first])
        inertial = inertial + sum(w * h / 3.0 * _drift(law, q[k], v[k]) for w, k in zip(simpson, at, strict=True))
        of_joints = np.zeros((law.arm.n, law.arm.n * len(law.kinds)))
        for w, k in zip(simpson, at, strict=True):
            entries = columns(v[k], np.zeros(law.arm.n), law.v_s, law.kinds)
            of_joints += w * h / 3.0 * entries
        gained = v[at[-1]] - v[first]
        of_joints += columns(np.zeros(law.arm.n), gained, law.v_s, law.kinds, 0.0)
        rows.append(np.hstack([inertial, of_joints]))
        weights = held_weights if held else simpson * h / 3.0
        torques.append(weights @ tau[first : at[-1] + 1] - armature * gained)
    return np.array(rows), np.array(torques)


def stacked(W: Array) -> Array:
    """The rows of all samples, (N n, p)."""
    return W.reshape(-1, W.shape[-1])


def smallest(W: Array, chosen: Any, rank: int) -> float:
    """The `rank`-th largest singular value of the stacked rows of the chosen samples."""
    return float(np.linalg.svd(stacked(W[list(chosen)]), compute_uv=False)[rank - 1])


def select(W: Array, count: int) -> tuple[list[int], float]:
    """The indices of `count` samples, and the r-th largest singular value of their stacked rows. r is the rank of all rows.

    Replacing one of these samples by another sample does not increase this singular value.
    """
    rank = int(np.linalg.matrix_rank(stacked(W), tol=1e-6 * np.linalg.norm(stacked(W), 2)))
    chosen = list(range(count))
    best = smallest(W, chosen, rank)
    better = True
    while better:
        better = False
        for k in range(count):
            for j in set(range(len(W))) - set(chosen):
                trial = [*chosen[:k], j, *chosen[k + 1 :]]
                found = smallest(W, trial, rank)
                if found > best * (1.0 + 1e-9):
                    chosen, best, better = trial, found, True
    return sorted(chosen), best
