"""Joint limits: a start, target, end of motion or waypoint outside of them gives a warning, and an error with `check_limits=True`."""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest

import armlet as al
from armlet.cli import main


def hinge(lower: float, upper: float, kind: str = "R") -> dict[str, Any]:
    return {
        "type": kind,
        "axis": [0, 0, 1],
        "xyz": [0.5, 0, 0],
        "phi": [1, 0, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1],
        "lower": lower,
        "upper": upper,
    }


# The joints are a revolute joint without limits, a revolute joint and a prismatic joint with limits.
ARM = al.Arm.from_chain([hinge(-np.inf, np.inf), hinge(-3.1, 3.1), hinge(0.0, 0.5, "P")])
PLANT = al.RigidArm(ARM)
HOME = [0.0, 0.1, 0.2]
DEGREES = [90.0, -57.0, 0.2]
SAYS = r"\[1\] = -57 rad is outside \[-3\.1, 3\.1\]: degrees\?"
SHORT: dict[str, Any] = {"t_end": 0.01, "dt": 0.005}


def law(target: Any = HOME) -> al.Law:
    return al.PDGravity(ARM, target, kp=10.0, kd=10.0)


def follow(motion: al.Motion) -> al.Law:
    return al.ComputedTorque(ARM, motion, kp=10.0, kd=10.0)


def loop(of: al.Law, q0: Any = HOME, **keywords: Any) -> al.Run:
    return al.simulate(PLANT, of, q0, **SHORT, **keywords)


MOTORS: dict[str, Any] = {"joint_stiffness": 1e3}
ELASTIC = al.ElasticArm(ARM, 1e3, 0.1)
TASK = [al.Task("link3", "xy", [0.9, 0.2])]
CALLS: dict[str, tuple[str, Callable[..., Any]]] = {
    "start": ("simulate: q0", lambda **k: loop(law(), DEGREES, **k)),
    "target": ("simulate: law.target", lambda **k: loop(law(DEGREES), **k)),
    "pid": ("simulate: law.target", lambda **k: loop(al.PID(ARM, DEGREES, 10.0, 1.0, 10.0), **k)),
    "motors": (
        "simulate: law.target",
        lambda **k: al.simulate(ELASTIC, al.MotorPD(ARM, DEGREES, 10.0, 1.0, **MOTORS), HOME, **SHORT, **k),
    ),
    "joints": (
        "simulate: law.target",
        lambda **k: al.simulate(ELASTIC, al.JointImpedance(ARM, DEGREES, 10.0, 1.0, 1e3, 0.1, 0.05), HOME, t_end=0.0, dt=1e-3, **k),
    ),
    "hold": ("simulate: law.motion", lambda **k: loop(follow(al.Hold(DEGREES)), **k)),
    "end of a motion": ("simulate: law.motion", lambda **k: loop(follow(al.Quintic(HOME, DEGREES, 50.0)), **k)),
    "simulator": ("Simulator: q0", lambda **k: al.Simulator(PLANT, law(), DEGREES, dt=1e-3, **k)),
    "reset": ("Simulator.reset: q0", lambda **k: al.Simulator(PLANT, law(), HOME, dt=1e-3, **k).reset(DEGREES)),
    "inverse kinematics": ("inverse_kinematics: q0", lambda **k: al.inverse_kinematics(ARM, TASK, DEGREES, **k)),
}
ROWS: dict[str, tuple[str, Callable[..., Any]]] = {
    "batch": ("simulate_batch: q0", lambda q, **k: al.simulate_batch(PLANT, law(), q, **SHORT, **k)),
    "pieces": ("simulate_batch: q0", lambda q, **k: al.simulate_batch(PLANT, law(), q, **SHORT, progress=lambda *_: None, **k)),
    "inverse kinematics": ("inverse_kinematics: q0", lambda q, **k: al.inverse_kinematics(ARM, TASK, q, **k)),
    "waypoints": ("time_path: path", lambda q, **k: al.time_path(ARM, q, v_max=1.0, a_max=1.0, **k)),
}


@pytest.mark.parametrize("name", CALLS)
def test_a_position_outside_is_named(name: str) -> None:
    argument, call = CALLS[name]
    with pytest.warns(UserWarning, match=f"^{argument}{SAYS}; check_limits=True refuses this, False allows it$") as told:
        call()
    assert len(told) == 1 and told[0].filename == __file__, [str(each.message) for each in told]
    with pytest.raises(al.InputError, match=f"^{argument}{SAYS}$"):
        call(check_limits=True)
    call(check_limits=False)
    with pytest.raises(al.InputError, match=r"check_limits is not a flag: expected True or False, got 1\.5"):
        call(check_limits=1.5)


