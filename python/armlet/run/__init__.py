"""Runs of closed loops: arguments, results, metrics and storage."""

from .records import BatchRun, Run, load

__all__ = ["BatchRun", "Run", "load"]
