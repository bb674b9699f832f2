"""Search for values of a scenario with the gradient of a loss: scipy's L-BFGS-B [ByrdEtAl1995] in the unit cube, from several starts.

    minimise over u in [0, 1]^k   L(run with the values g(u))

`g` maps each number of `u` to the search interval of one path, on a linear or a logarithmic scale. A path such as `law.kd[0]` is an entry
of the number `law.kd` of the loop, and its derivative is computed as in `armlet.gradient`. For any other path the scenario is built again
with four slightly different values.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import groupby
from typing import Any, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from ..arguments import shown
from ..errors import InputError, SolveError
from ..run.gradients import of_loops, require_still_reference
from ..run.losses import TERMS
from ..run.named_numbers import (
    RULES,
    START,
    STEP,
    Loop,
    NamedNumber,
    Together,
    Variants,
    Varied,
    entry_variants,
    named_numbers,
    stacked,
    together,
)
from ..run.options import RunOptions
from ..scenario import Scenario
from .parameter_space import drawn

__all__ = ["Descent"]

Array: TypeAlias = NDArray[np.float64]
Row: TypeAlias = dict[str, Any]

#: The path of a quantity of the loop, such as `law.kp`, or of one of its entries, such as `run.q0[1]`.
ENTRY = re.compile(r"(law\.[A-Za-z_]+|run\.(?:q0|v0))(?:\[(\d+)\])?")
#: Approximate limit of the states that an adjoint run stores, bytes. Other states are computed again.
MEMORY = 1 << 26


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
        return np.array([_place(spec, _value(self.scenario, path)) for path, spec in self.space.items()])

    def evaluate(self, u: Array) -> tuple[float, Array]:
        """Return the cost of the candidate at `u`, (k,), and the derivatives of the cost with respect to `u`, (k,)."""
        row = {path: drawn(spec, float(x)) for (path, spec), x in zip(self.space.items(), u, strict=True)}
        try:
            each = [self._loss(row | condition) for condition in self.conditions]
        except SolveError:
            each = [(self.failed, np.zeros(len(u)))]
        values = np.array([value for value, _ in each])
        chosen = int(values.argmax())
        cost = float(values[chosen] if self.worst else values.mean())
        slopes = each[chosen][1] if self.worst else np.mean([slope for _, slope in each], axis=0)
        self.tried.append(row)
        self.paid.append(cost)
        rates = np.array([_rate(spec, row[path]) for path, spec in self.space.items()])
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

    def _loss(self, values: Row) -> tuple[float, Array]:
        """Return the loss of one run, and its derivatives with respect to the k searched values, (k,)."""
        scenario = self.scenario.replace(values)
        built = scenario.build()
        options = {"monitors": False, "check_limits": False, **built.arguments}
        options.pop("sensitivity", None)
        loop = _loop(built)
        known = named_numbers(*loop)
        names = _names(self.space)

        def alone(k: int) -> list[Variants]:
            return [self._variants(scenario, loop, known, path, values[path]) for path in names[k][1]]

        shared = [_together(loop, known, values, own) for _, own in names]
        loops: Varied = stacked(loop, [named for named, _ in names], shared, alone)
        q0 = options.pop("q0")
        return of_loops("tune", self.loss, (built.plant, built.law, q0), loops, cast(RunOptions, options), MEMORY)

    def _variants(self, scenario: Scenario, loop: Loop, known: Mapping[str, Array], path: str, value: float) -> Variants:
        found = _entry(known, path, value)
        if found is None:
            return _built(scenario, path, value)
        name, index = found
        return entry_variants(loop, name, known[name], index)


def _entry(known: Mapping[str, Array], path: str, value: float) -> tuple[str, tuple[int, ...]] | None:
    """Return the name and the index of the entry at `path`. Return None if the loop has no such entry, or if its value is not `value`."""
    found = ENTRY.fullmatch(path)
    name = found[1].removeprefix("run.") if found else ""
    if not found or name not in known:
        return None
    index = () if found[2] is None else (int(found[2]),)
    number = known[name]
    if number.ndim == len(index) and (not index or index[0] < len(number)) and number[index] == value:
        return name, index
    return None


def _names(paths: Iterable[str]) -> list[tuple[NamedNumber, list[str]]]:
    """Group consecutive paths of entries of the same array. Return a name and the paths of each group."""
    names = []
    for array, group in groupby(paths, lambda path: found[1] if (found := ENTRY.fullmatch(path)) else path):
        entries = list(group)
        names.append((NamedNumber(entries[0] if len(entries) == 1 else array, np.zeros(len(entries))), entries))
    return names


def _together(loop: Loop, known: Mapping[str, Array], values: Row, paths: Sequence[str]) -> Together | None:
    """Make loops that each change several of the entries at `paths`. Return None if the paths are not entries of one number."""
    found = [_entry(known, path, values[path]) for path in paths]
    names = {each[0] for each in found if each is not None}
    if None in found or len(names) != 1:
        return None
    name = names.pop()
    return together(loop, NamedNumber(name, known[name]), [each[1] for each in found if each is not None])


def _loop(built: Any) -> Loop:
    """Return the plant, the law and the start of a scenario that was built."""
    start = {name: built.arguments.get(name) for name in START}
    return built.plant, built.law, {name: None if x is None else np.asarray(x, dtype=np.float64) for name, x in start.items()}


def _built(scenario: Scenario, path: str, value: float) -> Variants:
    """Return four loops of the scenario with slightly different values at `path`, and their weights in the derivative."""
    step = STEP * 2.0 ** math.floor(math.log2(abs(value) or 1.0))
    refused: InputError | None = None
    for offsets, weights in RULES:
        try:
            each = [scenario.replace({path: value + offset * step}).build() for offset in offsets]
        except InputError as error:
            refused = error
            continue
        return [_loop(one) for one in each], [weight / step for weight in weights]
    raise InputError(f"tune: {path} cannot be varied at {shown(value)}: {refused}")


def _value(scenario: Scenario, path: str) -> float:
    """Return the scenario's number at `path`, or NaN if it has no number there."""
    at: Any = scenario.data
    try:
        for key in re.findall(r"[^.\[\]]+", path):
            at = at[int(key)] if isinstance(at, Sequence) and not isinstance(at, str) else at[key]
        return float(at)
    except (KeyError, IndexError, TypeError, ValueError):
        return math.nan


def _place(spec: Mapping[str, Any], value: float) -> float:
    ((kind, (low, high)),) = spec.items()
    if not low <= value <= high or low == high:
        return 0.5
    return float((value - low) / (high - low) if kind == "uniform" else math.log(value / low) / math.log(high / low))


def _rate(spec: Mapping[str, Any], value: float) -> float:
    """Return the derivative of a value with respect to its relative position in the search interval."""
    ((kind, (low, high)),) = spec.items()
    return float(high - low if kind == "uniform" else value * math.log(high / low))
