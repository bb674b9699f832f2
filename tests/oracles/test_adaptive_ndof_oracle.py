"""Adaptive control of serial arms against the 25-digit trajectories of a vector file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armlet as al

VECTORS = json.loads((Path(__file__).parents[1] / "vectors" / "oracle_g_adaptive_ndof_public.json").read_text())["cases"]


def sinusoid(joints: list[dict[str, Any]]) -> al.Sinusoid:
    terms = np.array([joint["terms"] for joint in joints], dtype=float)
    offset = np.array([joint["offset"] for joint in joints], dtype=float)
    return al.Sinusoid(offset, terms[..., 0], terms[..., 1], terms[..., 2])


@pytest.mark.parametrize("case", VECTORS, ids=lambda case: case["id"])
@pytest.mark.parametrize(("method", "options"), [("dop853", {"rtol": 1e-11, "atol": 1e-12}), ("rk4", {"dt": 2.5e-4})])
def test_trajectory(case: dict[str, Any], method: str, options: dict[str, float]) -> None:
    given, samples = case["input"], case["expected"]["samples"]
    arm = al.Arm.from_chain(given["chain"]["joints"], gravity=[float(x) for x in given["chain"]["gravity"]])
    kd, gamma = np.array(given["K_D"], dtype=float), np.tile(np.array(given["Gamma_per_link"], dtype=float), arm.n)
    kp = kd * np.array(given["Lambda"], dtype=float)
    law = al.Adaptive(arm, sinusoid(given["reference"]), kp, kd, gamma, estimate=given["ahat0"] or None)
    start = {"q0": given["q0"], "v0": given["qd0"]}
    run = al.simulate(al.RigidArm(arm), law, **start, t_end=given["times"][-1], t_eval=given["times"], method=method, **options)
    # The results differ from the file by at most 1.6e-8. The file's tolerance is 1e-7.
    close = {"rtol": 0.0, "atol": case["tolerance"]["abs"]}
    for name, got in (("q", run.q), ("qd", run.v), ("a_hat", run.estimate), ("tau", run.tau), ("V1", run.monitors["lyapunov"])):
        np.testing.assert_allclose(got, [sample[name] for sample in samples], err_msg=name, **close)
    assert np.max(run.monitors["skewness"]) < 1e-13
    assert np.max(np.abs(run.monitors["lyapunov_balance"])) < 1e-9
