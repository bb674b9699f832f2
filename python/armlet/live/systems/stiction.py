"""One link with static friction under PD or PID control, in a horizontal plane. Drag the target by a small distance, and wait.

    I theta_ddot = tau - tau_f,   tau = K_p e + K_i int e - K_d theta_dot,   F_s the breakaway torque, F_c the friction in motion

I is the inertia about the joint, e the error of the angle theta, and tau_f the friction torque. Under PD the link can stop before its
target. Under PID with F_s > F_c, the integral grows until the link slips, and the link can pass the target and stick again. If this
repeats, it is a limit cycle. Compare stick-slip with LuGre friction, whose bristles deflect before the link slips.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import armlet as al

from ..shapes import planar_links
from .system import DT, Array, Choice, Force, Plot, Slider, State, System, Targets, Values, number, pushed

__all__ = ["Stiction"]

LENGTH, MASS, INERTIA = 0.6, 1.0, 0.41  # m, kg, kg m^2 about the centre of mass: 0.5 about the joint
SPEED, VISCOUS = 0.05, 0.1  # Stribeck speed, rad/s, and viscous friction, N m s/rad
STILL = 1e-3  # a link slower than this counts as stuck, rad/s
BRISTLES = {"stiffness": 1e4, "damping": 70.0}  # stiffness, N m/rad, and damping, N m s/rad, of the bristles of LuGre friction


class Stiction(System):
    """One link with static friction."""

    title = "Stiction, one link"
    frame = "link1"
    q0 = np.array([0.0])
    controls = (
        Choice("friction", "friction", ("stick-slip", "LuGre", "none"), "stick-slip"),
        Slider("coulomb", "Coulomb friction F_c (N m)", 0.0, 4.0, 1.0),
        Slider("ratio", "breakaway torque F_s / F_c", 1.0, 3.0, 2.0),
        Slider("kp", "K_p (N m/rad)", 0.0, 60.0, 10.0),
        Slider("ki", "K_i (N m/(rad s))", 0.0, 60.0, 20.0),
        Slider("kd", "K_d (N m s/rad)", 0.0, 20.0, 3.0),
    )
    plots = (
        Plot("angle (rad)", ("theta", "goal"), 1),
        Plot("torque and breakaway torque (N m)", ("tau", "F_s", "-F_s"), 2),
        Plot("speed (rad/s), and whether stuck (1)", ("theta'", "stuck")),
    )

    def __init__(self) -> None:
        self.targets = {"goal": LENGTH * np.array([math.cos(1.0), math.sin(1.0), 0.0])}
        self.arm = al.planar_arm([LENGTH], masses=[MASS], coms=[LENGTH / 2], inertias=[INERTIA], gravity=(0.0, 0.0))
        self.shapes = planar_links(self.arm, [LENGTH], 0.025)

    @staticmethod
    def goal(targets: Targets) -> float:
        """The angle of the target, rad."""
        x, y, _ = targets["goal"]
        return math.atan2(y, x)

    @staticmethod
    def friction(values: Values) -> al.StickSlip | al.LuGre | bool:
        """The friction model for these values of the controls; False if there is no friction."""
        coulomb = number(values, "coulomb")
        curve = {"coulomb": coulomb, "static": number(values, "ratio") * coulomb, "stribeck_speed": SPEED, "viscous": VISCOUS}
        if values["friction"] == "none" or coulomb == 0.0:
            return False
        return al.LuGre(**curve, **BRISTLES) if values["friction"] == "LuGre" else al.StickSlip(**curve)

    def loop(self, values: Values, targets: Targets, force: Force | None, state: State) -> al.Simulator:
        kp, ki, kd = (number(values, name) for name in ("kp", "ki", "kd"))
        law = al.PID(self.arm, [self.goal(targets)], kp, ki or None, kd)
        friction = self.friction(values)
        given: dict[str, Any] = {"v0": state.v, "dt": DT, "method": "ros2" if isinstance(friction, al.LuGre) else "rk4"}
        sim = al.Simulator(al.RigidArm(self.arm, friction=friction), law, state.q, **given, **pushed(force))
        bristles = state.bristles if isinstance(friction, al.LuGre) else None
        # Without K_i the law has no integral state. The integral starts at zero when K_i becomes positive.
        integral = state.estimate if ki > 0.0 else None
        sim.set_state(state.q, state.v, bristles=bristles, estimate=integral)
        return sim

    def sample(self, sim: al.Simulator, state: State, values: Values, targets: Targets) -> list[list[float]]:
        breakaway = number(values, "ratio") * number(values, "coulomb")
        stuck = float(values["friction"] != "none" and abs(sim.v[0]) < STILL)
        return [[sim.q[0], self.goal(targets)], [sim.tau[0], breakaway, -breakaway], [sim.v[0], stuck]]

    def desired(self, t: float, values: Values, targets: Targets) -> Array | None:
        return np.asarray(self.arm.position([self.goal(targets)], "link1"))
