"""System 2: two tasks in priority on the macro-micro planar 4R arm.

Drag a target out of reach and observe which task still reaches its target.

    v = J1# v1 + (J2 P1)# (v2 - J2 J1# v1),   P1 = I - J1# J1,   v_i = gain_i (x_i,d - x_i)

J1 and J2 are the Jacobians of the tasks, and # is the pseudo-inverse. The first priority is the tip of link 4. The second priority is the
tip of link 2, the elbow.
"""

from __future__ import annotations

from typing import Any

import numpy as np

import armlet as al

from ..shapes import planar_links
from .system import DT, UPRIGHT, Choice, Force, Plot, Slider, State, System, Targets, Values, number

__all__ = ["Priority"]

LENGTHS = (1.0, 1.0, 0.25, 0.25)  # m


class Priority(System):
    """The planar 4R arm with a priority law."""

    title = "Task priority, planar 4R"
    frame = "link4"
    q0 = np.array([0.9, -1.2, 0.6, 0.7])
    controls = (
        Choice("method", "map", ("clamp", "exact", "damped", "chiaverini"), "clamp"),
        Slider("gain1", "gain of the tip, first (1/s)", 0.2, 20.0, 4.0),
        Slider("gain2", "gain of the elbow, second (1/s)", 0.0, 20.0, 4.0),
        Slider("eps", "clamp below (m), 10^", 1e-4, 1.0, 0.02, powers=True),
    )
    plots = (
        Plot("distance from the targets (m)", ("tip, first", "elbow, second")),
        Plot("joint speeds (rad/s)", ("v1", "v2", "v3", "v4")),
        Plot("det J = l1 l2 l3 l4 sin q2 sin q4 (m^4)", ("det J",)),
    )
    rotation = UPRIGHT
    takes_force = False  # external forces do not move a velocity-controlled arm

    def __init__(self) -> None:
        self.targets = {"tip": np.array([1.7, 0.9, 0.0]), "elbow": np.array([1.5, 0.6, 0.0])}
        self.arm = al.planar_arm(LENGTHS)
        self.plant = al.VelocityArm(self.arm)
        self.shapes = planar_links(self.arm, LENGTHS, 0.04)

    def loop(self, values: Values, targets: Targets, force: Force | None, state: State) -> al.Simulator:
        tasks = [al.Task("link4", "xy", targets["tip"][:2], number(values, "gain1"))]
        # A gain of zero removes the task.
        if number(values, "gain2") > 0.0:
            tasks.append(al.Task("link2", "xy", targets["elbow"][:2], number(values, "gain2")))
        method = str(values["method"])
        given: dict[str, Any] = {} if method == "exact" else {"eps": number(values, "eps")}
        return al.Simulator(self.plant, al.PriorityVelocity(self.arm, tasks, method, **given), state.q, dt=DT)

    def sample(self, sim: al.Simulator, state: State, values: Values, targets: Targets) -> list[list[float]]:
        tip, elbow = (
            float(np.linalg.norm(targets[name] - self.arm.position(sim.q, frame))) for name, frame in (("tip", "link4"), ("elbow", "link2"))
        )
        return [[tip, elbow], [*sim.v], [float(np.prod(LENGTHS) * np.sin(sim.q[1]) * np.sin(sim.q[3]))]]
