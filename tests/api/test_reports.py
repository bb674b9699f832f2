"""Reports of runs and batches: one file without network, its numbers, its descriptions, hostile texts, and refused arguments."""

from __future__ import annotations

import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from boxes import faults
from matplotlib.figure import Figure

import armlet as al
from armlet import cli
from armlet.figures.batch import plot
from armlet.run.metrics import violations

VOID = {"meta", "img"}
SIDES = al.load_urdf(al.example_urdf("planar_2r"))


class Page(HTMLParser):
    """A parsed page: its elements with their attributes, the rows of its tables by their header, and its text."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.rows: dict[str, list[str]] = {}
        self.cells: list[str] = []
        self.text = ""
        self.source = path.read_text(encoding="utf-8")
        self.feed(self.source)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)
        if tag == "tr":
            self.cells = []
        if tag in ("th", "td"):
            self.cells.append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag
        if tag == "tr":
            self.rows[self.cells[0]] = self.cells[1:]

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] in ("th", "td"):
            self.cells[-1] += data
        if "style" not in self.open:
            self.text += data

    def tags(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]


def run_of(dt: float = 1e-3, **options: Any) -> al.Run:
    law = al.ComputedTorque(SIDES, al.Quintic([0.0, 0.3], [0.8, 0.9], 0.7), kp=[100.0, 80.0], kd=[20.0, 18.0])
    return al.simulate(al.RigidArm(SIDES), law, [0.1, 0.3], t_end=1.0, dt=dt, **options)


def page_of(run: Any, tmp_path: Path, **options: Any) -> Page:
    path = tmp_path / "report.html"
    run.report(path, **options)
    return Page(path)


def test_a_page_needs_no_network_and_can_be_heard(tmp_path: Path) -> None:
    page = page_of(run_of(), tmp_path)
    assert page.source.startswith("<!doctype html>") and page.tags("html")[0]["lang"] == "en"
    assert not page.tags("script") + page.tags("link") + page.tags("a") and "http" not in page.source.partition("base64")[0]
    assert [attributes for _, attributes in page.elements if "href" in attributes] == []
    (figure,) = page.tags("img")
    assert (figure["src"] or "").startswith("data:image/png;base64,iVBOR")
    assert (figure["alt"] or "").startswith("Run over time: Joint positions, Tracking error")
    assert len(page.tags("caption")) == len(page.tags("table")) >= 6
    assert all(each.get("scope") in ("row", "col") for each in page.tags("th"))
    assert "@media print" in page.source and "prefers-color-scheme: dark" in page.source and page.tags("meta")[1]["name"] == "viewport"
    assert len(page.source) < 400_000


def test_the_numbers_of_a_run(tmp_path: Path) -> None:
    run = run_of()
    page, found = page_of(run, tmp_path, inputs={"run": {"seed": 3}}), run.metrics()
    for i, name in enumerate(SIDES.joint_names):
        assert page.rows[name][1] == f"{found['error_peak'][i]:.6g} rad" and page.rows[name][5] == f"{found['tau_peak'][i]:.6g} N m"
    assert page.rows["settling_time"] == [f"{float(found['settling_time']):.6g} s"]
    assert page.rows["law.kp"] == ["100, 80"] and page.rows["law.motion.duration"] == ["0.7"] and page.rows["q0"] == ["0.1, 0.3"]
    assert page.rows["steps"] == ["1000"] and page.rows["armlet"] == [al.__version__] and page.rows["numpy"] == [np.__version__]
    assert "seed = 3" in page.text and "success: the run reached its end" in page.text
    assert page.rows["energy_balance"][1:] == ["0", "ok"] and page.rows["energy"][1:] == ["-", "-"]


def test_a_violated_monitor_fails(tmp_path: Path) -> None:
    """With long steps the energy balance exceeds its tolerance. The counts of the monitors sum up to the metric."""
    run = run_of(dt=0.05)
    page, counts = page_of(run, tmp_path), violations(run.monitors, 1e-6)
    assert page.rows["energy_balance"][1:] == [f"{int(counts['energy_balance'])}", "FAILED"] and counts["energy_balance"] > 0
    assert float(run.metrics()["monitor_violations"]) == sum(counts.values())
    assert "The run has no monitors" in page_of(run_of(monitors=False), tmp_path).text


def test_a_run_that_failed_and_a_run_from_a_file(tmp_path: Path) -> None:
    law = al.PDGravity(models.TWO_LINKS, [0.5, 0.2], kp=100.0, kd=0.01)
    run = al.simulate(al.RigidArm(models.TWO_LINKS), law, [0.0, 0.0], t_end=9.0, dt=0.4, throw=False)
    assert run.status == al.Status.DIVERGED
    page = page_of(run, tmp_path, title="A bad run")
    assert "A bad run" in page.text and "diverged: the state stopped being finite" in page.text
    run_of().save(tmp_path / "run.npz")
    loaded = page_of(al.load(tmp_path / "run.npz"), tmp_path)
    assert "A run from a file has no plant and law" in loaded.text and "settling_time" in loaded.rows


@pytest.mark.parametrize("keep", ["all", "metrics", "final"])
def test_a_batch(keep: Any, tmp_path: Path) -> None:
    """One of the five runs diverges. The table names it, and the run with the largest value of each metric."""
    laws = [al.PDGravity(models.TWO_LINKS, [0.5, 0.2], kp=20.0, kd=kd) for kd in (3.0, 4.0, 1e5, 5.0, 3.5)]
    batch = al.simulate_batch(al.RigidArm(models.TWO_LINKS), laws, np.zeros((5, 2)), t_end=1.0, dt=1e-3, keep=keep)
    page = page_of(batch, tmp_path)
    assert page.rows["success"][0] == "4" and page.rows["diverged"][0] == "1" and page.rows["run 2"] == ["diverged"]
    assert len(page.tags("img")) == (keep == "all")
    if keep == "final":
        assert "error_rms1" not in page.rows
        return
    values = batch.metrics()["error_rms"][:, 0]
    assert page.rows["error_rms1"] == [f"{f(values):.6g}" for f in (np.nanmin, np.nanmedian, np.nanmax)] + [str(np.nanargmax(values))]
    if keep == "all":
        assert "Error of joint1, Error of joint2" in (page.tags("img")[0]["alt"] or "")


def test_the_figure_of_a_batch() -> None:
    """The line is the median, and the band has the smallest and the largest error. The axes have units."""
    law = al.PDGravity(models.TWO_LINKS, [0.5, 0.2], kp=20.0, kd=4.0)
    q0 = np.random.default_rng(3).uniform(-0.2, 0.2, (7, 2))
    batch = al.simulate_batch(al.RigidArm(models.TWO_LINKS), law, q0, t_end=0.5, dt=1e-3)
    figure = Figure()
    axes = plot(batch, figure)
    assert faults(figure) == []
    error = np.array([0.5, 0.2]) - batch.q
    for i, ax in enumerate(axes.flat):
        np.testing.assert_array_equal(ax.get_lines()[0].get_ydata(), np.median(error[..., i], axis=0))
        band = ax.collections[0].get_paths()[0].vertices
        assert (band[:, 1].min(), band[:, 1].max()) == (error[..., i].min(), error[..., i].max())


def test_texts_of_others_are_texts(tmp_path: Path) -> None:
    """A title, a key and a joint's name with HTML inside are shown, and are not elements of the page."""
    bad = '<script>alert("x")</script>'
    xml = al.example_urdf("planar_2r").replace('"joint1"', '"&lt;script&gt;"')
    arm = al.load_urdf(xml[xml.index("<robot") :])
    assert "<script>" in arm.joint_names
    run = al.simulate(al.RigidArm(arm), al.PDGravity(arm, [0.5, 0.2], kp=10.0, kd=5.0), [0.0, 0.0], t_end=0.1, dt=1e-2)
    page = page_of(run, tmp_path, title=bad, inputs={bad: {"name": "</pre>" + bad}})
    assert not page.tags("script") and page.text.count(bad) == 2 and any("<script>" in name for name in page.rows)


