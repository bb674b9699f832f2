"""The adaptive loop of the PR robot, and functions that run it with changed arguments."""

from __future__ import annotations

from typing import Any

import models
import numpy as np

import armlet as al

ARM = models.PR
PLANT = al.RigidArm(ARM)
HOLD = al.Hold([1.0, -0.5])
LAW = al.Adaptive(ARM, HOLD, 40.0, 20.0, 5.0)
NAN, INF = float("nan"), float("inf")

RUN: dict[str, Any] = {"t_end": 0.01, "dt": 1e-3}


def changed(changes: dict[str, Any]) -> dict[str, Any]:
    """The arguments RUN, updated with `changes`. For adaptive methods, `dt` is None."""
    free = {"dt": None} if changes.get("method") in ("dopri5", "dop853", "radau5", "rodas4") else {}
    return RUN | free | changes


def run(**changes: Any) -> al.Run:
    given = {"plant": PLANT, "law": LAW, "q0": [0.1, 0.2]} | changed(changes)
    return al.simulate(given.pop("plant"), given.pop("law"), given.pop("q0"), **given)


def batch(**changes: Any) -> al.BatchRun:
    given = {"plant": PLANT, "law": LAW, "q0": np.zeros((3, 2))} | changed(changes)
    return al.simulate_batch(given.pop("plant"), given.pop("law"), given.pop("q0"), **given)


def adaptive(**changes: Any) -> al.Adaptive:
    given = {"arm": ARM, "motion": HOLD, "kp": 40.0, "kd": 20.0, "gamma": 5.0} | changes
    return al.Adaptive(**given)
