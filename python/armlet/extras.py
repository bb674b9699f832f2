"""Libraries that armlet uses where they are installed."""

from __future__ import annotations

from importlib import import_module
from shlex import quote
from typing import Any

__all__ = ["extra"]


def extra(caller: str, module: str, install: str, library: str | None = None) -> Any:
    """The module of an optional library; `install`: the argument of pip that installs it.

    Raises:
        ImportError: `library`, by default the package of `module`, is not installed; the message begins with `caller`.
    """
    try:
        return import_module(module)
    except ImportError:
        library = library or module.partition(".")[0]
        raise ImportError(f"{caller}: {library} is not installed: pip install {quote(install)}") from None
