"""Import of optional libraries. The extras of `pyproject.toml` install them."""

from __future__ import annotations

from importlib import import_module
from typing import Any

__all__ = ["extra", "missing"]


def missing(caller: str, library: str, name: str) -> ImportError:
    """The error for a library that is not installed. `name` is the extra that installs it.

    The advice installs from the sources. No package index has armlet, so another author could publish a package of this name.
    """
    return ImportError(f"{caller}: {library} is not installed: pip install '.[{name}]' in the folder of armlet's sources")


def extra(caller: str, module: str, name: str, library: str | None = None) -> Any:
    """Import the module of an optional library and return it. `name` is the extra that installs the library.

    Raises:
        ImportError: the library is not installed. The message begins with `caller` and names `library`, by default the package of `module`.
    """
    try:
        return import_module(module)
    except ImportError:
        raise missing(caller, library or module.partition(".")[0], name) from None
