"""Kinds of tables from the classes of the extension: the keys of a table are the parameters of the constructor.

A class needs no further declaration if each of its parameters has a field of the same name.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Container, Iterable, Mapping
from typing import Any

from .. import _core
from .fields import Field, Kind

__all__ = ["classes_of", "derived"]


def classes_of(base: type, listed: Container[str] = ()) -> list[type]:
    """The classes of the extension that are derived from `base`, except classes whose names are in `listed`."""
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
    """Return the kind of table that describes the class `kind`.

    Args:
        kind: the class.
        fields: the field of each parameter, by name.
        needs: names of other tables of the scenario. The constructor receives the objects of these tables that are among its parameters.
        required: keys that a table must have although the constructor has a default.
        known: keys that a table may omit although the constructor has no default.
        make: function that makes the object; None: the class.
    """
    parameters = inspect.signature(kind).parameters
    taken = tuple(need for need in needs if need in parameters)
    own = {name: parameter for name, parameter in parameters.items() if name not in taken}
    must = [name for name, each in own.items() if name in required or (each.default is each.empty and name not in known)]
    names = [*must, *(name for name in own if name not in must)]
    return Kind({name: fields[name] for name in names}, tuple(must), make or kind, taken)
