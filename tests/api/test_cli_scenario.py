"""`armlet run`, `check`, `new`, `sweep`, `schema`: exit codes, one line per error, no partial files."""

from __future__ import annotations

import errno
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import armlet as al
from armlet import cli, files
from armlet.scenario import TEMPLATES, template

TEXT = """
title = "A step"
[arm]
kind = "planar_arm"
lengths = [0.5, 0.4]
[law]
kind = "PDGravity"
target = [0.5, 0.2]
kp = 100.0
kd = 5.0
[run]
q0 = [0.0, 0.0]
t_end = 2.0
dt = 1e-3
record_every = 10
[sweep.vary]
"law.kp" = [50.0, 100.0]
"law.kd" = { linspace = [2.0, 10.0, 3] }
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "step.toml"
    path.write_text(TEXT)
    return path


def one_line(capsys: pytest.CaptureFixture[str]) -> str:
    """Return the single line on stderr. stdout must be empty."""
    out, err = capsys.readouterr()
    (line,) = err.splitlines()
    assert line.startswith("armlet: ") and "wrote" not in out
    return line


def test_run_prints_metrics_and_writes_nothing(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["run", str(file)]) == 0
    out = capsys.readouterr().out
    for word in ("A step", "success", "error_rms", "settling_time", "tau_peak", "N m"):
        assert word in out
    assert [path.name for path in file.parent.iterdir()] == ["step.toml"]


def test_run_writes_results(file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "new" / "folder"
    assert cli.main(["run", str(file), "--out", str(out), "--plot"]) == 0
    assert capsys.readouterr().out.count("wrote ") == 3
    assert sorted(path.name for path in out.iterdir()) == ["step.csv", "step.npz", "step.png"]
    run = al.load(out / "step.npz")
    assert isinstance(run, al.Run) and run.metrics()["error_final"].shape == (2,)
    head, *lines = (out / "step.csv").read_text().splitlines()
    assert head.startswith("t,q1,q2,v1,v2,tau1,tau2") and len(lines) == len(run.t)
    assert float(lines[7].split(",")[1]) == run.q[7, 0]
    assert (out / "step.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("command", ["run", "check", "sweep"])
def test_bad_scenarios(command: str, file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    rest = [] if command == "check" else ["--out", str(out)]
    for text, part in (
        (TEXT.replace("kd = 5.0", "kd = [20.0, -1.0]"), "$.law.kd[1]: expected > 0, got -1.0"),
        (TEXT.replace('"PDGravity"', '"PDgravity"'), "did you mean PDGravity?"),
        ("[arm", "is not TOML"),
        (None, "step.toml: no such file or directory"),
    ):
        if text is None:
            file.unlink()
        else:
            file.write_text(text)
        assert cli.main([command, str(file), *rest]) == 2
        err = capsys.readouterr().err
        assert part in err and len(err.splitlines()) == 1, err
        assert not out.exists()


def test_export_writes_the_law_and_functions_of_the_arm(file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "c"
    assert cli.main(["export", str(file), "--out", str(out)]) == 0
    assert capsys.readouterr().out == "".join(f"wrote {out / name}\n" for name in ("law.h", "law.c", "CMakeLists.txt"))
    assert "int law_step(" in (out / "law.h").read_text()
    arm = ["--functions", "mass_matrix,jacobian:link2", "--prefix", "robot"]
    assert cli.main(["export", str(file), "--out", str(out / "arm"), *arm]) == 0
    header = (out / "arm" / "robot.h").read_text()
    assert "int robot_mass_matrix(" in header and "int robot_jacobian_link2(" in header
    capsys.readouterr()
    (out / "law.c").write_text("mine")
    for arguments, message in (
        (["--out", str(out)], "armlet: export_c: folder holds a file that armlet did not make"),
        (["--out", str(tmp_path / "d"), "--functions", "mass"], "armlet: export_c: functions has one that is unknown"),
        (["--out", str(tmp_path / "d"), "--prefix", "7"], "armlet: export_c: prefix is no name in C"),
    ):
        assert cli.main(["export", str(file), *arguments]) == 2
        assert one_line(capsys).startswith(message)
    assert not (tmp_path / "d").exists()
    assert cli.main(["export", str(file), "--out", str(out), "--overwrite"]) == 0
    assert "int law_step(" in (out / "law.c").read_text()


def test_exported_states_advance_by_the_steps_of_the_scenario(tmp_path: Path) -> None:
    path = tmp_path / "adaptive.toml"
    path.write_text(template("adaptive"))
    assert cli.main(["export", str(path), "--out", str(tmp_path / "c")]) == 0
    assert "#define LAW_DT 0x1.0624dd2f1a9fcp-10 /* step of the law's own state: 0.001 s */" in (tmp_path / "c" / "law.h").read_text()


def test_check_lists_all_problems(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["check", str(file)]) == 0
    assert "is a scenario: PDGravity on RigidArm, 2 joints, 2 s by rk4" in capsys.readouterr().out
    file.write_text(TEXT.replace("kd = 5.0", "kd = -1.0").replace("dt = 1e-3", "dt = 0"))
    assert cli.main(["check", str(file)]) == 2
    err = capsys.readouterr().err.splitlines()
    assert [line.partition(": $.")[2] for line in err] == ["law.kd: expected > 0, got -1.0", "run.dt: expected > 0, got 0"]
    file.write_text(TEXT.replace("[0.5, 0.2]", "[0.5]"))  # only the constructor can detect this error
    assert cli.main(["check", str(file)]) == 2
    assert "$.law.target: has the wrong shape" in capsys.readouterr().err


BODY = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
ROBOT = f"""<robot name="crane">
  <link name="base">{BODY}</link>
  <link name="boom">{BODY}</link>
  <link name="hook">{BODY}</link>
  <joint name="slew" type="continuous"><parent link="base"/><child link="boom"/><axis xyz="0 0 1"/></joint>
  <joint name="lift" type="prismatic">
    <parent link="boom"/><child link="hook"/><limit effort="1" velocity="1"/><dynamics damping="0.1"/>
  </joint>
