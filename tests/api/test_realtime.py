"""The real-time example: both controllers run, and the robot's final state equals that of `al.simulate`. Times are not checked."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.compile

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "realtime"


def test_both_controllers_move_the_robot_as_simulate_does(tmp_path: Path) -> None:
    figure = tmp_path / "latency.png"
    command = [sys.executable, str(FOLDER / "measure.py"), "--seconds", "0.05", "--figure", str(figure)]
    # measure.py compares the states before it prints a row.
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    rows = [line.split() for line in done.stdout.splitlines()[2:]]
    assert [(row[0], row[1]) for row in rows] == [("C", "1"), ("Python", "1"), ("C", "4"), ("Python", "4")]
    assert [row[row.index("of") + 1] for row in rows] == ["50", "50", "200", "200"]
    assert figure.stat().st_size > 10_000
