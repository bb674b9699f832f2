"""Which directions of a stack of levels can be commanded, by ranks of stacked rows.

    projected rank of level i = rank(rows down to i) - rank(rows above),   overlap = sum rank J_i - rank J_E
    algorithmic iff rank J_E < min(sum rank J_i, n),   kinematic iff some rank J_i is below its rows      (Chiaverini 1997)
    lost at level i     1 - U U',  U the leading left vectors of J_i N,  N a null basis of the rows above
    loss of a command   (1 - U U')(v_i - J_i v_above),  v_above the exact solution of the levels above

Ranks count singular values of stacked rows above rounding * sigma_max, each block first divided by its own norm, because
tasks have different units. No singular value of a projected Jacobian is ever compared with the projected Jacobian itself.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .lagrange import Array

EPS = float(np.finfo(np.float64).eps)
COMPATIBLE = 1e3  # a loss is rounding below this multiple of rounding, condition and size


class Diagnosis(NamedTuple):
    """Ranks of a stack of levels, and the lost parts of a command.

    There are ranks of each block, of the stack, and of each block projected on the null space above. Each level has singular values
    alone and projected, two flags, and the projector on its lost directions. With a command it also has the losses.
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
    """The block divided by its norm; a zero block stays zero."""
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
    """The rows above a level, each block divided by its norm."""
    return np.vstack([np.zeros((0, blocks[0].shape[1])), *[_unit(block) for block in blocks[:level]]])


def _stacked_ranks(blocks: list[Array], rounding: float) -> list[int]:
    """Ranks of the rows down to each level."""
    return [_rank(np.vstack([_unit(J) for J in blocks[: i + 1]]), rounding) for i in range(len(blocks))]


def projected_ranks(blocks: list[Array], rounding: float) -> list[int]:
    """Rank of each level in the null space of those above."""
    stack = _stacked_ranks(blocks, rounding)
    return [after - before for before, after in zip([0, *stack], stack, strict=False)]


def diagnose_priority(jacobians: Sequence[ArrayLike], *, rhs: Sequence[ArrayLike] | None = None, rounding: float = 8 * EPS) -> Diagnosis:
    """Ranks by the rule rank(stack) - rank(rows above); rounding is the relative error of the entries, rhs a command."""
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


# s2, s3, s4 different from zero (None: any) -> class and the ranks of J1, J2, J_E, J2 P1
MACRO_MICRO_CLASSES: tuple[tuple[bool, bool | None, bool, str, tuple[int, int, int, int]], ...] = (
    (True, None, True, "R", (2, 2, 4, 2)),
    (True, None, False, "A", (2, 2, 3, 1)),
    (False, None, True, "S2", (2, 1, 3, 1)),
    (False, True, False, "AS", (2, 1, 2, 0)),
    (False, False, False, "D", (1, 1, 2, 1)),
)


def macro_micro_class(q: ArrayLike, angle_tol: float = 1e-9) -> tuple[str, tuple[int, int, int, int]]:
    """SPEC system 2's table for the planar 4R with tasks at the tips of links 4 and 2; multiples of pi count as zero."""
    moved = np.abs(np.sin(np.asarray(q, dtype=np.float64)[1:])) > angle_tol
    for s2, s3, s4, name, ranks in MACRO_MICRO_CLASSES:
        if s2 == moved[0] and s4 == moved[2] and (s3 is None or s3 == moved[1]):
            return name, ranks
    raise AssertionError("the table covers every sign pattern")
