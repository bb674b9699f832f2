"""Figures, one file each, in one style. Drawing imports matplotlib. This module exports the style for your figures."""

from .style import COLOURS, available, literal, require, sheet

__all__ = ["COLOURS", "available", "literal", "require", "sheet"]
