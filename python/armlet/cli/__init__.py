"""The command line, `armlet ..`: every command with its arguments, and what it prints."""

from .command_line import main

__all__ = ["main"]
