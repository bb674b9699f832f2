"""Pickles of Python objects with a checksum, like the pickles of the extension's classes.

A changed bit of a pickle raises an error, `FormatError` or an error of pickle, and never makes a different object.
"""

from __future__ import annotations

from copy import deepcopy
from typing import Any, TypeVar

from . import _core

__all__ = ["sealed"]

C = TypeVar("C", bound=type)


def sealed(kind: C) -> C:
    """Class decorator: pickles of the objects have a checksum.

    A pickle contains the attributes of the object, and its entries if it is a dict or a tuple.
    """

    def parts(thing: Any) -> tuple[type, Any, dict[str, Any]]:
        entries = dict(thing) if isinstance(thing, dict) else tuple(thing) if isinstance(thing, tuple) else None
        return type(thing), entries, dict(getattr(thing, "__dict__", {}))

    def reduce(self: Any, protocol: Any) -> Any:
        return _core._seal(_remade, parts(self))

    def shallow(self: Any) -> Any:
        return _remade(*parts(self))

    def deep(self: Any, memo: dict[int, Any]) -> Any:
        kind, entries, fields = parts(self)
        return _remade(kind, deepcopy(entries, memo), deepcopy(fields, memo))

    for name, method in (("__reduce_ex__", reduce), ("__copy__", shallow), ("__deepcopy__", deep)):
        method.__name__, method.__qualname__ = name, f"{kind.__name__}.{name}"
        setattr(kind, name, method)
    return kind


def _remade(kind: Any, entries: Any, fields: dict[str, Any]) -> Any:
    """Make an object from its parts without checks, because the parts were checked by its constructor."""
    made = tuple.__new__(kind, entries) if isinstance(entries, tuple) else kind.__new__(kind)
    if isinstance(entries, dict):
        made.update(entries)
    if fields:
        vars(made).update(fields)
    return made
