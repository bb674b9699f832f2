"""Names from files appear as plain text in figures, reports and lines of the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import models
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

import armlet as al
from armlet import cli
from armlet.arguments import one_line
from armlet.demo.report import Report
from armlet.figures import literal
from armlet.figures.time_path import PathTiming

# A script, incomplete mathematics (an error when drawn), complete mathematics, TeX that reads a file, a hidden label, and others.
NAMES = ["<script>alert(1)</script>", r"$\frac{", "$x_1$", r"\input{/etc/passwd}", "_hidden", r"\$5$", "a\u202eb", "two\nlines"]
SCENARIO = """title = {title}
arm = {{ kind = "planar_pr", A = 2.0, B = 0.5, C = 0.5 }}
motion = {{ kind = "Hold", q = [1.0, 0.0] }}
law = {{ kind = "ComputedTorque", kp = 100.0, kd = 20.0 }}
run = {{ q0 = [0.0, 0.0], t_end = 0.01, dt = 1e-3 }}
"""


def drawn(figure: Figure) -> set[str]:
    """The visible texts of a drawn figure. None of them may be rendered as mathematics or TeX."""
    FigureCanvasAgg(figure).draw()  # draws once; savefig would draw twice
    return {text.get_text().replace(r"\$", "$").strip() for text in figure.findobj(Text)}


@pytest.mark.parametrize("name", NAMES)
def test_joint_names_in_figures(name: str) -> None:
    arm = al.Arm.from_chain([{"type": "R", "name": name, "axis": [0, 0, 1], "phi": [1, 0.5, 0, 0, 0, 0, 0, 0, 0, 0.3]}])
    path = al.time_path(arm, [[0.0], [0.4]], tau_max=[30.0], v_max=2.0)
    figure = Figure()
    PathTiming(arm, path, tau_max=[30.0]).plot(figure)
    assert one_line(name) in drawn(figure)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_units_and_laws_of_a_stored_run_in_figures(name: str, tmp_path: Path) -> None:
    arm = models.PR
    run = al.simulate(al.RigidArm(arm), al.PDGravity(arm, [0.0, 0.0], 5.0, 2.0), [0.1, 0.2], t_end=0.01, dt=1e-3)
    fields: dict[str, Any] = dict(run._items()) | {"units": (name, "rad"), "law_name": name}
    other = al.Run(fields)
    for draw in (lambda f: al.compare([other], fig=f), other.plot):
        figure = Figure()
        draw(figure)
        assert any(one_line(name) in text for text in drawn(figure))


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_titles_of_scenarios(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import json

    file = tmp_path / "s.toml"
    file.write_text(SCENARIO.format(title=json.dumps(name)), encoding="utf-8")
    assert cli.main(["run", str(file), "--plot", "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().out.splitlines()[0] == one_line(name)
    assert (tmp_path / "s.png").read_bytes()[:4] == b"\x89PNG"


def test_orders_to_a_terminal_are_not_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "s.toml"
    file.write_text(SCENARIO.format(title='"\\u001b]0;owned\\u0007 x"'))
    assert cli.main(["run", str(file)]) == 0
    file.write_text(SCENARIO.format(title='"x"') + '"\\u001b[2Jkey" = 1\n')
    assert cli.main(["run", str(file)]) == 2 and cli.main(["check", str(file)]) == 2
    assert cli.main(["run", str(tmp_path / "\x1b[2J.toml")]) == 2
    output = capsys.readouterr()
    assert "\x1b" not in output.out + output.err and "\x07" not in output.out


def test_a_report_escapes_what_it_is_given(tmp_path: Path) -> None:
    report = Report(tmp_path, figures=False)
    report.section(NAMES[0])
    report.equal(NAMES[0], NAMES[0], NAMES[0], NAMES[0], NAMES[0])
    page = report.write_page(NAMES[0]).read_text()
    assert "<script" not in page and page.count("&lt;script&gt;") == 7


def test_literal_is_one_line_of_text() -> None:
    assert [literal(name) for name in ("a $x$", "_a", "a\tb\n", r"\$")] == [r"a \$x\$", " _a", "a b", r"\\$"]
    assert np.all([literal(name).isprintable() for name in NAMES])
