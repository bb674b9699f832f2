"""The tasks of a priority law as tables: `[[law.tasks]]`, the highest priority first, each with a `kind`.

A table with `joins = true` shares the level of the table above. `weight` is the weight of its squared error in this level.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

from .. import _core
from ..errors import InputError
from .derived import classes_of, derived
from .fields import Field, Flag, Numbers, OneOf, Text

__all__ = ["prioritised", "tasks_of"]

VECTOR = Numbers(depth=1, scalar=False)
#: The keys of a task that shares its level.
LEVEL: dict[str, Field] = {"joins": Flag(), "weight": Numbers(low=0.0, strict=True)}
TEXT = Text()


def tasks_of(motions: OneOf) -> OneOf:
    """The kinds of tasks. A task has a fixed `target`, a `motion`, or `lower` and `upper`; a `JointLimitTask` has none."""
    matrix = Numbers(depth=2, low=0.0)
    fields: dict[str, Field] = {
        **dict.fromkeys(("frame", "reference", "other", "axes"), TEXT),
        "axis": VECTOR,
        "joints": _Names(),
        "margin": Numbers(low=0.0, strict=True),
        "target": Numbers(depth=1),
        "motion": motions,
        "gain": matrix,
        "damping": matrix,
        **dict.fromkeys(("lower", "upper"), Numbers(depth=1, finite=False)),
        **dict.fromkeys(("points", "other_points"), Numbers(depth=2, scalar=False)),
        **dict.fromkeys(("radius", "other_radius"), Numbers(low=0.0)),
    }
    classes = [_core.Task, _core.PostureTask, *classes_of(_core.Task, ("PostureTask",))]
    kinds = {each.__name__: derived(each, fields, required=("gain",), make=_with_motion(each, motions)) for each in classes}
    return OneOf({name: replace(kind, keys={**kind.keys, **LEVEL}) for name, kind in kinds.items()})


class _Names(Field):
    """A list of names."""

    def check(self, value: object, path: str) -> Iterable[str]:  # type: ignore[override]
        if not isinstance(value, list | tuple) or not value or not all(isinstance(item, str) for item in value):
            yield f"{path}: expected a list of names, got {value!r}"

    def schema(self) -> dict[str, Any]:
        return {"type": "array", "items": {"type": "string"}, "minItems": 1}


def _with_motion(make: Callable[..., Any], motions: OneOf) -> Callable[..., Any]:
    def task(motion: Mapping[str, Any] | None = None, **values: Any) -> Any:
        if motion is not None:
            values["motion"] = motions.make(motion)
        return make(**values)

    return task


def prioritised(law: Callable[..., _core.Law], kinds: OneOf) -> Callable[..., _core.Law]:
    """Return a function that makes the priority law `law` from tasks in tables."""

    def make(arm: _core.Arm, tasks: list[Mapping[str, Any]], **keywords: Any) -> _core.Law:
        levels: list[Any] = []
        for i, table in enumerate(tasks):
            try:
                task = kinds.make({key: value for key, value in table.items() if key not in LEVEL})
            except InputError as error:
                raise InputError(f"Task: tasks[{i}].{str(error).partition(': ')[2]}") from None
            item = (task, table["weight"]) if "weight" in table else task
            if not table.get("joins", False):
                levels.append([item])
            elif levels:
                levels[-1].append(item)
            else:
                raise InputError("Task: tasks[0].joins has no level above: expected false for the first task, got true")
        return law(arm, [level if len(level) > 1 else _alone(level[0]) for level in levels], **keywords)

    return make


def _alone(item: Any) -> Any:
    """A task without other tasks in its level, where a weight has no effect."""
    return item[0] if isinstance(item, tuple) else item
