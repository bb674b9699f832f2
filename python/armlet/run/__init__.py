"""Runs of closed loops: arguments, results, metrics and storage.

The folder is flat, because each property of a run has one file.
"""

from .records import BatchRun, Run, load

__all__ = ["BatchRun", "Run", "load"]
