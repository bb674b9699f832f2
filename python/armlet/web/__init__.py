"""Closed loops as web pages that run them in the browser (`armlet.export_web`, `armlet web`)."""

from .export import export_web

__all__ = ["export_web"]
