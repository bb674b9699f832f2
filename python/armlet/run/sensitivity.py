"""Derivatives of all recorded series of a run with respect to named numbers of its loop, computed forwards in time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from .. import _core
from ..arguments import shown
from ..border import bordered
from ..errors import InputError
from ..pickling import sealed
from ..status import Status, having
from .events import watched
from .named_numbers import NamedNumber, Varied, varied, varied_rows
from .options import LoopOptions, RunOptions, starts
from .recorded import Array

__all__ = [
    "Sensitivity",
    "derived",
    "naming",
    "of_row",
    "of_rows",
    "of_run",
    "options_at",
    "require_names",
    "series_of",
    "split",
    "vary",
    "vary_rows",
]

T = TypeVar("T")


@bordered
@sealed
@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Derivatives of the series of a run with respect to one named number.

    Entry `[k, i, j]` of `q` is the derivative of `q[k, i]` of the run with respect to entry `j` of the number. Its unit is the unit of the
    series per unit of the number. For a batch the axis B of the runs comes first, and a run without derivatives is NaN.

    Attributes:
        name: name of the number, such as "law.kp".
        shape: shape of the number, which has `size` entries in C order.
        t: times of the records, (K,), s.
        q, v, tau: derivatives of joint positions, joint velocities and inputs, (K, n, size).
        estimate: derivatives of the law's state, (K, p, size); None for laws without a state.
        theta, theta_dot: derivatives of motor positions and velocities, (K, n, size); None without elastic joints.
        bristles: derivatives of the bristles of `LuGre` friction, (K, n, size); None without this friction.
    """

    name: str
    shape: tuple[int, ...]
    t: Array
    q: Array
    v: Array
    tau: Array
    estimate: Array | None = None
    theta: Array | None = None
    theta_dot: Array | None = None
    bristles: Array | None = None

    @property
    def size(self) -> int:
        """The number of entries of the number."""
        return int(np.prod(self.shape, dtype=np.int64))

    def __repr__(self) -> str:
        rows = f"{self.q.shape[0]} rows, " if self.q.ndim == 4 else ""
        return f"Sensitivity({self.name!r}, shape={self.shape}, {rows}{self.q.shape[-3]} records)"

    def plot(self, fig: Any = None) -> Any:
        """Draw the derivatives over time: a column per joint, rows for position, velocity, input. It requires matplotlib (extra `plot`).

        Args:
            fig: a matplotlib figure for the drawing; None makes one with pyplot.

        Returns:
            The axes, an array (3, n) of `matplotlib.axes.Axes`.

        Raises:
            ImportError: matplotlib is not installed.
            InputError: the derivatives belong to a batch.
        """
        from ..figures.sensitivity import plot

        return plot(self, fig)


def require_names(function: str, argument: str, names: Any) -> list[str]:
    """Return `names` as a list of strings.

    Raises:
        InputError: `names` is neither a string nor a sequence of at least one string.
    """
    if isinstance(names, str):
        return [names]
    if not isinstance(names, Sequence) or not names or not all(isinstance(name, str) for name in names):
        raise InputError(f'{function}: {argument} is not a list of names: expected a list such as ["law.kp", "q0"], got {shown(names)}')
    return list(names)


def vary(function: str, plant: Any, law: Any, q0: Any, options: RunOptions, names: Sequence[str]) -> Varied:
    """Make the loops in which the numbers `names` differ, from the arguments of `simulate`.

    Raises:
        InputError: the law is a Python function, a name is unknown, or an event ends the run.
    """
    if not isinstance(law, _core.Law):
        raise InputError(f"{function}: law has no derivatives: expected a law of armlet such as Adaptive, got {shown(law)}")
    if any(event.stop for event in watched(options.get("events"))):
        raise InputError(f"{function}: events that end the run have no derivatives: expected events without stop with sensitivity")
    n = law.arm.n
    others = {name: None if x is None else _core.numbers(function, name, x, (n,)) for name, x in starts(options).items()}
    start = {"q0": _core.numbers(function, "q0", q0, (n,)), **others}
    return varied(function, plant, law, start, names)


