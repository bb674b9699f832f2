"""A seven-axis arm with a momentum observer, which estimates the torque of a push without a force sensor. Pull any link.

    dr/dt = K_O (tau_ext - r),   contact where |r_i| is above the threshold of joint i
    reaction from contact on:   tau = g + K_c (q_c - q) + D_c (dq_c/dt - v)

g is the gravity torque, and K_c and D_c are stiffness and damping of the reaction. The reaction "stop" holds `q_c`, the position at
contact. "retract" moves `q_c` away from the contact. "float" has K_c = 0 and a constant `q_c`. The force of the slider acts along y at the
tip, unless the mouse pulls. The force of the mouse acts at its grip point. The curves show the residual `r` and the external torque J'F,
which the observer does not know. F is the wrench of the force, J the Jacobian of its frame and ' the transpose. After contact a reaction
replaces the law, until a reset or another choice of reaction or observer gain.
"""

from __future__ import annotations

from typing import Any

import numpy as np

import armlet as al

from ...run.guards import contact_states
from ..urdf import read_shapes
from .system import DT, Array, Choice, Force, Plot, Slider, State, System, Targets, Values, number

__all__ = ["Observer"]

START = np.array([0.2, 0.6, 0.1, -1.3, 0.2, 0.9, 0.3])  # rad
SHOWN = (0, 1, 3)  # indices of the joints whose residual is drawn


class Observer(System):
    """The seven-axis example with a momentum observer and a PD law with gravity compensation."""

    title = "Momentum observer, seven axes"
    frame = "tcp"
    q0 = START
    controls = (
        Slider("gain", "gain of the observer K_O (1/s), 10^", 1.0, 1000.0, 50.0, powers=True),
        Slider("threshold", "threshold of contact (N m)", 0.05, 5.0, 0.5),
        Slider("push", "push at the tip along y (N)", -20.0, 20.0, 0.0),
        Slider("payload", "payload (kg), unknown to law and observer", 0.0, 2.0, 0.0),
        Choice("reaction", "reaction to contact", ("none", "stop", "float", "retract"), "none"),
        Slider("reaction_omega", "bandwidth of stop and retract (rad/s)", 1.0, 30.0, 10.0),
        Slider("float_damping", "damping of float, per inertia (1/s)", 0.1, 20.0, 2.0),
        Slider("speed", "speed of retract (rad/s)", 0.05, 1.0, 0.3),
        Slider("omega", "bandwidth of the law w (rad/s)", 1.0, 30.0, 6.0),
    )
    plots = (
        Plot(
            "residual and true torque (N m)",
            (*(f"r{k + 1}" for k in SHOWN), *(f"J'F {k + 1}" for k in SHOWN)),
            len(SHOWN),
        ),
        Plot("largest residual and threshold (N m)", ("largest |r|", "threshold"), 1),
        Plot("touched link, 0 for none, and whether the arm reacts (1)", ("link", "reacts")),
    )
    planar = False

    def __init__(self) -> None:
        source = al.example_urdf("seven_axis")
        self.arm = al.load_urdf(source)
        self.targets = {}
        self.shapes = read_shapes(source, self.arm, ()).shapes
        self.inertia = np.diag(self.arm.mass_matrix(START)).copy()
        self.reset()

    def reset(self) -> None:
        self.observer: al.MomentumObserver | None = None
        self.guarded: al.Guarded | None = None
        self.gain = 0.0
        self.force: Force | None = None
        self.note = ""

    def start(self) -> State:
        self.reset()
        return super().start()

    def law(self, values: Values) -> al.PDGravity | al.Guarded:
        """The law that holds the arm, with the chosen reaction to contact."""
        omega = number(values, "omega")
        hold = al.PDGravity(self.arm, START, omega**2 * self.inertia, 2.0 * omega * self.inertia)
        reaction, omega = values["reaction"], number(values, "reaction_omega")
        if reaction == "none":
            return hold
        observer = al.MomentumObserver(self.arm, number(values, "gain"), threshold=number(values, "threshold"))
        if reaction == "float":
            return al.Guarded(hold, observer, "float", damping=number(values, "float_damping") * self.inertia)
        impedance: dict[str, Any] = {"stiffness": omega**2 * self.inertia, "damping": 2.0 * omega * self.inertia}
        if reaction == "stop":
            return al.Guarded(hold, observer, "stop", **impedance)
        return al.Guarded(hold, observer, "retract", **impedance, speed=number(values, "speed"))

    def contact(self, state: State) -> float | None:
        """The time at which the reaction replaced the law, s; None before contact."""
        if self.guarded is None or state.estimate is None:
            return None
        found = contact_states([self.guarded], np.array([state.t]), state.estimate[None], False)
        return None if found is None or np.isnan(found[0]) else float(found[0])

    def due(self, state: State, values: Values, targets: Targets) -> bool:
        # After a contact a new loop must start once, because the note appears only at the start of a loop.
        return not self.note and self.contact(state) is not None

    def loop(self, values: Values, targets: Targets, force: Force | None, state: State) -> al.Simulator:
        gain, law = number(values, "gain"), self.law(values)
        guarded = law if isinstance(law, al.Guarded) else None
        reaction, before = (None if each is None else each.reaction for each in (guarded, self.guarded))
        # The observer's state and the contact are valid only for the same gain and reaction.
        estimate = state.estimate if gain == self.gain and reaction == before else None
        if self.observer is None or gain != self.gain:
            self.observer, self.gain = al.MomentumObserver(self.arm, gain), gain
            self.observer.reset(state.q, state.v)
        if force is None and number(values, "push") != 0.0:
            force = Force(self.frame, np.array([0.0, number(values, "push"), 0.0, 0.0, 0.0, 0.0]))
        self.force = force
        payload = number(values, "payload")
        plant = al.RigidArm(self.arm.with_payload(self.frame, payload) if payload > 0.0 else self.arm)
        # The torque is held for one step, as the observer assumes.
        options = {} if force is None else {"force": force.wrench, "force_frame": force.frame}
        sim = al.Simulator(plant, law, state.q, v0=state.v, dt=DT, sample_time=DT, check_limits=False, **options)
        if guarded is not None and estimate is not None:
            sim.set_state(state.q, state.v, estimate=estimate)
        self.guarded = guarded
        contact = self.contact(State.of(sim, state.t))
        self.note = "" if contact is None else f"contact at t = {contact:.2f} s, reaction {reaction}: reset to return to the law"
        return sim

    def step(self, sim: al.Simulator) -> None:
        sim.step()
        if self.observer is not None:
            self.observer.update(sim.q, sim.v, sim.tau, DT)

    def true_torque(self, q: Array) -> Array:
        """Joint torques J'F of the acting force, (n,), N m."""
        if self.force is None:
            return np.zeros(self.arm.n)
        return np.asarray(self.arm.jacobian(q, self.force.frame).T @ self.force.wrench)

    def sample(self, sim: al.Simulator, state: State, values: Values, targets: Targets) -> list[list[float]]:
        residual = None if self.observer is None else self.observer.residual
        r = np.zeros(self.arm.n) if residual is None else residual
        threshold, true = number(values, "threshold"), self.true_torque(sim.q)
        beyond = np.flatnonzero(np.abs(r) > threshold)
        # A force on a link loads only the joints between the base and this link. So the last loaded joint belongs to the touched link.
        link = int(beyond[-1]) + 1 if beyond.size else 0
        return [[*r[[*SHOWN]], *true[[*SHOWN]]], [float(np.abs(r).max()), threshold], [float(link), float(self.contact(state) is not None)]]
