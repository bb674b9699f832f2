"""System 4: one link under gravity from rest to rest in minimum time, under a torque limit. Drag the target and observe the motion.

    I theta_ddot + G sin theta = tau,   |tau| <= tau_max,   theta from the downward vertical

A plan starts only when the link is at rest. So a new target during a motion is planned after this motion. If no motion within the limit
is found, a message reports it, and the link stays. Computed torque tracks the plan within the same limit.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import armlet as al

from ..shapes import planar_links
from .system import DT, Array, Force, Plot, Slider, State, System, Targets, Values, number, pushed

__all__ = ["MinimumTime"]

LENGTH, MASS, INERTIA = 0.6, 1.0, 0.03  # m, kg, kg m^2 about the centre of mass
GRAVITY = 9.81  # m/s^2
TOTAL = INERTIA + MASS * (LENGTH / 2) ** 2
MOMENT = MASS * GRAVITY * LENGTH / 2
SLOW = 2e-2  # tolerance of "at rest": largest speed, rad/s, and largest distance from the end of the plan, rad


class MinimumTime(System):
    """One link under gravity that tracks a minimum-time plan."""

    title = "Minimum time, one link"
    frame = "link1"
    q0 = np.array([-math.pi / 2])
    controls = (
        Slider("tau_max", "torque limit (N m)", 0.5, 12.0, 4.0),
        Slider("omega", "bandwidth of the tracking (rad/s)", 1.0, 60.0, 20.0),
    )
    plots = (
        Plot("angle from the downward vertical (rad)", ("theta", "goal", "planned"), 1),
        Plot("torque and its limits (N m)", ("tau", "tau_max", "-tau_max"), 2),
        Plot("speed (rad/s)", ("theta'", "planned"), 1),
    )
    # The arm's x axis is along gravity, so it points down in the scene.
    rotation = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])

    def __init__(self) -> None:
        self.targets = {"goal": np.array([0.0, LENGTH, 0.0])}
        # Gravity is along x. So the joint angle, measured from x, is the angle from the downward vertical.
        self.arm = al.planar_arm([LENGTH], masses=[MASS], coms=[LENGTH / 2], inertias=[INERTIA], gravity=(GRAVITY, 0.0))
        self.shapes = planar_links(self.arm, [LENGTH], 0.025)
        self.reset()

    def reset(self) -> None:
        self.begin, self.duration = 0.0, 0.0
        self.plan: al.TorqueOptimum | None = None
        self.q_end = float(self.q0[0])  # angle at which the plan ends, rad
        self.wanted: tuple[float, float] | None = None  # goal and limit of the last plan
        self.note = ""

    def start(self) -> State:
        self.reset()
        return super().start()

    @staticmethod
    def goal(targets: Targets, near: float) -> float:
        """The angle of the target, rad, plus the multiple of 2 pi that brings it nearest to `near`. So the motion is at most pi long."""
        x, y, _ = targets["goal"]
        angle = math.atan2(y, x)
        return angle + 2 * math.pi * round((near - angle) / (2 * math.pi))

    def due(self, state: State, values: Values, targets: Targets) -> bool:
        """Whether a new goal or limit requires a plan, and the link is at rest at the end of the last plan."""
        if self.wanted == (self.goal(targets, self.q_end), number(values, "tau_max")):
            return False
        return state.t >= self.begin + self.duration and abs(state.v[0]) < SLOW and abs(state.q[0] - self.q_end) < SLOW

    def replan(self, values: Values, targets: Targets, state: State) -> None:
        """Plan a motion to the target within the torque limit, from the present rest angle."""
        goal, limit = self.goal(targets, self.q_end), number(values, "tau_max")
        self.wanted = (goal, limit)
        if goal == self.q_end:
            return
        plan = al.torque_optimal_time(self.q_end, goal, TOTAL, MOMENT, limit)
        if plan.best.kind == "none found":
            self.note = f"no way to {goal:.2f} rad: {plan.reason}"
            return
        kind = "certified optimal" if plan.certified_global else "best of its families"
        self.note = f"{plan.best.kind}, {plan.best.t:.3f} s, {kind}"
        if max(abs(math.sin(self.q_end)), abs(math.sin(goal))) * MOMENT > limit:
            self.note += "; the limit cannot hold an end"
        self.plan, self.begin, self.duration, self.q_end = plan, state.t, plan.best.t, goal

    def motion(self, t: float) -> al.Motion:
        """The plan for a loop that starts at time `t`, s. After its end it holds its last angle."""
        left = self.begin + self.duration - t
        if self.plan is None or left <= 0.0:
            return al.Hold([self.q_end])
        # `profile` is constant after the plan's end, and `Table` is constant after its last row.
        q, v, a, _ = self.plan.profile(np.arange(t - self.begin, self.duration + 2 * DT, DT))
        return al.Table(DT, q[:, None], v[:, None], a[:, None])

    def planned(self, t: float) -> tuple[float, float]:
        """Angle, rad, and speed, rad/s, of the plan at time `t`, s."""
        if self.plan is None or t >= self.begin + self.duration:
            return self.q_end, 0.0
        q, v, _, _ = self.plan.profile(t - self.begin)
        return q, v

    def loop(self, values: Values, targets: Targets, force: Force | None, state: State) -> al.Simulator:
        if self.due(state, values, targets):
            self.replan(values, targets, state)
        omega = number(values, "omega")
        law = al.ComputedTorque(self.arm, self.motion(state.t), omega**2, 2 * omega)
        given: dict[str, Any] = {"v0": state.v, "dt": DT, "tau_max": number(values, "tau_max")}
        return al.Simulator(al.RigidArm(self.arm), law, state.q, **given, **pushed(force))

    def sample(self, sim: al.Simulator, state: State, values: Values, targets: Targets) -> list[list[float]]:
        q, v = self.planned(state.t)
        limit = number(values, "tau_max")
        return [[sim.q[0], self.goal(targets, self.q_end), q], [sim.tau[0], limit, -limit], [sim.v[0], v]]

    def desired(self, t: float, values: Values, targets: Targets) -> Array | None:
        return np.asarray(self.arm.position([self.planned(t)[0]], "link1"))
