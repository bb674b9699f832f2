"""System 3: Cartesian impedance of a 2R arm with elastic joints.

Pull its tip, and reduce the stiffness of its joints and the inertia of its motors.

    M a + C v + g = tau_J + J'F,   B theta_ddot + tau_J = tau,   tau_J = K_J (theta - q)
    tau = (1 - B B0^-1) tau_J + B B0^-1 (u - D0 theta_dot),   u = J'[K_m (x_d - x) - D_m J v] + g(q)

B and B0 are the inertia and the reduced inertia of the motors, and D0 is the damping of B0. K_J is the joint stiffness. x is the tip
position with the target x_d, the Jacobian J, the stiffness K_m and the damping D_m. F is the external force at the tip, and ' the
transpose. K_J, B0/B, the damping ratio of D0, K_m and D_m have one slider each, for both joints or both directions of the tip.
"""

from __future__ import annotations

import numpy as np

import armlet as al

from ..shapes import planar_links
from .system import DT, UPRIGHT, Force, Plot, Slider, State, System, Targets, Values, number, pushed

__all__ = ["Elastic"]

LENGTHS, B = (0.5, 0.4), np.array([0.4, 0.25])  # m, kg m^2


class Elastic(System):
    """The elastic 2R arm with a Cartesian impedance law."""

    title = "Elastic impedance, 2R"
    frame = "link2"
    q0 = np.array([0.3, 1.2])
    controls = (
        Slider("joint_stiffness", "joint stiffness K_J (N m/rad), 10^", 10.0, 1e5, 800.0, powers=True),
        Slider("share", "reduced inertia B0/B, 10^", 1e-5, 1.0, 0.05, powers=True),
        Slider("damping_ratio", "damping ratio of the motors", 0.05, 2.0, 1.0),
        Slider("stiffness", "stiffness at the tip K_m (N/m)", 10.0, 1000.0, 300.0),
        Slider("damping", "damping at the tip D_m (N s/m)", 0.1, 200.0, 40.0),
    )
    plots = (
        Plot("tip minus target (m)", ("x", "y")),
        Plot("deflection of the springs (rad)", ("theta1 - q1", "theta2 - q2")),
        Plot("motor torque (N m)", ("tau1", "tau2")),
    )
    rotation = UPRIGHT

    def __init__(self) -> None:
        self.targets = {"x_d": np.array([0.505963, 0.546758, 0.0])}
        self.arm = al.planar_arm(LENGTHS, masses=[3.0, 2.0], coms=[0.25, 0.2], inertias=[0.0625, 0.027], gravity=(0.0, -9.81))
        self.shapes = planar_links(self.arm, LENGTHS, 0.022)

    def loop(self, values: Values, targets: Targets, force: Force | None, state: State) -> al.Simulator:
        K_J = number(values, "joint_stiffness")
        law = al.ElasticImpedance(
            self.arm,
            targets["x_d"][:2],
            number(values, "stiffness"),
            number(values, "damping"),
            K_J,
            B,
            number(values, "share") * B,
            frame="link2",
            axes="xy",
            damping_ratio=number(values, "damping_ratio"),
        )
        motors = {} if state.theta is None else {"theta0": state.theta, "theta_dot0": state.theta_dot}
        return al.Simulator(al.ElasticArm(self.arm, K_J, B), law, state.q, v0=state.v, **motors, dt=DT, **pushed(force))

    def sample(self, sim: al.Simulator, state: State, values: Values, targets: Targets) -> list[list[float]]:
        assert sim.theta is not None
        return [[*(self.arm.position(sim.q, "link2") - targets["x_d"])[:2]], [*(sim.theta - sim.q)], [*sim.tau]]