@pytest.mark.parametrize("name", ROWS)
def test_one_warning_counts_the_rows(name: str) -> None:
    argument, call = ROWS[name]
    # 130 rows; three of them are outside of a limit.
    rows = np.linspace(HOME, [0.0, 1.0, 0.3], 130)
    rows[[3, 70, 129], 1] = [4.0, -57.0, 90.0]
    with pytest.warns(
        UserWarning, match=rf"^{argument}\[3, 1\] = 4 rad is outside \[-3\.1, 3\.1\] \(3 of 130 rows\); check_limits"
    ) as told:
        call(rows)
    assert len(told) == 1 and told[0].filename == __file__
    with pytest.raises(al.InputError, match=rf"^{argument}\[3, 1\] = 4 rad is outside \[-3\.1, 3\.1\] \(3 of 130 rows\)$"):
        call(rows, check_limits=True)
    call(rows, check_limits=False)


def test_numpy_counts_the_same() -> None:
    q = np.random.default_rng(0).uniform(-4.0, 4.0, (5000, 3))
    lower, upper = (np.array(ARM.limits[name]) for name in ("q_min", "q_max"))
    outside = (q < lower) | (q > upper)
    row = int(outside.any(axis=1).argmax())
    joint = int(outside[row].argmax())
    with pytest.raises(al.InputError, match=rf"q0\[{row}, {joint}\] = .* \({outside.any(axis=1).sum()} of 5000 rows\)"):
        al.simulate_batch(PLANT, law(), q, **SHORT, check_limits=True)


def test_every_row_has_its_own_arm_and_law() -> None:
    free = al.Arm.from_chain([hinge(-1e4, 1e4)] * 3)
    with pytest.raises(al.InputError, match=rf"^simulate_batch: q0{SAYS.replace('1', '1, 1', 1)} \(1 of 2 rows\)$"):
        al.simulate_batch([al.RigidArm(free), PLANT], law(), [DEGREES, DEGREES], **SHORT, check_limits=True)
    with pytest.warns(UserWarning, match=rf"law.target{SAYS} \(1 of 2 rows\)"):
        al.simulate_batch(PLANT, [law(), law(DEGREES)], [HOME, HOME], **SHORT)


@pytest.mark.parametrize(
    ("kind", "limit", "q0", "words"),
    [
        ("R", 180.0, -57.0, r"q0\[0\] = -57 rad is implausibly large, and so are its limits \[-180, 180\]: degrees\?"),
        ("R", 90.0, 91.0, r"q0\[0\] = 91 rad is outside \[-90, 90\]"),
        ("P", 400.0, 250.0, r"q0\[0\] = 250 m is implausibly large, and so are its limits \[-400, 400\]: millimetres\?"),
    ],
)
def test_limits_in_degrees_do_not_hide_positions_in_degrees(kind: str, limit: float, q0: float, words: str) -> None:
    arm = al.Arm.from_chain([{**hinge(-limit, limit), "type": kind}])
    stay = al.PDGravity(arm, [0.0], 10.0, 5.0)
    with pytest.warns(UserWarning, match=words):
        al.simulate(al.RigidArm(arm), stay, [q0], **SHORT)
    with pytest.raises(al.InputError, match=words):
        al.simulate(al.RigidArm(arm), stay, [q0], **SHORT, check_limits=True)
    # A position of less than one turn is plausible.
    al.simulate(al.RigidArm(arm), stay, [0.9], **SHORT, check_limits=True)


def test_one_warning_names_all_positions() -> None:
    with pytest.warns(UserWarning, match=rf"^simulate: q0{SAYS} \(and 1 more joint\); law.target{SAYS}; check_limits") as told:
        loop(law(DEGREES), [0.0, -57.0, 0.6])
    assert len(told) == 1


def test_positions_within_limits_give_no_warning() -> None:
    for q in ([1e3, 3.1, 0.5], [-1e3, -3.1, 0.0], [0.0, 3.1 + 9e-10, -9e-10]):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            loop(law(q), q, check_limits=True)
    # Closed-form arms have no limits, and `check_limits` must ignore them.
    pr = models.PR
    al.simulate(al.RigidArm(pr), al.PDGravity(pr, [90.0, 90.0], 1.0, 1.0), [90.0, 90.0], **SHORT, check_limits=True)
    al.inverse_kinematics(ARM, TASK, DEGREES, limits=False)
    # Limits that are arguments of the call replace those of the arm.
    al.time_path(ARM, [HOME, [0.0, 4.0, 0.2]], v_max=1.0, a_max=1.0, q_max=[9.0, 9.0, 9.0])


