"""`armlet fit` and `LogFit.report`: exit codes, one line per error, no partial files."""

from __future__ import annotations

from pathlib import Path

import models
import numpy as np
import pytest

import armlet as al
from armlet import cli

ARM = models.TWO_LINKS
T = np.arange(0.0, 20.0, 0.01)
GRAVITY = ["--gravity", "0", "-9.81", "0"]


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """A log with Coulomb friction, and the robot."""
    q, v, a = al.Sinusoid([0.0, 0.0], [1.0, 1.2], [1.3, 2.1], [0.0, 1.0])(T)
    noise = 0.1 * np.random.default_rng(1).normal(size=q.shape)
    tau = ARM.inverse_dynamics(q, v, a) + [0.5, 0.0] * np.sign(v) + noise
    al.Log(T, q, tau=tau, names=ARM.joint_names).to_csv(tmp_path / "log.csv")
    (tmp_path / "robot.urdf").write_text(ARM.to_urdf()[0])
    return tmp_path / "log.csv", tmp_path / "robot.urdf"


def test_fit(files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, robot = files
    report = tmp_path / "fit.html"
    assert cli.main(["fit", str(log), "--urdf", str(robot), *GRAVITY, "--names", "inertia", "--report", str(report)]) == 1
    out = capsys.readouterr().out
    assert "refuted: joint 'joint1': the residual follows the sign of the velocity" in out and f"wrote {report}" in out
    page = report.read_text(encoding="utf-8")
    for text in (
        "Fit of log.csv",
        "Coulomb friction is missing",
        "add &quot;coulomb&quot; to names",
        "data:image/png",
        "armlet",
        "Versions",
    ):
        assert text in page
    assert "http://" not in page and "https://" not in page
    assert cli.main(["fit", str(log), "--urdf", str(robot), *GRAVITY, "--names", "inertia,coulomb"]) == 0
    assert "refuted" not in capsys.readouterr().out


LOOP = """
[arm]
kind = "planar_arm"
lengths = [0.5, 0.4]

[motion]
kind = "Sinusoid"
offset = [0.0, 0.0]
amplitude = [1.0, 1.2]
frequency = [1.3, 2.1]
phase = [0.0, 1.0]

[law]
kind = "ComputedTorque"
kp = 60.0
kd = 12.0

[run]
q0 = [0.0, 1.0]
t_end = 10.0
dt = 1e-3
record_every = 5
sample_time = 5e-3
"""


def test_fit_of_a_scenario(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A log of a loop without torques: its law computes them, and the plant has friction that the scenario lacks."""
    (tmp_path / "loop.toml").write_text(LOOP)
    built = al.Scenario.load(tmp_path / "loop.toml").build()
    plant = al.RigidArm(ARM.with_drives(damping=[0.8, 0.5]), friction=True)
    run = al.simulate(plant, built.law, **built.arguments)
    noise = 1e-5 * np.random.default_rng(0).normal(size=run.q.shape)
    al.Log(run.t, run.q + noise, v=run.v, names=ARM.joint_names).to_csv(tmp_path / "log.csv")
    command = ["fit", str(tmp_path / "log.csv"), "--scenario", str(tmp_path / "loop.toml"), "--names", "viscous"]
    assert cli.main(command) in (0, 1)
    lines = capsys.readouterr().out.splitlines()
    (line,) = [line for line in lines if line.endswith("damping[joint1]")]
    assert float(line.split()[0]) == pytest.approx(0.8, abs=0.02)
    assert cli.main([*command, *GRAVITY]) == 2
    assert "--gravity belongs to --urdf" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "part"),
    [
        (["--names", "mass"], "fit_log: names is unknown: expected one of inertia"),
        (["--cutoff", "60"], "fit_log: cutoff is too high"),
        (["--delay", "nan"], "fit_log: delay is not finite"),
        (["--report", "/nowhere/fit.html"], "/nowhere"),
    ],
)
def test_errors_are_one_line(files: tuple[Path, Path], options: list[str], part: str, capsys: pytest.CaptureFixture[str]) -> None:
    log, robot = files
    assert cli.main(["fit", str(log), "--urdf", str(robot), "--names", "inertia", *options]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("armlet: ") and part in line
    assert cli.main(["fit", str(log.with_name("none.csv")), "--urdf", str(robot)]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_bad_arguments_of_the_report(tmp_path: Path) -> None:
    q, v, a = al.Sinusoid([0.0, 0.0], [1.0, 1.2], [1.3, 2.1], [0.0, 1.0])(T)
    fit = al.fit_log(ARM, al.Log(T, q, tau=ARM.inverse_dynamics(q, v, a), names=ARM.joint_names), ["inertia"])
    fit.report(tmp_path / "fit.html", title="a <title>")
    assert "<h1>a &lt;title&gt;</h1>" in (tmp_path / "fit.html").read_text(encoding="utf-8")
    with pytest.raises(al.InputError, match=r"^LogFit.report: title is of the wrong type"):
        fit.report(tmp_path / "other.html", title=1)  # type: ignore[arg-type]
    with pytest.raises(al.InputError, match=r"^LogFit.report: path"):
        fit.report(1)  # type: ignore[arg-type]
    assert not (tmp_path / "other.html").exists()
