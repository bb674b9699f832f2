"""The time derivative pi_hat_dot of an estimate of inertial parameters, from y = Y's. Y is the regressor, s the sliding variable, and ' the
transpose.

    all parameters,        pi_hat_dot = Gamma y
    or a base set
    natural metric         pi_hat_dot = gamma G(pi_hat)^-1 y,  G_kl = tr(P^-1 E_k P^-1 E_l), body by body     (Lee, Kwon and Park 2018)
                           distance  d(P || P_hat) = log(det P_hat / det P) + tr(P_hat^-1 P) - 4
    projection             pi_hat_dot = Gamma (y - c g),   Z_k = R_k P_k R_k - 1 with R_k = (P_k^min)^-1/2,   N_k the negative part of Z_k,
                           f^2 = sum_k of the squared Frobenius norm of N_k,   g_j = sum_k tr(R_k N_k R_k E_j),
                           c = [min(1, 2 f) max(0, g'Gamma y) + 10 f^2] / g'Gamma g               (Pomet and Praly 1992)

Gamma and gamma are adaptation gains. P is the pseudo-inertia of a body with the estimated parameters pi_hat; for the planar PR arm it is
[[A, B], [B, C]]. E_j is the P of a body whose parameter j is 1 and whose others are 0. P_k^min is the pseudo-inertia of the smallest body
k that the projection allows. If P_k >= P_k^min at the start, then P_k >= P_k^min / 2 at all times.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from .inertia import PSEUDO, parameters_of
from .lagrange import Array, solve

LAYER = 0.5  # the value of f at which the correction of the rate reaches its full size
PULL = 10.0  # the factor 10 of f^2 in c: the rate, 1/s, at which an estimate below the smallest bodies returns to them
DISTANCE = 0.1  # root mean square distance, m, of a smallest body of given mass from each plane through its centre
PR = np.array([[[1.0, 0.0], [0.0, 0.0]], [[0.0, 1.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 1.0]]])


def _basis(p: int) -> Array:
    """The matrices E_j of a body: (3, 2, 2) for the planar PR arm, otherwise (10, 4, 4)."""
    return PR if p == 3 else PSEUDO


def _bodies(pi: Array) -> Array:
    """The pseudo-inertias P of all bodies, (bodies, 4, 4) or (1, 2, 2)."""
    E = _basis(pi.size)
    return np.asarray(np.einsum("bp,pij->bij", pi.reshape(-1, len(E)), E))


def _spectral(A: Array, f: Callable[[Array], Array]) -> Array:
    """The function f of symmetric matrices A, computed with their eigenvalues."""
    values, U = np.linalg.eigh(A)
    return np.asarray((U * f(values)[..., None, :]) @ np.swapaxes(U, -1, -2))


def _negative(A: Array) -> Array:
    """The negative parts of symmetric matrices: positive eigenvalues are replaced by zero."""
    return _spectral(A, lambda x: np.minimum(x, 0.0))


def natural_rate(estimate: Array, y: Array, gamma: Array) -> Array:
    """The rates gamma G^-1 y of the estimates of all bodies, (10 * bodies,). Here y = Y's, gamma (bodies,), G_kl = tr(P^-1 E_k P^-1 E_l).

    P is the pseudo-inertia of the estimate of a body. E_k is the pseudo-inertia of the parameter k alone.
    """
    rates = []
    for P, push, speed in zip(_bodies(estimate), y.reshape(-1, 10), gamma, strict=True):
        turned = np.linalg.solve(P, PSEUDO)
        rates.append(speed * solve(np.einsum("kij,lji->kl", turned, turned), push))
    return np.concatenate(rates)


def divergence(pi: Array, estimate: Array) -> Array:
    """The distance d(P || P_hat) = log(det P_hat / det P) + tr(P_hat^-1 P) - 4 of the pseudo-inertias of pi and the estimate, by body."""
    P, P_hat = _bodies(pi), _bodies(estimate)
    logs = np.linalg.slogdet(P_hat)[1] - np.linalg.slogdet(P)[1]
    return np.asarray(logs + np.trace(np.linalg.solve(P_hat, P), axis1=-2, axis2=-1) - 4.0)


def least_bodies(projection: ArrayLike, p: int) -> Array:
    """The parameters (p,) of the smallest allowed bodies. `projection` contains these parameters, or it is one mass in kg."""
    given = np.asarray(projection, dtype=np.float64)
    if given.ndim:
        return given
    second = float(given) * DISTANCE**2
    if p == 3:
        return np.array([float(given), 0.0, second])
    return np.tile(parameters_of(np.diag([second] * 3 + [float(given)])), p // 10)


def nearest_start(estimate: Array, least: Array) -> Array:
    """The estimate, projected to P >= P^min in the metric of P^min."""
    root, inverse = (_spectral(_bodies(least), f) for f in (np.sqrt, lambda x: x**-0.5))
    negative = _negative(inverse @ _bodies(estimate) @ inverse - np.eye(root.shape[-1]))
    raised = _bodies(estimate) - root @ negative @ root
    if estimate.size == 3:
        return np.array([raised[0, 0, 0], raised[0, 0, 1], raised[0, 1, 1]])
    # A body that already satisfies P >= P^min keeps its bits.
    kept = [
        body if not np.any(below) else parameters_of(P) for body, below, P in zip(estimate.reshape(-1, 10), negative, raised, strict=True)
    ]
    return np.concatenate(kept)


def projected_rate(gamma: Array, estimate: Array, y: Array, least: Array) -> Array:
    """The rate Gamma (y - c g) of the estimate, with y = Y's. The correction c g limits how far P falls below P^min.

    `least` contains the parameters of the smallest bodies, with the pseudo-inertias P^min.
    """
    beside = np.zeros(y.size - least.size)
    estimate = estimate[: least.size]
    inverse = _spectral(_bodies(least), lambda x: x**-0.5)
    negative = _negative(inverse @ _bodies(estimate) @ inverse - np.eye(inverse.shape[-1]))
    square = float(np.sum(negative**2))
    if square <= 1e-200:
        return np.asarray(gamma @ y)
    g = np.einsum("bij,pji->bp", inverse @ negative @ inverse, _basis(estimate.size)).reshape(-1)
    g = np.concatenate([g, beside])
    share = min(1.0, np.sqrt(square) / LAYER)
    c = (share * max(0.0, float(g @ gamma @ y)) + PULL * square) / float(g @ gamma @ g)
    return np.asarray(gamma @ (y - c * g))
