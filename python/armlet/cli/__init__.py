"""The command line, `armlet ..`: every command with its arguments and its output."""

from .command_line import main

__all__ = ["main"]
