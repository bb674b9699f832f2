"""Runs of closed loops: what they take, what they return, what sums them up, and how they are stored."""

from .records import BatchRun, Run, load

__all__ = ["BatchRun", "Run", "load"]
