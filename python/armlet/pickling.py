"""Pickles of Python objects with a checksum, as those of the extension: a changed bit raises `FormatError`, and never makes another
object."""

from __future__ import annotations

from copy import deepcopy
from typing import Any, TypeVar

from . import _core

__all__ = ["sealed"]

C = TypeVar("C", bound=type)


def sealed(kind: C) -> C:
    """Give the objects of a class, which consist of their fields and of the entries of a dict or a tuple, pickles with a checksum."""

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
    """An object whose parts were checked when it was first made."""
    made = tuple.__new__(kind, entries) if isinstance(entries, tuple) else kind.__new__(kind)
    if isinstance(entries, dict):
        made.update(entries)
    if fields:
        vars(made).update(fields)
    return made
