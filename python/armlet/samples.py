"""Samples of a recorded motion for concurrent learning."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from .border import border, bordered
from .pickling import sealed

__all__ = ["Samples", "select_samples"]

_Array = NDArray[np.float64]


@bordered
@sealed
@dataclass(frozen=True, eq=False)
class Samples:
    """Samples for `Adaptive(concurrent=)`, selected by `select_samples`: `tau_j = W_j pi` for the true parameters `pi` (p,).

    >>> import numpy as np
    >>> import armlet as al
    >>> al.Samples(W=np.ones((1, 2, 3)), tau=np.ones((1, 2)), indices=np.array([0]), singular_value=1.0, rank=1)
    <Samples: 1, smallest singular value 1 of 1 directions>
    """

    #: Regressors `W_j` of the samples, (N, n, p).
    W: _Array
    #: Torques `tau_j` of the samples, (N, n), N m or N; for windows their time integrals, N m s or N s.
    tau: _Array
    #: Indices of the selected records or windows, (N,).
    indices: NDArray[np.int64]
    #: Smallest nonzero singular value of the stacked rows of all `W_j`. Values that are zero up to rounding count as zero.
    singular_value: float
    #: Number of directions of the parameters that the record determines.
    rank: int

    def __post_init__(self) -> None:
        _core.numbers("Samples", "W", self.W, ("N", "n", "p"))
        _core.numbers("Samples", "tau", self.tau, ("N", "n"))
        _core.numbers("Samples", "indices", self.indices, ("N",))
        for name in ("singular_value", "rank"):
            _core.numbers("Samples", name, getattr(self, name), ())

    def __repr__(self) -> str:
        return f"<Samples: {len(self.W)}, smallest singular value {self.singular_value:.4g} of {self.rank} directions>"


def stated_samples(W: ArrayLike, tau: ArrayLike) -> Samples:
    """Make `Samples` of all entries of the arrays `W` (N, n, p) and `tau` (N, n), in their order."""
    rows, torques = _core.numbers("Adaptive", "concurrent", W, ("N", "n", "p")), _core.numbers("Adaptive", "concurrent", tau, ("N", "n"))
    stacked = rows.reshape(-1, rows.shape[-1])
    values = np.linalg.svd(stacked, compute_uv=False)
    # The cut-off of the singular values is the same as in numpy's `matrix_rank`.
    rank = int(np.count_nonzero(values > values.max(initial=0.0) * max(stacked.shape) * np.finfo(np.float64).eps))
    return Samples(rows, torques, np.arange(len(rows)), float(values[rank - 1]) if rank else 0.0, rank)


@border
def select_samples(
    law: _core.Adaptive,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    count: int,
    *,
    a: ArrayLike | None = None,
    t: ArrayLike | None = None,
    window: float | None = None,
    held: bool = False,
) -> Samples:
    """Select samples of a record for concurrent learning, so that the smallest nonzero singular value of their stacked `W` is large.

    With accelerations a sample is `W_j = Y(q, v, v, a)`. Without accelerations a sample is a window of the record. Its equation is
    integrated over time by Simpson's rule: `W_j = [Y_M] + int Y_D dt`, `tau_j = int tau dt`. `[Y_M]` is the end value minus the start value
    in the window. The torque of rotors is subtracted from `tau_j` if their inertia is not estimated. `M v = Y_M pi` and `g - C' v = Y_D pi`
    for the parameters `pi`, with the mass matrix `M`, the Coriolis matrix `C`, the gravity torque `g`, and `'` the transpose.

    Args:
        law: the `Adaptive` law that will learn from the samples. It determines the parameters: its base set, friction and rotors.
        q, v, tau: positions, velocities and torques of the record, (K, n), rad or m, rad/s or m/s, N m or N.
        count: number of samples.
        a: accelerations of the record, (K, n), rad/s^2 or m/s^2 (keyword only).
        t: times of the record, (K,), evenly spaced, s. Only without `a`, and then required (keyword only).
        window: length of a window, s. Only without `a`, and then required. Windows overlap by half (keyword only).
        held: whether each torque acts until the next record, as in a sampled loop. Only without `a` (keyword only).

    Returns:
        The selected samples, with the smallest nonzero singular value of their stacked `W`.

    Raises:
        InputError: a shape is wrong, a number is not finite, or an argument is missing. It is also raised if `t` is not evenly
            spaced, or `count` is smaller than necessary for the directions that the record determines.

    Source: Chowdhary and Johnson, Concurrent learning for convergence in adaptive control without persistency of excitation, CDC 2010;
    windows: Parikh, Kamalapurkar and Dixon, Integral concurrent learning, 2019.

    >>> import numpy as np
    >>> import armlet as al
    >>> arm = al.planar_pr(2.0, 0.5, 0.5)
    >>> law = al.Adaptive(arm, al.Hold([1.0, 0.0]), kp=40.0, kd=20.0, gamma=5.0)
    >>> q, v, a = np.random.default_rng(0).normal(size=(3, 50, 2))
    >>> samples = al.select_samples(law, q, v, arm.inverse_dynamics(q, v, a), 5, a=a)
    >>> samples.W.shape, samples.rank
    ((5, 2, 3), 3)
    >>> learning = al.Adaptive(arm, al.Hold([1.0, 0.0]), kp=40.0, kd=20.0, gamma=5.0, concurrent=samples)
    >>> run = al.simulate(al.RigidArm(arm), learning, [0.0, 0.0], t_end=3.0, dt=1e-3)
    >>> run.estimate[-1].round(6)
    array([2. , 0.5, 0.5])
    """
    return Samples(**_core._select_samples(law, (q, v, tau), a, (t, window, held), count))
