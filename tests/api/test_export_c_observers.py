"""Momentum observers as C return the residuals and contacts of `MomentumObserver` to the last bit. Invalid arguments are refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from compiled_c import COMPILERS, Observer
from test_export_c_arms import branched

import armlet as al

pytestmark = pytest.mark.compile

SIX = models.SIX_AXES
PLANAR = models.THREE_LINKS
FULL = 40.0 * np.eye(3) + 3.0
RUBBING = PLANAR.with_drives(damping=[0.7, 0.5, 0.3], friction=[0.2, 0.4, 0.1])

OBSERVERS: dict[str, tuple[al.Arm, dict[str, Any]]] = {
    "planar": (PLANAR, {"gain": 50.0, "threshold": 1.0}),
    "full gain": (PLANAR, {"gain": FULL, "threshold": [1.0, 0.5, 0.3]}),
    "friction": (RUBBING, {"gain": [50.0, 1.0, 30.0], "friction": True}),
    "motors": (PLANAR, {"gain": 50.0, "motor_inertia": [0.3, 0.2, 0.1]}),
    "motors, full": (PLANAR, {"gain": FULL, "motor_inertia": FULL / 99.0}),
    "planar_pr": (models.PR, {"gain": 20.0, "threshold": 0.3}),
    "pendulum": (al.pendulum(0.3, 2.0), {"gain": [[20.0]], "threshold": 0.3}),
    "tree": (branched(), {"gain": 35.0, "threshold": 3.0}),
    "six axes": (SIX, {"gain": 50.0, "threshold": 2.0}),
}


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", OBSERVERS)
def test_an_observer_has_the_bits_of_armlet(name: str, compiler: str, tmp_path: Path) -> None:
    arm, options = OBSERVERS[name]
    observer = al.MomentumObserver(arm, **options)
    files = al.export_c(observer, tmp_path)
    assert [file.name for file in files] == ["observer.h", "observer.c", "CMakeLists.txt"]
    c = Observer(files, compiler)
    rng = np.random.default_rng(31)
    x = rng.uniform(-3.0, 3.0, (1000, 3, arm.n))
    x[0] = 0.0
    touched = set()
    for k, (q, v, tau) in enumerate(x):
        dt = 1e-3 if k % 3 else rng.uniform(1e-4, 0.1)
        np.testing.assert_array_equal(c(q, v, tau, dt), observer.update(q, v, tau, dt), err_msg=f"sample {k}")
        if "threshold" in options:
            assert c.contact() == observer.contact()
            touched.add(c.contact())
    assert "threshold" not in options or len(touched) == arm.n + 1 or arm.n > 3


def test_at_rest_the_residual_is_the_torque_from_outside(tmp_path: Path) -> None:
    """A check without armlet: the solution of `r_dot = K (tau_ext - r)` from rest."""
    c = Observer(al.export_c(al.MomentumObserver(al.planar_arm([0.5], gravity=[0.0, 0.0]), 50.0), tmp_path), COMPILERS[0])
    for _ in range(1001):
        r = c([0.3], [0.0], [-1.5], 1e-3)
    # The remaining error exp(-50) is below the rounding error.
    np.testing.assert_allclose(r, [1.5], rtol=1e-14)


def test_a_sample_that_fails_changes_nothing(tmp_path: Path) -> None:
    c = Observer(al.export_c(al.MomentumObserver(PLANAR, FULL), tmp_path), COMPILERS[0])
    good = np.array([0.1, 0.2, 0.3])
    assert c.status([np.nan, 0.0, 0.0], good, good, 1e-3)[0] == 1
    assert not c.memory.any()
    c(good, good, good, 1e-3)
    residual = c(2.0 * good, good, good, 1e-3)
    assert residual.any()
    before = c.memory.copy()
    bad: list[tuple[Any, Any, Any, float, int]] = [
        (good, [0.0, np.inf, 0.0], good, 1e-3, 1),
        (good, good, [0.0, 0.0, -np.inf], 1e-3, 1),
        (good, good, good, np.nan, 1),
        (good, good, good, 0.0, 5),
        (good, good, good, -1e-3, 5),
        ([0.0, 2e6, 0.0], good, good, 1e-3, 2),
        (good, [1e200, 0.0, 0.0], good, 1e-3, 4),
        (good, good, [1e308, 0.0, 0.0], 1e300, 4),
        (good, good, good, 1e308, 4),
    ]
    for q, v, tau, dt, expected in bad:
        status, held = c.status(q, v, tau, dt)
        assert status == expected, (q, v, tau, dt)
        np.testing.assert_array_equal(held, residual)
        np.testing.assert_array_equal(c.memory, before)


def test_unused_arguments_of_an_observer_are_refused(tmp_path: Path) -> None:
    observer = al.MomentumObserver(PLANAR, 50.0)
    bad: list[tuple[dict[str, Any], str]] = [
        ({"dt": 1e-3}, "dt is not used: expected none for an observer"),
        ({"method": "euler"}, "method is not used"),
        ({"sample_time": 1e-3}, "sample_time is not used"),
        ({"tau_max": 9.0}, "tau_max is not used"),
        ({"functions": ["gravity"]}, "functions is not used"),
        ({"friction": True}, "friction is not used"),
        ({"armature": True}, "armature is not used"),
        ({"prefix": "a-b"}, "prefix is no name in C"),
        ({"fused": 2}, "fused is not a flag"),
    ]
    for arguments, message in bad:
        with pytest.raises(al.InputError, match=f"^export_c: {message}"):
            al.export_c(observer, tmp_path / "out", **arguments)
    joint = {
        "type": "R",
        "axis": [0.0, 0.0, 1.0],
        "rpy": [0.0] * 3,
        "xyz": [0.1, 0.0, 0.0],
        "phi": [1.0, *[0.0] * 3, 0.1, 0.0, 0.1, 0.0, 0.0, 0.1],
    }
    with pytest.raises(al.InputError, match=r"^export_c: observer is too long to be printed: expected an arm of at most 60 joints, got 61"):
        al.export_c(al.MomentumObserver(al.Arm.from_chain([joint] * 61), 50.0), tmp_path / "out")
    assert not (tmp_path / "out").exists()
