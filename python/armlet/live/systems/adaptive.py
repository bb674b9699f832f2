"""System 1: the PR robot under adaptive tracking, with parameters unknown to the law. Pull it, add a load, and observe the estimate.

    tau = Y pi_hat + Kd s,   pi_hat_dot = Gamma Y's,   s = v_d - v + Lambda (q_d - q),   Lambda = Kd^-1 Kp

Y is the regressor, pi_hat the estimate of the parameters and ' the transpose. The law has three parameters A, B, C and no frames. The plant
is the same robot as a chain of links, so that it can be drawn and pushed. Its parameters are A = m1 + m2, B = m2 d, C = I2 + m2 d^2. m1 and
m2 are the masses of the links. d is the distance of the centre of mass of link 2 from its joint, and I2 the inertia about this centre. At
q2 = 0 link 2 is along -y.
"""

from __future__ import annotations

import numpy as np

import armlet as al

from ..shapes import BLUE, GREY, ORANGE, Shape, between
from .system import DT, Array, Force, Plot, Slider, State, System, Targets, Values, number, pushed

__all__ = ["AdaptivePR"]

CART, LINK, LENGTH = 1.5, 0.5, 0.8  # kg, kg, m
FREQUENCY = np.array([1.0, 1.7])  # rad/s


def robot(payload: float) -> al.Arm:
    """The robot as a chain of links, with a load of `payload` kg at its tip."""
    inertia = LINK * LENGTH**2 / 12
    slide = {"type": "P", "axis": [1.0, 0.0, 0.0], "rpy": [0.0, 0.0, 0.0], "xyz": [0.0, 0.0, 0.0], "phi": [CART] + [0.0] * 9}
    about_origin = inertia + LINK * LENGTH**2 / 4
    turn = {
        "type": "R",
        "axis": [0.0, 0.0, 1.0],
        "rpy": [0.0, 0.0, -np.pi / 2],
        "xyz": [0.0, 0.0, 0.0],
        "phi": [LINK, LINK * LENGTH / 2, 0.0, 0.0, 0.0, 0.0, about_origin, 0.0, 0.0, about_origin],
    }
    arm = al.Arm.from_chain([slide, turn], gravity=(0.0, 0.0, 0.0)).with_frame("tip", "link2", xyz=[LENGTH, 0.0, 0.0])
    return arm.with_payload("tip", payload) if payload > 0.0 else arm


def parameters(payload: float) -> Array:
    """The parameters A (kg), B (kg m), C (kg m^2) of `robot(payload)`."""
    total = CART + LINK + payload
    return np.array([total, LINK * LENGTH / 2 + payload * LENGTH, LINK * LENGTH**2 / 3 + payload * LENGTH**2])


class AdaptivePR(System):
    """The PR robot with an adaptive law."""

    title = "Adaptive PR robot"
    frame = "tip"
    q0 = np.array([0.2, -0.3])
    controls = (
        Slider("kp", "stiffness Kp", 1.0, 400.0, 40.0),
        Slider("kd", "damping Kd", 1.0, 100.0, 15.0),
        Slider("gamma", "adaptation Gamma, 10^", 0.01, 100.0, 20.0, powers=True),
        Slider("amplitude", "amplitude of the motion (m, rad)", 0.0, 1.0, 0.5),
        Slider("payload", "payload (kg), unknown to the law", 0.0, 2.0, 0.0),
    )
    plots = (
        Plot("tracking error (m, rad)", ("e1", "e2")),
        Plot("estimates and true values (kg, kg m, kg m^2)", ("A estimated", "B estimated", "C estimated", "A", "B", "C"), 3),
        Plot("input (N, N m)", ("tau1", "tau2")),
    )

    def __init__(self) -> None:
        self.targets = {"centre": np.array([0.236, -0.764, 0.0])}
        self.arm = robot(0.0)
        # The law uses only the structure of this model, never its parameters.
        self.model = al.planar_pr(*parameters(0.0))
        self.shapes = [
            between(None, (-1.5, 0.0, 0.0), (1.5, 0.0, 0.0), 0.012, GREY),
            Shape("link1", "box", (0.16, 0.1, 0.08), colour=ORANGE),
            between("link2", (0.0, 0.0, 0.0), (LENGTH, 0.0, 0.0), 0.025, BLUE),
        ]

    def motion(self, t: float, values: Values, targets: Targets) -> al.Sinusoid:
        """The desired motion about the dragged centre, for a loop that starts at time `t`, s."""
        x, y, _ = targets["centre"]
        turn = np.arccos(np.clip(-y / LENGTH, -1.0, 1.0))
        amplitude = number(values, "amplitude") * np.array([1.0, 1.5])
        return al.Sinusoid([x - LENGTH * np.sin(turn), turn], amplitude, FREQUENCY, FREQUENCY * t)

    def loop(self, values: Values, targets: Targets, force: Force | None, state: State) -> al.Simulator:
        motion = self.motion(state.t, values, targets)
        kp, kd, gamma = (number(values, name) for name in ("kp", "kd", "gamma"))
        law = al.Adaptive(self.model, motion, kp, kd, gamma, estimate=state.estimate)
        return al.Simulator(al.RigidArm(robot(number(values, "payload"))), law, state.q, v0=state.v, dt=DT, **pushed(force))

    def sample(self, sim: al.Simulator, state: State, values: Values, targets: Targets) -> list[list[float]]:
        error = self.motion(state.t, values, targets)(0.0)[0] - sim.q
        assert sim.estimate is not None
        return [[*error], [*sim.estimate, *parameters(number(values, "payload"))], [*sim.tau]]

    def desired(self, t: float, values: Values, targets: Targets) -> Array | None:
        return np.asarray(self.arm.position(self.motion(t, values, targets)(0.0)[0], "tip"))
