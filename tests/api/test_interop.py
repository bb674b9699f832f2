"""Tests of interop that do not need other libraries: imports on demand, and messages about invalid arguments."""

from __future__ import annotations

import subprocess
import sys
from inspect import unwrap

import pytest

import armlet as al


def test_the_other_libraries_are_not_imported() -> None:
    code = "import sys, armlet; sys.exit(bool({'pinocchio', 'mujoco'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-P", "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("model", [None, 3, "robot.urdf", object()], ids=lambda model: type(model).__name__)
def test_objects_that_are_not_models_are_refused(model: object) -> None:
    with pytest.raises(al.InputError, match=r"verify: against is of the wrong type: expected a pinocchio.Model or a mujoco.MjModel"):
        al.verify(al.pendulum(1.0, 1.0), against=model)


@pytest.mark.parametrize("name", ["from_mujoco", "from_pinocchio"])
def test_no_arm_is_made_of_what_is_no_model(name: str) -> None:
    with pytest.raises(al.InputError, match=rf"{name}: model is of another type: expected a \w+\.\w+, got NoneType"):
        getattr(al, name)(None)


def test_without_scipy_the_error_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "scipy.integrate", None)
    unwrap(al.scipy_method).__globals__["_method"].cache_clear()
    with pytest.raises(ImportError, match=r"scipy_method: scipy is not installed: pip install '\.\[tune\]'"):
        al.scipy_method("dopri5")
