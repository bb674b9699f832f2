"""Many runs of one scenario, and the search of its best values: `armlet.sweep`, `armlet.tune`. The folder has another name, because
`armlet.sweep` is the function."""

from .execution import SweepTable, sweep
from .tuning import Tuning, tune

__all__ = ["SweepTable", "Tuning", "sweep", "tune"]
