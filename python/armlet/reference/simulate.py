"""One closed loop as one initial value problem, with the theory's integrals carried along as extra states.

    y = [plant state, law state, w_1, w_2],   w_1' = s' Kd s,   w_2' = P
    lyapunov_balance = V1(0) - V1(t) - w_1,   energy_balance = E(t) - E(0) - w_2

Quadrature and trajectory share one method and one step, so both balances vanish at the method's own order.
A sampled loop holds tau and the law's rate from one sample to the next, as a controller does.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import integrate
from .impedance import ElasticImpedance
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

    def __init__(
        self,
        plant: Plant,
        law: Law,
        force: Force | None = None,
        load: Callable[[Array, Array], Array] | None = None,
        tau_max: Array | None = None,
        sampled: bool = False,
    ) -> None:
        self.plant, self.law, self.force, self.tau_max = plant, law, force, tau_max
        # load(q, F) is the joint torque J'F of an external force.
        self.load = load if load is not None else getattr(law, "load", None)
        self.sampled, self.held = sampled, dict[str, Array]()
        self.slices = (slice(0, plant.size), slice(plant.size, plant.size + law.state0.size))

    def initial(self, plant_state: Array) -> Array:
        return np.concatenate([plant_state, self.law.state0, np.zeros(2)])

    def sample(self, t: float, y: Array) -> None:
        """Take the law's answer at (t, y) and hold it."""
        self.held = self._control(t, y)

    def _control(self, t: float, y: Array) -> dict[str, Array]:
        q, v, theta, theta_dot = self.plant.split(y[self.slices[0]])
        terms = self.law.terms(t, q, v, theta, theta_dot, y[self.slices[1]])
        if self.tau_max is not None:
            terms = terms | {"tau": np.clip(terms["tau"], -self.tau_max, self.tau_max)}
        return terms

    def _evaluate(self, t: float, y: Array) -> tuple[Array, dict[str, Array], Array]:
        x = y[self.slices[0]]
        q = self.plant.split(x)[0]
        load = np.zeros_like(q)
        if self.force is not None:
            if self.load is None:
                raise ValueError("simulate: force has no frame: give load or a law with a frame")
            load = self.load(q, self.force(t))
        return x, self.held if self.sampled else self._control(t, y), load

    def __call__(self, t: float, y: Array) -> Array:
        x, terms, load = self._evaluate(t, y)
        loss = float(terms["s"] @ self.law.kd @ terms["s"]) if isinstance(self.law, Adaptive) else 0.0
        law = self._storage()
        power = law.power(x, terms, load) if law else self.plant.power(x, terms["tau"], load)
        return np.concatenate([self.plant.rates(x, terms["tau"], load), terms["state_rate"], [loss, power]])

    def _storage(self) -> ElasticImpedance | None:
        """The law's own storage function, where it has one and acts all the time; else the mechanical energy is watched."""
        own = isinstance(self.law, ElasticImpedance) and not self.sampled and self.tau_max is None
        return self.law if own and isinstance(self.law, ElasticImpedance) else None

    def record(self, t: float, y: Array) -> dict[str, Any]:
        """Everything a run shows at one instant."""
        x, terms, _ = self._evaluate(t, y)
        q, v, theta, theta_dot = self.plant.split(x)
        state = y[self.slices[1]]
        law = self._storage()
        energy = law.energy(self.plant, x, terms) if law else self.plant.energy(x)
        row: dict[str, Any] = {"t": t, "q": q, "v": v, "tau": terms["tau"], "energy": energy}
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
    sample_time: float | None = None,
    record_every: int = 1,
    t_eval: ArrayLike | None = None,
    force: Any = None,
    load: Callable[[Array, Array], Array] | None = None,
    tau_max: ArrayLike | None = None,
) -> dict[str, Array]:
    """Run the loop; arrays with time first: t, q, v, tau, estimate, theta, theta_dot, s, energy, lyapunov and the balances.

    method "euler", "semi_implicit", "rk4" (need dt; a sample is a whole number of steps) or "gbs" (adaptive, records t_eval).
    Without t_eval fixed steps record the start, every record_every-th step and the end. load(q, F) is J'F for a law without frame.
    """
    n = plant.arm.n
    f_ext, jumps = as_force(force)
    limit = None if tau_max is None else np.broadcast_to(np.asarray(tau_max, dtype=np.float64), (n,))
    loop = ClosedLoop(plant, law, f_ext, load, limit, sample_time is not None)
    start = np.array(q0, dtype=np.float64)
    speed = np.zeros(n) if v0 is None else np.array(v0, dtype=np.float64)
    y0 = loop.initial(plant.initial(start, speed, theta0, theta_dot0))
    breaks = sorted({b for b in (*law.breaks, *jumps) if 0.0 < b < t_end})
    wanted = None if t_eval is None else [float(t) for t in np.asarray(t_eval, dtype=np.float64)]
    if method == "gbs":
        points = _adaptive(loop, y0, t_end, [t_end] if wanted is None else wanted, sample_time, breaks, rtol, atol)
    elif dt is not None:
        hold = 0 if sample_time is None else round(sample_time / dt)
        points = _fixed(loop, y0, t_end, dt, _stepper(method, plant, n), record_every, wanted, hold, breaks)
    else:
        raise ValueError(f"simulate: dt is missing: method {method!r} takes fixed steps")
    if loop.sampled:
        loop.sample(0.0, y0)
    first = loop.record(0.0, y0)
    # The generator samples as it goes: each row must be recorded before the next step.
    return _collect(first, [loop.record(t, y) for t, y in points])


