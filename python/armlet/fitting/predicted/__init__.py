"""The prediction fit: a plant that predicts recorded positions from recorded torques."""

from .fit import predicted_fit
from .plant_numbers import KINDS

__all__ = ["KINDS", "predicted_fit"]
