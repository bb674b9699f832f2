"""The derivatives of a loss of a run with respect to values of its scenario, by their paths.

A path such as `law.kd[0]` is an entry of the number `law.kd` of the loop, and its derivative is computed as in `armlet.gradient`. For any
other path the scenario is built again with four slightly different values.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from typing import Any, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from ..arguments import shown
from ..errors import InputError
from ..run.gradients import of_loops
from ..run.losses import Loss
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

__all__ = ["loss_and_slopes"]

Array: TypeAlias = NDArray[np.float64]

#: The path of a quantity of the loop, such as `law.kp`, or of one of its entries, such as `run.q0[1]`.
ENTRY = re.compile(r"(law\.[A-Za-z_]+|run\.(?:q0|v0))(?:\[(\d+)\])?")
#: Approximate limit of the states that an adjoint run stores, bytes. Other states are computed again.
MEMORY = 1 << 26


def loss_and_slopes(function: str, loss: Loss, scenario: Scenario, values: Mapping[str, Any], paths: Iterable[str]) -> tuple[float, Array]:
    """Return the loss of the scenario with `values`, and its derivatives with respect to the values at the k `paths`, (k,).

    Raises:
        SolveError: the run ended early, or is not differentiable.
    """
    scenario = scenario.replace(values)
    built = scenario.build()
    options = {"monitors": False, "check_limits": False, **built.arguments}
    options.pop("sensitivity", None)
    loop = _loop(built)
    known = named_numbers(*loop)
    names = _names(paths)

    def variants(path: str) -> Variants:
        found = _entry(known, path, values[path])
        if found is None:
            return _built(function, scenario, path, values[path])
        name, index = found
        return entry_variants(loop, name, known[name], index)

    def alone(k: int) -> list[Variants]:
        return [variants(path) for path in names[k][1]]

    shared = [_together(loop, known, values, own) for _, own in names]
    loops: Varied = stacked(loop, [named for named, _ in names], shared, alone)
    q0 = options.pop("q0")
    return of_loops(function, loss, (built.plant, built.law, q0), loops, cast(RunOptions, options), MEMORY)


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


def _together(loop: Loop, known: Mapping[str, Array], values: Mapping[str, Any], paths: Sequence[str]) -> Together | None:
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


def _built(function: str, scenario: Scenario, path: str, value: float) -> Variants:
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
    raise InputError(f"{function}: {path} cannot be varied at {shown(value)}: {refused}")
