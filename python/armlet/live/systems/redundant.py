"""A seven-axis arm under Cartesian impedance. One spring holds its tip. In the null space another spring moves the joints to a
posture. Pull the elbow, or the tip.

    tau = J' F + N' tau_0 + g,   F = K_m (x_d - x) - D_m J v,   tau_0 = K_n (q_n - q) - D_n v
    compensated:   tau += C v,   F -= L J_dot v,   L = (J M^-1 J')^-1

x is the tip position with the target x_d and the Jacobian J, N' the projector of `al.NullSpace`, q_n the posture, and ' the transpose. K_m
and D_m are stiffness and damping at the tip, K_n and D_n those of the posture. M is the mass matrix, and C v the Coriolis torque. The
posture is the initial configuration, except for one joint, which a slider sets. Compare the projectors, with and without compensation
of the coupling.
"""

from __future__ import annotations

import numpy as np

import armlet as al

from ..urdf import read_shapes
from .system import DT, Choice, Force, Plot, Slider, State, System, Targets, Values, number, pushed

__all__ = ["Redundant"]

START = np.array([0.2, 0.6, 0.1, -1.3, 0.2, 0.9, 0.3])  # rad, away from singularities
TURNED = 2  # index of the joint whose posture the slider sets


class Redundant(System):
    """The seven-axis example with an impedance law and a null-space posture."""

    title = "Null space, seven axes"
    frame = "tcp"
    q0 = START
    controls = (
        Slider("stiffness", "stiffness at the tip K_m (N/m)", 10.0, 1000.0, 400.0),
        Slider("damping", "damping at the tip D_m (N s/m)", 1.0, 120.0, 40.0),
        Choice("projection", "null space", ("consistent", "static", "none"), "consistent"),
        Slider("posture", "posture of joint 3 (rad)", -1.5, 1.5, 0.8),
        Slider("null_stiffness", "null-space stiffness K_n (N m/rad)", 0.0, 100.0, 30.0),
        Slider("null_damping", "null-space damping D_n (N m s/rad)", 0.0, 40.0, 12.0),
        Choice("coupling", "coupling", ("left", "compensated"), "left"),
    )
    plots = (
        Plot("tip minus target (m)", ("x", "y", "z")),
        Plot("joints minus posture (rad)", tuple(f"q{k + 1}" for k in range(7))),
        Plot("kinetic energy (J) and loss of the clamp (1)", ("kinetic energy", "loss")),
    )
    planar = False

    def __init__(self) -> None:
        source = al.example_urdf("seven_axis")
        self.arm = al.load_urdf(source)
        self.targets = {"x_d": np.asarray(self.arm.position(START, self.frame))}
        self.shapes = read_shapes(source, self.arm, ()).shapes

    @staticmethod
    def posture(values: Values) -> al.NullSpace | None:
        """The options of the null space; None if no projection is chosen."""
        projection = values["projection"]
        if projection == "none":
            return None
        q_n = START.copy()
        q_n[TURNED] = number(values, "posture")
        return al.NullSpace(
            q_n,
            number(values, "null_stiffness"),
            number(values, "null_damping"),
            projection="static" if projection == "static" else "consistent",
        )

    def law(self, values: Values, targets: Targets) -> al.CartesianImpedance:
        """The impedance law for these values of the controls."""
        posture, compensated = self.posture(values), values["coupling"] == "compensated"
        return al.CartesianImpedance(
            self.arm,
            targets["x_d"],
            number(values, "stiffness"),
            number(values, "damping"),
            frame=self.frame,
            nullspace=posture,
            compensate_coupling=compensated,
            # Large, because the mouse may stretch the arm, which is then singular.
            eps=0.1 if posture is not None or compensated else None,
        )

    def loop(self, values: Values, targets: Targets, force: Force | None, state: State) -> al.Simulator:
        law = self.law(values, targets)
        return al.Simulator(al.RigidArm(self.arm), law, state.q, v0=state.v, dt=DT, check_limits=False, **pushed(force))

    def sample(self, sim: al.Simulator, state: State, values: Values, targets: Targets) -> list[list[float]]:
        away = self.arm.position(sim.q, self.frame) - targets["x_d"]
        null_space = self.posture(values)
        posture = START if null_space is None else np.asarray(null_space.q_d)
        kinetic, _ = self.arm.energy(sim.q, sim.v)
        loss = self.law(values, targets).terms(0.0, sim.q, sim.v).get("loss", 0.0)
        return [[*away], [*(sim.q - posture)], [float(kinetic), float(loss)]]
