"""`armlet lab` and `armlet view` in a real browser: pages load, controls reach the loop, and there are no errors.

The folder build/browser has pictures of the pages.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from visits import PICTURES, Visit, until

import armlet as al
from armlet.live.lab import LabPage
from armlet.live.model import Lab
from armlet.live.server import open_server
from armlet.live.systems import AdaptivePR, Elastic, Limits, MinimumTime, Observer, Priority, Redundant, Robot, Stiction
from armlet.live.view import ViewPage

Go = Callable[[str], Visit]
Draw = Callable[[Any, Callable[[float], None]], str]


@pytest.fixture
def lab() -> LabPage:
    robot = Robot(al.example_urdf("seven_axis"), "Robot of seven axes")
    systems = [AdaptivePR(), Priority(), Limits(), Elastic(), MinimumTime(), Redundant(), Observer(), Stiction(), robot]
    return LabPage(open_server("lab", "127.0.0.1", 0), Lab(systems))


def test_every_system_runs_in_real_time(lab: LabPage, drawn: Draw, visit: Go) -> None:
    seen = visit(drawn(lab.server, lab.frame))
    for k, title in enumerate(lab.model.systems):
        if k:
            seen.choose("system", title)
        until(lambda title=title: lab.model.system.title == title and lab.model.t > 3.0, title)  # type: ignore[misc]
        for plot in lab.model.system.plots:
            seen.page.get_by_text(plot.title, exact=True).wait_for()
        seen.page.get_by_text("real-time factor").wait_for()
        assert 0.9 < lab.model.real_time_factor < 1.1
        seen.picture(f"lab_{k}")


def test_sliders_change_the_run(lab: LabPage, drawn: Draw, visit: Go) -> None:
    seen, model = visit(drawn(lab.server, lab.frame)), lab.model
    until(lambda: model.t > 0.5, "the loop runs")
    seen.turn("amplitude of the motion (m, rad)", 0.0)
    until(lambda: model.values["amplitude"] == 0.0, "the slider arrives")
    time.sleep(8.0)
    still = model.q.copy()
    time.sleep(0.5)
    # The remaining oscillation has decayed. During the motion the arm moved at up to 1 m/s.
    assert np.abs(model.q - still).max() < 1e-2
    seen.turn("adaptation Gamma", -1.0)
    until(lambda: np.isclose(float(model.values["gamma"]), 0.1), "a slider over powers of ten")


def test_the_mouse_pulls_and_releases_a_link(lab: LabPage, drawn: Draw, visit: Go) -> None:
    seen, model = visit(drawn(lab.server, lab.frame)), lab.model
    seen.choose("system", "Elastic impedance, 2R")
    until(lambda: model.system.title.startswith("Elastic") and model.t > 1.0, "the elastic arm")
    seen.page.get_by_text("stiffness at the tip K_m (N/m)", exact=True).wait_for()
    time.sleep(5.0)  # wait until the camera shows the new arm
    turn, arm = model.system.rotation, model.system.arm
    rest = np.array(arm.position(model.q, "link2"))
    held = np.array(arm.pose(model.q, "link2") @ [-0.1, 0.0, 0.0, 1.0])[:3]
    start = seen.pixel(lab.server, turn @ held)
    seen.drag(start, (start[0] + 120.0, start[1]))
    until(lambda: model.force[0] > 5.0, "the pull arrives")
    time.sleep(2.0)
    moved = np.array(arm.position(model.q, "link2")) - rest
    until(lambda: "pull 0.0 N" not in seen.page.locator("body").inner_text(), "the page says so")
    seen.picture("lab_pull")
    # The link is pulled 0.1 m from the tip. The tip's spring, 300 N/m, deflects by about F / K_m.
    assert 0.5 < moved[0] / (model.force[0] / 300.0) < 1.5
    seen.page.mouse.up()
    until(lambda: not model.force.any(), "let go")
    time.sleep(3.0)
    assert np.abs(arm.position(model.q, "link2") - rest).max() < 1e-3


def test_the_mouse_drags_a_target(lab: LabPage, drawn: Draw, visit: Go) -> None:
    seen, model = visit(drawn(lab.server, lab.frame)), lab.model
    seen.choose("system", "Task priority, planar 4R")
    until(lambda: model.system.title.startswith("Task") and model.t > 1.0, "the 4R arm")
    seen.page.get_by_text("gain of the tip, first (1/s)", exact=True).wait_for()
    time.sleep(5.0)  # wait until the camera shows the new arm
    before, gizmo = model.targets["tip"].copy(), lab.gizmos["tip"]
    # The middle of the arrow along x.
    start = seen.pixel(lab.server, model.system.rotation @ (before + np.array([0.6 * gizmo.scale, 0.0, 0.0])))
    seen.drag(start, (start[0] - 90.0, start[1]))
    seen.page.mouse.up()
    until(lambda: before[0] - model.targets["tip"][0] > 0.1, "the target moves along -x")
    assert model.targets["tip"][2] == 0.0 and abs(model.targets["tip"][1] - before[1]) < 1e-6
    time.sleep(3.0)
    seen.picture("lab_target")
    assert np.abs(model.system.arm.position(model.q, "link4") - model.targets["tip"]).max() < 1e-3
    seen.page.get_by_role("button", name="Reset").click()
    until(lambda: np.allclose(model.targets["tip"], before) and np.allclose(gizmo.position, before), "the handle goes back")


def test_divergence_is_shown_and_reset(lab: LabPage, drawn: Draw, visit: Go) -> None:
    seen, model = visit(drawn(lab.server, lab.frame)), lab.model
    seen.choose("system", "Elastic impedance, 2R")
    until(lambda: model.system.title.startswith("Elastic"), "the elastic arm")
    seen.turn("joint stiffness K_J (N m/rad)", 4.3)
    seen.turn("reduced inertia B0/B", -5.0)
    until(lambda: model.status is al.Status.DIVERGED, "it diverges")
    seen.page.get_by_text("DIVERGED", exact=True).wait_for()
    seen.picture("lab_diverged")
    seen.page.get_by_role("button", name="Controls to their defaults").click()
    seen.page.get_by_role("button", name="Reset").click()
    until(lambda: model.status is al.Status.SUCCESS and model.t > 0.5, "it runs again")
    assert float(seen.entry("reduced inertia B0/B").input_value()) == pytest.approx(np.log10(0.05), abs=1e-3)
    seen.page.get_by_role("button", name="Pause").click()
    seen.page.get_by_role("button", name="Go on").wait_for()
    stands = model.t
    time.sleep(0.5)
    assert model.paused and model.t == stands


def test_view_turns_joints(drawn: Draw, visit: Go) -> None:
    source = al.example_urdf("seven_axis")
    arm = al.load_urdf(source)
    page = ViewPage(open_server("view", "127.0.0.1", 0), arm, source, "seven_axis.urdf")
    seen = visit(drawn(page.server, lambda _: page.frame()))
    seen.turn("joint2", 0.8)
    seen.turn("joint4", -1.5)
    q = page.start.copy()
    q[1], q[3] = 0.8, -1.5
    x, y, z = arm.position(q, "tcp")
    seen.page.get_by_text(f"tcp at ({x:.3f}, {y:.3f}, {z:.3f}) m").wait_for()
    seen.page.get_by_text("show frames").click()
    until(lambda: all(handle.show_axes for handle in page.scene.frames.values()), "the axes are shown")
    time.sleep(1.0)
    seen.picture("view")


@pytest.mark.parametrize("command", ["lab", "view"])
def test_from_the_command_line(command: str, visit: Go, tmp_path: Path) -> None:
    """The address is printed, the page opens, and Ctrl-C ends the program with exit code 0."""
    file = tmp_path / "arm.urdf"
    file.write_text(al.example_urdf("six_axis"))
    arguments = ["--urdf", str(file), "--frame", "flange"] if command == "lab" else [str(file)]
    given = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "cwd": tmp_path}
    line = [sys.executable, "-P", "-m", "armlet", command, *arguments, "--port", "0"]
    with subprocess.Popen(line, **given, env=os.environ | {"PYTHONUNBUFFERED": "1"}) as process:
        try:
            first = process.stdout.readline()
            found = re.fullmatch(r"armlet: (http://127\.0\.0\.1:\d+) \(Ctrl-C ends it\)\n", first)
            assert found, first
            seen = visit(found[1])
            seen.page.get_by_text("arm" if command == "lab" else "6 joints").first.wait_for()
            time.sleep(4.0)  # wait until the scene is visible
            seen.picture(f"{command}_own")
            process.send_signal(signal.SIGINT)
            assert process.wait(20) == 0
            assert process.stdout.read() == "" and process.stderr.read() == ""
        finally:
            process.kill()


def test_pictures_are_there() -> None:
    """The pictures exist and are not empty."""
    pictures = {path.stem: path.stat().st_size for path in PICTURES.glob("*.png")}
    assert set(pictures) >= {*(f"lab_{k}" for k in range(5)), "lab_pull", "lab_target", "lab_diverged", "lab_own", "view", "view_own"}
    assert min(pictures.values()) > 20_000
