"""Worker processes of a sweep import this module to fail at chosen cells: those whose first joint starts at a position in BAD."""

from __future__ import annotations

import os
from importlib import import_module
from pathlib import Path
from typing import Any

BAD = (0.3, 0.7)


def sabotage(how: str, log: str) -> None:
    """Make batches with a bad cell fail in this process: raise, raise only once, or abort. Each failure is written to the file `log`."""
    chunk: Any = import_module("armlet.sweeping.chunk")
    whole = chunk.simulate_batch

    def batch(plants: Any, laws: Any, q0: Any, **keywords: Any) -> Any:
        bad = [x for x in BAD if (q0[:, 0] == x).any()]
        if bad:
            first = not Path(log).exists()
            with open(log, "a") as file:
                file.write("".join(f"{x}\n" for x in bad))
            if how == "abort":
                os.abort()
            if how == "raise" or first:
                raise ZeroDivisionError("a law's fault")
        return whole(plants, laws, q0, **keywords)

    chunk.simulate_batch = batch


def die(how: str = "", log: str = "") -> None:
    """End the process, as a worker that cannot start."""
    os.abort()
