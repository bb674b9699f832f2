"""The figures of armlet, one file per figure, in one style. Only drawing imports matplotlib. This module exports the style."""

# The folder is flat, because each figure has one file.
from .style import COLOURS, available, literal, require, sheet

__all__ = ["COLOURS", "available", "literal", "require", "sheet"]
