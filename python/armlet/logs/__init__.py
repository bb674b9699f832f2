"""Logs of robots: read recordings of many kinds, report their faults, and prepare them for identification."""

from .log import Log
from .reading import read_log
from .report import LogReport

__all__ = ["Log", "LogReport", "read_log"]
