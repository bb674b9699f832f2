"""Search for values of a scenario with the gradient of a loss: scipy's L-BFGS-B [ByrdEtAl1995] in the unit cube, from several starts.

    minimise over u in [0, 1]^k   L(run with the values g(u))

`g` maps each number of `u` to the search interval of one path, on a linear or a logarithmic scale.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..arguments import shown
from ..errors import InputError, SolveError
from ..run.gradients import require_still_reference
from ..run.losses import TERMS
from ..scenario import Scenario
from .derivatives import loss_and_slopes
from .parameter_space import drawn, place_in, rate_in, value_at

__all__ = ["Descent"]

Array: TypeAlias = NDArray[np.float64]
Row: TypeAlias = dict[str, Any]


class Descent:
    """The gradient search for one scenario. It stores every candidate and its cost.

    Args:
        scenario: the scenario.
        space: search intervals by path.
        conditions: the values by path of each condition. A candidate runs once per condition.
        loss: a loss of `armlet.gradient`.
        worst: True: the cost of a candidate is the largest cost of its conditions. False: it is the mean cost.
        failed: the cost of a candidate of which a run ends early.
    """

    def __init__(
        self, scenario: Scenario, space: Mapping[str, Any], conditions: Sequence[Row], loss: Any, worst: bool, failed: float
    ) -> None:
        self.scenario, self.space, self.conditions, self.loss, self.worst, self.failed = scenario, space, conditions, loss, worst, failed
        if not callable(loss):
            terms = [loss] if isinstance(loss, str) else list(loss)
            for term in terms:
                if term not in TERMS:
                    problem = f"expected names of {list(TERMS)} or a function of a run, got {shown(term)}"
                    raise InputError(f"tune: cost has no gradient: {problem}")
        require_still_reference("tune", loss, list(space))
        #: Every candidate that was run. `paid` contains the cost of each candidate.
        self.tried: list[Row] = []
        self.paid: list[float] = []

    def own(self) -> Array:
        """Return the relative positions of the scenario's values in their k intervals, (k,): 1/2 for a value outside of its interval."""
        return np.array([place_in(spec, value_at(self.scenario.data, path)) for path, spec in self.space.items()])

    def evaluate(self, u: Array) -> tuple[float, Array]:
        """Return the cost of the candidate at `u`, (k,), and the derivatives of the cost with respect to `u`, (k,)."""
        row = {path: drawn(spec, float(x)) for (path, spec), x in zip(self.space.items(), u, strict=True)}
        try:
            each = [loss_and_slopes("tune", self.loss, self.scenario, row | condition, self.space) for condition in self.conditions]
        except SolveError:
            each = [(self.failed, np.zeros(len(u)))]
        values = np.array([value for value, _ in each])
        chosen = int(values.argmax())
        cost = float(values[chosen] if self.worst else values.mean())
        slopes = each[chosen][1] if self.worst else np.mean([slope for _, slope in each], axis=0)
        self.tried.append(row)
        self.paid.append(cost)
        rates = np.array([rate_in(spec, row[path]) for path, spec in self.space.items()])
        return cost, slopes * rates

    def search(self, optimize: Any, u: Array, steps: int, tolerance: float, after: Callable[[], object]) -> bool:
        """Search from the start `u`, (k,), and return whether the search converged."""
        result = optimize.minimize(
            self.evaluate,
            u,
            jac=True,
            method="L-BFGS-B",
            bounds=[(0.0, 1.0)] * len(u),
            callback=lambda _: after(),
            options={"maxiter": steps, "ftol": tolerance, "maxfun": 4 * steps + 10},
        )
        return bool(result.success)