def vary_rows(function: str, plant: Any, law: Any, q0: Any, options: LoopOptions, names: Sequence[str]) -> Varied:
    """Make the loops in which the numbers `names` differ, for each row of a batch, from the arguments of `simulate_batch`.

    Raises:
        InputError: a law is a Python function, a name is unknown, or a number of rows is wrong.
    """
    plants, laws = (list(each) if isinstance(each, list | tuple) else [each] for each in (plant, law))
    for i, each in enumerate(laws):
        if not isinstance(each, _core.Law):
            raise InputError(f"{function}: law has no derivatives: expected laws of armlet, got {shown(each)} (first bad index {i})")
    if not laws or not plants:
        raise InputError(f"{function}: plant or law is empty: expected one object, or one per row, got []")
    first = _core.numbers(function, "q0", q0, ("B", laws[0].arm.n))
    rows = len(first)
    if not rows:
        raise InputError(f"{function}: q0 has no rows: expected at least one with sensitivity, got shape {first.shape}")
    others = {name: None if x is None else _core.numbers(function, name, x, first.shape) for name, x in starts(options).items()}
    for name, values in (("plant", plants), ("law", laws)):
        if len(values) not in (1, rows):
            raise InputError(f"{function}: {name} has the wrong number of entries: expected 1 or {rows}, got {len(values)}")
    at = {"q0": first, **others}
    loops = [
        (plants[min(r, len(plants) - 1)], laws[min(r, len(laws) - 1)], {name: None if x is None else x[r] for name, x in at.items()})
        for r in range(rows)
    ]
    return varied_rows(function, loops, names)


def options_at(options: LoopOptions, loops: Varied, t: Array) -> LoopOptions:
    """Return the options for the derivatives of a run at the times `t` of its records, (K,), s."""
    start, method = loops.start, options.get("method", "rk4")
    own: LoopOptions = {"v0": start["v0"], "theta0": start["theta0"], "theta_dot0": start["theta_dot0"], "method": method}
    return {**options, **own, "t_eval": t, "record_every": 1, "monitors": False}


def of_run(loops: Varied, options: LoopOptions, t: Array) -> dict[str, Sensitivity]:
    """Return the derivatives of a run by name, at the times `t` of its records."""
    rates = derived("simulate", loops, lambda loops: _core._sensitivities(*loops.runs, options_at(options, loops, t)))
    parts = split(loops.names)
    return {named.name: Sensitivity(named.name, named.value.shape, t, **_columns(rates, part)) for named, part in parts}


def of_rows(loops: Varied, options: LoopOptions, t: Array, status: Any, threads: int | None) -> dict[str, Sensitivity]:
    """Return the derivatives of the runs of a batch by name: NaN for runs that did not reach their end."""
    with naming("simulate_batch", loops):
        rates = _core._sensitivities_of_rows(*loops.runs, threads, options_at(options, loops, t))
    ended_early = ~having(status, Status.SUCCESS)
    for values in rates.values():
        values[ended_early] = np.nan
    return {named.name: Sensitivity(named.name, named.value.shape, t, **_columns(rates, part)) for named, part in split(loops.names)}


def of_row(one: Sensitivity, row: int) -> Sensitivity:
    """Return the derivatives of one row of a batch."""
    return Sensitivity(one.name, one.shape, one.t, **{name: values[row] for name, values in series_of(one).items()})


def series_of(one: Sensitivity) -> dict[str, Array]:
    """Return the derivatives of the run's series by name, without the series that are None."""
    values = {name: getattr(one, name) for name in ("q", "v", "tau", "estimate", "theta", "theta_dot", "bristles")}
    return {name: value for name, value in values.items() if value is not None}


def derived(function: str, loops: Varied, work: Callable[[Varied], T]) -> T:
    """Return `work(loops)`.

    The core may refuse loops that each change several entries of a number at once. Then `work` is called with separate loops for each
    entry.
    """
    if loops.apart is not None:
        try:
            return work(loops)
        except InputError:
            loops = loops.apart()
    with naming(function, loops):
        return work(loops)


@contextmanager
def naming(function: str, loops: Varied) -> Iterator[None]:
    """Replace the index of a number by its name in the errors that the core raises."""
    try:
        yield
    except InputError as error:
        if error.argument != "sensitivity" or not error.index:
            raise
        place = error.index[0]
        name = next(named.name for named, part in split(loops.names) if part.start <= place < part.stop)
        named_error = InputError(f"{function}: {name} {error.problem}")
        named_error.argument, named_error.problem = name, error.problem
        raise named_error from None


def _columns(rates: Mapping[str, Array], part: slice) -> dict[str, Array]:
    return {series: np.ascontiguousarray(values[..., part]) for series, values in rates.items()}


def split(names: Sequence[NamedNumber]) -> Iterator[tuple[NamedNumber, slice]]:
    """Yield each name with the slice of its entries in the vector of all entries."""
    first = 0
    for named in names:
        yield named, slice(first, first + named.value.size)
        first += named.value.size
