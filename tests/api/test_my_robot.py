"""The page `docs/my_robot.md` with other robots: its code holds for light wrists, heavy bases and limits that exclude zero."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import pyplot

import armlet as al

PAGE = Path(__file__).resolve().parents[2] / "docs" / "my_robot.md"
Z, Y = [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]


def chain(
    inertias: list[float],
    masses: list[float],
    lengths: list[float],
    limits: tuple[float, float] = (-3.0, 3.0),
    damping: float = 0.0,
    friction: float = 0.0,
) -> str:
    """The URDF of rods along z on alternating axes. `inertias`, kg m^2, are about the centres of mass."""
    joints = []
    for i, (inertia, m, length) in enumerate(zip(inertias, masses, lengths, strict=True)):
        c, before = length / 2.0, lengths[i - 1] if i else 0.2
        phi = [m, 0.0, 0.0, m * c, inertia + m * c * c, 0.0, inertia + m * c * c, 0.0, 0.0, inertia]
        drive = {"lower": limits[0], "upper": limits[1], "effort": 1e4, "velocity": 20.0, "damping": damping, "friction": friction}
        joints.append({"type": "R", "axis": Y if i % 2 else Z, "xyz": [0.0, 0.0, before], "phi": phi, **drive})
    return al.Arm.from_chain(joints).to_urdf()[0]


def rounded_angles() -> str:
    """A light arm in which every right angle is the rounded number 1.5708, as in many public files."""
    rod = {"type": "R", "phi": [0.1, 0.0, 0.0, 0.005, 4e-4, 0.0, 4e-4, 0.0, 0.0, 2e-5], "effort": 10.0, "velocity": 10.0}
    turns = [[1.5708, 0.0, 0.0], [-1.5708, 0.0, 0.0], [1.5708, 0.0, 0.0], [0.0, 1.5708, 0.0], [0.0, -1.5708, 0.0]]
    joints = [rod | {"axis": Z, "xyz": [0.0, 0.0, 0.05]}]
    joints += [rod | {"axis": Z, "rpy": turn, "xyz": [0.0, 0.02, 0.1], "lower": -3.0, "upper": 3.0} for turn in turns]
    return al.Arm.from_chain(joints).to_urdf()[0]


ROBOTS = {
    "six_axis": al.example_urdf("six_axis"),
    "seven_axis": al.example_urdf("seven_axis"),
    "planar_2r": al.example_urdf("planar_2r"),
    "light wrist": chain([0.5, 0.3, 0.05, 1e-3, 1e-4, 1e-5], [30.0, 15.0, 5.0, 0.5, 0.1, 0.02], [0.4, 0.4, 0.3, 0.1, 0.05, 0.02]),
    "lighter wrist": chain([5.0, 3.0, 0.5, 1e-3, 1e-5, 1e-6], [100.0, 50.0, 10.0, 0.5, 0.05, 0.005], [0.6, 0.6, 0.4, 0.1, 0.05, 0.01]),
    "seven light": chain(
        [1.0, 1.0, 0.5, 0.1, 1e-2, 1e-3, 2e-5], [40.0, 20.0, 10.0, 5.0, 1.0, 0.3, 0.05], [0.3, 0.3, 0.3, 0.3, 0.1, 0.1, 0.02]
    ),
    "heavy tip": chain([1e-4, 1e-3, 0.1], [0.01, 0.1, 10.0], [0.1, 0.1, 0.4]),
    "damped wrist": chain([0.3, 0.1, 1e-2, 1e-4], [10.0, 5.0, 1.0, 0.1], [0.4, 0.4, 0.2, 0.05], damping=10.0, friction=1.0),
    "rounded angles": rounded_angles(),
    "limits without zero": chain([0.1, 0.1, 0.1], [1.0, 1.0, 1.0], [0.3, 0.3, 0.3], (0.2, 2.0)),
}


def code(page: str) -> str:
    """The code of all steps, without the line that writes the example's file."""
    steps = page[page.index("## 1.") : page.index("## 7.")]
    lines = "\n".join(re.findall(r"^```python\n(.*?)^```", steps, re.DOTALL | re.MULTILINE)).splitlines()
    return "\n".join(line for line in lines if not line.startswith("Path("))


