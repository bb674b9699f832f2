"""Progress and remaining time of long computations, as a line on standard error."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any, TextIO

from .arguments import shown
from .errors import InputError

__all__ = ["Progress", "reporter", "search_reporter"]


class Progress:
    """A callback `(done, total)` that rewrites one line with the remaining time.

    The estimate of the remaining time uses the mean speed since the object was made, or since `start`.
    """

    def __init__(self, what: str, stream: TextIO | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        self._what, self._stream, self._clock = what, stream, clock
        self._began, self._first, self._width = clock(), 0, 0

    def start(self, done: int) -> None:
        """Set the amount that was done before the start, such as cells of an earlier run."""
        self._began, self._first = self._clock(), done

    def __call__(self, done: int, total: int) -> None:
        text = f"{done:,} of {total:,} {self._what}"
        passed, fresh = self._clock() - self._began, done - self._first
        if done < total and fresh > 0:
            text += f", {duration(passed * (total - done) / fresh)} left"
        elif done >= total:
            text += f" in {duration(passed)}"
        # Spaces extend the line to the length of the longest earlier line, so that no old characters remain.
        self._width = max(self._width, len(text))
        stream = sys.stderr if self._stream is None else self._stream
        print(f"\r{text:{self._width}}", end="\n" if done >= total else "", file=stream, flush=True)


def duration(seconds: float) -> str:
    """Return a duration as text: `4 s`, `3 min 20 s`, `2 h 5 min`."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    minutes, rest = divmod(whole, 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def reporter(caller: str, progress: Any, what: str) -> Any:
    """Return the progress callback: a function of the caller; `Progress` for True; None for None or False.

    Raises:
        InputError: `progress` is none of these.
    """
    if progress is True:
        return Progress(what)
    if progress is None or progress is False:
        return None
    if not callable(progress):
        raise InputError(f"{caller}: progress is not callable: expected a function, True or None, got {shown(progress)}")
    return progress


def search_reporter(caller: str, progress: Any, what: str, total: int) -> Callable[[int, float], object]:
    """Return the progress callback of a search. Its arguments are the number of finished `what` and the best value so far."""
    report = reporter(caller, progress, what)
    if isinstance(report, Progress):
        return lambda done, best: report(done, total)
    return report or (lambda done, best: None)
