"""Derivatives of a run with respect to named numbers of its loop: forward, of all its series."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import _core
from ..arguments import shown
from ..border import bordered
from ..errors import InputError
from ..pickling import sealed
from .named_numbers import START, NamedNumber, Varied, varied
from .recorded import Array

__all__ = ["Sensitivity", "naming", "of_run", "require_names", "run_keywords", "split", "vary"]


@bordered
@sealed
@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Derivatives of the series of a run with respect to one named number.

    Entry `[k, i, j]` is the derivative of `q[k, i]` with respect to entry `j` of the number.

    Attributes:
        name: the name, such as "law.kp".
        shape: the shape of the number; `size` entries in C order.
        q, v, tau: (K, n, size), in units of the series per unit of the number.
        estimate: of the law's own state, (K, p, size); None for laws without one.
        theta, theta_dot: of the motors, (K, n, size); None without elastic joints.
        bristles: of the bristles of `LuGre` friction, (K, n, size); None without.
    """

    name: str
    shape: tuple[int, ...]
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
        return f"Sensitivity({self.name!r}, shape={self.shape}, {self.q.shape[0]} records)"


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
        InputError: the law is a function in Python, a name is unknown, or events are located.
    """
    if not isinstance(law, _core.Law):
        raise InputError(f"{function}: law has no derivatives: expected a law of armlet such as Adaptive, got {shown(law)}")
    if keywords.get("events"):
        raise InputError(f"{function}: events have no derivatives: expected None with sensitivity")
    n = law.arm.n
    given = {"q0": q0, **{name: keywords.get(name) for name in START[1:]}}
    start = {name: None if value is None else _core.numbers(function, name, value, (n,)) for name, value in given.items()}
    return varied(function, plant, law, start, names)


def run_keywords(keywords: Mapping[str, Any], loops: Varied, t: Array) -> dict[str, Any]:
    """The keywords of a run for its derivatives at the times `t` of its records."""
    return {**keywords, **{name: loops.start[name] for name in START[1:]}, "t_eval": t, "record_every": 1, "monitors": False}


def of_run(loops: Varied, keywords: Mapping[str, Any], t: Array) -> dict[str, Sensitivity]:
    """The derivatives of the run of these arguments at its records, by name."""
    with naming("simulate", loops):
        rates = _core._sensitivities(*loops.runs, run_keywords(keywords, loops, t))
    parts = split(loops.names)
    return {named.name: Sensitivity(named.name, named.value.shape, **_columns(rates, part)) for named, part in parts}


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
