"""One closed loop as one initial value problem, with the theory's integrals carried along as extra states.

    y = [plant state, law state, w_1, w_2],   w_1' = s' Kd s,   w_2' = P
    lyapunov_balance = V1(0) - V1(t) - w_1,   energy_balance = E(t) - E(0) - w_2

Quadrature and trajectory share one method and one step, so both balances vanish at the method's own order.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import integrate
from .lagrange import Array
from .law import Adaptive, Law
from .plant import Plant

Force = Callable[[float], Array]


def as_force(force: Any) -> tuple[Force | None, tuple[float, ...]]:
    """None, a constant, [(t_start, F), ...] or F(t), as a function of time and its jumps."""
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


class ClosedLoop:
    """The right-hand side y' = f(t, y) of plant and law, and the monitors along it."""

    def __init__(self, plant: Plant, law: Law, force: Force | None = None, load: Callable[[Array, Array], Array] | None = None) -> None:
        self.plant, self.law, self.force = plant, law, force
        # load(q, F) is the joint torque J'F of an external force.
        self.load = load if load is not None else getattr(law, "load", None)
        self.slices = (slice(0, plant.size), slice(plant.size, plant.size + law.state0.size))

    def initial(self, plant_state: Array) -> Array:
        return np.concatenate([plant_state, self.law.state0, np.zeros(2)])

    def _evaluate(self, t: float, y: Array) -> tuple[Array, dict[str, Array], Array]:
        x, state = y[self.slices[0]], y[self.slices[1]]
        q, v, theta, theta_dot = self.plant.split(x)
        terms = self.law.terms(t, q, v, theta, theta_dot, state)
        load = np.zeros_like(q)
        if self.force is not None:
            if self.load is None:
                raise ValueError("simulate: force has no frame: give force_frame or a law with a frame")
            load = self.load(q, self.force(t))
        return x, terms, load

    def __call__(self, t: float, y: Array) -> Array:
        x, terms, load = self._evaluate(t, y)
        loss = float(terms["s"] @ self.law.kd @ terms["s"]) if isinstance(self.law, Adaptive) else 0.0
        power = self.energy(t, x, terms, load)[1]
        return np.concatenate([self.plant.rates(x, terms["tau"], load), terms["state_rate"], [loss, power]])

    def energy(self, t: float, x: Array, terms: dict[str, Array], load: Array) -> tuple[float, float]:
        """The law's own storage function where it has one, else the mechanical energy."""
        own = getattr(self.law, "energy", None)
        if own is not None and self.plant.elastic:
            value: tuple[float, float] = own(self.plant, x, terms, load)
            return value
        return self.plant.energy(x, terms["tau"], load)

    def record(self, t: float, y: Array) -> dict[str, Any]:
        """Everything a run shows at one instant."""
        x, terms, load = self._evaluate(t, y)
        q, v, theta, theta_dot = self.plant.split(x)
        state = y[self.slices[1]]
        row: dict[str, Any] = {"q": q, "v": v, "tau": terms["tau"], "energy": self.energy(t, x, terms, load)[0]}
        row |= {"estimate": state, "loss": y[-2], "work": y[-1]}
        if theta is not None:
            row |= {"theta": theta, "theta_dot": theta_dot}
        if isinstance(self.law, Adaptive):
            row["lyapunov"] = self.law.lyapunov(t, q, v, state, self.plant.arm)[0]
            row["s"] = terms["s"]
        return row


def simulate(
    plant: Plant,
    law: Law,
    q0: ArrayLike,
    *,
    t_end: float,
    dt: float | None = None,
    v0: ArrayLike | None = None,
    theta0: ArrayLike | None = None,
    theta_dot0: ArrayLike | None = None,
    method: str = "rk4",
    rtol: float = 1e-12,
    atol: float = 1e-12,
    record_every: int = 1,
    t_eval: ArrayLike | None = None,
    force: Any = None,
    load: Callable[[Array, Array], Array] | None = None,
) -> dict[str, Array]:
    """Run the loop; arrays with time first: t, q, v, tau, estimate, theta, theta_dot, s, energy, lyapunov and the balances.

    method "euler", "semi_implicit", "rk4" (need dt) or "gbs" (adaptive, needs t_eval).
    """
    n = plant.arm.n
    f_ext, jumps = as_force(force)
    loop = ClosedLoop(plant, law, f_ext, load)
    start = np.array(q0, dtype=np.float64)
    speed = np.zeros(n) if v0 is None else np.array(v0, dtype=np.float64)
    y0 = loop.initial(plant.initial(start, speed, theta0, theta_dot0))
    breaks = sorted({b for b in (*law.breaks, *jumps) if 0.0 < b < t_end})
    if method == "gbs":
        times = np.asarray([t_end] if t_eval is None else t_eval, dtype=np.float64)
        states = integrate.gbs(loop, 0.0, y0, times, rtol=rtol, atol=atol, breaks=breaks)
    else:
        if dt is None or t_eval is not None:
            raise ValueError(f"simulate: method {method!r} takes dt and no t_eval")
        times, states = _fixed(loop, y0, t_end, dt, _stepper(method, plant, n), record_every, breaks)
    return _collect(loop, times, states, loop.record(0.0, y0))


def _stepper(method: str, plant: Plant, n: int) -> Callable[[integrate.Field, float, Array, float], Array]:
    if method == "semi_implicit":
        once = integrate.semi_implicit(slice(0, n), slice(n, 2 * n))
        if not plant.elastic:
            return once
        motors = slice(2 * n, 3 * n)

        def both(f: integrate.Field, t: float, y: Array, h: float) -> Array:
            after = once(f, t, y, h)
            after[motors] = y[motors] + h * after[3 * n : 4 * n]
            return after

        return both
    return {"euler": integrate.euler, "rk4": integrate.rk4}[method]


def _fixed(
    loop: ClosedLoop,
    y: Array,
    t_end: float,
    dt: float,
    step: Callable[[integrate.Field, float, Array, float], Array],
    record_every: int,
    breaks: list[float],
) -> tuple[Array, Array]:
    """The grid k dt, the last step shortened to t_end; a jump inside a step splits it, and stages before it see its left limit."""
    count = int(np.ceil(t_end / dt - 1e-9))
    times, states = [0.0], [y]
    for k in range(count):
        t, end = k * dt, min((k + 1) * dt, t_end)
        for stop in [*[b for b in breaks if t < b < end], end]:
            limit = float(np.nextafter(stop, -np.inf)) if stop in breaks else np.inf
            y = step(_until(loop, limit), t, y, stop - t)
            t = stop
        if (k + 1) % record_every == 0:
            times.append(end)
            states.append(y)
    return np.array(times), np.array(states)


def _until(loop: ClosedLoop, limit: float) -> integrate.Field:
    return lambda t, y: loop(min(t, limit), y)


def _collect(loop: ClosedLoop, times: Array, states: Array, first: dict[str, Any]) -> dict[str, Array]:
    rows = [loop.record(float(t), y) for t, y in zip(times, states, strict=True)]
    run = {key: np.array([row[key] for row in rows]) for key in rows[0]} | {"t": times}
    run["energy_balance"] = run["energy"] - first["energy"] - run.pop("work")
    loss = run.pop("loss")
    if "lyapunov" in run:
        run["dissipated"] = loss
        run["lyapunov_balance"] = first["lyapunov"] - run["lyapunov"] - loss
    return run
