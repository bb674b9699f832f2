"""Corner cases of exported laws: limits, sample times, arms of one and nine joints, prismatic and mimic joints, and odd arguments."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from compiled_c import COMPILERS, Controller

import armlet as al

pytestmark = [
    pytest.mark.compile,
    pytest.mark.filterwarnings("ignore:.*balance does not close:UserWarning", "ignore:.*close to unstable:UserWarning"),
]

BODY = [1.0, 0.1, 0.02, 0.1, 0.3, 0.01, 0.3, 0.02, 0.01, 0.2]
PLANAR = models.TWO_LINKS


def chain(types: str) -> al.Arm:
    axes = np.random.default_rng(4).normal(size=(len(types), 3))
    joints = [
        {"type": kind, "axis": list(axis), "rpy": [0.3, -0.2, 0.5], "xyz": [0.2, 0.1, 0.3], "phi": BODY}
        for kind, axis in zip(types, axes, strict=True)
    ]
    return al.Arm.from_chain(joints)


def following() -> al.Arm:
    """An arm with three moving joints; the second is a mimic joint of the first."""
    body = "<inertial><origin xyz='0.1 0.02 0.2'/><mass value='1.5'/>"
    body += "<inertia ixx='0.02' iyy='0.03' izz='0.01' ixy='0' ixz='0' iyz='0'/></inertial>"
    links = "".join(f"<link name='{name}'>{body}</link>" for name in "abc")
    rows = [
        ("j1", "base", "a", "0 0 1", ""),
        ("j2", "a", "b", "0 1 0", "<mimic joint='j1' multiplier='-1.5' offset='0.2'/>"),
        ("j3", "b", "c", "1 0 0", ""),
    ]
    joint = (
        "<joint name='{0}' type='continuous'><parent link='{1}'/><child link='{2}'/><origin xyz='0.1 0 0.3'/><axis xyz='{3}'/>{4}</joint>"
    )
    return al.load_urdf(f"<robot name='r'><link name='base'/>{links}{''.join(joint.format(*row) for row in rows)}</robot>")


ARMS = {
    "one joint": lambda: chain("R"),
    "one sliding joint": lambda: chain("P"),
    "sliding joints": lambda: chain("PRP"),
    "followers": following,
    "nine joints": lambda: chain("RRRRPRRRR"),
}


@pytest.mark.parametrize("name", ARMS)
def test_arms_of_many_kinds_in_a_sampled_loop(name: str, tmp_path: Path) -> None:
    """Inputs and estimates of an adaptive law with torque limits are compared at every sample."""
    arm = ARMS[name]()
    n, dt = arm.n, 2e-3
    motion = al.Sinusoid(np.full(n, 0.3), np.full(n, 0.2), np.full(n, 3.0), np.zeros(n))
    law = al.Adaptive(arm, motion, kp=40.0, kd=20.0, gamma=0.1, leakage=0.1)
    limit = np.append(np.full(n - 1, 8.0), np.inf) if n > 1 else 8.0
    c = Controller(al.export_c(law, tmp_path, dt=dt, tau_max=limit), COMPILERS[0])
    run = al.simulate(
        al.RigidArm(arm), law, np.linspace(0.1, -0.2, n), t_end=0.1, dt=dt, sample_time=dt, tau_max=limit, check_limits=False, throw=False
    )
    assert run.estimate is not None and run.tau is not None
    reached = len(run.t) - 1
    assert reached > 10 and (np.abs(run.tau[:-1, 0]) == 8.0).any()
    for k in range(reached):
        np.testing.assert_array_equal(c(run.t[k], run.q[k], run.v[k]), run.tau[k], err_msg=f"sample {k}")
        np.testing.assert_array_equal(c.state, run.estimate[k], err_msg=f"sample {k}")


@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.parametrize("limit", [None, 6.0])
def test_a_guarded_law_knows_its_sample_time_and_its_limits(samples: int, limit: float | None, tmp_path: Path) -> None:
    dt = 1e-3
    law = al.Guarded(al.PDGravity(PLANAR, [0.5, 0.3], 60.0, 9.0), al.MomentumObserver(PLANAR, 50.0, threshold=2.0), "float", damping=2.0)
    c = Controller(al.export_c(law, tmp_path, dt=dt, sample_time=samples * dt, tau_max=limit), COMPILERS[0])
    push: dict[str, Any] = {"force": [8.0, -6.0, 0.0], "force_frame": "link2"}
    times: dict[str, Any] = {"t_end": 0.2, "dt": dt, "sample_time": samples * dt, "record_every": samples, "tau_max": limit}
    run = al.simulate(al.RigidArm(PLANAR), law, [0.0, 0.9], check_limits=False, **times, **push)
    assert run.estimate is not None and run.tau is not None and run.contact is not None
    for k in range(len(run.t) - 1):
        np.testing.assert_array_equal(c(run.t[k], run.q[k], run.v[k]), run.tau[k], err_msg=f"sample {k}")
        np.testing.assert_array_equal(c.state, run.estimate[k], err_msg=f"sample {k}")


def test_measurements_and_delay_of_a_sampled_loop(tmp_path: Path) -> None:
    """The C receives the law's measurements: delayed and rounded. The delay of the input is not part of the law."""
    law = al.PDGravity(PLANAR, [0.5, 0.3], 60.0, 9.0)
    c = Controller(al.export_c(law, tmp_path), COMPILERS[0])
    sampling = al.Sampling(1e-3, delay=1e-3, sensor_delay=1)
    run = al.simulate(al.RigidArm(PLANAR), law, [0.0, 0.9], t_end=0.1, dt=1e-3, sample_time=sampling, check_limits=False)
    assert run.tau is not None
    for k in range(1, len(run.t) - 2):
        np.testing.assert_array_equal(c(run.t[k], run.q[k - 1], run.v[k - 1]), run.tau[k + 1], err_msg=f"sample {k}")


