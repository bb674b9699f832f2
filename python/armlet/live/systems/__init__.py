"""The systems of the laboratory, and the parts of their interface."""

from __future__ import annotations

from .adaptive import AdaptivePR
from .elastic import Elastic
from .mintime import MinimumTime
from .observer import Observer
from .priority import Limits, Priority
from .redundant import Redundant
from .robot import Robot
from .stiction import Stiction
from .system import Choice, Control, Force, Plot, Slider, State, System, Values

__all__ = [
    "AdaptivePR",
    "Choice",
    "Control",
    "Elastic",
    "Force",
    "Limits",
    "MinimumTime",
    "Observer",
    "Plot",
    "Priority",
    "Redundant",
    "Robot",
    "Slider",
    "State",
    "Stiction",
    "System",
    "Values",
]
