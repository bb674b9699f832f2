"""The line of the caller's code that a warning names."""

from __future__ import annotations

import sys

__all__ = ["level_of_caller"]


def level_of_caller() -> int:
    """Return the stack level of the first caller outside this package, for the `warnings.warn` of the calling function."""
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and str(frame.f_globals.get("__name__", "")).partition(".")[0] == "armlet":
        level, frame = level + 1, frame.f_back
    return level