</robot>
"""


def test_check_shows_a_robot(file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`armlet check` lists the joints in their order with units, and the parts of the robot file that the loop ignores."""
    (tmp_path / "crane.urdf").write_text(ROBOT)
    file.write_text(TEXT[: TEXT.index("[arm")] + '[arm]\nkind = "urdf"\npath = "crane.urdf"\n' + TEXT[TEXT.index("[law") :])
    dropped = "  dropped: inertia of links fixed to the base, which never move: base"
    friction = "  left out: the friction of the robot's file (friction = true in [plant] adds it)"
    for plant, expected in (("", [dropped, friction]), ('[plant]\nkind = "RigidArm"\nfriction = true\n', [dropped])):
        file.write_text(file.read_text() + plant)
        assert cli.main(["check", str(file)]) == 0
        assert capsys.readouterr().out.splitlines()[1:] == ["  joints: slew (rad), lift (m)", *expected]
    assert cli.main(["check", str(tmp_path / "crane.urdf")]) == 0
    out = capsys.readouterr().out
    assert "slew   continuous" in out and "frames: base, boom, hook" in out and dropped.strip() in out
    (tmp_path / "crane.urdf").write_text(ROBOT.replace("boom", "hook", 1))
    assert cli.main(["check", str(tmp_path / "crane.urdf")]) == 2
    assert "hook" in one_line(capsys)