def test_without_matplotlib_the_report_says_so(tmp_path: Path) -> None:
    run_of().save(tmp_path / "run.npz")
    code = "import sys; sys.modules['matplotlib'] = None\nimport armlet as al\nal.load('run.npz').report('run.html')"
    subprocess.run([sys.executable, "-P", "-c", code], cwd=tmp_path, check=True)
    page = Page(tmp_path / "run.html")
    assert not page.tags("img") and "no figure: matplotlib is not installed: pip install '.[plot]'" in page.text


def test_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    law = {"kind": "PDGravity", "target": [0.5, 0.2], "kp": 100.0, "kd": 5.0}
    arm, run = {"kind": "planar_arm", "lengths": [0.5, 0.4]}, {"q0": [0.0, 0.0], "t_end": 0.5, "dt": 1e-3}
    worst = {"vary": {"law.kd": {"uniform": [4.0, 6.0]}}, "criterion": "error_rms", "runs": 8}
    file = tmp_path / "step.toml"
    al.Scenario({"title": "A step", "arm": arm, "law": law, "run": run, "worst": worst}).save(file)
    assert cli.main(["run", str(file), "--out", str(tmp_path), "--report"]) == 0
    assert cli.main(["worst", str(file), "--out", str(tmp_path), "--report"]) == 0
    assert capsys.readouterr().out.count(".html") == 2
    assert "A step" in Page(tmp_path / "step.html").text and "kd = " in Page(tmp_path / "step.worst.html").text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"title": 3}, "report: title is of the wrong type"),
        ({"inputs": 3}, "report: inputs is of the wrong type"),
        ({"path": 3}, "report: path is of the wrong type"),
    ],
)
def test_refusals(arguments: dict[str, Any], message: str, tmp_path: Path) -> None:
    batch = al.simulate_batch(
        al.RigidArm(models.PR), al.PDGravity(models.PR, [0.1, 0.2], kp=9.0, kd=5.0), np.zeros((2, 2)), t_end=0.1, dt=1e-2
    )
    for run in (run_of(), batch):
        with pytest.raises(al.InputError, match=message):
            run.report(**{"path": tmp_path / "x.html", **arguments})
        with pytest.raises(OSError):
            run.report(tmp_path / "none" / "x.html")
    assert list(tmp_path.iterdir()) == []
