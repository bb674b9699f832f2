"""A robot from a file. Drag the target of its tip, or pull any link.

    tau = M (Kp e - Kd v) + C v + g   or   tau = D (Kp e - Kd v) + g,   Kp = w^2, Kd = 2 zeta w, D the diagonal of M(q0)

e is the joint error, w the bandwidth and zeta the damping ratio. M is the mass matrix, C v the Coriolis torque and g the gravity torque.
Inverse kinematics, started at the last solution, gives the joint positions for the target.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

import armlet as al

from ..urdf import read_shapes
from .system import DT, Array, Choice, Force, Plot, Slider, State, System, Targets, Values, number, pushed

__all__ = ["Robot", "middle"]


def middle(arm: al.Arm) -> Array:
    """Joint positions: zero if the limits allow it, otherwise the middle of the joint's range, or its only limit."""
    low, high = arm.limits["q_min"], arm.limits["q_max"]
    nearest: Array = np.clip(0.0, low, high)
    between = (nearest != 0.0) & np.isfinite(low) & np.isfinite(high)
    nearest[between] = 0.5 * (low[between] + high[between])
    return nearest


class Robot(System):
    """Any arm that `al.load_urdf` can read, with a joint law."""

    controls = (
        Choice("law", "law", ("computed torque", "PD + gravity"), "computed torque"),
        Slider("omega", "bandwidth w (rad/s)", 0.5, 100.0, 10.0),
        Slider("zeta", "damping ratio zeta", 0.05, 2.0, 1.0),
    )
    planar = False

    def __init__(self, source: str | Path, title: str, frame: str | None = None, packages: Sequence[Path] = ()) -> None:
        self.arm = al.load_urdf(source)
        if self.arm.n == 0:
            raise al.InputError(f"lab: {title} has no joints: expected a robot that moves")
        names = self.arm.frame_names
        if frame is not None and frame not in names:
            raise al.InputError(f"lab: frame is unknown: expected one of {', '.join(names)}, got {frame}")
        self.title, self.frame = title, frame or str(self.arm.tip_frame)
        # A stretched arm is singular. So the initial configuration is 0.3 rad or m away from `middle`, within the limits.
        low, high = self.arm.limits["q_min"], self.arm.limits["q_max"]
        self.q0 = np.clip(middle(self.arm) + 0.3, low, high)
        self.inertia = np.diag(self.arm.mass_matrix(self.q0)).copy()
        self.targets = {"tip": np.asarray(self.arm.position(self.q0, self.frame))}
        self.goal, self.answered = self.q0, self.targets["tip"]
        looks = read_shapes(source, self.arm, packages)
        self.shapes, self.missing = looks.shapes, looks.missing
        curves = tuple(self.arm.joint_names)
        self.plots = (
            Plot("joint error (rad, m)", curves),
            Plot("input (N m, N)", curves),
            Plot("distance of the tip from its target (m)", ("distance",)),
        )

    def start(self) -> State:
        self.goal, self.answered, self.note = self.q0, self.targets["tip"], ""
        return super().start()

    def reach(self, target: Array) -> None:
        """Search for joint positions that reach the target, starting from the last solution.

        If the search does not reach the target, its last joint positions are used, and `note` reports their error.
        """
        if np.array_equal(target, self.answered):
            return
        task = al.Task(self.frame, "xyz", target)
        found = al.inverse_kinematics(self.arm, [task], self.goal, tolerance=1e-4, max_iterations=60, restarts=0)
        self.goal, self.answered = found.q, target
        self.note = "" if found.reached[0] else f"out of reach by {np.linalg.norm(found.errors[0]):.3f} m"

    def loop(self, values: Values, targets: Targets, force: Force | None, state: State) -> al.Simulator:
        self.reach(targets["tip"])
        kp, kd = number(values, "omega") ** 2, 2.0 * number(values, "zeta") * number(values, "omega")
        law: al.Law
        if values["law"] == "computed torque":
            law = al.ComputedTorque(self.arm, al.Hold(self.goal), kp, kd)
        else:
            law = al.PDGravity(self.arm, self.goal, kp * self.inertia, kd * self.inertia)
        return al.Simulator(al.RigidArm(self.arm), law, state.q, v0=state.v, dt=DT, check_limits=False, **pushed(force))

    def sample(self, sim: al.Simulator, state: State, values: Values, targets: Targets) -> list[list[float]]:
        distance = float(np.linalg.norm(targets["tip"] - self.arm.position(sim.q, self.frame)))
        return [[*(self.goal - sim.q)], [*sim.tau], [distance]]
