"""Search of values of a scenario by the gradient of a loss: scipy's L-BFGS-B [ByrdEtAl1995] in the unit cube, from several starts.

    minimise over u in [0, 1]^k   L(run with the values g(u))

`g` is the inverse of each entry's distribution. A path such as `law.kd[0]` is an entry of a number of the loop: of `law.kd` of
`armlet.gradient`. For any other path the scenario is built again with that value a little above and below.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import groupby
from typing import Any, TypeAlias

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
from ..scenario import Scenario
from .parameter_space import drawn

__all__ = ["Descent"]

Array: TypeAlias = NDArray[np.float64]
Row: TypeAlias = dict[str, Any]

#: A number of the loop, and an entry of it.
ENTRY = re.compile(r"(law\.[A-Za-z_]+|run\.(?:q0|v0))(?:\[(\d+)\])?")
#: Bytes for the states that an adjoint keeps.
MEMORY = 1 << 26


class Descent:
    """The search of one scenario.

    Args:
        scenario: the scenario.
        space: search intervals by path.
        conditions: values under which each candidate runs.
        loss: a loss of `armlet.gradient`.
        worst: whether the cost of a candidate is that of its worst condition; else it is the mean.
        failed: the cost of a run that ends early.
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
        #: Every candidate that was run, and its cost.
        self.tried: list[Row] = []
        self.paid: list[float] = []

    def own(self) -> Array:
        """The relative positions of the scenario's values in their intervals, (k,); 1/2 for a value outside of its interval."""
        return np.array([_place(spec, _value(self.scenario, path)) for path, spec in self.space.items()])

    def evaluate(self, u: Array) -> tuple[float, Array]:
        """The cost at `u` and its derivatives, (k,)."""
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
        """Search from `u`, and return whether the search converged."""
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
        """The loss of one run and its derivatives with respect to the values that are searched."""
        scenario = self.scenario.replace(values)
        built = scenario.build()
        keywords = {"monitors": False, "check_limits": False, **built.arguments}
        keywords.pop("sensitivity", None)
        loop = _loop(built)
        known = named_numbers(*loop)
        names = _names(self.space)

        def alone(k: int) -> list[Variants]:
            return [self._variants(scenario, loop, known, path, values[path]) for path in names[k][1]]

        shared = [_together(loop, known, values, own) for _, own in names]
        loops: Varied = stacked(loop, [named for named, _ in names], shared, alone)
        q0 = keywords.pop("q0")
        return of_loops("tune", self.loss, (built.plant, built.law, q0), loops, keywords, MEMORY)

    def _variants(self, scenario: Scenario, loop: Loop, known: Mapping[str, Array], path: str, value: float) -> Variants:
        found = _entry(known, path, value)
        if found is None:
            return _built(scenario, path, value)
        name, index = found
        return entry_variants(loop, name, known[name], index)


def _entry(known: Mapping[str, Array], path: str, value: float) -> tuple[str, tuple[int, ...]] | None:
    """The named number and the index of a path; None if it is not an entry of this value."""
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
    """A name for each path, with its paths. Neighbouring entries of one array share a name, as they enter the programs of a loop alike."""
    names = []
    for array, group in groupby(paths, lambda path: found[1] if (found := ENTRY.fullmatch(path)) else path):
        entries = list(group)
        names.append((NamedNumber(entries[0] if len(entries) == 1 else array, np.zeros(len(entries))), entries))
    return names


def _together(loop: Loop, known: Mapping[str, Array], values: Row, paths: Sequence[str]) -> Together | None:
    """Loops in which the entries of these paths move together; None if they are not entries of one number."""
    found = [_entry(known, path, values[path]) for path in paths]
    names = {each[0] for each in found if each is not None}
    if None in found or len(names) != 1:
        return None
    name = names.pop()
    return together(loop, NamedNumber(name, known[name]), [each[1] for each in found if each is not None])


def _loop(built: Any) -> Loop:
    """The loop of a scenario that is built."""
    start = {name: built.arguments.get(name) for name in START}
    return built.plant, built.law, {name: None if x is None else np.asarray(x, dtype=np.float64) for name, x in start.items()}


def _built(scenario: Scenario, path: str, value: float) -> Variants:
    """Four loops of the scenario with other values at `path`, and the weights of the derivative."""
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
    """The scenario's value at a path; NaN where it has none."""
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
    """The derivative of a value with respect to its relative position in the search interval."""
    ((kind, (low, high)),) = spec.items()
    return float(high - low if kind == "uniform" else value * math.log(high / low))
