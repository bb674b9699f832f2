"""The systems of the laboratory, in the order of its menu."""

from __future__ import annotations

from .adaptive import AdaptivePR
from .elastic import Elastic
from .mintime import MinimumTime
from .priority import Priority
from .robot import Robot
from .system import Choice, Control, Force, Plot, Slider, State, System, Values

__all__ = [
    "AdaptivePR",
    "Choice",
    "Control",
    "Elastic",
    "Force",
    "MinimumTime",
    "Plot",
    "Priority",
    "Robot",
    "Slider",
    "State",
    "System",
    "Values",
]
