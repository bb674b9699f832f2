"""Libraries that armlet uses where they are installed."""

from __future__ import annotations

from importlib import import_module
from shlex import quote
from typing import Any

__all__ = ["extra"]


def extra(caller: str, module: str, install: str, library: str | None = None) -> Any:
    """The module of a library that need not be there; `install`: what pip is given.

    Raises:
        ImportError: `library`, by default the package of `module`, is not installed; the message begins with `caller`.
    """
    try:
        return import_module(module)
    except ImportError:
        library = library or module.partition(".")[0]
        raise ImportError(f"{caller}: {library} is not installed: pip install {quote(install)}") from None
