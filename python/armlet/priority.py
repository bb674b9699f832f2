"""Which part of a prioritised command can be executed, and why not: overlap = sum rank J_i - rank J_E."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from .border import border, bordered
from .pickling import sealed

__all__ = ["PriorityDiagnosis", "diagnose_priority"]

Array: TypeAlias = NDArray[np.float64]


@bordered
@sealed
@dataclass(frozen=True, eq=False)
class PriorityDiagnosis:
    """Ranks, singular values and lost directions of a stack of levels; `str()` is a summary in one sentence.

    Attributes:
        n: number of joints.
        kind: "regular", "algorithmic", "kinematic" or "algorithmic+kinematic".
        ranks: rank of each J_i.
        projected_ranks: rank of each J_i in the null space of the levels above, level 1 included.
        stacked_rank: rank of all levels together, the sum of `projected_ranks`.
        overlap: sum of `ranks` minus `stacked_rank`.
        singular_values: of each J_i, descending, in the unit of the task over that of the joints.
        projected_singular_values: of each J_i in the null space of the levels above.
        kinematic: per level: the rank is below the number of rows.
        algorithmic: per level: the projected rank is below the rank, and below the number of directions that the levels above leave free.
        lost: per level, (k, rows_i): orthonormal directions of the command that no joint velocity left free by the levels above produces.
        losses: per level, (rows_i,): the part of the command `rhs` along `lost`, in the unit of the task; None without `rhs`.
        compatible: whether every loss is zero up to rounding, so that the whole command can be executed; None without `rhs`.
    """

    n: int
    kind: str
    ranks: list[int]
    projected_ranks: list[int]
    stacked_rank: int
    overlap: int
    singular_values: list[Array]
    projected_singular_values: list[Array]
    kinematic: list[bool]
    algorithmic: list[bool]
    lost: list[Array]
    text: str
    losses: list[Array] | None = None
    compatible: bool | None = None

    def __str__(self) -> str:
        return self.text


@border
def diagnose_priority(
    jacobians: Sequence[ArrayLike], *, rhs: Sequence[ArrayLike] | None = None, rounding: float = 8 * float(np.finfo(np.float64).eps)
) -> PriorityDiagnosis:
    """Diagnose which directions of which level can be commanded.

    The stack is algorithmic if and only if `rank J_E < min(sum rank J_i, n)`. It is kinematic if and only if some `rank J_i` is below its
    number of rows.

    Args:
        jacobians: one (rows_i, n) per level, the highest first.
        rhs: the task velocities (rows_i,) per level, to test whether they can be executed; None: directions alone.
        rounding: relative error of the entries; 8 eps (1 + sum |q|) if they were computed from joint angles.

    Returns:
        The kind, the ranks and singular values of each level, the lost directions, and, with `rhs`, the lost part of each command.

    Raises:
        InputError: shapes that do not match, an empty stack, numbers that are not finite.

    Source: [chiaverini1997singularity] for the two kinds of singularity; docs/priority.md.

    >>> import armlet as al
    >>> d = al.diagnose_priority([[[1.0, 0.0]], [[2.0, 0.0]]], rhs=[[1.0], [2.0]])
    >>> d.kind, d.ranks, d.projected_ranks, d.stacked_rank, d.overlap, d.compatible
    ('algorithmic', [1, 1], [1, 0], 1, 1, True)
    >>> print(d)
    algorithmic: stacked rank 1 of 2 joints; level 2 commands 0 of 1 rows (the rest taken by higher levels), compatibly.
    """
    return PriorityDiagnosis(**_core.diagnose_priority(jacobians, rhs, rounding))
