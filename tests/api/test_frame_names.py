"""The error about an unknown frame has the name of the argument."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import armlet as al

TWO = al.planar_arm([1.0, 1.0])
PLANT = al.RigidArm(TWO)
LAW = al.PDGravity(TWO, [0.1, 0.2], 50.0, 20.0)
Q = [0.0, 0.0]
RUN: dict[str, Any] = {"t_end": 0.1, "dt": 1e-2, "force": [1.0, 0.0, 0.0], "force_frame": "no"}
CALLS: dict[str, tuple[str, Callable[[], object]]] = {
    "simulate": ("force_frame", lambda: al.simulate(PLANT, LAW, Q, **RUN)),
    "simulate_batch": ("force_frame", lambda: al.simulate_batch(PLANT, LAW, [Q], **RUN)),
    "Simulator": ("force_frame", lambda: al.Simulator(PLANT, LAW, Q, dt=1e-2, force_frame="no")),
    "gradient": ("force_frame", lambda: al.gradient(lambda run: run.q.sum(), PLANT, LAW, Q, ["law.kp"], **RUN)),
    "equilibrium": ("force_frame", lambda: al.equilibrium(PLANT, LAW, q0=Q, force=[1.0, 0.0, 0.0], force_frame="no")),
    "inverse_dynamics": ("wrench_frame", lambda: TWO.inverse_dynamics(Q, Q, Q, wrench=np.zeros(6), wrench_frame="no")),
    "forward_dynamics": ("wrench_frame", lambda: TWO.forward_dynamics(Q, Q, Q, wrench=np.zeros(6), wrench_frame="no")),
    "with_frame": ("parent", lambda: TWO.with_frame("tool", "no")),
    "a plant's wall": ("wall.frame", lambda: al.RigidArm(TWO, wall=al.Wall("no", [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], stiffness=1e4))),
    "root of load_urdf": ("root", lambda: al.load_urdf(al.example_urdf("planar_2r"), root="no")),
    "tip of load_urdf": ("tip", lambda: al.load_urdf(al.example_urdf("planar_2r"), tip="no")),
}


@pytest.mark.parametrize("name", CALLS)
def test_the_argument_is_named(name: str) -> None:
    argument, call = CALLS[name]
    with pytest.raises(al.InputError, match=rf": {argument} is unknown: expected one of the (frames|links) .*, got no$"):
        call()
