"""Assemble a log from the columns of a file: units, missing numbers, times and angles."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .clock import Clock, examined, repaired, unwrapped
from .log import SERIES, Log
from .report import LogReport
from .selection import Selection

__all__ = ["Raw", "assembled"]

Array = NDArray[np.float64]

#: Clock values above these are dates in smaller units than seconds: 1e11 s is the year 5138.
_DATES = ((1e17, 1e-9, "ns"), (1e14, 1e-6, "us"), (1e11, 1e-3, "ms"))


@dataclass(frozen=True)
class Raw:
    """The selected columns of a source."""

    path: str
    headers: Sequence[str]
    selection: Selection
    #: Numbers of each selected column by its index, (K,) each, in the units of the file.
    columns: Mapping[int, Array]
    #: The line of a row in a text file, for messages.
    line: Callable[[int], int] | None = None
    #: The clock's value that was subtracted from the times, s.
    start: float = 0.0

    def place(self, row: int, column: int | None = None) -> str:
        """Where a row, or a cell of a column, is in the source, for messages."""
        where = f"read_log: {self.path} " + (f"line {self.line(row)}" if self.line else f"row {row}")
        return where if column is None else f"{where}, column {column + 1} ({self.headers[column]})"


def assembled(raw: Raw, dt: float | None, *, drop: bool, repair: bool, unwrap: bool) -> Log:
    """Make the log.

    Raises:
        InputError: a number is missing, the times do not increase, or there are no times.
    """
    selection = raw.selection
    if not selection.columns.get("q"):
        problem = "has no positions: expected a column of positions for each joint"
        raise InputError(f"read_log: {raw.path} {problem}, got {', '.join(selection.columns)}")
    remarks = list(selection.remarks)
    columns, rows, incomplete = _complete(raw, drop)
    t, start = _times(raw, rows, dt, remarks)
    tables = {
        name: np.stack([columns[index] * scale for index, scale in zip(indices, selection.factors[name], strict=True)], axis=1)
        for name, indices in selection.columns.items()
        if all(index in columns for index in indices)
    }
    if "q" not in tables:
        raise InputError(f"read_log: {raw.path} has no positions: expected numbers, got only NaN")
    remarks += [f"{name} has no values" for name in selection.columns if name not in tables]
    t, tables, kept, repeated = _without_repeated(t, tables)
    clock = examined(t, tables["q"], start)
    _check_clock(raw, t, rows[kept], clock, repair)
    fixed = repaired(t, clock) if repair else t
    turns = ~np.array(selection.prismatic, dtype=bool) & unwrap
    wraps = np.zeros(len(turns), dtype=np.intp)
    for name in ("q", "theta", "q_d"):
        if name in tables:
            tables[name], counts = unwrapped(tables[name], turns)
            wraps = counts if name == "q" else wraps
    references = {name.removesuffix("_d"): values for name, values in tables.items() if name.endswith("_d")}
    series: dict[str, Any] = {name: tables.get(name) for name in SERIES[1:]}
    units = tuple("m" if slides else "rad" for slides in selection.prismatic)
    log = Log(fixed, tables["q"], **series, references=references, names=selection.names, units=units, start=start)
    log.report = _report(log, t, clock, repair, (repeated, incomplete), wraps, remarks)
    return log


def _complete(raw: Raw, drop: bool) -> tuple[dict[int, Array], NDArray[np.intp], int]:
    """The columns that have values, the indices of their rows, and the number of rows that were removed because a number is missing."""
    columns = dict(raw.columns)
    finite = {index: np.isfinite(values) for index, values in columns.items()}
    partial = {index for index, each in finite.items() if not each.all()}
    for each in raw.selection.columns.values():
        if all(index in partial and np.isnan(columns[index]).all() for index in each):
            partial -= set(each)
            columns = {index: values for index, values in columns.items() if index not in each}
    count = len(next(iter(raw.columns.values())))
    if not count:
        raise InputError(f"read_log: {raw.path} has no samples: expected at least one row of numbers, got none")
    if not partial:
        return columns, np.arange(count), 0
    if not drop:
        row, index = min((int(np.argmin(finite[index])), index) for index in partial)
        advice = "expected a finite number (missing='drop' removes the samples)"
        raise InputError(f"{raw.place(row, index)} is not finite: {advice}, got {columns[index][row]}")
    sound = np.logical_and.reduce([finite[index] for index in partial])
    if not sound.any():
        raise InputError(f"read_log: {raw.path} has no complete sample: expected at least one row without NaN, got none")
    return {index: values[sound] for index, values in columns.items()}, np.flatnonzero(sound), int(count - sound.sum())


def _times(raw: Raw, rows: NDArray[np.intp], dt: float | None, remarks: list[str]) -> tuple[Array, float]:
    """The times from the first sample on, s, and the value of the clock there, s."""
    times = raw.selection.times
    if not times or dt is not None:
        if dt is None:
            listed = ", ".join(raw.headers)[:200]
            raise InputError(f"read_log: {raw.path} has no times: expected a column such as time, or dt=, got {listed}")
        if times:
            remarks.append(f"the times of the file are not used: dt = {dt:g} s")
        return dt * (rows - rows[0]), 0.0
    t, start = np.zeros(len(rows)), raw.start
    for index, scale in times:
        values = raw.columns[index]
        values = values if len(rows) == len(values) else values[rows]
        if scale is None:
            scale = next((factor for above, factor, _ in _DATES if np.abs(values[0]) > above), 1.0)
            named = next((unit for above, _, unit in _DATES if np.abs(values[0]) > above), "s")
            remarks += [f"the times are dates in {named}"] if named != "s" else []
        # The first value is subtracted before the unit is converted, because dates have many digits.
        t += (values - values[0]) * scale
        start += float(values[0] * scale)
    return t, start


def _without_repeated(t: Array, tables: dict[str, Array]) -> tuple[Array, dict[str, Array], NDArray[np.intp], int]:
    """Remove samples that are equal to the sample before, in time and in all values."""
    same = np.concatenate([[False], np.diff(t) == 0.0])
    if same.any():
        for values in tables.values():
            same[1:] &= (np.diff(values, axis=0) == 0.0).all(axis=1)
    if not same.any():
        return t, tables, np.arange(len(t)), 0
    kept = np.flatnonzero(~same)
    return t[kept], {name: values[kept] for name, values in tables.items()}, kept, int(same.sum())


def _check_clock(raw: Raw, t: Array, rows: NDArray[np.intp], clock: Clock, repair: bool) -> None:
    backward = clock.jumps[np.diff(t)[clock.jumps] <= 0.0]
    if len(backward) and not repair:
        k = int(backward[0])
        advice = "expected increasing times (repair_clock=True replaces jumps of the clock)"
        found = f"got {t[k + 1]:.9g} s after {t[k]:.9g} s"
        raise InputError(f"{raw.place(int(rows[k + 1]))} is not later than the line before: {advice}, {found}")
    if repair and len(clock.jumps) and not clock.period > 0.0:
        raise InputError(f"read_log: {raw.path} has no clock: expected times that increase somewhere, got equal or decreasing times")


def _report(
    log: Log, t: Array, clock: Clock, repair: bool, removed: tuple[int, int], wraps: NDArray[np.intp], remarks: list[str]
) -> LogReport:
    jumps = tuple((float(log.t[k]), float(t[k + 1] - t[k] - clock.period)) for k in clock.jumps)
    gaps = tuple((float(log.t[k]), round((t[k + 1] - t[k]) / clock.period) - 1) for k in clock.gaps)
    found = replace(log.report, gaps=gaps, dropped=clock.dropped, clock_jumps=jumps, repaired=repair and bool(jumps))
    found = replace(found, repeated=removed[0], incomplete=removed[1], wraps=tuple(wraps.tolist()))
    # A large angle without a unit is probably in degrees.
    if any("assumed" in remark and "q" in remark for remark in remarks):
        most = np.abs(log.q).max(axis=0)
        large = [name for name, unit, angle in zip(log.names, log.units, most, strict=True) if unit == "rad" and angle > 40.0]
        remarks += [f"positions of {', '.join(large)} exceed 40 rad: if they are degrees, pass units={{'q': 'deg'}}"] if large else []
    return replace(found, remarks=(*found.remarks, *remarks))
