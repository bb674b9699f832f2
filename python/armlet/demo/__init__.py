"""`armlet demo`: the systems of the exam "Robotics 2" (10 June 2022), simulated by armlet and checked against the theory.

Each system is one module with a `TITLE` and a function `run(report)`. SYSTEMS lists the modules in the order of the report.
"""

from __future__ import annotations

import time
from importlib import import_module
from pathlib import Path

from .. import _core
from .checks import Check
from .report import Report

__all__ = ["SYSTEMS", "Check", "Report", "demonstrate"]

SYSTEMS = ("adaptive", "priority", "elastic", "mintime")


def demonstrate(out: Path, *, figures: bool = True) -> Report:
    """Run every system, print its table of checks, and write the figures and the HTML page into `out`.

    A system that raises an error counts as a failed check, except an OSError, which is raised.
    """
    report = Report(out, figures=figures)
    for name in SYSTEMS:
        module = import_module(f".{name}", __name__)
        report.section(module.TITLE)
        start = time.perf_counter()
        try:
            module.run(report)
        except OSError:
            raise  # a fault of the disk, not of the system; the command line prints it
        except Exception as error:
            report.equal("runs to its end", "yes", f"{type(error).__name__}: {error}")
        report.close_section(time.perf_counter() - start)
    build = [f"{name.replace('_', ' ')} {value}" for name, value in _core.build_info().items() if name != "version"]
    report.write_page(", ".join([f"armlet {_core.__version__}", *build]))
    return report
