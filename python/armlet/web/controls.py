"""The controls of a page: sliders, each for one named number of a loop.

A slider has `POSITIONS` positions. The core computes the numbers of the loop's programs for each of them, so that a page needs no set-up of
a loop.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..arguments import number, shown
from ..errors import InputError
from ..run.named_numbers import START, Loop, loop_with, named_numbers
from .labels import labelled

__all__ = ["POSITIONS", "Control", "controls_of", "stacked"]

#: The number of positions of a slider.
POSITIONS = 101
#: The largest number of sliders.
MOST = 40
ENTRY = re.compile(r"(.+)\[([0-9, ]+)\]")
Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class Control:
    """A slider.

    Attributes:
        name: name of the number, with the index of an entry such as "q0[1]".
        label: what the number is; empty if that is not known.
        unit: unit of the number; empty if it is not known, or if the number has no unit.
        values: the number at each position, (POSITIONS,).
        position: the position at the start of the page.
        loops: the loop at each position.
    """

    name: str
    label: str
    unit: str
    values: Array
    position: int
    loops: list[Loop]


def controls_of(plant: Any, law: Any, start: Mapping[str, Any], given: Mapping[str, Any] | None) -> list[Control]:
    """Return the controls of a loop.

    Raises:
        InputError: a name is unknown, a range is not valid, or the loop refuses a value in this range.
    """
    if given is None:
        return []
    if not isinstance(given, Mapping) or len(given) > MOST:
        expected = f'expected a dict of at most {MOST} ranges such as {{"law.kp": (10.0, 100.0)}}'
        raise InputError(f"export_web: controls is not valid: {expected}, got {shown(given)}")
    known = named_numbers(plant, law, start)
    return [_control((plant, law, start), known, name, limits) for name, limits in given.items()]


def _control(loop: Loop, known: Mapping[str, Array], name: object, limits: object) -> Control:
    match = ENTRY.fullmatch(name) if isinstance(name, str) else None
    base = match[1] if match else name
    if not isinstance(base, str) or base not in known:
        raise InputError(f"export_web: controls has an unknown name: expected names of {sorted(known)}, got {shown(name)}")
    label, value = f"export_web: controls[{shown(name)}]", known[base]
    index: tuple[int, ...] | None = tuple(int(i) for i in match[2].split(",")) if match else None
    if index is not None and (len(index) != value.ndim or any(i >= size for i, size in zip(index, value.shape, strict=True))):
        raise InputError(f"{label} has no such entry: expected an index into the shape {value.shape}, got {list(index)}")
    if index is None and not np.all(value == value.flat[0]):
        first = ", ".join("0" for _ in value.shape)
        raise InputError(f"{label} has entries that differ: expected the name of one entry such as {base}[{first}], got {shown(value)}")
    low, high = _limits(label, limits)
    now = float(value.flat[0] if index is None else value[index])
    if not low <= now <= high:
        raise InputError(f"{label} does not contain the value of the loop: expected low <= {now:g} <= high, got ({low:g}, {high:g})")
    values = np.linspace(low, high, POSITIONS)
    position = int(np.argmin(np.abs(values - now)))
    values[position] = now
    loops = []
    for x in values:
        entries = value.copy()
        entries[... if index is None else index] = x
        try:
            loops.append(loop_with(*loop, base, entries))
        except InputError as error:
            raise InputError(f"{label} has a value that the loop refuses: {x:g}: {error}") from None
    return Control(str(name), *labelled(*loop[:2], base, index), values, position, loops)


def _limits(label: str, limits: object) -> tuple[float, float]:
    if not isinstance(limits, Sequence | np.ndarray) or isinstance(limits, str) or len(limits) != 2:
        raise InputError(f"{label} is not a range: expected (low, high), got {shown(limits)}")
    low, high = (number("export_web", label.removeprefix("export_web: "), x) for x in limits)
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise InputError(f"{label} is not a range: expected finite numbers low < high, got {shown(limits)}")
    return low, high


def stacked(loop: Loop, controls: Sequence[Control]) -> tuple[list[_core.Plant], list[_core.Law], dict[str, Array | None]]:
    """Return the plants, laws and starts of the loop and of all positions of the controls, one after another."""
    loops = [loop, *(each for control in controls for each in control.loops)]
    starts: dict[str, Array | None] = {}
    for part in START:
        rows = [start.get(part) for _, _, start in loops]
        zero = np.zeros(loop[0].arm.n)
        starts[part] = None if all(row is None for row in rows) else np.array([zero if row is None else row for row in rows])
    return [plant for plant, _, _ in loops], [law for _, law, _ in loops], starts
