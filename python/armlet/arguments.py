"""Checks of arguments: `number(function, name, value)` returns a float, or raises an InputError that names the function and the argument.

A message has the form `function: name problem: expected .., got ..`. Some messages omit the part `got ..`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import fields
from itertools import islice
from os import PathLike, fspath
from reprlib import Repr
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from .errors import InputError

__all__ = [
    "brief",
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
    "require_partner",
    "require_shallow",
    "shown",
    "text",
]

T = TypeVar("T")

# Largest allowed nesting depth of lists and tables in an argument.
DEPTH = 32


def one_line(text: str) -> str:
    """Return `text` in one line. Characters that do not print are replaced, for example terminal codes and marks of text direction."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in " ".join(text.split()))


def shown(value: object) -> str:
    """Return `value`, of any type, as a short text in one line, for a message."""
    if isinstance(value, np.ndarray) and value.size > 100:
        return f"an array {value.shape} of {value.dtype}"
    try:
        words = " ".join(_SHORT.repr(value).split())
    except Exception:  # the object's own `__repr__` failed
        return f"an object of type {type(value).__name__}"
    return words if len(words) <= 60 else words[:57] + "..."


def brief(record: Any) -> str:
    """Return the `repr` of a dataclass. An array of more than 30 entries is replaced by its shape."""

    def one(value: object) -> str:
        return f"an array {value.shape}" if isinstance(value, np.ndarray) and value.size > 30 else repr(value)

    return f"{type(record).__name__}({', '.join(f'{each.name}={one(getattr(record, each.name))}' for each in fields(record))})"


class _Short(Repr):
    """A `repr` that shortens long values and deeply nested values."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel = 8
        self.maxlist = self.maxtuple = self.maxdict = self.maxset = self.maxfrozenset = self.maxarray = self.maxdeque = 30
        self.maxstring = self.maxother = self.maxlong = 80

    def repr_dict(self, x: dict[Any, Any], level: int) -> str:
        """Return the entries in the order of the dict. They are not sorted, because keys may have no order."""
        if level <= 0 and x:
            return "{...}"
        parts = [f"{self.repr1(key, level - 1)}: {self.repr1(part, level - 1)}" for key, part in islice(x.items(), self.maxdict)]
        return "{" + ", ".join(parts + ["..."] * (len(x) > self.maxdict)) + "}"


_SHORT = _Short()


def number(function: str, name: str, value: object) -> float:
    """Check that `value` is a real number and return it as a float. Infinity and NaN are valid."""
    real = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    if isinstance(value, np.ndarray) and value.ndim == 0 and value.dtype.kind in "iuf":
        # A masked entry is not a number.
        real = not isinstance(value, np.ma.MaskedArray)
    if not real:
        raise InputError(f"{function}: {name} is not a number: expected a real number such as 1.0, got {shown(value)}")
    try:
        x = float(value)  # type: ignore[arg-type]  # the code above checked that it is a number
    except OverflowError:
        raise InputError(f"{function}: {name} is too large: expected a number within the range of float64, got {shown(value)}") from None
    if isinstance(value, int | np.integer) and int(value) != x:
        raise InputError(f"{function}: {name} is not exact in float64: expected a number that float64 represents, got {shown(value)}")
    return x


def positive(function: str, name: str, value: object, most: float = math.inf) -> float:
    """Check that `value` is a number in (0, most] and return it. Infinity is valid if `most` is infinite."""
    x = number(function, name, value)
    if not 0.0 < x <= most:
        raise InputError(f"{function}: {name} is out of range: expected a number in (0, {most:g}], got {shown(value)}")
    return x


def integer(function: str, name: str, value: object, least: int = 0, most: int | None = None) -> int:
    """Check that `value` is an integer from `least` to `most` and return it. Integers of numpy are valid; True and 1.0 are not."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or value < least:  # type: ignore[operator]  # `whole` implies an integer
        raise InputError(f"{function}: {name} is not a count: expected an integer >= {least}, got {shown(value)}")
    if most is not None and value > most:  # type: ignore[operator]
        raise InputError(f"{function}: {name} is beyond reason: expected at most {most:,}, got {shown(value)}")
    return int(value)  # type: ignore[call-overload,no-any-return]


def finite(function: str, name: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Check that all entries of the array `values` are finite and return it. `_core.numbers` has converted it to float64."""
    if not np.isfinite(values).all():
        at = np.argwhere(~np.isfinite(values))[0].tolist()
        where = f" (first bad index {at[0] if len(at) == 1 else tuple(at)})" if at else ""
        raise InputError(f"{function}: {name} is not finite: expected finite numbers, got {values[tuple(at)]}{where}")
    return values


def text(function: str, name: str, value: object) -> str:
    """Check that `value` is a string and return it."""
    if not isinstance(value, str):
        raise InputError(f"{function}: {name} is not a text: expected a string, got {shown(value)}")
    return value


def choice(function: str, name: str, value: object, known: Iterable[str]) -> str:
    """Check that `value` is one of the texts `known` and return it."""
    known = list(known)
    if not isinstance(value, str) or value not in known:
        raise InputError(f"{function}: {name} is unknown: expected one of {', '.join(known)}, got {shown(value)}")
    return value


def count(function: str, name: str, value: object) -> int:
    """Check that `value` is a whole number >= 0, such as 2 or 2.0, and return it as an integer.

    True and False count as 1 and 0, as in the attribute `terminal` of scipy's events.
    """
    whole = value if isinstance(value, bool) else number(function, name, value)
    if not math.isfinite(whole) or int(whole) != whole or whole < 0:
        raise InputError(f"{function}: {name} is not a count: expected an integer >= 0, got {shown(value)}")
    return int(whole)


def entries(function: str, name: str, value: object, most: int) -> list[Any]:
    """Return the entries of a finite iterable as a list, if there are at most `most`."""
    if not isinstance(value, Iterable) and not hasattr(type(value), "__getitem__"):
        raise InputError(f"{function}: {name} is not a sequence: expected a list or a tuple, got {shown(value)}")
    found = list(islice(iter(value), most + 1))  # type: ignore[call-overload]  # `iter` also accepts `__getitem__`
    if len(found) > most:
        raise InputError(f"{function}: {name} is too long: expected at most {most:,} entries")
    return found


def instance(function: str, name: str, value: object, kind: type[T] | tuple[type[T], ...], expected: str) -> T:
    """Check that `value` is an instance of `kind` and return it. `expected` describes `kind` in the message."""
    if isinstance(value, kind):
        return value
    raise InputError(f"{function}: {name} is of the wrong type: expected {expected}, got {shown(value)}")


def file_path(function: str, value: object, name: str = "path") -> str:
    """Check that `value` is a path that the operating system accepts, and return it as a string.

    Raises:
        InputError: `value` is not a path, is empty, or contains characters that are not valid in a path.
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


def require_partner(function: str, name: str, value: object, partner: str, present: bool, default: object = None) -> None:
    """Refuse the argument `name`, which takes effect only with `partner`, unless the partner is present or `value` is the default."""
    given = value is not default and not (isinstance(value, str | int | float | np.generic) and value == default)
    if given and not present:
        raise InputError(f"{function}: {name} takes effect only with {partner}: expected {default!r} without it, got {shown(value)}")


def require_shallow(function: str, name: str, value: object, depth: int = DEPTH) -> None:
    """Refuse lists, tuples and mappings that are nested deeper than `depth` or contain themselves.

    Recursive functions can process the accepted values without a RecursionError.
    """
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
