"""The command line `armlet ..`: one function per command."""

from .command_line import main

__all__ = ["main"]
