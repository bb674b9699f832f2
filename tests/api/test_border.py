"""`border` wraps every public function of Python: faults of armlet are an InternalError, and the caller's exceptions pass unchanged."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import models
import pytest

import armlet as al
from armlet import gym, scenario
from armlet.border import border

PLANT = al.RigidArm(models.PR)


def test_a_fault_of_armlet_is_an_internal_error() -> None:
    @border
    def faulty(f: Callable[[], Any]) -> Any:
        return f() if callable(f) else {}["key"]

    def users() -> Any:
        raise LookupError("mine")

    with pytest.raises(al.InternalError, match=r"faulty: internal error, please report it: KeyError: 'key'") as caught:
        _ours_faulty()
    assert isinstance(caught.value.__cause__, KeyError)
    # Exceptions of the caller's functions pass unchanged.
    for name in ("simulate", "integrate"):
        with pytest.raises(LookupError, match="mine"):
            if name == "simulate":
                al.simulate(PLANT, lambda t, q, v: users(), [0.0, 0.0], t_end=0.01, dt=1e-3, sample_time=1e-3)
            else:
                al.integrate(lambda t, y: users(), (0.0, 1.0), [1.0])
    assert al.metrics.__name__ == "metrics" and "band" in str(__import__("inspect").signature(al.metrics))
    with pytest.raises(LookupError, match="mine"):
        faulty(users)


def _ours_faulty() -> Any:
    """A function that `border` takes for a function of armlet."""
    space: dict[str, Any] = {"__name__": "armlet.somewhere"}
    exec("def faulty():\n    return {}['key']", space)
    return border(space["faulty"])()


def open_doors(module: Any, names: list[str]) -> set[str]:
    """Public functions and methods that are written in Python and are not wrapped by `border`."""
    found: set[str] = set()
    for name in names:
        thing = getattr(module, name)
        where = getattr(thing, "__module__", "") or ""
        if not where.startswith("armlet.") or where.startswith("armlet._core") or not callable(thing):
            continue
        if not isinstance(thing, type):
            found |= set() if hasattr(thing, "__wrapped__") else {name}
            continue
        if issubclass(thing, Exception | int):
            continue
        for part, value in vars(thing).items():
            plain = (
                value.__func__ if isinstance(value, classmethod | staticmethod) else value.fget if isinstance(value, property) else value
            )
            if (part.startswith("_") and part not in ("__call__", "__post_init__")) or not inspect.isfunction(plain):
                continue
            found |= set() if hasattr(plain, "__wrapped__") else {f"{name}.{part}"}
    return found


def test_all_that_is_public_lies_before_the_border() -> None:
    """All public functions, methods and properties written in Python are wrapped by `border`, except those of demo and reference."""
    assert open_doors(al, al.__all__) == set()
    assert open_doors(gym, gym.__all__) == set()
    assert open_doors(scenario, scenario.__all__) == set()


def test_an_unwrapped_function_is_detected() -> None:
    space: dict[str, Any] = {"__name__": "armlet.somewhere"}
    exec("class A:\n    def f(self): ...\n    @property\n    def p(self): ...\ndef g(): ...", space)
    assert open_doors(SimpleNamespace(**{name: space[name] for name in ("A", "g")}), ["A", "g"]) == {"A.f", "A.p", "g"}
