"""The laboratory without a screen: sliders, targets and pulls change the loop, and no input of the user raises an error.

After each change the loop continues from its current state. Each system responds as its theory predicts.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import armlet as al
from armlet.live.model import FRAME, WINDOW, Lab
from armlet.live.systems import (
    AdaptivePR,
    Choice,
    Elastic,
    Limits,
    MinimumTime,
    Observer,
    Priority,
    Redundant,
    Robot,
    Slider,
    Stiction,
    System,
)
from armlet.live.systems.adaptive import parameters, robot
from armlet.live.systems.mintime import MOMENT, TOTAL
from armlet.live.systems.robot import middle

NAMES = ("planar_2r", "planar_pr", "macro_micro_4r", "six_axis", "seven_axis", "two_arms")
MOVED = np.array([0.1, -0.05, 0.0])  # m


def systems() -> list[System]:
    robot = Robot(al.example_urdf("seven_axis"), "seven_axis")
    return [AdaptivePR(), Priority(), Limits(), Elastic(), MinimumTime(), Redundant(), Observer(), Stiction(), robot]


def run(lab: Lab, seconds: float) -> None:
    for _ in range(round(seconds / FRAME)):
        lab.advance()


def tip(lab: Lab) -> np.ndarray:
    return np.asarray(lab.system.arm.position(lab.q, lab.system.frame))


@pytest.mark.parametrize("k", range(9))
def test_every_system_runs(k: int) -> None:
    lab = Lab([systems()[k]])
    run(lab, 1.0)
    # One second is 62 frames of 16 steps of 1 ms: 0.992 s.
    assert lab.status is al.Status.SUCCESS and lab.t == pytest.approx(0.992, abs=1e-12)
    poses = lab.poses()
    assert set(poses) == {shape.frame for shape in lab.system.shapes if shape.frame is not None}
    for frame, pose in poses.items():
        assert np.array_equal(pose, lab.system.arm.pose(lab.q, frame))
    for plot, (t, *curves) in zip(lab.system.plots, lab.panels(), strict=True):
        assert len(curves) == len(plot.curves) and t[-1] == lab.t and np.all(np.diff(t) > 0)
        assert all(curve.shape == t.shape and np.all(np.isfinite(curve)) for curve in curves)


def test_a_lab_is_the_loop_itself() -> None:
    """Without a pull, stepping in frames gives the same state as `al.simulate`."""
    lab = Lab([Elastic()])
    target = lab.targets["x_d"].copy()
    lab.drag("x_d", target + MOVED)
    run(lab, 1.0)
    elastic = lab.system
    law = al.ElasticImpedance(
        elastic.arm,
        (target + MOVED)[:2],
        300.0,
        40.0,
        800.0,
        [0.4, 0.25],
        [0.02, 0.0125],
        frame="link2",
        damping_ratio=1.0,
        axes="xy",
    )
    same = al.simulate(al.ElasticArm(elastic.arm, 800.0, [0.4, 0.25]), law, elastic.q0, t_end=0.992, dt=1e-3)
    # `al.simulate` and the frames of the laboratory take the same steps.
    assert np.abs(lab.q - same.q[-1]).max() < 1e-12


@pytest.mark.parametrize("k", range(9))
def test_a_change_continues_from_the_state(k: int) -> None:
    """A loop that restarts in every frame, as under a pull, ends in the same state as a loop that never restarts."""
    free, touched = Lab([systems()[k]]), Lab([systems()[k]])
    for _ in range(150):
        free.advance()
        control = touched.system.controls[-1]
        touched.set(control.name, touched.values[control.name])
        touched.advance()
    assert touched.t == pytest.approx(free.t, abs=1e-9)
    # Each restart shifts the motion in time. This adds rounding of a phase, or the interpolation error of a table with 1 ms between points.
    assert np.abs(touched.q - free.q).max() < 1e-6
    assert np.allclose(touched.panels()[1][1], free.panels()[1][1], atol=1e-4)


@pytest.mark.parametrize("k", range(9))
def test_every_corner_of_the_controls_is_survived(k: int) -> None:
    """Every slider goes to both ends of its range: the loop runs, or its status is that it diverged, or the value is refused.

    After a reset with default values the loop runs again.
    """
    lab = Lab([systems()[k]])
    for control in lab.system.controls:
        for value in control.options if isinstance(control, Choice) else (control.low, control.high):
            lab.set(control.name, value)
            run(lab, 0.3)
            assert np.all(np.isfinite(lab.q))
            assert lab.status in (al.Status.SUCCESS, al.Status.DIVERGED)
            if lab.status is al.Status.DIVERGED:
                assert "reset" in lab.message
    lab.choose(lab.system.title)
    run(lab, 0.5)
    assert lab.status is al.Status.SUCCESS and lab.t > 0.4 and lab.message in ("", lab.system.note)


def test_controls_are_read_with_care() -> None:
    lab = Lab(systems()[1:2])
    lab.set("gain1", 1e9)
    assert lab.values["gain1"] == 20.0
    for name, value, part in (("gain1", float("nan"), "not finite"), ("method", "best", "clamp"), ("gain3", 1.0, "gain1, gain2")):
        with pytest.raises(al.InputError, match=part):
            lab.set(name, value)
    with pytest.raises(al.InputError, match="system is unknown"):
        lab.choose("none")
    lab.drag("tip", [np.nan, 0.0, 0.0])
    lab.drag("nose", [0.0, 0.0, 0.0])
    assert np.array_equal(lab.targets["tip"], lab.system.targets["tip"]) and set(lab.targets) == {"tip", "elbow"}
    lab.drag("tip", [1.0, 1.0, 0.3])
    assert lab.targets["tip"].tolist() == [1.0, 1.0, 0.0]


def test_divergence_is_a_state() -> None:
    lab = Lab([Elastic()])
    run(lab, 0.5)
    lab.set("joint_stiffness", 2e4)
    lab.set("share", 1e-5)
    run(lab, 1.0)
    stands, q = lab.t, lab.q
    assert lab.status is al.Status.DIVERGED and lab.message.startswith("diverged after t = ") and np.all(np.isfinite(q))
    lab.set("share", 0.05)  # too late: only a reset restarts the loop
    run(lab, 0.5)
    assert lab.t == stands and lab.q is q and lab.advance() == 0
    lab.reset()
    assert lab.status is al.Status.SUCCESS and lab.t == 0.0
    run(lab, 0.5)
    assert lab.t > 0.4 and lab.message == ""


def test_a_refused_value_does_not_stop_the_loop() -> None:
    class Refusing(Elastic):
        def loop(self, values, targets, force, state):  # type: ignore[no-untyped-def]
            if values["stiffness"] > 500.0:
                raise al.InputError("elastic: stiffness is too much")
            return super().loop(values, targets, force, state)

    lab = Lab([Refusing()])
    lab.set("stiffness", 900.0)
    assert lab.advance() == 0 and lab.message == "refused: elastic: stiffness is too much"  # the loop has not started
    lab.set("stiffness", 300.0)
    run(lab, 0.2)
    lab.set("stiffness", 900.0)
    run(lab, 0.2)
    assert lab.t > 0.35 and lab.message.startswith("refused") and lab.status is al.Status.SUCCESS


def test_pause_speed_and_pace() -> None:
    clock = iter(np.arange(0.0, 1e3, FRAME))
    lab = Lab([Priority()], clock=lambda: float(next(clock)))
    run(lab, 2.0)
    assert lab.real_time_factor == pytest.approx(1.0, rel=1e-9)
    lab.speed = 0.25
    run(lab, 2.0)
    assert lab.real_time_factor == pytest.approx(0.25, rel=1e-9)
    lab.paused, stands = True, lab.t
    run(lab, 2.0)
    assert lab.t == stands and lab.real_time_factor == 0.0
    lab.paused, lab.speed = False, 2.0
    assert lab.advance() == 32
    assert lab.advance(10.0) == 200  # after a pause of 10 s the laboratory advances 200 steps only
    run(lab, 12.0)
    t = lab.panels()[0][0]
    assert t[-1] - t[0] <= WINDOW


def test_pull_and_rest_of_the_elastic_arm() -> None:
    """A pull F at the tip moves the resting point to x_E = x_d + K_m^-1 F. After its release the tip returns to x_d."""
    lab = Lab([Elastic()])
    run(lab, 3.0)
    point = tip(lab)
    lab.grip("link2", point)
    lab.pull(point + MOVED, 120.0)
    run(lab, 10.0)
    # All modes have decayed after 10 s. The drawn spring starts at the tip.
    assert np.abs(tip(lab) - lab.targets["x_d"] - lab.force / 300.0).max() < 1e-7
    assert 5.0 < lab.force[0] < 12.0
    ends = lab.spring()
    assert ends is not None and np.allclose(ends[0], tip(lab)) and np.allclose(ends[1], point + MOVED)
    lab.release()
    run(lab, 10.0)
    assert lab.spring() is None and not lab.force.any()
    assert np.abs(tip(lab) - lab.targets["x_d"]).max() < 1e-7


def test_a_pull_away_from_the_frame_has_a_moment() -> None:
    """A pull at a point of the last link acts through the Jacobian of that point, not of the tip."""
    lab = Lab([Robot(al.example_urdf("planar_2r"), "planar_2r")])
    run(lab, 1.0)
    arm, held = lab.system.arm, np.array([-0.2, 0.03, 0.0])
    pose = np.asarray(arm.pose(lab.q, "tool"))
    point = pose[:3, :3] @ held + pose[:3, 3]
    lab.grip("tool", point)
    lab.pull(point + np.array([0.0, 0.2, 0.1]), 20.0)
    run(lab, 8.0)
    J = arm.with_frame("held", "tool", xyz=[*held]).jacobian(lab.q, "held")[:3]
    # At rest, computed torque satisfies M Kp e + J'F = 0.
    error = lab.q - lab.system.q0
    assert np.allclose(100.0 * arm.mass_matrix(lab.q) @ error, J.T @ lab.force, atol=1e-6)
    assert np.abs(error).max() > 5e-3


def test_a_hand_does_not_shake() -> None:
    """Under the strongest pull, a weakly controlled arm comes to rest, although the force changes only every 16 ms."""
    lab = Lab([Robot(al.example_urdf("planar_2r"), "planar_2r")])
    lab.set("omega", 0.5)
    lab.set("zeta", 0.05)
    run(lab, 0.5)
    point = tip(lab)
    lab.grip("tool", point)
    lab.pull(point - np.array([0.1, 0.0, 0.05]), 500.0)
    run(lab, 30.0)
    ends = lab.spring()
    assert ends is not None and np.linalg.norm(ends[1] - ends[0]) < 0.01
    here = lab.q
    run(lab, 1.0)
    assert np.abs(lab.q - here).max() < 1e-3
    lab.grip("nose", point)  # "nose" belongs to another system: the arm stays held at "tool"
    assert lab.spring() is not None


def test_a_velocity_arm_is_not_pulled() -> None:
    lab = Lab([Priority()])
    lab.grip("link4", tip(lab))
    lab.pull([9.0, 9.0, 0.0], 100.0)
    assert lab.spring() is None and not lab.force.any()


def test_adaptive_learns_its_payload() -> None:
    """The drawn chain has the same dynamics as `al.planar_pr(A, B, C)`, and the law estimates an unknown payload."""
    for payload in (0.0, 0.7):
        chain, model = robot(payload), al.planar_pr(*parameters(payload))
        q, v = np.array([0.4, -1.1]), np.array([0.3, 2.0])
        assert np.allclose(chain.mass_matrix(q), model.mass_matrix(q), atol=1e-14)
        assert np.allclose(chain.bias(q, v), model.bias(q, v), atol=1e-14)
    lab = Lab([AdaptivePR()])
    lab.set("gamma", 50.0)
    lab.set("payload", 1.0)
    run(lab, 60.0)
    estimates, truth = np.array([curve[-1] for curve in lab.panels()[1][1:]]).reshape(2, 3)
    assert np.allclose(truth, parameters(1.0)) and np.abs(estimates - truth).max() < 0.02 * truth.max()
    assert np.abs([curve[-1] for curve in lab.panels()[0][1:]]).max() < 1e-3
    lab.set("amplitude", 0.0)
    lab.drag("centre", [0.5, -0.6, 0.0])
    run(lab, 8.0)
    wanted = lab.system.desired(lab.t, lab.values, lab.targets)
    assert wanted is not None and np.abs(tip(lab) - wanted).max() < 1e-3 and abs(wanted[0] - 0.5) < 1e-12


def test_minimum_time_arrives_at_the_planned_time() -> None:
    lab = Lab([MinimumTime()])
    optimum = al.torque_optimal_time(-np.pi / 2, np.pi / 2, TOTAL, MOMENT, 4.0)
    lab.advance()
    assert lab.message.startswith(f"monotone, {optimum.t:.3f} s, certified")
    run(lab, optimum.t - 2 * FRAME)
    assert abs(lab.q[0] - np.pi / 2) > 1e-3
    run(lab, 3 * FRAME)
    # The planned torque jumps inside a step of 1 ms. The feedback removes the resulting error.
    assert abs(lab.q[0] - np.pi / 2) < 2e-2
    run(lab, 1.0)
    assert abs(lab.q[0] - np.pi / 2) < 1e-6
    # A goal that changes during a motion takes effect when the link is at rest.
    lab.drag("goal", [0.6, 0.0, 0.0])
    lab.advance()
    lab.drag("goal", [0.5, -0.3, 0.0])
    run(lab, 5.0)
    assert abs(lab.q[0] - np.arctan2(-0.3, 0.5)) < 1e-6
    assert np.abs(lab.panels()[1][1]).max() <= 4.0
    # While the user pulls the link, the laboratory plans no motion.
    here = tip(lab)
    lab.grip("link1", here)
    lab.pull(here + np.array([0.1, 0.17, 0.0]), 50.0)
    run(lab, 0.1)
    lab.drag("goal", [0.0, -0.6, 0.0])
    told = lab.message
    run(lab, 0.1)
    assert lab.message == told
    lab.release()
    run(lab, 5.0)
    assert lab.message != told and abs(lab.q[0] + np.pi / 2) < 1e-6
    # A torque of 0.5 N m cannot raise the link to 1.57 rad with one swing. The message reports this, and the link stays at rest.
    lab.drag("goal", [0.6, 0.0, 0.0])
    run(lab, 3.0)
    lab.set("tau_max", 0.5)
    lab.drag("goal", [0.0, 0.6, 0.0])
    run(lab, 1.0)
    assert lab.message.startswith("no way to 1.57 rad: ") and lab.status is al.Status.SUCCESS
    assert abs(lab.q[0]) < 1e-6


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("law", ["computed torque", "PD + gravity"])
def test_robots_follow_their_target(name: str, law: str) -> None:
    system = Robot(al.example_urdf(name), name)
    lab = Lab([system])
    lab.set("law", law)
    low, high = system.arm.limits["q_min"], system.arm.limits["q_max"]
    assert np.all((middle(system.arm) >= low) & (middle(system.arm) <= high))
    wanted = system.arm.position(np.clip(system.q0 - 0.15, low, high), system.frame)
    lab.drag("tip", wanted)
    run(lab, 6.0)
    assert lab.status is al.Status.SUCCESS and lab.message == ""
    # Inverse kinematics stops at an error of 0.1 mm.
    assert np.abs(tip(lab) - wanted).max() < 2e-4
    lab.drag("tip", [30.0, 0.0, 0.0])
    run(lab, 0.2)
    assert lab.message.startswith("out of reach by") and lab.status is al.Status.SUCCESS


def test_where_a_robot_starts() -> None:
    """A robot starts at zero. A joint whose limits exclude zero starts in the middle of its range."""
    text = al.example_urdf("planar_2r")
    arm = al.load_urdf(text)
    assert middle(arm).tolist() == [0.0, 0.0]
    low, high = arm.limits["q_min"][1], arm.limits["q_max"][1]
    assert np.isfinite([low, high]).all() and not np.isfinite(arm.limits["q_min"][0])
    beyond = al.load_urdf(text.replace(f'lower="{low:g}"', 'lower="0.5"').replace(f'upper="{high:g}"', 'upper="1.5"'))
    assert middle(beyond).tolist() == [0.0, 1.0]


def test_robots_that_cannot_be_shown() -> None:
    text = al.example_urdf("planar_2r")
    with pytest.raises(al.InputError, match="frame is unknown: expected one of base, link1, link2, tool, got nose"):
        Robot(text, "x", "nose")
    with pytest.raises(al.InputError, match="has no joints"):
        Robot('<robot name="r"><link name="base"/></robot>', "stone")
    with pytest.raises(al.ModelError):
        Robot("<robot>", "broken")


def test_a_slider_over_powers_and_its_label() -> None:
    """Every slider has a label and starts inside its range. A slider of exponents has a positive range."""
    for system in systems():
        names = [control.name for control in system.controls]
        assert len(set(names)) == len(names) == len(system.defaults())
        for control in system.controls:
            assert control.label
            if isinstance(control, Slider):
                assert control.low <= control.value <= control.high and control.read(control.value) == control.value
                assert not control.powers or (control.low > 0.0 and control.label.endswith("10^"))


def test_no_viser_is_needed(tmp_path: Path) -> None:
    """The model runs without the package viser, and each command prints one line that viser is missing."""
    hidden = "import sys; sys.modules['viser'] = None\n"
    code = (
        hidden
        + "from armlet.live.model import Lab; from armlet.live.systems import Priority; lab = Lab([Priority()]); print(lab.advance())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, cwd=tmp_path)
    assert done.stdout == "16\n", done.stderr
    file = tmp_path / "arm.urdf"
    file.write_text(al.example_urdf("planar_2r"))
    for arguments in (["lab"], ["view", str(file)]):
        code = hidden + f"from armlet.cli import main; sys.exit(main({arguments!r}))"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, cwd=tmp_path)
        assert done.returncode == 2 and done.stdout == ""
        assert done.stderr == f"armlet: {arguments[0]}: viser is not installed: pip install '.[live]' in the folder of armlet's sources\n"
