"""Many runs of one scenario, and the search of its best: `armlet.sweep`, `armlet.tune`. (`armlet.sweep` is the function, so no folder.)"""

from .execution import SweepTable, sweep
from .tuning import Tuning, tune

__all__ = ["SweepTable", "Tuning", "sweep", "tune"]