def follow(urdf: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any, chain: str = "") -> None:
    """Run the code of the page with a robot, and check its results. `chain` has further arguments of `load_urdf`."""
    monkeypatch.chdir(folder)
    Path("my_robot.urdf").write_text(urdf)
    # The film and the picture take most of the time, and they are the same for all robots.
    monkeypatch.setattr(al.Run, "animate", lambda *_: None)
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda *_: None)
    bound: dict[str, Any] = {}
    source = code(PAGE.read_text()).replace('load_urdf("my_robot.urdf")', f'load_urdf("my_robot.urdf"{chain})')
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        exec(compile(source, "my_robot.md", "exec"), bound)
    pyplot.close("all")
    # The adaptive law reaches the target with the unknown tool; the page prints its metrics.
    printed = capsys.readouterr().out
    assert "error_final" in printed
    run = al.simulate(bound["loaded"], bound["adaptive"], bound["start"], t_end=3.0, method="dop853")
    assert np.abs(run.q[-1] - bound["q"]).max() < 0.05
    # The identified model follows the motion better than that of the file, whose masses are wrong by 10 %.
    of_file, identified = (float(line) for line in printed.splitlines()[-2:])
    assert identified < of_file


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOTS)
def test_the_page_holds_for_other_robots(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    follow(ROBOTS[name], tmp_path, monkeypatch, capsys)


@pytest.mark.parametrize("name", ROBOTS)
def test_the_step_of_the_gains(name: str) -> None:
    """The step is the inverse of the fastest pole of M e'' + kd e' + kp e = 0, and a run with this step holds a pose."""
    arm = al.load_urdf(ROBOTS[name])
    gains = al.suggest_gains(arm, 15.0)
    low, high = (np.where(np.isfinite(arm.limits[k]), arm.limits[k], s * np.pi) for k, s in (("q_min", -1.0), ("q_max", 1.0)))
    fastest = 0.0
    for q in np.random.default_rng(1).uniform(low, high, (50, arm.n)):
        slopes = np.linalg.solve(arm.mass_matrix(q), np.hstack([np.diag(gains.kp), np.diag(gains.kd)]))
        loop = np.block([[np.zeros((arm.n, arm.n)), np.eye(arm.n)], [-slopes]])
        fastest = max(fastest, np.abs(np.linalg.eigvals(loop)).max())
    # Other random configurations than those of `suggest_gains` have slightly other poles.
    assert 0.5 < fastest * gains.step < 1.2
    q = np.clip(np.full(arm.n, 0.4), low, high)
    law = al.PDGravity(arm, q, gains.kp, gains.kd)
    run = al.simulate(al.RigidArm(arm), law, q + 0.01, t_end=3.0, dt=gains.step, method="rk4", check_limits=False)
    assert np.abs(run.q[-1] - q).max() < 1e-3


MASSLESS = """<robot name="industrial"><link name="base"/><link name="l1"/><link name="l2"/>
  <joint name="a1" type="revolute"><parent link="base"/><child link="l1"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="0" velocity="3"/></joint>
  <joint name="a2" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="0" velocity="3"/></joint></robot>"""


def test_advice_for_a_file_without_masses() -> None:
    """The errors of the first steps say what to do, and it works."""
    arm = al.load_urdf(MASSLESS)
    advice = r"<inertial> elements .*arm\.with_payload\(frame, mass\)"
    with pytest.raises(al.InputError, match=r"^suggest_gains: arm has no inertia at a joint: expected bodies with mass, from " + advice):
        al.suggest_gains(arm, 15.0)
    with pytest.raises(al.SolveError, match=r"the mass matrix is not positive definite at the last record, t = 0 s\. Add " + advice):
        al.simulate(al.RigidArm(arm), al.PDGravity(arm, [0.1, 0.1], 1.0, 1.0), [0.0, 0.0], t_end=0.1, dt=1e-3)
    for link in ("l1", "l2"):
        arm = arm.with_payload(link, 8.0, com=[0.0, 0.0, 0.2], inertia=np.diag([0.1, 0.1, 0.02]))
    gains = al.suggest_gains(arm, 15.0)
    law = al.PDGravity(arm, [0.1, 0.1], gains.kp, gains.kd)
    run = al.simulate(al.RigidArm(arm), law, [0.0, 0.0], t_end=2.0, dt=1e-3)
    assert np.abs(run.q[-1] - 0.1).max() < 1e-3
