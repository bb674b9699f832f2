"""The parameters that the motion of an arm determines, and their estimate from a record of motion and torque.

    tau = M(q) a + C(q, v) v + g(q) determines the same combinations of pi as M(q; pi) and g(q; pi), because C has only derivatives of M:
        W z = 0,  W = rows M_ij(q; e_k) and g_i(q; e_k) at random q,  z = null space of W by SVD             (Gautier 1991)
    column j depends on earlier columns if the last nonzero entry of some null vector is j:   reduced echelon form R from the back,
        W_j = -sum_k R_jk W_k over the remaining columns k,   so  Y = Y_b P,  P_kj = -R_jk,  P_kk = 1
    record:  Y_b beta = tau over all samples at once.  With rows and tau divided by the noise, and N = diag(norms of the columns of Y_b):
        Y_b N^-1 = U S V',   beta = N^-1 V S^-1 U' tau,   sigma^2 = |tau - Y_b beta|^2 / (rows - rank),
        cov = sigma^2 N^-1 V S^-2 V' N^-1                                                                   (Gautier and Khalil 1992)
    all parameters:  the smallest change of the arm's pi with P pi = beta, by least squares

pi are the parameters, and in e_k parameter k is 1 and all others are 0. Y is the regressor, Y_b has its remaining columns, and beta are the
base parameters. The noise is the standard deviation of each torque. ' is the transpose.

The core stacks torques at random states, and removes dependent columns one by one. It processes a record block by block.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array, Mechanism

DEPENDENT = 1e-9  # singular values of a null basis or of scaled columns below this count as zero
HIDDEN = 1e-3  # a parameter counts as unidentified if its component in an undetermined direction is larger than this


class BaseParameters(NamedTuple):
    """Indices of the independent columns of the regressor, (b,); the matrix P, (b, p); the base parameters of the arm, (b,)."""

    columns: Any
    projection: Array
    values: Array


class Identification(NamedTuple):
    """Estimates and deviations (b,), covariance (b, b), rank, condition, singular values (b,), residuals (n,), all parameters (p,)."""

    base: BaseParameters
    values: Array
    deviations: Array
    covariance: Array
    rank: int
    condition: float
    singular_values: Array
    residuals: Array
    parameters: Array


def _traces(arm: Mechanism, armature: bool, friction: bool, offset: bool) -> Array:
    """The matrix W: for each parameter, a column with its contributions to M, to g and to both kinds of friction at random q."""
    n, p = arm.n, arm.parameters.size
    places = np.random.default_rng(1991).uniform(-3.0, 3.0, (2 + 3 * p // n, n))
    lower = np.tril_indices(n)
    shown = [np.vstack([at.mass[:, *lower].T, at.gravity.T]) for at in (arm._expand(q) for q in places)]
    W = np.vstack(shown)
    if armature:
        # The inertia of a rotor is a constant entry on the diagonal of M.
        rotor = np.vstack([(np.eye(n)[:, None] * np.eye(n))[lower], np.zeros((n, n))])
        W = np.hstack([W, np.tile(rotor, (len(places), 1))])
    if friction:
        W = np.block([[W, np.zeros((W.shape[0], 2 * n))], [np.zeros((2 * n, W.shape[1])), np.eye(2 * n)]])
    if offset:
        # A torque offset is a constant of g.
        constant = np.vstack([np.zeros((lower[0].size, n)), np.eye(n)])
        column = np.tile(constant, (len(places), 1))
        W = np.hstack([W, np.vstack([column, np.zeros((W.shape[0] - len(column), n))])])
    return W


def _drives(arm: Mechanism, armature: bool, friction: bool, offset: bool) -> Array:
    drives = [arm.armature] * armature + [arm.damping, arm.friction] * friction + [np.zeros(arm.n)] * offset
    return np.concatenate([arm.parameters, *drives])


def _rank(rows: Array) -> int:
    return int(np.count_nonzero(np.linalg.svd(rows, compute_uv=False) > DEPENDENT)) if rows.size else 0


def base_parameters(arm: Mechanism, *, armature: bool = False, friction: bool = False, offset: bool = False) -> BaseParameters:
    """The smallest set of combinations of parameters that determines the arm's motion.

    A column of the regressor that depends on earlier columns is dropped.
    """
    W = _traces(arm, armature, friction, offset)
    lengths = np.linalg.norm(W, axis=0)
    lengths[lengths <= 1e-12 * lengths.max()] = np.inf  # a column without effect becomes zero
    # V is square; the other factor of a tall matrix, with a column for each row, is not needed.
    _, sigma, V = np.linalg.svd(W / lengths, full_matrices=W.shape[0] < W.shape[1])
    null = V[np.count_nonzero(sigma > DEPENDENT) :]
    p = null.shape[1]
    ranks = [_rank(null[:, j:]) for j in range(p + 1)]
    gone = [j for j in range(p) if ranks[j] > ranks[j + 1]]
    stay = [j for j in range(p) if j not in gone]
    echelon = np.linalg.solve(null[:, gone], null) if gone else np.zeros((0, p))
    projection = np.zeros((len(stay), p))
    projection[np.arange(len(stay)), stay] = 1.0
    scale = np.where(np.isinf(lengths), 0.0, lengths)
    projection[:, gone] = -(echelon[:, stay] * scale[gone][:, None] / lengths[stay]).T
    return BaseParameters(np.array(stay), projection, projection @ _drives(arm, armature, friction, offset))


def identify(
    arm: Mechanism,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    tau: ArrayLike,
    *,
    armature: bool = False,
    friction: bool = False,
    noise: ArrayLike | None = None,
    cutoff: float = 1e-6,
    offset: bool = False,
) -> Identification:
    """Estimate base parameters from samples (..., n) of motion and torque, by one dense least-squares problem.

    With `armature`, `friction` and `offset` these parameters of the joints are estimated too. `noise` has the standard deviations of the
    torques, (n,), N m or N. Singular values below `cutoff` times the largest one are dropped.
    """
    q, v, a, tau = (np.asarray(x, dtype=np.float64).reshape(-1, arm.n) for x in (q, v, a, tau))
    base = base_parameters(arm, armature=armature, friction=friction, offset=offset)
    known = tau if armature else tau - arm.armature * a
    Y = arm.regressor(q, v, v, a, armature=armature, friction=friction, offset=offset)[..., base.columns]
    weights = np.broadcast_to(1.0 if noise is None else 1.0 / np.asarray(noise, dtype=np.float64), (arm.n,))
    W, right = (Y * weights[:, None]).reshape(-1, base.columns.size), (known * weights).reshape(-1)
    lengths = np.linalg.norm(W, axis=0)
    lengths[lengths == 0.0] = 1.0
    U, sigma, V = np.linalg.svd(W / lengths, full_matrices=False)
    rank = int(np.count_nonzero(sigma > cutoff * sigma[0]))
    back = V[:rank].T / sigma[:rank] / lengths[:, None]
    values = back @ (U[:, :rank].T @ right)
    covariance = np.sum((right - W @ values) ** 2) / (right.size - rank) * back @ back.T
    hidden = np.any(np.abs(V[rank:]) > HIDDEN, axis=0)
    deviations = np.where(hidden, np.inf, np.sqrt(np.diag(covariance)))
    condition = float(sigma[0] / sigma[-1]) if rank == sigma.size else np.inf
    residuals = np.sqrt(np.mean((known - Y @ values) ** 2, axis=0))
    own = _drives(arm, armature, friction, offset)
    nearest = own + np.linalg.lstsq(base.projection, values - base.projection @ own, rcond=None)[0]
    return Identification(base, values, deviations, covariance, rank, condition, sigma, residuals, nearest)
