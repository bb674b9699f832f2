"""Pictures of environments: the arm as lines between its joints, and a green ring at its target.

It requires matplotlib (extra `plot`).
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import shown
from ..errors import InputError
from ..figures.skeleton import Picture, Skeleton
from ..figures.style import require
from .rows import Rows

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Viewer", "viewer_for"]

SIZE = 480  # width and height of a picture, pixels
#: Number of random configurations within the limits. The picture is large enough for the arm in all these configurations.
SAMPLES = 200


class Viewer:
    """Draw rows of an environment."""

    def __init__(self, caller: str, rows: Rows) -> None:
        require(caller)
        self._caller, self._rows, self._skeleton = caller, rows, Skeleton(caller, rows.arm)
        self._picture: Picture | None = None
        self._window: Figure | None = None
        self._due = 0.0

    def pixels(self, row: int) -> NDArray[np.uint8]:
        """Return the picture of a row, (480, 480, 3)."""
        if self._picture is None:
            self._picture = self._new(None)
        self._draw(self._picture, row)
        return self._picture.pixels()

    def show(self) -> None:
        """Draw the first row in a window, in real time. Nothing is visible if matplotlib's backend has no windows."""
        from matplotlib import pyplot

        if self._picture is None or self._window is None:
            self._window = pyplot.figure()
            self._picture = self._new(self._window)
            if getattr(self._window.canvas, "required_interactive_framework", None):
                pyplot.show(block=False)
        self._draw(self._picture, 0)
        self._window.canvas.flush_events()
        now = time.monotonic()
        time.sleep(min(max(self._due - now, 0.0), self._rows.period))
        self._due = max(self._due, now) + self._rows.period

    def close(self) -> None:
        """Close the window."""
        if self._window is not None:
            from matplotlib import pyplot

            pyplot.close(self._window)
        self._picture = self._window = None

    def _new(self, figure: Figure | None) -> Picture:
        low, high = self._rows.q_limit
        q = np.random.default_rng(0).uniform(low, high, (SAMPLES, len(low)))
        return Picture(self._caller, self._skeleton.lines(q).cloud(), SIZE, figure=figure)

    def _draw(self, picture: Picture, row: int) -> None:
        rows = self._rows
        one = slice(row, row + 1)
        q, k = rows.states.q[one], np.minimum(rows.k[one], rows.length)
        targets = rows.task.points(k, q, rows.goal[one])[0]
        picture.show(self._skeleton.lines(q), 0, f"t = {rows.k[row] * rows.period:.2f} s", targets)

    def __getstate__(self) -> dict[str, Any]:
        # A pickled viewer has no window and no picture.
        return self.__dict__ | {"_picture": None, "_window": None}


def viewer_for(caller: str, mode: str | None, modes: list[str], rows: Rows) -> Viewer | None:
    """Return the viewer for a render mode; None if nothing is drawn."""
    if mode is None:
        return None
    if mode not in modes:
        raise InputError(f"{caller}: render_mode is unknown: expected one of {', '.join(modes)} or None, got {shown(mode)}")
    return Viewer(caller, rows)
