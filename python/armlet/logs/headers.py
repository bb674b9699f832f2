"""Recognise the quantity, the joint and the unit of a column from its name, such as `/joint_states/elbow/position` or `q1_deg [deg]`.

A name is split into words and numbers. Words state the quantity (`pos`, `effort`), its kind (`desired`, `cmd`) and the joint.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from .units import SUFFIXES, known_unit

__all__ = ["Column", "Key", "recognised", "words"]

#: A joint: its name, or the numbers in the column's name.
Key = str | tuple[int, ...]

_QUANTITIES = {
    "q": ("q", "pos", "position", "positions", "angle", "angles"),
    "v": ("v", "dq", "vel", "velocity", "velocities", "qdot", "speed"),
    "a": ("a", "ddq", "acc", "accel", "acceleration", "accelerations", "qddot"),
    "tau": ("tau", "torque", "torques", "trq", "effort", "efforts", "eff", "moment"),
    "theta": ("theta",),
}
_QUANTITY = {word: letter for letter, each in _QUANTITIES.items() for word in each}
_DESIRED = frozenset("target desired des ref reference cmd command commanded setpoint goal".split())
_NEUTRAL = frozenset("joint joints state states axis actual measured act meas msr j".split())
_TIME = frozenset("t time times timestamp stamp timestamps clock sec secs seconds nanosec nsec nsecs header epoch from start".split())
#: Words that state a quantity or its kind, and no joint.
_STATED = set(_QUANTITY) | _DESIRED | {"actual", "measured", "motor", "qd", "qdd", "dot", "ddot", "d"}
_DERIVATIVE = {"v": "a", "q": "v"}


@dataclass(frozen=True)
class Column:
    """What a column contains."""

    quantity: str
    joint: Key
    #: Whether the column is a reference, such as a desired position.
    desired: bool = False
    #: The unit in the name, or None.
    unit: str | None = None
    #: Whether the name is `qd`, which means a velocity or a desired position.
    ambiguous: bool = False


def words(name: str) -> list[str]:
    """Split a name into words in lower case and numbers: `panda_joint1/posDeg` has the words panda, joint, 1, pos, deg."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[^\W\d_])(?=\d)|(?<=\d)(?=[^\W\d_])", " ", name)
    return re.findall(r"[^\W\d_°]+|\d+|°", spaced.lower())


def _unit_in(name: str) -> tuple[str, str | None]:
    """Return the name without its unit, and the unit. A unit is in brackets, or is the last word."""
    found = re.search(r"\s*[\[(]\s*([^\[\]()]*[^\W\d][^\[\]()]*|°[^\[\]()]*)\s*[\])]\s*$", name)
    if found and known_unit(found[1]):
        return name[: found.start()], found[1].strip()
    for part in reversed(re.findall(r"[^\W\d_]+", name)):
        if part.lower() in SUFFIXES and re.search(rf"[_\s.\-/]{part}(?=$|[_\s.\-/\[\d])", name) and len(words(name)) > 1:
            without = re.sub(rf"[_\s.\-/]{part}(?=$|[_\s.\-/\[\d])", "_", name)
            return without, {"nsec": "ns", "sec": "s", "secs": "s"}.get(part.lower(), part.lower())
    return name, None


def _is_time(parts: Sequence[str]) -> bool:
    return bool(parts) and all(part in _TIME or known_unit(part) for part in parts) and any(part in _TIME for part in parts)


def recognised(name: str, joints: Sequence[str] | None) -> Column | None:
    """Return what the column `name` contains, or None for another column. `joints` are the names of the joints, if known."""
    parts = words(name)
    if _is_time(parts):
        seconds = {"nanosec": "ns", "nsec": "ns", "nsecs": "ns", "sec": "s", "secs": "s", "seconds": "s"}
        return Column("t", (), unit=_unit_in(name)[1] or next((seconds[part] for part in parts if part in seconds), None))
    plain, unit = _unit_in(name)
    parts, joint = words(plain), None
    for known in sorted(joints or (), key=lambda each: -len(words(each))):
        place = _place(words(known), parts)
        remaining = parts[:place] + parts[place + len(words(known)) :] if place is not None else []
        if place is not None and (_content(remaining) is not None or not remaining):
            joint, parts = known, remaining
            break
    if joint is not None and not parts:
        found: tuple[str, bool, bool, list[str]] | None = ("q", False, False, [])
    else:
        found = _content(parts)
    if found is None:
        return None
    quantity, desired, ambiguous, others = found
    numbers = tuple(int(part) for part in parts if part.isdigit())
    if joint is not None:
        # Numbers beyond those of the joint's name belong to another column.
        return Column(quantity, joint, desired, unit, ambiguous) if not numbers and not others else None
    if others:
        # Without known names, the other words are the name of the joint.
        return Column(quantity, _joint_name(plain), desired, unit, ambiguous) if joints is None else None
    return Column(quantity, numbers, desired, unit, ambiguous)


def _place(part: Sequence[str], of: Sequence[str]) -> int | None:
    """The index at which the words `part` are in the words `of`, or None."""
    return next((i for i in range(len(of) - len(part) + 1) if list(of[i : i + len(part)]) == list(part)), None)


def _content(parts: Sequence[str]) -> tuple[str, bool, bool, list[str]] | None:
    """Return the quantity, whether it is desired, whether it is ambiguous, and the words that state neither. None without a quantity."""
    kinds = [part for part in parts if part in _QUANTITY or part in ("qd", "qdd")]
    if not kinds:
        return None
    qualified = any(part in _DESIRED or part in ("actual", "measured") for part in parts)
    desired = any(part in _DESIRED for part in parts)
    word = kinds[-1]
    # A single letter before a longer word is part of a joint's name, as in `arm_a_position`.
    word = max(kinds, key=len) if len(word) == 1 else word
    ambiguous = word == "qd" and not qualified
    quantity = {"qd": "v", "qdd": "a"}.get(word) or _QUANTITY[word]
    used = {word} | _DESIRED | _NEUTRAL
    for before, after in pairwise(parts):
        if before == word and after in ("dot", "ddot"):
            quantity = _DERIVATIVE.get(quantity, quantity) if after == "dot" else "a"
            used.add(after)
        # The suffix d means desired, as in `q_d` and `tau_J_d`.
        if after == "d" and (before == word or before == "j" or before.isdigit()):
            desired = True
            used.add("d")
    if "motor" in parts and quantity in ("q", "tau"):
        quantity = {"q": "theta"}.get(quantity, quantity)
        used.add("motor")
    others = [part for part in parts if part not in used and not part.isdigit()]
    return quantity, desired, ambiguous, others


def _joint_name(plain: str) -> str:
    """The part of a column's name that names the joint: without words of quantities, and without the topic before it."""
    *before, last = [segment for segment in plain.split("/") if segment.strip()]
    if before and not set(words(last)) - _STATED:
        return before[-1].strip()
    named = [token for token in re.findall(r"[^.\s\[\]()]+", last) if set(words(token)) - _STATED]
    pieces = re.split(r"([_\-:]+)", named[-1])
    chosen = [piece for piece in pieces if not piece or piece.lower() not in _STATED]
    return re.sub(r"[_\-:]{2,}", "_", "".join(chosen)).strip("_-:")
