"""Velocities within bounds against the reference, which solves for all fixed joints at once by SVD."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from test_task_kinds_parity import levels
from trees import close, driven_tree

import armlet as al
from armlet import reference as ref

Array = NDArray[np.float64]


def settled(Js: list[Array], vs: list[Array], options: dict[str, Any]) -> bool:
    """Whether rounding of the rows moves both answers by rounding: joints that higher levels brought to their bounds may tie."""
    rng = np.random.default_rng(0)
    near = [[J * (1.0 + 1e-15 * rng.normal(size=J.shape)) for J in Js] for _ in range(4)]
    for lib in (al, ref):
        answers = [lib.solve_priority(rows, vs, method="sns", **options).v for rows in (Js, *near)]
        if np.ptp(answers, axis=0).max() > 1e-9:
            return False
    return True


@pytest.mark.parametrize("n", [3, 7])
def test_solvers_within_bounds(n: int) -> None:
    """`PrioritySolver` and that of an arm, with bounds of their own."""
    arm, theirs = driven_tree(n, 1)
    rng = np.random.default_rng(n)
    tasks, others = levels(al, arm, n)[:2], levels(ref, arm, n)[:2]
    for bounds in ({"v_max": 0.4}, {"v_min": -0.3}, {"v_min": -0.2, "v_max": rng.uniform(0.1, 0.5, n)}):
        of_arm = al.PrioritySolver.for_arm(arm, tasks, method="sns", **bounds)
        for q in rng.uniform(-1.0, 1.0, (5, n)):
            Js = [other.jacobian(theirs, q) for other in others]
            vs = [rng.normal(size=len(J)) for J in Js]
            want = ref.solve_priority(Js, vs, "sns", **bounds)
            if settled(Js, vs, bounds):
                plain = al.PrioritySolver(n, [len(J) for J in Js], method="sns", **bounds)
                for got in (of_arm.solve(q, vs), plain.solve(Js, vs)):
                    close(got, want.v, tolerance=1e-9)