def test_check_tries_the_sweep(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for lines, code, part in (
        ('"law.kp" = [10.0, 20.0]', 0, "; a sweep of 2 runs"),
        ('"law.kpp" = [10.0, 20.0]', 2, "cell 0 (law.kpp = 10.0)"),
        ('"law.kp" = [10.0, -20.0]', 2, "cell 1 (law.kp = -20.0)"),
        ('"law.kp" = { uniform = [10.0, 20.0] }', 2, "uniform is random: expected draws"),
    ):
        file.write_text(TEXT[: TEXT.index("[sweep")] + f"[sweep.vary]\n{lines}\n")
        assert cli.main(["check", str(file)]) == code
        streams = capsys.readouterr()
        assert part in (streams.err if code else streams.out) and len(streams.err.splitlines()) == (code == 2)


def test_a_run_that_fails(file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A failed run prints its reason in one line, returns an exit code, and writes no files."""
    file.write_text(TEXT.replace("kd = 5.0", "kd = 1e9"))
    assert cli.main(["run", str(file), "--out", str(tmp_path / "out")]) == 2
    assert "diverged" in one_line(capsys)
    assert not list((tmp_path / "out").iterdir())


@pytest.mark.parametrize("command", ["run", "sweep"])
def test_an_output_folder_that_cannot_be_written(command: str, file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    assert cli.main([command, str(file), "--out", str(tmp_path / "file" / "out")]) == 2
    assert "file" in one_line(capsys)


def test_no_permission(file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # root may write anywhere, and tests may run as root
    for arguments in (["run", str(file), "--plot"], ["run", str(file)], ["demo"]):
        assert cli.main([*arguments, "--out", str(tmp_path / "out")]) == 2
        assert "is not writable" in one_line(capsys)


@pytest.mark.parametrize("command", ["run", "sweep"])
def test_a_full_disk(command: str, file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """The second file cannot be synced to disk. The first file is complete, and no other file exists."""
    calls = []

    def fsync(handle: int) -> None:
        calls.append(handle)
        if len(calls) == 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(files.os, "fsync", fsync)
    out = tmp_path / "out"
    assert cli.main([command, str(file), "--out", str(out)]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert line == f"armlet: {out / ('step.csv' if command == 'run' else 'chunk-000000.npz')}: no space left on device"
    assert [path.name for path in out.iterdir()] == (["step.npz"] if command == "run" else ["sweep.json"])
    if command == "sweep":
        assert cli.main([command, str(file), "--out", str(out)]) == 0


@pytest.mark.parametrize("command", [["new", "adaptive"], ["schema"], ["info"]])
def test_output_to_a_full_disk(command: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    class Full(io.StringIO):
        def flush(self) -> None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(sys, "stdout", Full())
    assert cli.main(command) == 2
    assert one_line(capsys) == "armlet: output: no space left on device"


@pytest.mark.parametrize("command", ["run", "sweep"])
def test_without_matplotlib(
    command: str, file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert cli.main([command, str(file), "--out", str(tmp_path / "out"), "--plot"]) == 2
    assert ".[plot]" in one_line(capsys) and not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", TEMPLATES)
def test_new(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["new", name]) == 0
    text = capsys.readouterr().out
    assert text == template(name)
    (tmp_path / "x.toml").write_text(text)
    assert cli.main(["check", str(tmp_path / "x.toml")]) == 0
    with pytest.raises(SystemExit):
        cli.main(["new", "nothing"])


def test_sweep(file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["sweep", str(file), "--out", str(tmp_path / "a"), "--plot"]) == 0
    assert (tmp_path / "a" / "table.png").read_bytes()[:4] == b"\x89PNG"
    out = capsys.readouterr().out
    assert "6 runs: 6 success" in out and "table.csv" in out
    first = (tmp_path / "a" / "table.csv").read_text()
    assert first.splitlines()[0].startswith("cell,law.kp,law.kd,status,error_rms1") and len(first.splitlines()) == 7
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-P", "-m", "armlet", "sweep", str(file), "--out", str(tmp_path / "b"), "--workers", "2"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "b" / "table.csv").read_text() == first
    file.write_text(TEXT.partition("[sweep")[0])
    assert cli.main(["sweep", str(file), "--out", str(tmp_path / "c")]) == 2
    assert "$.sweep: is missing" in one_line(capsys)
    with pytest.raises(SystemExit):
        cli.main(["sweep", str(file), "--out", "x", "--workers", "0"])
    for many in ("1025", "9" * 5000, "\u0663", "-1"):
        with pytest.raises(SystemExit):
            cli.main(["sweep", str(file), "--out", "x", f"--workers={many}"])
        assert "expected an integer from 1 to 1024" in capsys.readouterr().err


def test_schema(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["schema"]) == 0
    assert json.loads(capsys.readouterr().out)["properties"]["law"]["properties"]["kind"]["enum"][0] == "Adaptive"


@pytest.mark.parametrize("command", ["run", "sweep", "export"])
@pytest.mark.parametrize("name", ["arm.urdf", "arm.xml"])
def test_a_robot_file_in_place_of_a_scenario(command: str, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The message names the kind of the file, and the commands for it. The advised command succeeds."""
    robot = tmp_path / name
    robot.write_text(al.example_urdf("planar_2r"))
    assert cli.main([command, str(robot), *(["--out", str(tmp_path / "out")] if command != "run" else [])]) == 2
    line = one_line(capsys)
    assert "is a robot file, not a scenario" in line and "TOML file such as `armlet new adaptive` prints" in line
    assert f"`armlet check {robot}` lists the joints" in line and f"`armlet view {robot}`" in line
    assert cli.main(["check", str(robot)]) == 0
    assert "joint1" in capsys.readouterr().out and not (tmp_path / "out").exists()


def test_a_model_of_mujoco_in_place_of_a_scenario(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "arm.xml").write_text("<mujoco/>")
    assert cli.main(["run", str(tmp_path / "arm.xml")]) == 2
    assert "is a model of MuJoCo, not a scenario" in one_line(capsys)


def test_an_interrupted_sweep_says_how_to_continue(
    file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("armlet.cli.scenarios.sweep", interrupt)
    assert cli.main(["sweep", str(file), "--out", str(tmp_path / "out")]) == 130
    assert one_line(capsys) == f"armlet: interrupted: finished chunks are in {tmp_path / 'out'}; the same command continues the sweep"
