"""Arguments of Python functions, read once: `number(function, name, value)` gives a float or an InputError that names both.

Messages read `function: name what is wrong: expected .., got ..`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from os import PathLike, fspath
from typing import TypeVar

import numpy as np

from .errors import InputError

__all__ = ["count", "file_path", "instance", "number", "one_line", "require_shallow", "shown"]

T = TypeVar("T")

# Levels of lists and tables that any argument needs at most.
DEPTH = 32


def one_line(text: str) -> str:
    """`text` in one line; what does not print, orders to a terminal and overrides of the direction among it, is replaced."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in " ".join(text.split()))


def shown(value: object) -> str:
    """A value as a message quotes it: short, in one line, whatever it is."""
    try:
        text = " ".join(repr(value).split())
    except Exception:  # thousands of levels, or an object that cannot show itself
        return f"an object of type {type(value).__name__}"
    return text if len(text) <= 60 else text[:57] + "..."


def number(function: str, name: str, value: object) -> float:
    """A real number, which may be infinite or NaN."""
    real = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
    if isinstance(value, np.ndarray) and value.ndim == 0 and value.dtype.kind in "iuf":
        real = True
    if not real:
        raise InputError(f"{function}: {name} is not a number: expected such as 1.0, got {shown(value)}")
    try:
        return float(value)  # type: ignore[arg-type]  # a number by now
    except OverflowError:
        raise InputError(f"{function}: {name} is too large: expected a number that a float can hold, got {shown(value)}") from None


def count(function: str, name: str, value: object) -> int:
    """An integer >= 0; True and False count as 1 and 0, as `terminal` of scipy's events does."""
    whole = value if isinstance(value, bool) else number(function, name, value)
    if not math.isfinite(whole) or int(whole) != whole or whole < 0:
        raise InputError(f"{function}: {name} is not a count: expected an integer >= 0, got {shown(value)}")
    return int(whole)


def instance(function: str, name: str, value: object, kind: type[T] | tuple[type[T], ...], expected: str) -> T:
    """`value`, which is one of `kind`."""
    if isinstance(value, kind):
        return value
    raise InputError(f"{function}: {name} is of the wrong type: expected {expected}, got {shown(value)}")


def file_path(function: str, value: object) -> str:
    """A path that the system can be asked for.

    Raises:
        InputError: it is none, or holds what no path may.
    """
    if not isinstance(value, str | PathLike):
        raise InputError(f"{function}: path is of the wrong type: expected a path, got {shown(value)}")
    path = fspath(value)
    try:
        whole = isinstance(path, str) and "\0" not in path and bool(path.encode("utf-8", "surrogateescape"))
    except UnicodeEncodeError:
        whole = False
    if not whole:
        raise InputError(f"{function}: path cannot be opened: expected the name of a file, got {shown(path)}")
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
