"""Figures, one file each, in one style; matplotlib is imported when one is drawn. Here stands the style, for figures of your own."""

from .style import COLOURS, available, literal, require, sheet

__all__ = ["COLOURS", "available", "literal", "require", "sheet"]