def _stepper(method: str, plant: Plant, n: int) -> integrate.Step:
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
    if method not in integrate.STEPS:
        raise ValueError(f"simulate: method is unknown: expected one of semi_implicit, gbs, {', '.join(integrate.STEPS)}, got {method!r}")
    return integrate.STEPS[method]


def _fixed(
    loop: ClosedLoop,
    y: Array,
    t_end: float,
    dt: float,
    step: integrate.Step,
    record_every: int,
    wanted: list[float] | None,
    hold: int,
    breaks: list[float],
) -> Iterator[tuple[float, Array]]:
    """The grid k dt, the last step shortened to t_end; a jump inside a step splits it, and stages before it see its left limit.

    A wanted time between grid points is reached by one short step off the run's own path.
    """
    count = int(np.ceil(t_end / dt - 1e-9))
    for k in range(count + 1):
        t, end = min(k * dt, t_end), min((k + 1) * dt, t_end)
        if hold and k % hold == 0:
            loop.sample(t, y)
        if wanted is None:
            if k % record_every == 0 or k == count:
                yield t, y
        else:
            for w in wanted:
                if abs(w - t) <= 1e-9 * dt:
                    yield w, y
                elif t < w < end - 1e-9 * dt:
                    yield w, _across(loop, step, t, w, y, breaks)
        if k < count:
            y = _across(loop, step, t, end, y, breaks)


def _across(loop: ClosedLoop, step: integrate.Step, t: float, end: float, y: Array, breaks: list[float]) -> Array:
    for stop in [*[b for b in breaks if t < b < end], end]:
        y = step(_until(loop, float(np.nextafter(stop, -np.inf)) if stop in breaks else np.inf), t, y, stop - t)
        t = stop
    return y


def _until(loop: ClosedLoop, limit: float) -> integrate.Field:
    return lambda t, y: loop(min(t, limit), y)


def _adaptive(
    loop: ClosedLoop,
    y: Array,
    t_end: float,
    wanted: list[float],
    sample_time: float | None,
    breaks: list[float],
    rtol: float,
    atol: float,
) -> Iterator[tuple[float, Array]]:
    """One integration, or one per sample; a record at a sample shows the new input."""
    last = max(wanted)
    ends = [last] if sample_time is None else [min((k + 1) * sample_time, t_end) for k in range(int(last / sample_time + 1e-9) + 1)]
    t = 0.0
    for index, end in enumerate(ends):
        if loop.sampled:
            loop.sample(t, y)
        inside = [w for w in wanted if t <= w < end or (w == end and index == len(ends) - 1)]
        stops = [*inside, *([] if end in inside else [end])]
        states = integrate.gbs(loop, t, y, stops, rtol=rtol, atol=atol, breaks=breaks)
        yield from zip(inside, states, strict=False)
        t, y = end, states[-1]


def _collect(first: dict[str, Any], rows: list[dict[str, Any]]) -> dict[str, Array]:
    run = {key: np.array([row[key] for row in rows]) for key in first}
    run["energy_balance"] = run["energy"] - first["energy"] - run.pop("work")
    loss = run.pop("loss")
    if "lyapunov" in run:
        run["dissipated"] = loss
        run["lyapunov_balance"] = first["lyapunov"] - run["lyapunov"] - loss
    return run
