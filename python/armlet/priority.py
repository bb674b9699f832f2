"""Diagnosis of prioritised tasks: the feasible part of a command, and the overlap of the levels, sum rank J_i - rank J_E.

J_i is the Jacobian of level i, and J_E the matrix of the rows of all J_i. `active_bounds` has the reasons that bounds give.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._core import Within
from .border import border, bordered
from .errors import InputError
from .pickling import sealed

__all__ = ["PriorityDiagnosis", "diagnose_priority"]

Array: TypeAlias = NDArray[np.float64]


@bordered
@sealed
@dataclass(frozen=True, eq=False)
class PriorityDiagnosis:
    """Ranks, singular values and lost directions of a stack of levels. `str()` is a summary in one sentence.

    Attributes:
        n: number of joints.
        kind: "regular", "algorithmic", "kinematic" or "algorithmic+kinematic".
        ranks: rank of each J_i, the Jacobian of level i.
        projected_ranks: rank of each J_i in the null space of the higher levels; for level 1 the rank of J_1.
        stacked_rank: rank of all levels together, the sum of `projected_ranks`.
        overlap: sum of `ranks` minus `stacked_rank`.
        singular_values: singular values of each J_i, descending, in the unit of the task divided by the unit of the joints.
        projected_singular_values: singular values of each J_i in the null space of the higher levels.
        kinematic: for each level, whether the rank is below the number of rows.
        algorithmic: for each level, whether the projected rank is below the rank and below the number of directions that the higher levels
            do not use.
        lost: for each level, (k, rows_i): orthonormal directions of the command that no joint velocity in the null space of the higher
            levels produces.
        losses: for each level, (rows_i,), in the unit of the task: the part along `lost` of the remaining command; None without `rhs`. The
            remaining command is `rhs` minus the task velocity that the higher levels cause.
        compatible: whether every loss is zero up to rounding, so that the whole command is feasible; None without `rhs`.
        why: for each level, the sentence of `PrioritySolution.why`; None without bounds. With bounds, `losses` are the parts of the
            commands that the method "exact" does not reach within the bounds.
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
    why: list[str] | None = None

    def __str__(self) -> str:
        return self.text


@border
def diagnose_priority(
    jacobians: Sequence[ArrayLike],
    *,
    rhs: Sequence[ArrayLike | Within] | None = None,
    rounding: float = 8 * float(np.finfo(np.float64).eps),
    v_min: ArrayLike | None = None,
    v_max: ArrayLike | None = None,
) -> PriorityDiagnosis:
    """Diagnose which directions of each level are feasible.

    The stack is algorithmic if and only if `rank J_E < min(sum rank J_i, n)`. It is kinematic if and only if some `rank J_i` is below its
    number of rows. J_E is the matrix of the rows of all J_i.

    Args:
        jacobians: one (rows_i, n) per level, the highest priority first.
        rhs: the task velocities (rows_i,) per level, to test whether they are feasible; None: only directions are diagnosed. A level may
            have bounds, `Within(lower, upper)`.
        rounding: relative error of the entries of `jacobians`. It is 8 eps (1 + sum |q|) for Jacobians computed from joint positions q,
            with eps = 2.2e-16.
        v_min, v_max: bounds of the joint velocities, a number or (n,), rad/s or m/s; they require `rhs`.

    Returns:
        A `PriorityDiagnosis`: the kind, ranks and singular values of each level, lost directions, and, with `rhs`, the lost part of each
        command.

    Raises:
        InputError: shapes do not match, the stack is empty, or a number is not finite.

    Source: [chiaverini1997singularity] for the two kinds of singularity; docs/priority.md.

    >>> import armlet as al
    >>> d = al.diagnose_priority([[[1.0, 0.0]], [[2.0, 0.0]]], rhs=[[1.0], [2.0]])
    >>> d.kind, d.ranks, d.projected_ranks, d.stacked_rank, d.overlap, d.compatible
    ('algorithmic', [1, 1], [1, 0], 1, 1, True)
    >>> al.diagnose_priority([[[1.0, 0.0]]], rhs=[[1.0]], v_max=0.5).why
    ['level 1 misses row 1 by 0.5: joint 1 at its upper bound (level 0) takes 100 %']
    >>> print(d)
    algorithmic: stacked rank 1 of 2 joints; level 2 commands 0 of 1 rows (the rest taken by higher levels), compatibly.
    """
    bounded = v_min is not None or v_max is not None or any(isinstance(target, Within) for target in rhs or ())
    if rhs is None or not bounded:
        if bounded:
            raise InputError("diagnose_priority: rhs is missing: expected commands with v_min or v_max, got None")
        return PriorityDiagnosis(**_core.diagnose_priority(jacobians, rhs, rounding))
    directions = _core.diagnose_priority(jacobians, None, rounding)
    solution = _core.solve_priority(jacobians, rhs, method="exact", rounding=rounding, v_min=v_min, v_max=v_max)
    losses = [-violation for violation in solution.violations]
    why = [solution.why(k) for k in range(1, len(losses) + 1)]
    compatible = all(sentence.endswith("is reached") for sentence in why)
    return PriorityDiagnosis(**directions, losses=losses, compatible=compatible, why=why)
