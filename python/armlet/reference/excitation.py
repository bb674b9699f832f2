"""The accuracy of base parameters that are estimated from one record of a motion.

    W = rows Y_b(q_k, v_k, a_k) / noise = U S V',   deviations = sqrt(diag((W'W)^-1)) = norms of the rows of V S^-1
    condition = the largest / the smallest singular value of W, after its columns are scaled to norm one   (Gautier and Khalil 1992)

`armlet.excitation` accumulates `W'W` for its search and computes deviations from a triangular factor of `W`. Here they come from one dense
decomposition. `Y_b` is the regressor of the base parameters, and `'` the transpose.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .identification import base_parameters
from .lagrange import Array, Mechanism


class Excitation(NamedTuple):
    """The condition number, and the standard deviations (b,) of the base parameters for the torque noise."""

    condition: float
    deviations: Array


def excitation(
    arm: Mechanism,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    *,
    noise: ArrayLike = 1.0,
    armature: bool = False,
    friction: bool = False,
) -> Excitation:
    """The accuracy of base parameters from samples q, v, a (K, n) of a motion."""
    q, v, a = (np.asarray(x, dtype=np.float64) for x in (q, v, a))
    columns = base_parameters(arm, armature=armature, friction=friction).columns
    Y = arm.regressor(q, v, v, a, armature=armature, friction=friction)[..., columns]
    W = (Y / np.broadcast_to(noise, (arm.n,))[:, None]).reshape(-1, columns.size)
    lengths = np.linalg.norm(W, axis=0)
    _, sigma, V = np.linalg.svd(W / lengths, full_matrices=False)
    return Excitation(float(sigma[0] / sigma[-1]), np.linalg.norm(V.T / sigma, axis=1) / lengths)
