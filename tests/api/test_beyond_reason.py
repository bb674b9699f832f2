"""Counts and lengths that are too large are refused, with the argument's name, before memory of that size is allocated."""

from __future__ import annotations

import os
import subprocess
import sys

from pr_loops import batch
from refusals import refused

import armlet as al

SCENARIO = al.Scenario(
    {
        "arm": {"kind": "planar_pr", "A": 2.0, "B": 0.5, "C": 0.5},
        "motion": {"kind": "Hold", "q": [1.0, 0.0]},
        "law": {"kind": "ComputedTorque", "kp": 100.0, "kd": 20.0},
        "run": {"q0": [0.0, 0.0], "t_end": 0.1, "dt": 1e-3},
    }
)


def test_threads() -> None:
    refused(lambda: batch(threads=10**7), "simulate_batch: threads is out of range: expected 1 to 1024, got 10000000")


def test_cells_of_a_sweep() -> None:
    vary = {"law.kd": {"uniform": [1.0, 2.0]}}
    refused(lambda: al.sweep(SCENARIO, vary, draws=10**12), "sweep: draws is too large", "100,000,000", "1000000000000")
    million = {"linspace": [1.0, 2.0, 10**6]}
    refused(lambda: al.sweep(SCENARIO, {"law.kd": million, "law.kp": million}), "sweep: vary has too many combinations", "1000000000000")
    million_more = {"linspace": [0.0, 1.0, 10**6]}
    refused(lambda: al.sweep(SCENARIO, {"law.kd": million, "law.kp": million, "arm.A": million_more, "arm.B": million_more}), "sweep: vary")


def test_candidates_of_a_search() -> None:
    vary = {"law.kd": {"uniform": [1.0, 2.0]}}
    refused(lambda: al.tune(SCENARIO, vary, "settling_time", candidates=10**12), "tune: candidates are too many", "10,000,000")


THREADS_OF_A_BATCH = """
import pathlib, re, numpy as np
import armlet as al

arm = al.planar_pr(2.0, 0.5, 0.5)
law = al.ComputedTorque(arm, al.Hold([1.0, 0.0]), 100.0, 20.0)
al.simulate_batch(al.RigidArm(arm), law, np.zeros((3, 2)), t_end=0.1, dt=1e-3, threads=1000)
status = pathlib.Path("/proc/self/status")
print(re.search(r"Threads:\\s*(\\d+)", status.read_text())[1] if status.exists() else 0)
"""


def test_no_more_threads_start_than_there_are_runs() -> None:
    output = subprocess.run([sys.executable, "-c", THREADS_OF_A_BATCH], capture_output=True, text=True, check=True, timeout=120).stdout
    # The process has three threads for the runs, one for the caller, and the threads of numpy.
    assert int(output) <= 3 + 1 + (os.cpu_count() or 1)
