"""The directions of a stack of levels that can be commanded, from ranks of stacked rows.

    projected rank of level i = rank(rows down to i) - rank(rows above),   overlap = sum rank J_i - rank J_E
    algorithmic iff rank J_E < min(sum rank J_i, n),   kinematic iff a rank J_i < rows of J_i      (Chiaverini 1997)
    lost at level i     1 - U U',  U the leading left vectors of J_i N,  N a null basis of the rows above
    loss of a command   (1 - U U')(v_i - J_i v_above),  v_above the exact solution of the levels above

A *block* is the Jacobian J_i of a level i, v_i its task velocity, and J_E the matrix of the rows of all blocks. n is the number of joints.
A rank counts the singular values of stacked rows above rounding * sigma_max, with the largest singular value sigma_max. First, each block
is divided by its norm, because tasks have different units. The rank of a projected Jacobian does not come from its own singular values. '
is the transpose.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array

EPS = float(np.finfo(np.float64).eps)
COMPATIBLE = 1e3  # a loss below this multiple of rounding * condition * size counts as a rounding error


class Diagnosis(NamedTuple):
    """The ranks of a stack of levels, and the parts of a command that are lost.

    The ranks are given for each block, for the stack, and for each block after projection on the null space of the levels above. Each level
    has the singular values of its block and of the projected block, and the projector on its lost directions. Two flags state
    whether it is in a kinematic and in an algorithmic singularity. If there is a command, each level also has its loss.
    """

    ranks: list[int]
    stacked_rank: int
    projected_ranks: list[int]
    overlap: int
    kind: str
    singular_values: list[Array]
    projected_singular_values: list[Array]
    kinematic: list[bool]
    algorithmic: list[bool]
    lost: list[Array]
    losses: list[Array] | None
    compatible: bool | None


def _blocks(jacobians: Sequence[ArrayLike]) -> list[Array]:
    return [np.atleast_2d(np.asarray(J, dtype=np.float64)) for J in jacobians]


def _unit(J: Array) -> Array:
    """The block divided by its norm. A zero block is unchanged."""
    size = np.linalg.norm(J)
    return J / size if size > 0.0 else J


def _rank(rows: Array, rounding: float) -> int:
    if rows.size == 0:
        return 0
    sigma = np.linalg.svd(rows, compute_uv=False)
    return int(np.count_nonzero(sigma > rounding * max(float(sigma[0]), np.finfo(np.float64).tiny)))


def _null_basis(rows: Array, rank: int) -> Array:
    """Orthonormal columns that span the null space of rows whose rank is known."""
    n = rows.shape[1]
    basis: Array = np.eye(n) if rows.size == 0 else np.linalg.svd(rows)[2][rank:].T
    return basis


def _above(blocks: list[Array], level: int) -> Array:
    """The stacked rows of the levels above a level. Each block is divided by its norm."""
    return np.vstack([np.zeros((0, blocks[0].shape[1])), *[_unit(block) for block in blocks[:level]]])


def _stacked_ranks(blocks: list[Array], rounding: float) -> list[int]:
    """For each level, the rank of the stacked rows of this level and all levels above."""
    return [_rank(np.vstack([_unit(J) for J in blocks[: i + 1]]), rounding) for i in range(len(blocks))]


def projected_ranks(blocks: list[Array], rounding: float) -> list[int]:
    """The rank of each level in the null space of the levels above."""
    stack = _stacked_ranks(blocks, rounding)
    return [after - before for before, after in zip([0, *stack], stack, strict=False)]


def diagnose_priority(jacobians: Sequence[ArrayLike], *, rhs: Sequence[ArrayLike] | None = None, rounding: float = 8 * EPS) -> Diagnosis:
    """Diagnose a stack of Jacobians. `rounding`: relative error of their entries. `rhs`: a command, one task velocity per level."""
    blocks = _blocks(jacobians)
    n = blocks[0].shape[1]
    stacked, projected = _stacked_ranks(blocks, rounding)[-1], projected_ranks(blocks, rounding)
    ranks = [_rank(J, rounding) for J in blocks]
    kinematic = [rank < J.shape[0] for rank, J in zip(ranks, blocks, strict=True)]
    algorithmic = [p < min(r, n - sum(projected[:i])) for i, (p, r) in enumerate(zip(projected, ranks, strict=True))]
    names = ["algorithmic"] * (stacked < min(sum(ranks), n)) + ["kinematic"] * any(kinematic)
    alone: list[Array] = [np.asarray(np.linalg.svd(J, compute_uv=False), dtype=np.float64) for J in blocks]
    seen, lost, losses, compatible, condition = [], [], [], True, 1.0
    x = np.zeros(n)
    commands = [np.zeros(J.shape[0]) for J in blocks] if rhs is None else [np.atleast_1d(np.asarray(v, dtype=np.float64)) for v in rhs]
    for level, (J, v) in enumerate(zip(blocks, commands, strict=True)):
        N, rank = _null_basis(_above(blocks, level), sum(projected[:level])), projected[level]
        U, sigma, right = np.linalg.svd(J @ N, full_matrices=False)
        missing = np.eye(J.shape[0]) - U[:, :rank] @ U[:, :rank].T
        lost.append(missing)
        losses.append(missing @ (v - J @ x))
        seen.append(sigma)
        size = float(np.linalg.norm(v) + np.linalg.norm(J, 2) * np.linalg.norm(x))
        compatible = compatible and float(np.linalg.norm(losses[-1])) <= COMPATIBLE * rounding * condition * size
        x = x + N @ (right[:rank].T @ ((U[:, :rank].T @ (v - J @ x)) / sigma[:rank]))
        condition *= float(np.linalg.norm(J, 2) / sigma[rank - 1]) if rank else 1.0
    verdict = (None, None) if rhs is None else (losses, compatible)
    overlap = sum(ranks) - stacked
    kind = "+".join(names) or "regular"
    return Diagnosis(ranks, stacked, projected, overlap, kind, alone, seen, kinematic, algorithmic, lost, *verdict)


# For each class: whether each of sin q2, sin q3, sin q4 is nonzero (None: either), its name, and the ranks of J1, J2, J_E, J2 P1. P1 is the
# projector on the null space of J1.
MACRO_MICRO_CLASSES: tuple[tuple[bool, bool | None, bool, str, tuple[int, int, int, int]], ...] = (
    (True, None, True, "R", (2, 2, 4, 2)),
    (True, None, False, "A", (2, 2, 3, 1)),
    (False, None, True, "S2", (2, 1, 3, 1)),
    (False, True, False, "AS", (2, 1, 2, 0)),
    (False, False, False, "D", (1, 1, 2, 1)),
)


def macro_micro_class(q: ArrayLike, angle_tol: float = 1e-9) -> tuple[str, tuple[int, int, int, int]]:
    """The class and the ranks of a planar 4R arm with tasks at the tips of links 4 and 2. Angles that are multiples of pi count as zero."""
    moved = np.abs(np.sin(np.asarray(q, dtype=np.float64)[1:])) > angle_tol
    for s2, s3, s4, name, ranks in MACRO_MICRO_CLASSES:
        if s2 == moved[0] and s4 == moved[2] and (s3 is None or s3 == moved[1]):
            return name, ranks
    raise AssertionError("no row of the table matches the sines of q2, q3, q4")
