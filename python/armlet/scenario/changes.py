"""Changes of the tables of a scenario by path, such as `law.kd[1]`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from ..arguments import require_shallow, shown
from ..errors import InputError
from .fields import Field, OneOf, Table
from .tables import SCENARIO

__all__ = ["change", "entry_of", "field_of", "plain"]

STEP = re.compile(r"\.?([A-Za-z_]\w*)|\[(\d+)\]")


def change(data: dict[str, Any], path: str, value: Any) -> None:
    """Set one entry of the tables `data`. `path` names the entry, such as `law.kd[1]`."""
    if not isinstance(path, str):
        raise InputError(f"scenario: {shown(path)} is not a path: expected a path such as law.kp or run.q0[1]")
    require_shallow("scenario", path, value)
    steps = _steps(path)
    place: Any = data
    for i, step in enumerate(steps):
        last = i == len(steps) - 1
        inside = step in range(len(place)) if isinstance(place, list) and isinstance(step, int) else isinstance(place, dict)
        if not inside or (isinstance(place, dict) and (isinstance(step, int) or (step not in place and not last))):
            held = ", ".join(place) if isinstance(place, dict) else f"{len(place)} entries" if isinstance(place, list) else repr(place)
            here = ".".join(map(str, steps[:i])) or "the scenario"
            raise InputError(f"scenario: {path!r} leads nowhere: expected a part of {here}, which holds {held}, got {step!r}")
        if last:
            place[step] = plain(value)
        else:
            place = place[step]


def entry_of(path: object) -> tuple[str, str]:
    """Return the table of a path such as `law.kd[1]`, and the key in this table. The key of an unusual path is empty."""
    steps = _steps(path) if isinstance(path, str) else ()
    table, key = (*steps, "", "")[:2]
    return (table, key) if isinstance(table, str) and isinstance(key, str) else ("", "")


def field_of(table: str, values: Mapping[str, Any], key: str) -> Field | None:
    """Return the field that checks the entry `key` of a table independently of its other entries, or None if there is none."""
    what = SCENARIO.keys[table]
    if isinstance(what, OneOf):
        what = what.kinds[values["kind"]]
    return what.keys.get(key) if isinstance(what, Table) else None


@lru_cache(maxsize=256)
def _steps(path: str) -> tuple[str | int, ...]:
    """Split a path such as `law.kd[1]` into its steps law, kd, 1."""
    steps = tuple(name or int(index) for name, index in STEP.findall(path))
    rebuilt = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps)[1:]
    if not steps or rebuilt != path:
        raise InputError(f"scenario: {path!r} is not a path: expected a path such as law.kp or run.q0[1], got {path!r}")
    return steps


def plain(value: Any) -> Any:
    """Copy tables and lists. Numbers and arrays of numpy become Python numbers and lists."""
    if type(value) in (float, int, str, bool):
        return value
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value.tolist() if hasattr(value, "tolist") else value
