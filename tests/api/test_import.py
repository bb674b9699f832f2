"""Modules that an import loads, names of a star import, and the examples in docstrings."""

from __future__ import annotations

import doctest
import importlib
import inspect
import subprocess
import sys
from typing import Any

import pytest

import armlet as al
import armlet.gym

OPTIONAL = ("matplotlib", "pandas", "scipy", "xarray", "viser", "dask", "numba")
OPTIONAL += ("armlet.reference", "armlet.figures.run", "armlet.cli", "armlet.live")


def python(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_nothing_optional_is_imported() -> None:
    """Neither an import nor a run loads an optional package."""
    code = """
import sys
import armlet as al
arm = al.planar_pr(2.0, 0.5, 0.5)
run = al.simulate(al.RigidArm(arm), al.ComputedTorque(arm, al.Hold([1.0, 0.0]), 4.0, 4.0), [0.0, 0.0], t_end=0.1, dt=0.01)
repr(run)
print(*sys.modules)
"""
    modules = set(python(code).split())
    assert "numpy" in modules and "armlet._core" in modules
    assert modules.isdisjoint(OPTIONAL)


def test_only_numpy_is_brought_along() -> None:
    """Beyond numpy's modules, an import of armlet loads only armlet and the standard library."""
    brought = python("import sys, numpy; before = set(sys.modules); import armlet; print(*(set(sys.modules) - before))").split()
    roots = {name.partition(".")[0] for name in brought}
    assert "armlet" in roots
    assert roots - {"armlet", "numpy"} <= set(sys.stdlib_module_names)


def test_star_import_gives_the_public_names() -> None:
    names = set(python("from armlet import *; print(*[n for n in globals()])").split())
    assert {name for name in names if name in al.__all__ or not name.startswith("__")} == set(al.__all__)
    assert len(al.__all__) == len(set(al.__all__)) and list(al.__all__) == sorted(al.__all__)
    assert all(hasattr(al, name) for name in al.__all__) and dir(al) == sorted(al.__all__)


def documented() -> dict[str, Any]:
    """Every public object and every public method, by name."""
    found: dict[str, Any] = {"armlet": al, "gym": armlet.gym}
    public = {name: getattr(al, name) for name in al.__all__} | {f"gym.{name}": getattr(armlet.gym, name) for name in armlet.gym.__all__}
    for name, thing in public.items():
        if isinstance(thing, str):
            continue
        found[name] = thing
        if inspect.isclass(thing):
            members = {member: value for member, value in vars(thing).items() if not member.startswith("_")}
            found |= {f"{name}.{member}": value for member, value in members.items() if getattr(value, "__doc__", None)}
    return found


DOCUMENTED = dict(sorted(documented().items()))
EXAMPLES = {name: thing for name, thing in DOCUMENTED.items() if ">>>" in (inspect.getdoc(thing) or "")}


@pytest.mark.parametrize("name", DOCUMENTED)
def test_everything_public_is_documented(name: str) -> None:
    text = inspect.getdoc(DOCUMENTED[name])
    assert text and len(text.split()) >= 3, name


def test_the_list_of_examples_is_complete() -> None:
    """The list of examples, which the next test runs, contains these names. So a lost example is noticed."""
    assert {"armlet", "planar_pr", "Adaptive", "ComputedTorque", "Hold", "RigidArm", "Sinusoid", "simulate", "simulate_batch"} <= set(
        EXAMPLES
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_run(name: str) -> None:
    text = inspect.getdoc(EXAMPLES[name])
    assert text is not None
    test = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
    assert test.examples
    report: list[str] = []
    runner = doctest.DocTestRunner(verbose=False, optionflags=doctest.NORMALIZE_WHITESPACE)
    runner.run(test, out=report.append)
    assert runner.failures == 0, "".join(report)


@pytest.mark.parametrize(
    ("old", "new", "name"),
    [("path_plots", "figures.time_path", "PathTiming"), ("mintime_plots", "figures.minimum_time", "MinimumTime")],
)
def test_old_names_of_modules_warn(old: str, new: str, name: str) -> None:
    with pytest.warns(DeprecationWarning, match=rf"^armlet\.{old} is now armlet\.{new}$"):
        module = importlib.import_module(f"armlet.{old}")
    assert getattr(module, name) is getattr(importlib.import_module(f"armlet.{new}"), name)
    del sys.modules[f"armlet.{old}"]
