"""`armlet.export_web` and `armlet web`: the page, and one error for each part that has no WebAssembly."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from scripts import imported
from web_loops import WebRun

import armlet as al
from armlet import cli
from armlet.web.labels import labelled

ARM = models.TWO_LINKS
PLANT = al.RigidArm(ARM)
LAW = al.PDGravity(ARM, [0.4, 0.9], kp=80.0, kd=[16.0, 12.0])
Q0 = [0.0, 0.1]


class Texts(HTMLParser):
    """The content of the scripts of a page, and the addresses in its attributes."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.scripts: list[str] = []
        self.addresses: list[str] = []
        self.inside = False
        self.feed(page)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.inside = tag == "script"
        self.addresses += [value or "" for name, value in attributes if name in ("src", "href")]

    def handle_data(self, data: str) -> None:
        if self.inside:
            self.scripts.append(data)
            self.inside = False


def data_of(path: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(Texts(path.read_text(encoding="utf-8")).scripts[0])
    return content


def test_a_page_is_one_file_without_addresses(tmp_path: Path) -> None:
    title = "</script><b>& one"
    path = al.export_web((PLANT, LAW), tmp_path / "a.html", {"law.kp": (20.0, 200.0), "law.kd[1]": (1.0, 20.0)}, q0=Q0, title=title)
    page = path.read_text(encoding="utf-8")
    found = Texts(page)
    assert found.addresses == [] and len(found.scripts) == 4 and not re.search(r"https?://", page)
    data = data_of(path)
    assert data["title"] == title and "<b>" not in page
    assert [control["name"] for control in data["controls"]] == ["law.kp", "law.kd[1]"]
    for control, now in zip(data["controls"], (80.0, 12.0), strict=True):
        assert len(control["values"]) == 101 and control["values"][control["position"]] == now and control["slots"]
    assert data["targets"] == [{"kind": "joints", "first": 0}] and data["desired"] is True and len(page) < 100_000


def test_a_scenario_and_its_command(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("loop.toml").write_text(
        'title = "A step"\n[arm]\nkind = "planar_arm"\nlengths = [0.5, 0.4]\n[law]\nkind = "PDGravity"\ntarget = [0.5, 0.2]\nkp = 100.0\n'
        "kd = 5.0\n[run]\nq0 = [0.0, 0.0]\nt_end = 2.0\ndt = 2e-3\n"
    )
    assert cli.main(["web", "loop.toml", "--control", "law.kp", "50", "150"]) == 0
    assert capsys.readouterr().out == "wrote loop.html\n"
    data = data_of(Path("loop.html"))
    assert (data["title"], data["dt"]) == ("A step", 2e-3) and data["controls"][0]["name"] == "law.kp"
    written = al.export_web(al.Scenario.load("loop.toml"), "other.html", {"law.kp": (50.0, 150.0)})
    assert written.read_bytes() == Path("loop.html").read_bytes()
    for arguments, problem in (
        (["--control", "law.kp", "a", "2"], "web: --control law.kp has a limit that is no number"),
        (["--control", "law.kq", "1", "2"], "controls has an unknown name: expected names of"),
        (["--out", "no/folder.html"], "no"),
    ):
        assert cli.main(["web", "loop.toml", *arguments]) == 2
        assert problem in capsys.readouterr().err


def test_sliders_have_words_and_units(tmp_path: Path) -> None:
    """A name in Python has a label in the words of the field, unless the number has none."""
    friction = al.StickSlip(coulomb=1.0, static=2.0, stribeck_speed=0.1)
    pr, seven = models.PR, models.SEVEN_AXES
    slide = al.Sinusoid([0.0, 0.5], [[0.5], [0.8]], [[1.5], [2.0]], [[0.0], [0.0]])
    q = np.array([0.3, 0.5, -0.2, -0.9, 0.4, 1.6, 0.2])
    impedance = al.CartesianImpedance(
        seven, [0.4, 0.1, 0.7, 0.0], [300.0, 300.0, 300.0, 20.0], 40.0, frame="tcp", axes="xyz rx", nullspace=al.NullSpace(q, 20.0, 5.0)
    )
    tasks = [al.Task("tcp", "xyz", [0.4, 0.1, 0.7], 2.0)]
    expected: list[tuple[Any, Any, dict[str, tuple[str, str]]]] = [
        (
            al.RigidArm(ARM, friction=friction),
            LAW,
            {
                "law.kp": ("position gain", "N m/rad"),
                "law.kd[1]": ("velocity gain of joint2", "N m s/rad"),
                "q0[1]": ("initial position of joint2", "rad"),
                "arm.parameters[10]": ("mass of link 2", "kg"),
                "arm.parameters[1]": ("first moment m c_x of link 1", "kg m"),
                "law.arm.parameters[11]": ("first moment m c_x of link 2 in the law's model", "kg m"),
                "friction.static": ("", ""),
                "plant.friction.static": ("static friction", "N m"),
            },
        ),
        (
            al.RigidArm(pr),
            al.Adaptive(pr, slide, 40.0, 20.0, 5.0),
            {
                "law.kp": ("position gain", ""),  # one joint slides, and one turns
                "law.gamma": ("adaptation gain", ""),
                "arm.parameters[1]": ("first moment B", "kg m"),
                "v0[0]": ("initial velocity of p1", "m/s"),
            },
        ),
        (
            al.RigidArm(seven),
            impedance,
            {
                "law.stiffness[3]": ("stiffness along rx", "N m/rad"),
                "law.damping": ("damping", ""),
                "law.nullspace.stiffness": ("stiffness of the posture", "N m/rad"),
            },
        ),
        (al.RigidArm(ARM), al.ComputedTorque(ARM, al.Hold([0.1, 0.2]), 100.0, 20.0), {"law.kp": ("position gain", "1/s²")}),
        (al.VelocityArm(seven), al.PriorityVelocity(seven, tasks), {"law.tasks.0.gain": ("gain of task 1", "1/s")}),
    ]
    for plant, law, names in expected:
        for name, label in names.items():
            base, _, index = name.rstrip("]").partition("[")
            assert labelled(plant, law, base, (int(index),) if index else None) == label, name
    mass = float(ARM.parameters[0])
    path = al.export_web((PLANT, LAW), tmp_path / "a.html", {"law.kp": (20.0, 200.0), "arm.parameters[0]": (0.5 * mass, 2.0 * mass)}, q0=Q0)
    assert [(each["label"], each["unit"]) for each in data_of(path)["controls"]] == [("position gain", "N m/rad"), ("mass of link 1", "kg")]


@pytest.mark.parametrize(
    ("controls", "problem"),
    [
        ({"law.kq": (1.0, 2.0)}, r"controls has an unknown name: expected names of .*'law.kp'.*, got 'law.kq'"),
        ({"law.kp": (200.0, 20.0)}, r"controls\['law.kp'\] is not a range: expected finite numbers low < high"),
        ({"law.kp": (20.0, float("nan"))}, "expected finite numbers low < high"),
        ({"law.kp": (20.0, float("inf"))}, "expected finite numbers low < high"),
        ({"law.kp": 5.0}, r"is not a range: expected \(low, high\)"),
        ({"law.kp": (100.0, 200.0)}, "does not contain the value of the loop: expected low <= 80 <= high"),
        ({"law.kp": (-10.0, 100.0)}, r"controls\['law.kp'\] has a value that the loop refuses: -10: "),
        ({"law.kd": (1.0, 20.0)}, r"has entries that differ: expected the name of one entry such as law.kd\[0\]"),
        ({"law.kd[2]": (1.0, 20.0)}, r"has no such entry: expected an index into the shape \(2,\)"),
        ({"law.kp": (20.0, 200.0), "law.kp[0]": (20.0, 200.0)}, "has no such entry|another control also changes"),
        ([("law.kp", (1.0, 2.0))], "controls is not valid: expected a dict"),
    ],
)
def test_invalid_controls(controls: Any, problem: str, tmp_path: Path) -> None:
    with pytest.raises(al.InputError, match=f"^export_web: .*{problem}"):
        al.export_web((PLANT, LAW), tmp_path / "a.html", controls, q0=Q0)
    assert not (tmp_path / "a.html").exists()


SEVEN = models.SEVEN_AXES
TABLE = al.Table(0.1, np.zeros((3, 2)), np.zeros((3, 2)), np.zeros((3, 2)))


@pytest.mark.parametrize(
    ("plant", "law", "keywords", "problem"),
    [
        (PLANT, lambda t, q, v: np.zeros(2), {}, "law is of the wrong type: .* got a function in Python"),
        (
            al.VelocityArm(SEVEN),
            al.PriorityVelocity(SEVEN, [al.Task("tcp", "xyz", [0.3, 0.0, 0.6], 2.0)], v_max=1.0),
            {},
            "law has limits or bounds, which are solved in native code: expected a law without limits, got PriorityVelocity",
        ),
        (PLANT, LAW, {"method": "dopri5"}, "method is unknown: expected one of rk4, euler, semi_implicit, got 'dopri5'"),
        (PLANT, LAW, {"method": "ros2"}, "method is unknown"),
        (PLANT, LAW, {"dt": -1e-3}, "dt"),
        (PLANT, LAW, {"sample_time": al.Sampling(1e-2, noise={"q": 1e-3})}, "sample_time has noise, which native code computes"),
        (PLANT, LAW, {"sample_time": al.Sampling(1e-2, jitter=2e-3, delay=1e-3)}, "sample_time has jitter"),
        (PLANT, al.ComputedTorque(ARM, TABLE, 100.0, 20.0), {}, "law has a motion that is not exported: .* got Table"),
        (PLANT, al.PDGravity(SEVEN, np.zeros(7), 10.0, 1.0), {}, "law"),
        (PLANT, LAW, {"force": lambda t: np.zeros(3), "force_frame": "link2"}, "force changes in time: expected a constant force"),
        (PLANT, LAW, {"force": [1.0, 2.0], "force_frame": "link2"}, "force has the wrong shape"),
        (PLANT, LAW, {"q0": None}, "q0 is missing"),
        (PLANT, LAW, {"q0": [0.0, float("nan")]}, "q0"),
        (PLANT, LAW, {"q0": [0.0, 0.0, 0.0]}, r"q0 has the wrong shape: expected \(2,\), got \(3,\)"),
        (PLANT, LAW, {"tau_max": [1.0, -1.0]}, "tau_max"),
    ],
)
def test_parts_without_webassembly_are_refused_by_name(
    plant: Any, law: Any, keywords: dict[str, Any], problem: str, tmp_path: Path
) -> None:
    given = {"q0": np.zeros(plant.arm.n), "dt": 1e-3} | keywords
    with pytest.raises(al.InputError, match=f"^export_web: {problem}"):
        al.export_web((plant, law), tmp_path / "a.html", **given)
    assert not (tmp_path / "a.html").exists()


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="folder"):
        al.export_web((PLANT, LAW), tmp_path / "folder" / "a.html", q0=Q0)


def test_the_pages_of_loops_run_and_are_linked(tmp_path: Path) -> None:
    """The loops of the documentation are written, move, and are linked from their pages, in the exam from each exercise."""
    docs = Path(__file__).parents[2] / "docs"
    live = imported(docs / "live_loops.py")
    live.write(tmp_path)
    for name in live.LOOPS:
        web = WebRun(data_of(tmp_path / f"{name}.html"))
        start = web.group("state").copy()
        for _ in range(200):
            web.step()
        assert np.isfinite(web.group("state")).all() and np.abs(web.group("state") - start).max() > 1e-3, name
    for name in ("exam", "adaptive", "impedance", "elastic", "priority", "minimum_time", "friction"):
        page = (docs / f"{name}.md").read_text(encoding="utf-8")
        found = re.findall(r'href="loops/(\w+).html"', live.linked(name, page))
        assert found == (list(live.EXERCISES) if name == "exam" else [name])
