"""Logs of robots: read recordings of many kinds, report their faults, and prepare them for identification."""

from .fit import LogFit
from .fitting import fit_log
from .log import Log
from .reading import read_log
from .report import LogReport

__all__ = ["Log", "LogFit", "LogReport", "fit_log", "read_log"]
