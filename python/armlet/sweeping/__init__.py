"""Many runs of one scenario (`armlet.sweep`), and the search for its best gains and other values (`armlet.tune`).

The folder is not called `sweep`, because `armlet.sweep` is a function.
"""

from .execution import SweepTable, sweep
from .tuning import Tuning, tune

__all__ = ["SweepTable", "Tuning", "sweep", "tune"]
