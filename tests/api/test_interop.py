"""What of the interop can be said without the other libraries: they are not imported until asked for, and misuse is told."""

from __future__ import annotations

import subprocess
import sys

import pytest

import armlet as al


def test_the_other_libraries_are_not_imported() -> None:
    code = "import sys, armlet; sys.exit(bool({'pinocchio', 'mujoco'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-P", "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("model", [None, 3, "robot.urdf", object()], ids=lambda model: type(model).__name__)
def test_what_is_no_model_is_refused(model: object) -> None:
    with pytest.raises(al.InputError, match=r"verify: against is of the wrong type: expected a pinocchio.Model or a mujoco.MjModel"):
        al.verify(al.pendulum(1.0, 1.0), against=model)
