"""Deprecated name of `armlet.figures.time_path`."""

import warnings

from .figures.time_path import PathTiming

__all__ = ["PathTiming"]

warnings.warn("armlet.path_plots is now armlet.figures.time_path", DeprecationWarning, stacklevel=2)
