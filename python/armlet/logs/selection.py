"""Select the columns of a file for times, positions, velocities and torques, in the order of the joints, with their factors to SI units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import choice, entries, shown, text
from ..errors import InputError
from .headers import Column, Key, recognised
from .units import factor

__all__ = ["QUANTITIES", "Expected", "Selection", "select"]

Array = NDArray[np.float64]

#: Names of the quantities of the joints in `columns=` and `units=`. The names that end with `_d` are references.
QUANTITIES = ("q", "v", "tau", "theta", "q_d", "v_d", "a_d", "tau_d")
#: The largest number of joints and columns.
MOST = 10_000


@dataclass(frozen=True)
class Expected:
    """What the caller states about a log: names of the joints, whether they slide, units and columns."""

    function: str
    names: tuple[str, ...] | None
    prismatic: tuple[bool, ...] | None
    units: Mapping[str, Any]
    columns: Mapping[str, Any]


@dataclass
class Selection:
    """The columns of each quantity, by index, with factors to SI units; the joints; and remarks for the report."""

    names: tuple[str, ...]
    prismatic: tuple[bool, ...]
    times: list[tuple[int, float | None]]
    columns: dict[str, list[int]]
    factors: dict[str, list[float]]
    remarks: list[str] = field(default_factory=list)

    @property
    def indices(self) -> list[int]:
        """Indices of all selected columns, without repetition, ascending."""
        return sorted({index for index, _ in self.times} | {index for each in self.columns.values() for index in each})


def select(headers: Sequence[str], expected: Expected) -> Selection:
    """Find the columns of a file with the column names `headers`.

    Raises:
        InputError: two columns have one name or one meaning, a joint is missing, or a unit does not fit.
    """
    function = expected.function
    found: dict[tuple[str, Key], tuple[int, Column]] = {}
    times: list[tuple[int, str | None]] = []
    repeated = sorted({name for name in headers if headers.count(name) > 1 and name}) if len(set(headers)) < len(headers) else []
    if repeated:
        raise InputError(f"{function}: columns have the same name: expected different names, got {repeated[0]!r} more than once")
    for index, name in enumerate(headers):
        column = recognised(name, expected.names)
        if column is not None and column.quantity == "t":
            times.append((index, column.unit))
        elif column is not None:
            _add(found, index, column, headers, expected)
    given = _given(headers, expected)
    by_quantity = {name: {joint: each for (other, joint), each in found.items() if other == name} for name in QUANTITIES}
    for name in set(given) & set(QUANTITIES):
        by_quantity[name] = {(k,): (index, Column(name, (k,))) for k, index in enumerate(given[name])}
    names, keys = _joints(by_quantity, expected)
    columns = {name: _ordered(name, by_quantity[name], keys, names, expected) for name in QUANTITIES if by_quantity[name]}
    columns = {name: each for name, each in columns.items() if each}
    selection = _converted(columns, names, headers, expected)
    stated = given.get("t")
    selection.times = _clock([(stated[0], None)] if stated else times, headers, expected, selection.remarks)
    used = set(selection.indices)
    ignored = [name for index, name in enumerate(headers) if index not in used and name]
    if ignored:
        selection.remarks.append(f"not used: {', '.join(map(repr, ignored[:20]))}{', ..' if len(ignored) > 20 else ''}")
    return selection


def _add(found: dict[tuple[str, Key], tuple[int, Column]], index: int, column: Column, headers: Sequence[str], expected: Expected) -> None:
    if column.ambiguous:
        others = [recognised(header, expected.names) for header in headers]
        chain = any(each is not None and each.quantity == "a" and not each.desired for each in others)
        if not chain and not {"v", "q_d"} & set(expected.columns):
            problem = "may be a velocity or a desired position: expected columns= with 'v' or 'q_d'"
            raise InputError(f"{expected.function}: column {headers[index]!r} {problem}, got neither")
    name = f"{column.quantity}_d" if column.desired else column.quantity
    before = found.setdefault((name, column.joint), (index, column))
    if before[0] != index and name in QUANTITIES and name not in expected.columns:
        both = f"{headers[before[0]]!r} and {headers[index]!r}"
        meaning = f"have one meaning ({name} of joint {column.joint})"
        raise InputError(f"{expected.function}: columns {both} {meaning}: expected columns= to choose")


def _given(headers: Sequence[str], expected: Expected) -> dict[str, list[int]]:
    """Indices of the columns that `columns=` names."""
    function = expected.function
    given: dict[str, list[int]] = {}
    for name, value in expected.columns.items():
        choice(function, "columns", name, ("t", *QUANTITIES))
        listed = [value] if isinstance(value, str | int) else entries(function, "columns", value, MOST)
        indices: list[int] = []
        for each in listed:
            if isinstance(each, str) and each in headers:
                indices.append(list(headers).index(each))
            elif isinstance(each, int) and not isinstance(each, bool) and 0 <= each < len(headers):
                indices.append(each)
            else:
                known = ", ".join(headers[:30])
                raise InputError(f"{function}: columns has an unknown column: expected one of {known}, got {shown(each)}")
        if not indices or (name == "t" and len(indices) > 1):
            much = "many" if indices else "few"
            raise InputError(f"{function}: columns of {name} are too {much}: expected one per joint, got {len(indices)}")
        given[name] = indices
    return given


def _joints(by_quantity: Mapping[str, Mapping[Key, Any]], expected: Expected) -> tuple[tuple[str, ...], list[Key]]:
    """The names of the joints, and their keys in the columns of positions."""
    source = next((name for name in ("q", "q_d", "v", "tau") if by_quantity[name]), None)
    if source is None:
        expectation = "expected columns such as q1 or elbow_position, or columns="
        raise InputError(f"{expected.function}: the file has no joints: {expectation}, got none")
    if expected.names is not None:
        return expected.names, list(expected.names)
    keys = list(by_quantity[source])
    numbered = sorted((key for key in keys if not isinstance(key, str)), key=lambda key: key[-1:])
    keys = list(numbered) or keys
    first = 1 - keys[0][-1] if not isinstance(keys[0], str) and keys[0] else 1
    return tuple(key if isinstance(key, str) else f"joint{key[-1] + first if key else 1}" for key in keys), keys


def _ordered(
    name: str, found: Mapping[Key, tuple[int, Column]], keys: list[Key], names: tuple[str, ...], expected: Expected
) -> list[tuple[int, Column]]:
    """The columns of a quantity in the order of the joints; empty if no column fits."""
    numbered = sorted(key for key in found if not isinstance(key, str))
    if numbered and (expected.names is not None or name in expected.columns):
        if len(numbered) != len(names) and not any(each in found for each in names):
            problem = f"columns of {name} do not fit the joints {', '.join(names)}"
            raise InputError(f"{expected.function}: {problem}: expected {len(names)}, got {len(numbered)}")
        keys = list(numbered) if len(numbered) == len(names) else keys
    missing = [joint for joint, key in zip(names, keys, strict=True) if key not in found]
    if missing and (len(missing) < len(names) or name == "q"):
        listed = ", ".join(str(key) for key in found)
        raise InputError(f"{expected.function}: {name} of joint {missing[0]!r} is missing: expected a column for each joint, got {listed}")
    return [] if missing else [found[key] for key in keys]


def _converted(
    columns: Mapping[str, list[tuple[int, Column]]], names: tuple[str, ...], headers: Sequence[str], expected: Expected
) -> Selection:
    """The selection with the factors to SI units. A unit comes from `units=`, from the name of a column, or is the SI unit."""
    function, stated = expected.function, {}
    for name, value in expected.units.items():
        choice(function, "units", name, ("t", *QUANTITIES))
        stated[name] = [value] * len(names) if isinstance(value, str) else entries(function, "units", value, MOST)
        if name != "t" and len(stated[name]) != len(names):
            raise InputError(f"{function}: units of {name} have the wrong size: expected {len(names)}, got {len(stated[name])}")
    slides: list[bool | None] = list(expected.prismatic or [None] * len(names))
    factors: dict[str, list[float]] = {}
    assumed = []
    for name, each in columns.items():
        factors[name] = []
        letter = name.removesuffix("_d")
        units = stated.get(name) or stated.get(letter) or [column.unit for _, column in each]
        for joint, unit in enumerate(units):
            scale = 1.0
            if unit is not None:
                scale, sliding = factor(function, letter, unit, headers[each[joint][0]], slides[joint])
                slides[joint] = sliding if slides[joint] is None else slides[joint]
            factors[name].append(scale)
        if None in units:
            assumed.append(name)
    remarks = [f"SI units assumed for {', '.join(assumed)}"] if assumed else []
    indices = {name: [index for index, _ in each] for name, each in columns.items()}
    return Selection(names, tuple(bool(each) for each in slides), [], indices, factors, remarks)


def _clock(
    times: Sequence[tuple[int, str | None]], headers: Sequence[str], expected: Expected, remarks: list[str]
) -> list[tuple[int, float | None]]:
    """The columns of the time with their factors (None: without unit). Seconds and nanoseconds in two columns are added."""
    if not times:
        return []
    seconds = [each for each in times if each[1] == "s"]
    fractions = [each for each in times if each[1] == "ns"]
    chosen = [seconds[0], fractions[0]] if seconds and fractions and "t" not in expected.columns else [times[0]]
    if len(times) > len(chosen):
        remarks.append(f"several columns are times: {headers[chosen[0][0]]!r} is used")
    given = expected.units.get("t")
    if given is not None:
        return [(chosen[0][0], factor(expected.function, "t", text(expected.function, "units", given), headers[chosen[0][0]], None)[0])]
    return [(index, None if unit is None else factor(expected.function, "t", unit, headers[index], None)[0]) for index, unit in chosen]
