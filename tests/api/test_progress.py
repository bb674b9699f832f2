"""Progress of long computations: the line that `progress=True` writes, and other values of the argument."""

from __future__ import annotations

import io
from typing import Any

import models
import numpy as np
import pytest
from refusals import refused

import armlet as al
from armlet.progress import Progress

LOOP = {"arm": {"kind": "example", "name": "planar_2r"}, "law": {"kind": "PDGravity", "target": [0.1, 0.2], "kp": 20.0, "kd": 5.0}}
SCENARIO = al.Scenario.from_dict(LOOP | {"run": {"q0": [0.0, 0.0], "t_end": 0.1, "dt": 1e-3}})
ARM = models.TWO_LINKS
BATCH = (al.RigidArm(ARM), al.PDGravity(ARM, [0.1, 0.2], 20.0, 5.0), np.zeros((5, 2)))


def lines(given: dict[float, int], total: int, before: int = 0) -> list[str]:
    """The lines that `Progress` writes. `given` contains the amounts done by time in s."""
    stream, now = io.StringIO(), 0.0
    progress = Progress("runs", stream, lambda: now)
    progress.start(before)
    for now, done in given.items():  # noqa: B007  # read by the clock
        progress(done, total)
    return stream.getvalue().split("\r")[1:]


def test_the_remaining_time() -> None:
    written = lines({10.0: 1000, 20.0: 4000, 100.0: 9990, 100.4: 10_000}, 10_000)
    assert [line.strip(" \n") for line in written] == [
        "1,000 of 10,000 runs, 1 min 30 s left", "4,000 of 10,000 runs, 30 s left", "9,990 of 10,000 runs, 0 s left",
        "10,000 of 10,000 runs in 1 min 40 s",
    ]  # fmt: skip
    # A shorter line is padded to cover a longer one.
    assert len(written[1]) == len(written[0])
    # The amount done before the start does not count for the speed.
    assert lines({7200.0: 600}, 1200, before=500) == ["600 of 1,200 runs, 12 h 0 min left"]
    assert lines({1.0: 500}, 1200, before=500) == ["500 of 1,200 runs"]


def test_progress_is_written_to_standard_error(capsys: pytest.CaptureFixture[str]) -> None:
    al.sweep(SCENARIO, {"law.kp": [10.0, 20.0, 30.0]}, progress=True)
    al.simulate_batch(*BATCH, t_end=0.1, dt=1e-3, progress=True)
    al.tune(SCENARIO, {"law.kp": {"uniform": [1.0, 20.0]}}, "error_rms1", candidates=5, generations=2, progress=True)
    out, written = capsys.readouterr()
    assert out == "" and all(f"{done} in " in written for done in ("3 of 3 cells", "5 of 5 runs", "2 of 2 generations"))
    assert written.count("\n") == 3
    al.sweep(SCENARIO, {"law.kp": [10.0]}, progress=False)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("wrong", [1.0, "yes", 2])
def test_a_progress_argument_that_is_not_callable_is_refused(wrong: Any) -> None:
    words = "progress is not callable", "True or None"
    refused(lambda: al.sweep(SCENARIO, {"law.kp": [10.0]}, progress=wrong), "sweep: ", *words)
    refused(lambda: al.simulate_batch(*BATCH, t_end=0.1, dt=1e-3, progress=wrong), "simulate_batch: ", *words)
    refused(lambda: al.tune(SCENARIO, {"law.kp": {"uniform": [1.0, 2.0]}}, "error_rms1", progress=wrong), "tune: ", *words)
