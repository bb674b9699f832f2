"""Two tasks in priority on the macro-micro planar 4R arm, without and with limits of the joint speeds.

Drag a target out of reach and observe which task still reaches its target. With limits, drag the tip's target by a large distance: joint 2
turns at its limit, and the tip still moves towards its target, while the elbow cannot.

    v = J1# v1 + (J2 P1)# (v2 - J2 J1# v1),   P1 = I - J1# J1,   v_i = gain_i (x_i,d - x_i)

J1 and J2 are the Jacobians of the tasks, and # is the pseudo-inverse. The first priority is the tip of link 4. The second priority is the
tip of link 2, the elbow.
"""

from __future__ import annotations

from typing import Any

import numpy as np

import armlet as al

from ..shapes import planar_links
from .system import DT, UPRIGHT, Array, Choice, Control, Force, Plot, Slider, State, System, Targets, Values, number

__all__ = ["Limits", "Priority"]

LENGTHS = (1.0, 1.0, 0.25, 0.25)  # m


class Priority(System):
    """The planar 4R arm with a priority law."""

    title = "Task priority, planar 4R"
    frame = "link4"
    q0 = np.array([0.9, -1.2, 0.6, 0.7])
    controls: tuple[Control, ...] = (
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

    def options(self, values: Values) -> dict[str, Any]:
        """The options of the law for these values of the controls."""
        return {} if values["method"] == "exact" else {"eps": number(values, "eps")}

    def law(self, values: Values, targets: Targets) -> al.PriorityVelocity:
        """The law for these values of the controls and targets."""
        tasks = [al.Task("link4", "xy", targets["tip"][:2], number(values, "gain1"))]
        # A gain of zero removes the task.
        if number(values, "gain2") > 0.0:
            tasks.append(al.Task("link2", "xy", targets["elbow"][:2], number(values, "gain2")))
        return al.PriorityVelocity(self.arm, tasks, str(values["method"]), **self.options(values))

    def loop(self, values: Values, targets: Targets, force: Force | None, state: State) -> al.Simulator:
        return al.Simulator(self.plant, self.law(values, targets), state.q, dt=DT)

    def distances(self, q: Array, targets: Targets) -> list[float]:
        """The distances of tip and elbow from their targets, m."""
        return [
            float(np.linalg.norm(targets[name] - self.arm.position(q, frame))) for name, frame in (("tip", "link4"), ("elbow", "link2"))
        ]

    def sample(self, sim: al.Simulator, state: State, values: Values, targets: Targets) -> list[list[float]]:
        return [self.distances(sim.q, targets), [*sim.v], [float(np.prod(LENGTHS) * np.sin(sim.q[1]) * np.sin(sim.q[3]))]]


class Limits(Priority):
    """The planar 4R arm with a priority law that keeps limits of the joint speeds above both tasks."""

    title = "Priority with limits, planar 4R"
    controls = (
        Choice("method", "map", ("clamp", "exact", "damped", "sns"), "clamp"),
        *Priority.controls[1:3],
        Slider("slow", "speed limit of joint 2 (rad/s)", 0.05, 3.0, 0.5),
        Slider("fast", "speed limit of the other joints (rad/s)", 0.05, 9.0, 9.0),
    )
    plots = (
        Priority.plots[0],
        Plot("joint speeds, limit of joint 2 (rad/s)", ("v1", "v2", "v3", "v4", "limit", "-limit"), 2),
        Plot("joints at an active limit (1)", ("joint 1", "joint 2", "joint 3", "joint 4"), bands=True),
    )

    def options(self, values: Values) -> dict[str, Any]:
        slow, fast = number(values, "slow"), number(values, "fast")
        return {"v_max": [fast, slow, fast, fast]}

    def sample(self, sim: al.Simulator, state: State, values: Values, targets: Targets) -> list[list[float]]:
        slow = number(values, "slow")
        # The band of joint k extends from k upwards while its upper limit holds a task, and downwards while its lower limit does.
        bands = [1.0, 2.0, 3.0, 4.0]
        holds = self.law(values, targets).terms(0.0, sim.q, sim.v).get("holds", ())
        for name, side in {(name, side) for name, side, *_ in holds}:
            k = int(name.removeprefix("joint ")) - 1
            bands[k] += 0.4 if side == "upper" else -0.4
        return [self.distances(sim.q, targets), [*sim.v, slow, -slow], bands]
