"""A closed loop as one initial value problem, whose additional states are the integrals of two balances.

    y = [plant state, law state, w_1, w_2],   dw_1/dt = the rate that theory predicts for -dV1/dt,   dw_2/dt = P, the power that E receives
    lyapunov_balance = V1(0) - V1(t) - w_1,   energy_balance = E(t) - E(0) - w_2

V1 is the Lyapunov function of `adaptive`, and E the energy. The integrals and the trajectory use the same method and steps. In a sampled
loop, tau and the rate of the law's state are constant between two samples (see `sampling`).
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .adaptive import Adaptive
from .contact import pushes
from .guarded import Guarded
from .impedance import ElasticImpedance
from .lagrange import Array
from .law import Law, Terms
from .plant import Plant
from .sampling import Clock, Sampling

Force = Callable[[float], Array]


def as_force(force: Any) -> tuple[Force | None, tuple[float, ...]]:
    """Convert None, a constant, [(t_start, F), ...] or F(t) to a function of time and the times of its jumps."""
    if force is None:
        return None, ()
    if callable(force):
        return lambda t: np.asarray(force(t), dtype=np.float64), ()
    if isinstance(force, Sequence) and len(force) and isinstance(force[0], Sequence):
        starts = [float(start) for start, _ in force]
        values = [np.asarray(value, dtype=np.float64) for _, value in force]
        silent = np.zeros_like(values[0])

        def piecewise(t: float) -> Array:
            index = int(np.searchsorted(starts, t, side="right")) - 1
            return values[index] if index >= 0 else silent

        return piecewise, tuple(starts)
    constant = np.asarray(force, dtype=np.float64)
    return lambda t: constant, ()


def frame_load(arm: Any, frame: str) -> Callable[[Array, Array], Array]:
    """The function (q, F) -> J'F for a force F (3,) or a wrench F (6,) in world axes at a frame's origin."""
    return lambda q, F: arm.jacobian(q, frame)[: F.size].T @ F


class ClosedLoop:
    """The right-hand side of dy/dt = f(t, y) of a plant with a law, and the monitors of its solution."""

    def __init__(
        self,
        plant: Plant,
        law: Law,
        force: Force | None = None,
        load: Callable[[Array, Array], Array] | None = None,
        tau_max: Array | None = None,
        sampling: Sampling | None = None,
        grid: float = 0.0,
    ) -> None:
        if isinstance(law, Adaptive):
            law.plant = plant
        if isinstance(law, Guarded):
            law.period = 0.0 if sampling is None else sampling.period
            law.limit = law.limit if tau_max is None else np.broadcast_to(tau_max, law.limit.shape)
        self.plant, self.law, self.force, self.tau_max = plant, law, force, tau_max
        # load(q, F) returns the joint torque J'F of an external force.
        self.load = load if load is not None else getattr(law, "load", None)
        self.slices = (slice(0, plant.size), slice(plant.size, plant.size + law.state0.size))
        self.clock: Clock | None = None
        if sampling is not None:
            n = plant.arm.n
            silent = {"tau": np.zeros(n), "s": np.zeros(n), "state_rate": np.zeros(law.state0.size), "loss": np.zeros(())}
            springs = getattr(plant, "stiffness", np.eye(n))
            observed = slice(law.law.state0.size, law.law.state0.size + n) if isinstance(law, Guarded) and plant.size == 2 * n else None
            self.clock = Clock(sampling, n, grid, silent, springs, getattr(law, "joint_stiffness", springs), observed)

    def initial(self, plant_state: Array) -> Array:
        q, v, _, _ = self.plant.split(plant_state)
        return np.concatenate([plant_state, self.law.start(q, v), np.zeros(2)])

    def visit(self, t: float, y: Array) -> None:
        """Take all samples that are due at the time t, from the state y."""
        if self.clock is not None:
            self.clock.visit(t, y[self.slices[0]], lambda measured: self._control(t, measured, y[self.slices[1]]))

    def _control(self, t: float, measured: Array, state: Array) -> Terms:
        q, v, theta, theta_dot = self.plant.split(measured)
        terms = self.law.terms(t, q, v, theta, theta_dot, state)
        if isinstance(self.law, Adaptive):
            terms = terms | {"loss": np.asarray(self.law.loss(terms, q, v, state, self.plant))}
        if self.tau_max is not None:
            terms = terms | {"tau": np.clip(terms["tau"], -self.tau_max, self.tau_max)}
        return terms

    def _evaluate(self, t: float, y: Array) -> tuple[Array, Terms, Array]:
        x = y[self.slices[0]]
        q = self.plant.split(x)[0]
        load = np.zeros_like(q)
        if self.force is not None:
            if self.load is None:
                raise ValueError("simulate: force has no frame: give load, force_frame or a law with a frame")
            load = self.load(q, self.force(t))
        return x, self.clock.acting if self.clock is not None else self._control(t, x, y[self.slices[1]]), load

    def __call__(self, t: float, y: Array) -> Array:
        x, terms, load = self._evaluate(t, y)
        loss = float(terms["loss"]) if isinstance(self.law, Adaptive) else 0.0
        law = self._storage()
        if law is None:
            power = self.plant.power(x, terms["tau"], load)
        else:
            power = law.power(x, terms, load) - self._contacts(x)[1]
        return np.concatenate([self.plant.rates(x, terms["tau"], load), terms["state_rate"], [loss, power]])

    def _storage(self) -> ElasticImpedance | None:
        """Return the law if its storage function is the recorded energy. Return None if the recorded energy is the mechanical energy.

        Only an `ElasticImpedance` has a storage function, in a continuous loop without torque limits.
        """
        own = isinstance(self.law, ElasticImpedance) and self.clock is None and self.tau_max is None
        return self.law if own and isinstance(self.law, ElasticImpedance) and np.isinf(self.law.motor_max).all() else None

    def _contacts(self, x: Array) -> tuple[float, float]:
        q, v, _, _ = self.plant.split(x)
        return pushes(getattr(self.plant, "contacts", []), q, v)[1:]

    def record(self, t: float, y: Array) -> dict[str, Any]:
        """A dict of the recorded values of a run at one instant."""
        x, terms, _ = self._evaluate(t, y)
        q, v, theta, theta_dot = self.plant.split(x)
        state = y[self.slices[1]]
        law = self._storage()
        energy = law.energy(self.plant, x, terms) + self._contacts(x)[0] if law else self.plant.energy(x)
        row: dict[str, Any] = {"t": t, "q": q, "v": v, "tau": terms["tau"], "energy": energy}
        row |= {"estimate": state, "loss": y[-2], "work": y[-1]}
        if theta is not None:
            row |= {"theta": theta, "theta_dot": theta_dot}
        plant: Any = self.plant
        dry = getattr(plant, "dry", None)
        if dry is not None:
            row |= {"friction": plant.rub(x, terms["tau"])[0], "bristles": dry.deflection(x[-q.size :])}
        if isinstance(self.law, Adaptive):
            row["lyapunov"] = self.law.lyapunov(t, q, v, state, self.plant)
            row["s"] = terms["s"]
        return row
