"""Derivatives of a run with respect to named numbers of its loop: forward, of all its series."""

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
from .named_numbers import START, NamedNumber, Varied, varied, varied_rows
from .recorded import Array

__all__ = [
    "Sensitivity",
    "derived",
    "naming",
    "of_row",
    "of_rows",
    "of_run",
    "require_names",
    "run_keywords",
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

    Entry `[k, i, j]` is the derivative of `q[k, i]` with respect to entry `j` of the number. Those of a batch have its rows before the time
    axis, NaN where a row has no derivatives.

    Attributes:
        name: the name, such as "law.kp".
        shape: the shape of the number; `size` entries in C order.
        t: times of the records, (K,), s.
        q, v, tau: (K, n, size), in units of the series per unit of the number.
        estimate: of the law's own state, (K, p, size); None for laws without one.
        theta, theta_dot: of the motors, (K, n, size); None without elastic joints.
        bristles: of the bristles of `LuGre` friction, (K, n, size); None without.
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
        """Entries of the number."""
        return int(np.prod(self.shape, dtype=np.int64))

    def __repr__(self) -> str:
        rows = f"{self.q.shape[0]} rows, " if self.q.ndim == 4 else ""
        return f"Sensitivity({self.name!r}, shape={self.shape}, {rows}{self.q.shape[-3]} records)"

    def plot(self, fig: Any = None) -> Any:
        """Draw the derivatives over time: a column for each joint, rows of position, velocity and input. Needs matplotlib (`armlet[plot]`).

        Args:
            fig: a matplotlib figure to draw into; None makes one with pyplot.

        Returns:
            The axes, (3, n).

        Raises:
            ImportError: matplotlib is not installed.
            InputError: these are derivatives of a batch.
        """
        from ..figures.sensitivity import plot

        return plot(self, fig)


def require_names(function: str, argument: str, names: Any) -> list[str]:
    """Names as a list of texts.

    Raises:
        InputError: `names` is not a list of texts.
    """
    if isinstance(names, str):
        return [names]
    if not isinstance(names, Sequence) or not names or not all(isinstance(name, str) for name in names):
        raise InputError(f'{function}: {argument} is not a list of names: expected such as ["law.kp", "q0"], got {shown(names)}')
    return list(names)


def vary(function: str, plant: Any, law: Any, q0: Any, keywords: Mapping[str, Any], names: Sequence[str]) -> Varied:
    """The loops in which the numbers of these names differ, from the arguments of `simulate`.

    Raises:
        InputError: the law is a function in Python, a name is unknown, or an event ends the run.
    """
    if not isinstance(law, _core.Law):
        raise InputError(f"{function}: law has no derivatives: expected a law of armlet such as Adaptive, got {shown(law)}")
    if any(event.stop for event in watched(keywords.get("events"))):
        raise InputError(f"{function}: events that end the run have no derivatives: expected events without stop with sensitivity")
    n = law.arm.n
    given = {"q0": q0, **{name: keywords.get(name) for name in START[1:]}}
    start = {name: None if value is None else _core.numbers(function, name, value, (n,)) for name, value in given.items()}
    return varied(function, plant, law, start, names)


def vary_rows(function: str, plant: Any, law: Any, q0: Any, keywords: Mapping[str, Any], names: Sequence[str]) -> Varied:
    """The same of each row of a batch, from the arguments of `simulate_batch`.

    Raises:
        InputError: a law is a function in Python, a name is unknown, or the rows do not fit each other.
    """
    plants, laws = (list(each) if isinstance(each, list | tuple) else [each] for each in (plant, law))
    for i, each in enumerate(laws):
        if not isinstance(each, _core.Law):
            raise InputError(f"{function}: law has no derivatives: expected laws of armlet, got {shown(each)} (first bad index {i})")
    if not laws or not plants:
        raise InputError(f"{function}: plant or law is empty: expected one, or one per row, got []")
    starts = {"q0": _core.numbers(function, "q0", q0, ("B", laws[0].arm.n))}
    rows = len(starts["q0"])
    if not rows:
        raise InputError(f"{function}: q0 has no rows: expected at least one with sensitivity, got shape {starts['q0'].shape}")
    for name in START[1:]:
        if keywords.get(name) is not None:
            starts[name] = _core.numbers(function, name, keywords[name], starts["q0"].shape)
    for name, values in (("plant", plants), ("law", laws)):
        if len(values) not in (1, rows):
            raise InputError(f"{function}: {name} has the wrong number of entries: expected 1 or {rows}, got {len(values)}")
    at = {name: starts.get(name) for name in START}
    loops = [
        (plants[min(r, len(plants) - 1)], laws[min(r, len(laws) - 1)], {name: None if x is None else x[r] for name, x in at.items()})
        for r in range(rows)
    ]
    return varied_rows(function, loops, names)


def run_keywords(keywords: Mapping[str, Any], loops: Varied, t: Array) -> dict[str, Any]:
    """The keywords of a run for its derivatives at the times `t` of its records."""
    own = {"t_eval": t, "record_every": 1, "monitors": False, "events": None}
    return {**keywords, **{name: loops.start[name] for name in START[1:]}, **own}


def of_run(loops: Varied, keywords: Mapping[str, Any], t: Array) -> dict[str, Sensitivity]:
    """The derivatives of the run of these arguments at its records, by name."""
    rates = derived("simulate", loops, lambda loops: _core._sensitivities(*loops.runs, run_keywords(keywords, loops, t)))
    parts = split(loops.names)
    return {named.name: Sensitivity(named.name, named.value.shape, t, **_columns(rates, part)) for named, part in parts}


def of_rows(loops: Varied, keywords: Mapping[str, Any], t: Array, status: Any, threads: int | None) -> dict[str, Sensitivity]:
    """The derivatives of the runs of a batch, by name; NaN for rows that did not reach their end."""
    with naming("simulate_batch", loops):
        rates = _core._sensitivities_of_rows(*loops.runs, threads, run_keywords(keywords, loops, t))
    ended_early = ~having(status, Status.SUCCESS)
    for values in rates.values():
        values[ended_early] = np.nan
    return {named.name: Sensitivity(named.name, named.value.shape, t, **_columns(rates, part)) for named, part in split(loops.names)}


def of_row(one: Sensitivity, row: int) -> Sensitivity:
    """The derivatives of one row of a batch."""
    return Sensitivity(one.name, one.shape, one.t, **{name: values[row] for name, values in series_of(one).items()})


def series_of(one: Sensitivity) -> dict[str, Array]:
    """The derivatives that are there, by series."""
    values = {name: getattr(one, name) for name in ("q", "v", "tau", "estimate", "theta", "theta_dot", "bristles")}
    return {name: value for name, value in values.items() if value is not None}


def derived(function: str, loops: Varied, work: Callable[[Varied], T]) -> T:
    """The result of `work` on the loops. If the core refuses loops in which entries move together, each entry gets its own loops."""
    if loops.apart is not None:
        try:
            return work(loops)
        except InputError:
            loops = loops.apart()
    with naming(function, loops):
        return work(loops)


@contextmanager
def naming(function: str, loops: Varied) -> Iterator[None]:
    """Raise the errors of the core with the name of a number instead of its index."""
    try:
        yield
    except InputError as error:
        if error.argument != "sensitivity" or not error.index:
            raise
        place = error.index[0]
        name = next(named.name for named, part in split(loops.names) if part.start <= place < part.stop)
        raise InputError(f"{function}: {name} {error.problem}") from None


def _columns(rates: Mapping[str, Array], part: slice) -> dict[str, Array]:
    return {series: np.ascontiguousarray(values[..., part]) for series, values in rates.items()}


def split(names: Sequence[NamedNumber]) -> Iterator[tuple[NamedNumber, slice]]:
    """Each name with its place among all numbers."""
    first = 0
    for named in names:
        yield named, slice(first, first + named.value.size)
        first += named.value.size
