"""Import of optional libraries."""

from __future__ import annotations

from importlib import import_module
from shlex import quote
from typing import Any

__all__ = ["extra"]


def extra(caller: str, module: str, install: str, library: str | None = None) -> Any:
    """Import the module of an optional library and return it. `install` is the argument of pip that installs the library.

    Raises:
        ImportError: the library is not installed. The message begins with `caller` and names `library`, by default the package of `module`.
    """
    try:
        return import_module(module)
    except ImportError:
        library = library or module.partition(".")[0]
        raise ImportError(f"{caller}: {library} is not installed: pip install {quote(install)}") from None
