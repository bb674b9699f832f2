"""Arguments of `exciting_motion`, and the object that it returns."""

from __future__ import annotations

import copy
import pickle
import sys
from typing import Any

import models
import numpy as np
import pytest

import armlet as al

LIMITS: dict[str, Any] = {"q_min": -1.5, "q_max": 1.5, "v_max": 3.0, "a_max": 10.0}
ARM = models.TWO_LINKS


def short(**changed: Any) -> al.ExcitingMotion:
    options = {"limits": LIMITS, "harmonics": 1, "iterations": 1} | changed
    arm, duration = options.pop("arm", ARM), options.pop("duration", 4.0)
    return al.exciting_motion(arm, duration, **options)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"duration": 0.0}, "duration"),
        ({"duration": np.nan}, "duration"),
        ({"duration": np.inf}, "duration"),
        ({"duration": 1e-300}, "duration is out of range"),
        ({"duration": 1e300}, "duration is out of range"),
        ({"limits": LIMITS | {"q_max": [1.5, 1e300]}}, r"limits\['q_max'\] is too large: .* \(first bad index 1\)"),
        ({"harmonics": 0}, "harmonics"),
        ({"harmonics": 1.5}, "harmonics"),
        ({"samples": 3}, "samples"),
        ({"starts": 0}, "starts"),
        ({"iterations": 0}, "iterations"),
        ({"starts": 10**400}, "starts is beyond reason: expected at most 1,000, got "),
        ({"iterations": 10**7}, "iterations is beyond reason"),
        ({"harmonics": 10**4}, "harmonics is beyond reason"),
        ({"samples": 10**7}, "samples is beyond reason"),
        ({"seed": -1}, "seed"),
        ({"noise": 0.0}, r"noise is not positive: .* got 0.0 \(first bad index 0\)"),
        ({"noise": [1.0, np.nan]}, r"noise .* got nan \(first bad index 1\)"),
        ({"noise": [1.0, 1.0, 1.0]}, "noise"),
        ({"limits": [1.0]}, "limits is of the wrong type"),
        ({"limits": LIMITS | {"torque": 1.0}}, "limits has an unknown name: expected one of q_min, .* got 'torque'"),
        ({"limits": LIMITS | {"v_max": [1.0, -1.0]}}, r"limits\['v_max'\] is not a number > 0: .* got -1.0 \(first bad index 1\)"),
        ({"limits": LIMITS | {"q_min": np.nan}}, r"limits\['q_min'\] is not a number: .* got nan \(first bad index 0\)"),
        ({"limits": LIMITS | {"q_min": [-1.0, 2.0]}}, r"limits leave joint joint2 no range \(first bad index 1\)"),
        ({"limits": {"effort": 10.0}}, r"limits do not bound joint joint1 \(first bad index 0\)"),
        ({"limits": None}, "limits do not bound joint joint1"),
        ({"limits": LIMITS | {"effort": 0.1}}, r"limits leave joint joint1 no torque \(first bad index 0\): expected an effort above 3.97"),
    ],
    ids=str,
)
def test_bad_arguments_are_named(changed: dict[str, Any], words: str) -> None:
    with pytest.raises(al.InputError, match=f"^exciting_motion: {words}"):
        short(**changed)


@pytest.mark.parametrize("changed", [{"arm": None}, {"friction": "yes"}, {"armature": 1}], ids=str)
def test_wrong_types_are_named(changed: dict[str, Any]) -> None:
    with pytest.raises((al.InputError, TypeError), match=f"exciting_motion: {next(iter(changed))}"):
        short(**changed)


def test_the_limits_of_the_file_are_those_of_the_arm() -> None:
    arm = models.SIX_AXES
    m = al.exciting_motion(arm, 6.0, harmonics=1, iterations=1)
    v = np.array([m(t)[1] for t in np.linspace(0.0, 6.0, 500)])
    assert np.all(np.abs(v) <= arm.limits["v_max"])
    slower = al.exciting_motion(arm, 6.0, limits={"v_max": 0.1}, harmonics=1, iterations=1)
    assert max(float(np.abs(slower(t)[1]).max()) for t in np.linspace(0.0, 6.0, 500)) <= 0.1


def test_a_joint_without_a_range_moves_under_its_other_limits() -> None:
    m = short(limits={"v_max": 2.0, "q_max": [np.inf, 0.5]})
    q, v, _ = (np.array(x) for x in zip(*(m(t) for t in np.linspace(0.0, 4.0, 800)), strict=True))
    assert np.abs(v).max() <= 2.0 and q[:, 1].max() <= 0.5


def test_an_exciting_motion_is_a_sinusoid() -> None:
    m = short()
    assert isinstance(m, al.Sinusoid) and repr(m).startswith("<ExcitingMotion: 2 joints, period 4 s, condition ")
    law = al.ComputedTorque(ARM, m, kp=100.0, kd=20.0)
    run = al.simulate(al.RigidArm(ARM), law, m(0.0)[0], v0=m(0.0)[1], t_end=1.0, dt=1e-3)
    assert np.abs(run.q[-1] - m(1.0)[0]).max() < 1e-8
    for other in (pickle.loads(pickle.dumps(m)), copy.deepcopy(m)):
        assert type(other) is al.ExcitingMotion and other == m
        assert (other.duration, other.condition) == (m.duration, m.condition) and np.array_equal(other.deviations, m.deviations)
    data = bytearray(pickle.dumps(m))
    data[len(data) // 2] ^= 1
    with pytest.raises(al.FormatError):
        pickle.loads(bytes(data))


def test_without_scipy_the_error_names_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "scipy.optimize", None)
    with pytest.raises(ImportError, match=r"exciting_motion: scipy is not installed: pip install '\.\[tune\]'"):
        short()


def test_an_exciting_motion_in_a_scenario() -> None:
    limits = {"q_min": -1.0, "q_max": [1.0, 0.8], "v_max": 3.0, "a_max": 10.0, "effort": 50.0}
    motion = {"kind": "ExcitingMotion", "duration": 4.0, "limits": limits, "harmonics": 1, "iterations": 1}
    law, run = {"kind": "ComputedTorque", "kp": 100.0, "kd": 20.0}, {"q0": [0.0, 0.0], "t_end": 0.1, "dt": 1e-2}
    scenario = al.Scenario({"arm": {"kind": "planar_arm", "lengths": [0.5, 0.4]}, "motion": motion, "law": law, "run": run})
    assert scenario.run().q.shape == (11, 2)
