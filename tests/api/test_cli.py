"""The command line: exit codes, one line per error, no partial files; and the verdicts of the demonstration."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from armlet import cli, demo
from armlet.demo import Check, Report


@pytest.mark.parametrize(
    ("check", "passed"),
    [
        (Check("equal", 1.0, 1.0), True),
        (Check("at the tolerance", 0.0, 0.5, 0.5), True),
        (Check("beyond", 0.0, np.nextafter(0.5, 1.0), 0.5), False),
        (Check("NaN got", 0.0, float("nan"), 1e9), False),
        (Check("NaN expected", float("nan"), 0.0, 1e9), False),
        (Check("infinite", None, float("inf"), 1e9), False),
        (Check("bound", None, -2e-13, 1e-13), False),
        (Check("bound held", None, -1e-14, 1e-13), True),
        (Check("array", (1.0, -2.0), np.array([1.0, -2.0])), True),
        (Check("one entry off", (1.0, -2.0), np.array([1.0, 2.0]), 1.0), False),
        (Check("shorter", (1.0, -2.0), np.array([1.0]), 1.0), False),
        (Check("empty", None, np.array([]), 1.0), False),
        (Check("text", "regular", "regular"), True),
        (Check("other text", "regular", "kinematic"), False),
        (Check("text for a number", 1.0, "ValueError: no"), False),
        (Check("truth", True, False), False),
    ],
    ids=lambda value: value.what if isinstance(value, Check) else "",
)
def test_verdicts(check: Check, passed: bool) -> None:
    assert check.passed is passed
    assert check.verdict == ("ok" if passed else "FAILED")
    assert len(check.columns()) == 4


def test_an_erratum_shows_what_was_printed() -> None:
    assert "E10" in Check("u_E", 1.0, 1.0, 0.0, "J'F + g", "E10").columns()[0]


@pytest.fixture
def system(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[Report], None]], None]:
    """Return a function that replaces the demonstration's systems by one test system."""

    def put(run: Callable[[Report], None]) -> None:
        module = ModuleType("armlet.demo.made_up")
        vars(module).update(TITLE="A made-up system", run=run)
        monkeypatch.setitem(sys.modules, "armlet.demo.made_up", module)
        monkeypatch.setattr(demo, "SYSTEMS", ("made_up",))

    return put


System = Callable[[Callable[[Report], None]], None]


def test_demo_passes(system: System, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    system(lambda report: report.near("one", 1.0, 1.0, 0.0))
    assert cli.main(["demo", "--out", str(tmp_path / "new" / "folder")]) == 0
    printed = capsys.readouterr().out
    assert "what" in printed and "expected" in printed and "verdict" in printed
    assert "1 of 1 checks hold" in printed


def test_demo_fails_with_one_false_check(system: System, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def run(report: Report) -> None:
        report.near("one", 1.0, 1.0, 0.0)
        report.bound("nothing", float("nan"), 1.0)

    system(run)
    assert cli.main(["demo", "--out", str(tmp_path)]) == 1
    assert "1 FAILED" in capsys.readouterr().out


def test_demo_fails_when_a_system_stops(system: System, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def run(report: Report) -> None:
        report.near("one", 1.0, 1.0, 0.0)
        raise ZeroDivisionError("in the middle")

    system(run)
    assert cli.main(["demo", "--out", str(tmp_path)]) == 1
    assert "ZeroDivisionError: in the middle" in capsys.readouterr().out


def test_the_table_fits_its_terminal(
    system: System, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a file the table has three columns. In a terminal that is too narrow for them, the values are below their claim."""
    system(lambda report: report.near("a claim of some length, about nothing in particular", 1.0, 1.0, 0.5))
    wide = "  a claim of some length, about nothing in particular  1 +- 0.5  1    ok"
    narrow = ["  ok      a claim of some length, about nothing in particular", "          expected 1 +- 0.5, got 1"]
    for columns, terminal, expected in ((60, False, [wide]), (200, True, [wide]), (60, True, narrow)):
        monkeypatch.setenv("COLUMNS", str(columns))
        monkeypatch.setattr(sys.stdout, "isatty", lambda terminal=terminal: terminal)
        assert cli.main(["demo", "--out", str(tmp_path)]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert [line for line in lines if line in (wide, *narrow)] == expected


def test_demo_without_checks_fails(system: System, tmp_path: Path) -> None:
    system(lambda report: None)
    assert cli.main(["demo", "--out", str(tmp_path)]) == 1


def test_demo_without_matplotlib(
    system: System, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    system(lambda report: report.near("one", 1.0, 1.0, 0.0))
    assert cli.main(["demo", "--out", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr().out
    assert len([line for line in printed.splitlines() if "figures skipped" in line and ".[plot]" in line]) == 1
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["report.html"]


def test_the_page_needs_no_other_file(system: System, tmp_path: Path) -> None:
    """The page contains no address and no script. The text of a check is escaped."""
    system(lambda report: report.near("<script>a & b</script>", (1.0, 2.0), (1.0, 3.0), 0.5, "1 < 2", "E1"))
    assert cli.main(["demo", "--out", str(tmp_path)]) == 1
    text = (tmp_path / "report.html").read_text()
    for part in ("http:", "https:", "<script", "<link", 'src="/'):
        assert part not in text
    assert "&lt;script&gt;a &amp; b" in text and "1 &lt; 2" in text and 'class="verdict FAILED"' in text
    assert 'name="viewport"' in text and "prefers-color-scheme: dark" in text


def test_demo_where_nothing_can_be_written(system: System, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    system(lambda report: report.near("one", 1.0, 1.0, 0.0))
    assert cli.main(["demo", "--out", str(tmp_path / "file" / "out")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("armlet: ") and "file" in line


def test_interruption(system: System, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def run(report: Report) -> None:
        raise KeyboardInterrupt

    system(run)
    assert cli.main(["demo", "--out", str(tmp_path)]) == 130
    assert capsys.readouterr().err == "armlet: interrupted\n"


def test_a_closed_stdout(monkeypatch: pytest.MonkeyPatch) -> None:
    """If standard output is closed, the exit codes are unchanged."""
    for arguments, code in ((["info"], 0), (["new", "adaptive"], 0), (["check", "none.toml"], 2)):
        monkeypatch.setattr(sys, "stdout", None)
        assert cli.main(arguments) == code


@pytest.mark.parametrize("arguments", [[], ["nothing"], ["demo", "--nothing"]])
def test_wrong_arguments(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        cli.main(arguments)
    assert stop.value.code == 2
    err = capsys.readouterr().err
    assert "usage: armlet" in err
    # Without arguments the help lists all commands.
    commands = ("demo", "info", "run", "check", "export", "new", "sweep", "worst", "schema", "view", "lab")
    assert arguments or all(f"  {command} " in err for command in commands)


def armlet(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-P", "-W", "error", "-m", "armlet", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300)


def test_info(tmp_path: Path) -> None:
    result = armlet("info", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    for word in ("armlet", "python", "numpy", "instruction set", "lanes", "threads"):
        assert word in result.stdout


@pytest.mark.slow
def test_the_demonstration_holds(tmp_path: Path) -> None:
    """All checks of the demonstration pass, and all figures exist."""
    result = armlet("demo", "--out", str(tmp_path / "out"), cwd=tmp_path)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "FAILED" not in result.stdout
    assert result.stdout.count(" ok\n") >= 10
    assert {"adaptive.png", "priority.png"} <= {path.name for path in (tmp_path / "out").iterdir()}
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in (tmp_path / "out").glob("*.png"))
