"""Many runs of one scenario (`armlet.sweep`), the search for its best values (`armlet.tune`) and for its worst case (`armlet.worst_case`).

The folder is not called `sweep`, because `armlet.sweep` is a function.
"""

from .execution import SweepTable, sweep
from .tuning import Tuning, tune
from .worst import WorstCase, worst_case

__all__ = ["SweepTable", "Tuning", "WorstCase", "sweep", "tune", "worst_case"]
