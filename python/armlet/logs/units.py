"""Units of logged quantities, and their factors to SI units.

A quantity is `t` (time), `q` (position), `v` (velocity), `a` (acceleration), `tau` (torque or force) or `theta` (motor position).
"""

from __future__ import annotations

import math
import re

from ..arguments import shown, text
from ..errors import InputError

__all__ = ["ANGLE", "LENGTH", "SUFFIXES", "Unit", "factor", "known_unit"]

#: A unit: its factor to the SI unit, and its dimension.
Unit = tuple[float, str]

ANGLE, LENGTH = "rad", "m"
_DEGREE, _TURN = math.pi / 180.0, 2.0 * math.pi
_ANGLES = dict.fromkeys(("rad", "radian", "radians"), 1.0) | dict.fromkeys(("deg", "degree", "degrees", "°"), _DEGREE)
_ANGLES |= {"mrad": 1e-3} | dict.fromkeys(("rev", "turn", "turns"), _TURN)
_LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
_TIMES = dict.fromkeys(("s", "sec", "secs", "second", "seconds"), 1.0) | {"ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9}
_TORQUES = {"nm": 1.0, "mnm": 1e-3, "knm": 1e3, "ncm": 1e-2}
_FORCES = {"n": 1.0, "kn": 1e3, "mn": 1e-3}

#: Each unit by its name in lower case without blanks and signs of multiplication.
_UNITS: dict[str, Unit] = {name: (scale, "s") for name, scale in _TIMES.items()}
for _names, _base in ((_ANGLES, ANGLE), (_LENGTHS, LENGTH)):
    for _power, _endings in enumerate((("",), ("/s", "s^-1"), ("/s^2", "/s2", "/s²", "s^-2"))):
        _dimension = _base + ("", "/s", "/s^2")[_power]
        _UNITS |= {name + ending: (scale, _dimension) for name, scale in _names.items() for ending in _endings}
_UNITS |= {"rpm": (_TURN / 60.0, "rad/s")}
_UNITS |= {name: (scale, "N m") for name, scale in _TORQUES.items()} | {name: (scale, "N") for name, scale in _FORCES.items()}

#: Units that a name may end with, such as `q1_deg`. Short units such as `m` and `n` are too ambiguous for the end of a name.
SUFFIXES = frozenset({"rad", "deg", "degree", "degrees", "mrad", "mm", "rpm", "nm", "ms", "us", "ns", "nsec", "sec", "secs"})

#: The dimensions of each quantity, for joints that turn and for joints that slide.
_DIMENSIONS = {
    "t": ("s", "s"),
    "q": (ANGLE, LENGTH),
    "theta": (ANGLE, LENGTH),
    "v": ("rad/s", "m/s"),
    "a": ("rad/s^2", "m/s^2"),
    "tau": ("N m", "N"),
}


def known_unit(name: str) -> Unit | None:
    """Return the factor and the dimension of the unit `name`, or None if it is not a unit."""
    return _UNITS.get(re.sub(r"[\s*·.]", "", name).lower()) or _UNITS.get({"nsec": "ns"}.get(name, name))


def factor(function: str, quantity: str, unit: object, of: str, prismatic: bool | None) -> tuple[float, bool | None]:
    """Return the factor to SI units of a column, and whether its joint slides (None: unknown).

    Args:
        quantity: the letter of the quantity.
        unit: name of the unit.
        of: what has the unit, for messages.
        prismatic: whether the joint slides; None if unknown.
    """
    found = known_unit(text(function, "units", unit))
    if found is None:
        raise InputError(f"{function}: units of {of} are unknown: expected a unit such as rad, deg, m, rad/s, N m or ms, got {shown(unit)}")
    scale, dimension = found
    turning, sliding = _DIMENSIONS[quantity]
    valid = {None: (turning, sliding), False: (turning,), True: (sliding,)}[prismatic]
    if dimension not in valid:
        raise InputError(f"{function}: units of {of} do not fit: expected a unit of {' or '.join(dict.fromkeys(valid))}, got {shown(unit)}")
    return scale, (dimension == sliding if turning != sliding else None)
