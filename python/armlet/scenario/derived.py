"""Kinds of a scenario from the classes of the extension: the keys of a table are the parameters of a constructor.

A class needs no entry if each of its parameters has a field of the same name.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Container, Iterable, Mapping
from typing import Any

from .. import _core
from .fields import Field, Kind

__all__ = ["classes_of", "derived"]


def classes_of(base: type, listed: Container[str] = ()) -> list[type]:
    """The classes of the extension below `base` that are not listed by name."""
    below = [each for each in vars(_core).values() if isinstance(each, type) and issubclass(each, base)]
    return [each for each in below if each is not base and each.__name__ not in listed]


def derived(
    kind: type,
    fields: Mapping[str, Field],
    *,
    needs: Iterable[str] = (),
    required: Container[str] = (),
    known: Container[str] = (),
    make: Callable[..., Any] | None = None,
) -> Kind:
    """The kind of table that makes a class.

    Args:
        kind: the class.
        fields: the field of each parameter, by name.
        needs: other tables of the scenario; the constructor receives those that are among its parameters.
        required: keys that a table must have although the constructor has a default.
        known: keys that a table may leave out although the constructor has none.
        make: function that makes the object; the class if None.
    """
    parameters = inspect.signature(kind).parameters
    taken = tuple(need for need in needs if need in parameters)
    own = {name: parameter for name, parameter in parameters.items() if name not in taken}
    must = [name for name, each in own.items() if name in required or (each.default is each.empty and name not in known)]
    names = [*must, *(name for name in own if name not in must)]
    return Kind({name: fields[name] for name in names}, tuple(must), make or kind, taken)