def test_no_number_that_is_bad_passes(tmp_path: Path) -> None:
    law = al.Adaptive(PLANAR, al.Quintic([0.0, 0.5], [0.4, 0.9], 0.3), kp=40.0, kd=20.0, gamma=0.2)
    c = Controller(al.export_c(law, tmp_path, dt=1e-3, tau_max=5.0), COMPILERS[0])
    first = c(0.0, [0.1, 0.2], [0.0, 0.0])
    before = c.memory.copy()
    for bad in (np.nan, np.inf, -np.inf):
        for t, q, v in ((bad, [0.1, 0.2], [0.0, 0.0]), (1e-3, [0.1, bad], [0.0, 0.0]), (1e-3, [0.1, 0.2], [bad, 0.0])):
            status, tau = c.status(t, q, v)
            assert status == 1
            np.testing.assert_array_equal(tau, first)
            np.testing.assert_array_equal(c.memory, before)
    # The C reports a state that is not finite.
    c.memory[c.n + 1] = np.nan
    assert c.status(1e-3, [0.1, 0.2], [0.0, 0.0])[0] == 4


def test_arguments_that_are_bad(tmp_path: Path) -> None:
    guarded = al.Guarded(al.PDGravity(PLANAR, [0.5, 0.3], 60.0, 9.0), al.MomentumObserver(PLANAR, 50.0))
    law = al.PDGravity(PLANAR, [0.5, 0.3], 60.0, 9.0)
    bad: list[tuple[al.Law, dict[str, Any], str]] = [
        (guarded, {}, "dt is missing: expected the sample time, which Guarded needs"),
        (guarded, {"sample_time": 0.0}, "sample_time is not positive"),
        (guarded, {"sample_time": np.nan}, "sample_time is not"),
        (guarded, {"sample_time": "1"}, "sample_time is not a number"),
        (law, {"dt": np.inf}, "dt is not"),
        (law, {"dt": -1.0}, "dt is not positive"),
        (law, {"dt": True}, "dt is not a number"),
        (law, {"method": 4}, "method is not"),
        (law, {"tau_max": [5.0]}, "tau_max has the wrong shape"),
        (law, {"tau_max": [5.0, 0.0]}, r"tau_max is not positive: expected > 0, got 0 \(first bad index 1\)"),
        (law, {"tau_max": [np.nan, 5.0]}, r"tau_max is not positive: expected > 0, got NaN \(first bad index 0\)"),
        (law, {"tau_max": "5"}, "tau_max"),
        (law, {"armature": True}, "armature is not used: expected none for a law"),
        (law, {"prefix": "int"}, "prefix is no name in C"),
        (law, {"overwrite": 1}, "overwrite"),
    ]
    for given, arguments, message in bad:
        with pytest.raises(al.InputError, match=f"^export_c: {message}"):
            al.export_c(given, tmp_path / "out", **arguments)
    assert not (tmp_path / "out").exists()
    assert al.export_c(guarded, tmp_path / "out", sample_time=2e-3)


def test_an_arm_that_is_too_long_is_refused(tmp_path: Path) -> None:
    arm = chain("R" * 80)
    with pytest.raises(al.InputError, match=r"^export_c: law is too long to be printed: expected an arm with fewer joints, got 80 joints"):
        al.export_c(al.Adaptive(arm, al.Hold(np.zeros(80)), 1.0, 1.0, 1.0), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_folder_that_exists_and_one_that_is_a_file(tmp_path: Path) -> None:
    law = al.PDGravity(PLANAR, [0.5, 0.3], 60.0, 9.0)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    files = al.export_c(law, tmp_path / "mine")
    assert sorted(os.listdir(tmp_path / "mine")) == ["CMakeLists.txt", "law.c", "law.h", "notes.txt"]
    assert al.export_c(law, str(tmp_path / "mine"), method="rk4") == files
    (tmp_path / "file").write_text("mine")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises((al.InputError, OSError)):
            al.export_c(law, folder)
    assert (tmp_path / "file").read_text() == "mine"
