"""Arguments of Python functions, read once: `number(function, name, value)` gives a float or an InputError that names both.

Messages read `function: name what is wrong: expected .., got ..`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from itertools import islice
from os import PathLike, fspath
from reprlib import Repr
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from .errors import InputError

__all__ = [
    "choice",
    "count",
    "entries",
    "file_path",
    "finite",
    "instance",
    "integer",
    "number",
    "one_line",
    "positive",
    "require_shallow",
    "shown",
    "text",
]

T = TypeVar("T")

# Levels of lists and tables that any argument needs at most.
DEPTH = 32


def one_line(text: str) -> str:
    """`text` in one line. Characters that do not print are replaced, such as terminal codes and overrides of the direction."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in " ".join(text.split()))


def shown(value: object) -> str:
    """The text of a value in a message: short, in one line, for every type."""
    if isinstance(value, np.ndarray) and value.size > 100:
        return f"an array {value.shape} of {value.dtype}"
    try:
        words = " ".join(_SHORT.repr(value).split())
    except Exception:  # an object that cannot show itself
        return f"an object of type {type(value).__name__}"
    return words if len(words) <= 60 else words[:57] + "..."


class _Short(Repr):
    """A `repr` that stops early where a value is long or deeply nested."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel = 8
        self.maxlist = self.maxtuple = self.maxdict = self.maxset = self.maxfrozenset = self.maxarray = self.maxdeque = 30
        self.maxstring = self.maxother = self.maxlong = 80

    def repr_dict(self, x: dict[Any, Any], level: int) -> str:
        """Entries in the order of the dict: its keys may have no order."""
        if level <= 0 and x:
            return "{...}"
        parts = [f"{self.repr1(key, level - 1)}: {self.repr1(part, level - 1)}" for key, part in islice(x.items(), self.maxdict)]
        return "{" + ", ".join(parts + ["..."] * (len(x) > self.maxdict)) + "}"


_SHORT = _Short()


def number(function: str, name: str, value: object) -> float:
    """A real number, which may be infinite or NaN."""
    real = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    if isinstance(value, np.ndarray) and value.ndim == 0 and value.dtype.kind in "iuf":
        # A masked number is none.
        real = not isinstance(value, np.ma.MaskedArray)
    if not real:
        raise InputError(f"{function}: {name} is not a number: expected such as 1.0, got {shown(value)}")
    try:
        x = float(value)  # type: ignore[arg-type]  # a number by now
    except OverflowError:
        raise InputError(f"{function}: {name} is too large: expected a number that a float can hold, got {shown(value)}") from None
    if isinstance(value, int | np.integer) and int(value) != x:
        raise InputError(f"{function}: {name} is not exact in float64: expected a number that a float can hold, got {shown(value)}")
    return x


def positive(function: str, name: str, value: object, most: float = math.inf) -> float:
    """A number in (0, most]; infinity is valid if `most` is infinite."""
    x = number(function, name, value)
    if not 0.0 < x <= most:
        raise InputError(f"{function}: {name} is out of range: expected a number in (0, {most:g}], got {shown(value)}")
    return x


def integer(function: str, name: str, value: object, least: int = 0, most: int | None = None) -> int:
    """An integer >= `least`, and at most `most`; numpy's too, but neither True nor 1.0."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or value < least:  # type: ignore[operator]  # an integer by now
        raise InputError(f"{function}: {name} is not a count: expected an integer >= {least}, got {shown(value)}")
    if most is not None and value > most:  # type: ignore[operator]
        raise InputError(f"{function}: {name} is beyond reason: expected at most {most:,}, got {shown(value)}")
    return int(value)  # type: ignore[call-overload,no-any-return]


def finite(function: str, name: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """`values`, converted by `_core.numbers`, if all of them are finite."""
    if not np.isfinite(values).all():
        at = np.argwhere(~np.isfinite(values))[0].tolist()
        where = f" (first bad index {at[0] if len(at) == 1 else tuple(at)})" if at else ""
        raise InputError(f"{function}: {name} is not finite: expected finite numbers, got {values[tuple(at)]}{where}")
    return values


def text(function: str, name: str, value: object) -> str:
    """A string."""
    if not isinstance(value, str):
        raise InputError(f"{function}: {name} is not a text: expected a string, got {shown(value)}")
    return value


def choice(function: str, name: str, value: object, known: Iterable[str]) -> str:
    """One of the valid texts `known`."""
    known = list(known)
    if not isinstance(value, str) or value not in known:
        raise InputError(f"{function}: {name} is unknown: expected one of {', '.join(known)}, got {shown(value)}")
    return value


def count(function: str, name: str, value: object) -> int:
    """An integer >= 0; True and False count as 1 and 0, as `terminal` of scipy's events does."""
    whole = value if isinstance(value, bool) else number(function, name, value)
    if not math.isfinite(whole) or int(whole) != whole or whole < 0:
        raise InputError(f"{function}: {name} is not a count: expected an integer >= 0, got {shown(value)}")
    return int(whole)


def entries(function: str, name: str, value: object, most: int) -> list[Any]:
    """The entries of a finite iterable, at most `most` of them."""
    if not isinstance(value, Iterable) and not hasattr(type(value), "__getitem__"):
        raise InputError(f"{function}: {name} is not a sequence: expected a list or a tuple, got {shown(value)}")
    found = list(islice(iter(value), most + 1))  # type: ignore[call-overload]  # by its entries, where it has no iterator
    if len(found) > most:
        raise InputError(f"{function}: {name} is too long: expected at most {most:,} entries")
    return found


def instance(function: str, name: str, value: object, kind: type[T] | tuple[type[T], ...], expected: str) -> T:
    """`value`, if it is an instance of `kind`."""
    if isinstance(value, kind):
        return value
    raise InputError(f"{function}: {name} is of the wrong type: expected {expected}, got {shown(value)}")


def file_path(function: str, value: object, name: str = "path") -> str:
    """A path that the operating system accepts.

    Raises:
        InputError: the value is not a path, or has characters that no path may have.
    """
    if not isinstance(value, str | PathLike):
        raise InputError(f"{function}: {name} is of the wrong type: expected a path, got {shown(value)}")
    path = fspath(value)
    try:
        whole = isinstance(path, str) and "\0" not in path and bool(path.encode("utf-8", "surrogateescape"))
    except UnicodeEncodeError:
        whole = False
    if not whole:
        raise InputError(f"{function}: {name} cannot be opened: expected the name of a file or folder, got {shown(path)}")
    return str(path)


def require_shallow(function: str, name: str, value: object, depth: int = DEPTH) -> None:
    """Refuse lists and tables nested beyond `depth`, or inside themselves, before anything recurses into them."""
    level: list[object] = [value]
    for _ in range(depth):
        below: dict[int, object] = {}
        for each in level:
            parts = each.values() if isinstance(each, Mapping) else each if isinstance(each, list | tuple) else ()
            below |= {id(part): part for part in parts if isinstance(part, Mapping | list | tuple)}
        if not below:
            return
        level = list(below.values())
    raise InputError(f"{function}: {name} is nested too deeply: expected at most {depth} levels of lists and tables")
