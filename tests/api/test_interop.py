"""Tests of interop that do not need other libraries: imports on demand, and messages about invalid arguments."""

from __future__ import annotations

import subprocess
import sys
from enum import IntEnum
from inspect import unwrap
from types import SimpleNamespace

import numpy as np
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


def test_lost_loops_of_a_mujoco_model_cause_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    """A connection that closes a loop changes the motion. The model is a stand-in for one of MuJoCo, which is not installed here."""
    kinds = IntEnum("mjtEq", ["mjEQ_CONNECT", "mjEQ_WELD", "mjEQ_JOINT"], start=0)
    flags = SimpleNamespace(mjDSBL_GRAVITY=1)
    monkeypatch.setitem(sys.modules, "mujoco", SimpleNamespace(mjtEq=kinds, mjtDisableBit=flags))
    option = SimpleNamespace(density=0.0, viscosity=0.0, disableflags=0, gravity=[0.0, 0.0, -9.81])
    names = ["loop", "", "off"]
    model = SimpleNamespace(
        **dict.fromkeys(("njnt", "nu", "nsite", "ntendon"), 0),
        **dict.fromkeys(("jnt_stiffness", "body_gravcomp"), np.zeros(1)),
        **{"nbody": 1, "neq": 3, "body_parentid": [0], "opt": option},
        **{
            "eq_type": [0, 1, 1],
            "eq_active0": [True, True, False],
            "eq_obj1id": [0] * 3,
            "eq_obj2id": [1] * 3,
            "eq_data": np.zeros((3, 11)),
        },
        body=lambda k: SimpleNamespace(name="world"),
        equality=lambda k: SimpleNamespace(name=names[k]),
    )
    with pytest.warns(
        UserWarning, match=r"^from_mujoco: the arm lacks active constraints of model, so it .*: connect loop, weld 1$"
    ) as told:
        arm = al.from_mujoco(model)
    assert told[0].filename == __file__ and arm.report == ("equality constraints dropped (3)",)


def test_without_scipy_the_error_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "scipy.integrate", None)
    unwrap(al.scipy_method).__globals__["_method"].cache_clear()
    with pytest.raises(ImportError, match=r"scipy_method: scipy is not installed: pip install '\.\[tune\]'"):
        al.scipy_method("dopri5")
