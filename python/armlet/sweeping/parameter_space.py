"""The cells of a sweep: the varied quantities, and their values in cell i.

A grid has every combination of the listed values, and the last quantity varies fastest. Draws are random: each quantity of cell `i` has a
number `u = U(seed, i, quantity)`, uniform in [0, 1). The value is the inverse distribution function at `u`. So a cell's values do not
depend on the order or number of workers.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import instance, integer, require_shallow, shown, text
from ..errors import InputError

__all__ = ["MOST", "Cells", "ListedCells", "columns", "drawn", "place_in", "rate_in", "value_at"]

LISTS = ("linspace", "geomspace")
DISTRIBUTIONS = ("uniform", "log_uniform", "normal", "integers")
# Largest number of values in one list. The expanded list is kept in memory.
MOST = 10_000_000
# Largest number of cells of a sweep. Its table is kept in memory.
MOST_CELLS = 100_000_000


@dataclass(frozen=True)
class Cells:
    """The cells of a sweep: values by path for each cell.

    Args:
        vary: for each path a list of values. With `draws` also `{"uniform": [a, b]}`, `{"log_uniform": [a, b]}`,
            `{"normal": [mean, deviation]}` and `{"integers": [a, b]}` with `a` and `b` included. `of` also accepts
            `{"linspace": [a, b, n]}` and `{"geomspace": [a, b, n]}`, and expands them.
        draws: number of random cells. Each takes a random value of every list and distribution. None makes a cell for every combination
            of the values.
        seed: seed of the draws, an integer >= 0.
    """

    vary: Mapping[str, Any]
    draws: int | None
    seed: int

    @staticmethod
    def of(vary: Mapping[str, Any], draws: int | None, seed: int) -> Cells:
        """Check the arguments, and expand `linspace` and `geomspace` to lists."""
        instance("sweep", "vary", vary, Mapping, "a table of values by path")
        draws = None if draws is None else integer("sweep", "draws", draws, 1)
        if integer("sweep", "seed", seed) >= 2**31:
            raise InputError(f"sweep: seed is too large: expected an integer < 2**31, got {shown(seed)}")
        if not vary:
            raise InputError("sweep: vary is empty: expected at least one path with its values")
        if draws is not None and draws > MOST_CELLS:
            raise InputError(f"sweep: draws is too large: expected at most {MOST_CELLS:,}, got {shown(draws)}")
        paths = [text("sweep", "vary", path) for path in vary]
        require_shallow("sweep", "vary", vary)
        cells = Cells({path: _listed(path, vary[path], draws) for path in paths}, draws, int(seed))
        if cells.count > MOST_CELLS:
            raise InputError(f"sweep: vary has too many combinations: expected at most {MOST_CELLS:,} cells, got {cells.count}")
        return cells

    @property
    def count(self) -> int:
        """The number of cells."""
        return self.draws if self.draws is not None else math.prod(len(values) for values in self.vary.values())

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, i: int) -> dict[str, Any]:
        """Return the values of cell `i` by path."""
        if self.draws is None:
            # The last quantity varies fastest, so its index is the first remainder.
            chosen: dict[str, Any] = dict.fromkeys(self.vary)
            rest = i
            for path in reversed(chosen):
                rest, k = divmod(rest, len(self.vary[path]))
                chosen[path] = self.vary[path][k]
            if rest != 0:
                raise IndexError(f"Cells: cell is out of range: expected 0..{self.count - 1}, got {i}")
            return chosen
        u = np.random.Generator(np.random.PCG64(np.random.SeedSequence([self.seed, i]))).random(len(self.vary))
        return {path: drawn(spec, float(each)) for (path, spec), each in zip(self.vary.items(), u, strict=True)}

    def sampling_seed(self, i: int, stated: int = 0) -> int:
        """Return the seed of noise and jitter in run `i`. `stated` is that of its scenario. Consecutive cells have consecutive seeds."""
        return (self.seed << 32) + i


@dataclass(frozen=True)
class ListedCells(Cells):
    """Cells whose values are stored in a list, one entry per cell. With `own_seeds`, noise and jitter have the seed of the scenario."""

    rows: Sequence[dict[str, Any]] = field(default=())
    own_seeds: bool = False

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, i: int) -> dict[str, Any]:
        return self.rows[i]

    def sampling_seed(self, i: int, stated: int = 0) -> int:
        return stated if self.own_seeds else super().sampling_seed(i, stated)


def _listed(path: str, spec: Any, draws: int | None) -> Any:
    def fault(expected: str) -> InputError:
        return InputError(f'sweep: $.sweep.vary."{path}": expected {expected}, got {shown(spec)}')

    if not isinstance(spec, Mapping):
        values = spec.tolist() if hasattr(spec, "tolist") else spec
        if isinstance(values, str) or not isinstance(values, Sequence) or not values:
            raise fault("a list of values")
        return [value.tolist() if hasattr(value, "tolist") else value for value in values]
    kind, numbers = next(iter(spec.items()), ("", ()))
    numbers = list(numbers) if isinstance(numbers, Sequence | np.ndarray) and not isinstance(numbers, str) else []
    if len(spec) != 1 or kind not in (*LISTS, *DISTRIBUTIONS):
        raise fault(f"a table with one of {', '.join((*LISTS, *DISTRIBUTIONS))}")
    real = [isinstance(x, int | float | np.number) and not isinstance(x, bool) and math.isfinite(x) for x in numbers]
    if kind in LISTS:
        if len(numbers) != 3 or not all(real) or numbers[2] < 1 or numbers[2] != int(numbers[2]):
            raise fault(f"{kind} = [first, last, count]")
        if numbers[2] > MOST:
            raise fault(f"at most {MOST:,} values")
        if kind == "geomspace" and min(numbers[:2]) <= 0:
            raise fault("geomspace between numbers > 0")
        make = np.linspace if kind == "linspace" else np.geomspace
        return make(numbers[0], numbers[1], int(numbers[2])).tolist()
    if draws is None:
        raise InputError(f'sweep: $.sweep.vary."{path}": {kind} is random: expected draws, the number of random cells')
    if len(numbers) != 2 or not all(real):
        raise fault(f"{kind} = [{'mean, deviation' if kind == 'normal' else 'low, high'}]")
    whole = kind != "integers" or all(x == int(x) for x in numbers)
    if not whole or (numbers[1] < 0 if kind == "normal" else numbers[1] < numbers[0] or (kind == "log_uniform" and numbers[0] <= 0)):
        bounds = {
            "normal": "a deviation >= 0",
            "uniform": "low <= high",
            "log_uniform": "0 < low <= high",
            "integers": "integers low <= high",
        }
        raise fault(bounds[kind])
    return {kind: [int(x) if kind == "integers" else float(x) for x in numbers]}


def drawn(spec: Any, u: float) -> Any:
    """Return the value of a quantity at `u` in [0, 1]: an element of a list, or the inverse distribution function at `u`."""
    if not isinstance(spec, Mapping):
        return spec[min(int(u * len(spec)), len(spec) - 1)]
    ((kind, (a, b)),) = spec.items()
    if kind == "integers":
        return a + min(int(u * (b - a + 1)), b - a)
    if kind == "uniform":
        return min(max(a + (b - a) * u, a), b)
    if kind == "log_uniform":
        return min(max(a * math.exp(math.log(b / a) * u), a), b)
    # random() can return exactly 0, where the inverse of the normal distribution is infinite.
    return a + b * NormalDist().inv_cdf(max(u, 2.0**-54))


def value_at(data: Mapping[str, Any], path: str) -> Any:
    """Return the value in the tables `data` at `path`, such as `law.kd[1]`. Return None if there is none."""
    at: Any = data
    try:
        for key in re.findall(r"[^.\[\]]+", path):
            at = at[int(key)] if isinstance(at, Sequence) and not isinstance(at, str) else at[key]
    except (KeyError, IndexError, TypeError, ValueError):
        return None
    return at


def place_in(spec: Any, value: Any) -> float:
    """Return the position in [0, 1] at which `drawn` returns `value`: 1/2 for a value that is outside of the interval or the list."""
    if not isinstance(spec, Mapping):
        return (spec.index(value) + 0.5) / len(spec) if value in spec else 0.5
    ((kind, (low, high)),) = spec.items()
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high or low == high:
        return 0.5
    if kind == "integers":
        return float((value - low + 0.5) / (high - low + 1))
    return float((value - low) / (high - low) if kind == "uniform" else math.log(value / low) / math.log(high / low))


def rate_in(spec: Mapping[str, Any], value: float) -> float:
    """Return the derivative of a value with respect to its position in the interval."""
    ((kind, (low, high)),) = spec.items()
    return float(high - low if kind == "uniform" else value * math.log(high / low))


def columns(rows: Sequence[Mapping[str, Any]]) -> dict[str, NDArray[Any]]:
    """Return the values of cells as columns by path. A value that is a list becomes one column per entry: `run.q0[0]`, .."""
    table: dict[str, NDArray[Any]] = {}
    for path in rows[0] if rows else ():
        try:
            values = np.array([row[path] for row in rows])
        except ValueError:
            values = np.array([], dtype=object)
        if values.dtype == object:
            raise InputError(f"sweep: values of {path} are of different kinds: expected numbers, texts, or lists of one length")
        for index in np.ndindex(values.shape[1:]):
            table[path + "".join(f"[{k}]" for k in index)] = values[(slice(None), *index)]
    return table
