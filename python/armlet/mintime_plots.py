"""Deprecated name of `armlet.figures.minimum_time`."""

import warnings

from .figures.minimum_time import MinimumTime

__all__ = ["MinimumTime"]

warnings.warn("armlet.mintime_plots is now armlet.figures.minimum_time", DeprecationWarning, stacklevel=2)