def test_rows_that_are_not_numbers_are_not_outside() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = al.inverse_kinematics(ARM, TASK, [HOME, [np.nan] * 3])
    assert found.status.tolist() == [al.Status.SUCCESS, al.Status.DIVERGED]


def test_degrees_are_a_question_where_they_fit() -> None:
    for value, question in ((3.2, ""), (6.2, ""), (6.3, ": degrees?"), (177.0, ": degrees?"), (178.0, "")):
        with pytest.raises(al.InputError) as caught:
            loop(law(), [0.0, value, 0.2], check_limits=True)
        assert str(caught.value).endswith("[-3.1, 3.1]" + question), value
    with pytest.raises(al.InputError, match=r"q0\[2\] = -10 m is outside \[0, 0\.5\]$"):
        loop(law(), [0.0, 0.0, -10.0], check_limits=True)


def test_a_copy_does_not_warn_again() -> None:
    with pytest.warns(UserWarning, match="outside"):
        sim = al.Simulator(PLANT, law(), DEGREES, dt=1e-3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        copies = pickle.loads(pickle.dumps(pickle.loads(pickle.dumps(sim))))
    with pytest.warns(UserWarning, match=r"^Simulator.reset: q0"):
        copies.reset(DEGREES)


SCENARIO = """
[arm]
kind = "example"
name = "six_axis"
[law]
kind = "PDGravity"
target = [0, 0.4, {target}, 0, 0, 0]
kp = 100
kd = 50
[run]
q0 = [0, {start}, 0, 0, 0, 0]
t_end = 0.01
dt = 0.005
"""


class TestScenario:
    def file(self, folder: Path, *, start: float = 0.0, target: float = 0.0, more: str = "") -> str:
        path = folder / "loop.toml"
        path.write_text(SCENARIO.format(start=start, target=target) + more)
        return str(path)

    def test_check_and_run_print_the_warning(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        for command in ("check", "run"):
            assert main([command, self.file(tmp_path, start=-57.0)]) == 0
            assert "armlet: warning: simulate: q0[1] = -57 rad is outside [" in capsys.readouterr().err

    @pytest.mark.parametrize(("key", "wrong"), [("run.q0[1]", {"start": -57.0}), ("law.target[2]", {"target": 90.0})])
    def test_check_refuses_with_the_key(self, tmp_path: Path, capsys: pytest.CaptureFixture[str], key: str, wrong: Any) -> None:
        assert main(["check", self.file(tmp_path, more="check_limits = true\n", **wrong)]) == 2
        assert f"$.{key}: = {next(iter(wrong.values())):g} rad is outside [" in capsys.readouterr().err

    def test_a_motion_is_named_by_its_table(self) -> None:
        data = {
            "arm": {"kind": "example", "name": "six_axis"},
            "motion": {"kind": "Hold", "q": [0, 90.0, 0, 0, 0, 0]},
            "law": {"kind": "ComputedTorque", "kp": 10.0, "kd": 10.0},
            "run": {"q0": [0.0] * 6, **SHORT, "check_limits": True},
        }
        with pytest.raises(al.InputError, match=r"\$\.motion\[1\]: = 90 rad is outside"):
            al.Scenario(data).check()

    def test_a_sweep_warns_of_its_first_and_last_cell(self, tmp_path: Path) -> None:
        text = SCENARIO.format(start=-57.0, target=0.0) + '[sweep.vary]\n"law.kd" = [50.0, 51.0, 52.0]\n'
        path = tmp_path / "loop.toml"
        path.write_text(text)
        with pytest.warns(UserWarning, match=r"q0\[1\] = -57 rad is outside") as told:
            al.sweep(al.Scenario.load(path))
        assert len(told) == 2


def test_a_run_that_diverges_names_the_joint_that_left_first() -> None:
    limited = al.Arm.from_chain([hinge(-50.0, 50.0), hinge(-0.5, 0.5)], gravity=(0, 0, 0))
    free = al.PDGravity(limited, [0.0, 0.0], kp=1e-9, kd=1e-9)
    words = r"v\[0\] = .*; joint2 left its limits first, at t = 0\.26 s: q\[1\] = "
    with pytest.raises(al.SolveError, match=words):
        al.simulate(al.RigidArm(limited), free, [0.0, 0.0], v0=[9.0, -2.0], t_end=9.0, dt=1e-2, state_limit=20.0)
