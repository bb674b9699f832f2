"""The walk over optional arguments: a function is called with each option and with each pair of options, and its results are compared."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

import numpy as np

import armlet as al


@dataclass
class Case:
    """A function with one valid value per option. The value differs from the default, and is such that the option should have an effect."""

    #: The call with the options as keywords. The result contains everything that an option may change.
    call: Callable[..., Any]
    options: Mapping[str, Any]
    #: Patterns of options without an effect in this case, and of pairs `a+b` in which `a` has no effect beside `b`, with the reason.
    idle: Mapping[str, str] = field(default_factory=dict)


def bits(made: Any, depth: int = 4) -> Any:
    """A comparable form of a result: the bytes of its arrays, and its numbers and texts. Settings that a result repeats are left out."""
    if made is None or isinstance(made, bool | int | str | bytes):
        return made
    if isinstance(made, float | complex | np.generic):
        return repr(made)
    if isinstance(made, np.ndarray):
        return made.shape, made.tobytes() if made.dtype != object else bits(made.tolist(), depth)
    if isinstance(made, Mapping):
        return tuple((str(name), bits(value, depth)) for name, value in made.items())
    if isinstance(made, Sequence):
        return tuple(bits(value, depth) for value in made)
    if depth == 0:
        return None
    if isinstance(made, al.Run | al.BatchRun):
        names = ["t", "q", "v", "tau", "estimate", "theta", "theta_dot", "bristles", "status", "monitors", "events", "sensitivity", "dense"]
        return tuple(bits(getattr(made, name, None), depth - 1) for name in names)
    if is_dataclass(made):
        return tuple(bits(getattr(made, each.name), depth - 1) for each in fields(made))
    names = [name for name in dir(made) if not name.startswith("_")]
    values = {name: getattr(made, name, None) for name in names}
    return tuple((name, bits(value, depth - 1)) for name, value in values.items() if not callable(value) and not isinstance(value, al.Arm))


def result(case: Case, names: Sequence[str]) -> Any:
    """The bits of the call with the options `names`, or the `InputError` that it raises."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return bits(case.call(**{name: case.options[name] for name in names}))
        except al.InputError as error:
            return error


def without_effect(case: Case, pairs: bool = True) -> list[str]:
    """The options without an effect: `a` for an option alone, and `a+b` for an option `a` that has no effect beside `b`.

    An option has an effect if the result differs from the result without it. It may also be refused, by an error that has its name.
    """
    base, alone = result(case, ()), {name: result(case, (name,)) for name in case.options}
    assert not isinstance(base, al.InputError), base
    found = [name for name, made in alone.items() if made == base]
    found += [f"{name} (error: {made})" for name, made in alone.items() if isinstance(made, al.InputError) and name not in str(made)]
    for i, a in enumerate(case.options if pairs else ()):
        for b in list(case.options)[i + 1 :]:
            both = result(case, (a, b))
            if isinstance(both, al.InputError):
                if a not in str(both) and b not in str(both):
                    found.append(f"{a}+{b} (error: {both})")
                continue
            found += [f"{one}+{other}" for one, other in ((a, b), (b, a)) if both == alone[other] and one not in found]
    return found
