"""Fit models to logs of robots, and test the assumptions of the fit."""

from .fit import LogFit
from .models import fit_log
from .refuted import Refuted

__all__ = ["LogFit", "Refuted", "fit_log"]
