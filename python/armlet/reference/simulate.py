"""Runs of a closed loop, with fixed steps k dt, or with an extrapolation method.

    fixed steps: a jump of force or motion inside a step divides the step; a record between grid points requires a separate short step
    adaptive: the method restarts at samples, when their torques begin to act, at jumps, at records and at checks of events
    events: a change of sign between two checks is located with trial points, each integrated from the previous check

`loop` defines the state.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import integrate
from .events import Event, Search
from .lagrange import Array
from .law import Law
from .loop import ClosedLoop, as_force, frame_load
from .plant import Plant
from .sampling import Sampling


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
    sample_time: float | Sampling | None = None,
    record_every: int = 1,
    t_eval: ArrayLike | None = None,
    force: Any = None,
    force_frame: str | None = None,
    load: Callable[[Array, Array], Array] | None = None,
    tau_max: ArrayLike | None = None,
    events: Sequence[Event] = (),
    looks: int = 200,
) -> dict[str, Any]:
    """Simulate the closed loop, and return a dict of arrays: t, q, v, tau, estimate, energy and energy_balance.

    An elastic arm adds theta and theta_dot. LuGre friction adds friction and bristles. An adaptive law adds s, lyapunov, dissipated and
    lyapunov_balance. The first axis of each array is time. The methods "euler", "semi_implicit" and "rk4" require dt, or
    use the sample time as dt. A sample time must be a multiple of dt. The method "gbs" is adaptive, and records t_eval, by default only
    t_end. Without t_eval, fixed steps record the start, every record_every-th step and the end. load(q, F) returns J'F for a law without a
    frame.

    Only "gbs" supports events: `run["events"]` is a list of (t, index, plant state). The sign of each event function is checked at `looks`
    times of the run.
    """
    n = plant.arm.n
    f_ext, jumps = as_force(force)
    limit = None if tau_max is None else np.broadcast_to(np.asarray(tau_max, dtype=np.float64), (n,))
    sampling = sample_time if isinstance(sample_time, Sampling) or sample_time is None else Sampling(sample_time)
    adaptive = method == "gbs"
    step = 0.0 if adaptive else dt if dt is not None else sampling.period if sampling is not None else None
    if step is None:
        raise ValueError(f"simulate: dt is missing: method {method!r} takes fixed steps")
    if force_frame is not None:
        load = frame_load(plant.arm, force_frame)
    loop = ClosedLoop(plant, law, f_ext, load, limit, sampling, step)
    start = np.array(q0, dtype=np.float64)
    speed = np.zeros(n) if v0 is None else np.array(v0, dtype=np.float64)
    y0 = loop.initial(plant.initial(start, speed, theta0, theta_dot0))
    breaks = sorted({b for b in (*law.breaks, *jumps) if 0.0 < b < t_end})
    wanted = None if t_eval is None else [float(t) for t in np.asarray(t_eval, dtype=np.float64)]
    loop.visit(0.0, y0)
    first = loop.record(0.0, y0)
    search = Search(events, plant, loop) if events else None
    if adaptive:
        points = _adaptive(loop, y0, t_end, [t_end] if wanted is None else wanted, breaks, rtol, atol, search, looks)
    else:
        points = _fixed(loop, y0, t_end, step, _stepper(method, plant, n), record_every, wanted, breaks)
    # The generator takes samples while it advances, so each row must be recorded before the next step.
    run: dict[str, Any] = _collect(first, [loop.record(t, y) for t, y in points])
    return run if search is None else run | {"events": search.found}


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
    breaks: list[float],
) -> Iterator[tuple[float, Array]]:
    """The times and states of the records. Stages before a jump use its limit from the left."""
    count = int(np.ceil(t_end / dt - 1e-9))
    for k in range(count + 1):
        t, end = min(k * dt, t_end), min((k + 1) * dt, t_end)
        loop.visit(t, y)
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
    breaks: list[float],
    rtol: float,
    atol: float,
    search: Search | None,
    looks: int,
) -> Iterator[tuple[float, Array]]:
    """The times and states of the records. The integration restarts when a sample is taken, when its torque begins to act, and at checks.

    It ends at an event that stops the run, with a record of it. A record at the time of a sample has the new input.
    """
    last = max(wanted)
    marks = {0.0, last, *(loop.clock.instants(last) if loop.clock is not None else ())}
    if search is not None:
        marks |= {*np.linspace(0.0, last, looks + 1)}
    times = sorted(marks)
    for t, end in zip(times, [*times[1:], np.inf], strict=True):
        loop.visit(t, y)
        if t in wanted:
            yield t, y
        if end == np.inf:
            return

        def onward(stops: list[float], t: float = t, y: Array = y, short: bool = len(times) > 2) -> Array:
            first = stops[0] - t if short else 0.0
            states: Array = integrate.gbs(loop, t, y, stops, rtol=rtol, atol=atol, breaks=breaks, first_step=first)
            return states

        stops = [*[w for w in wanted if t < w < end], end]
        states = onward(stops)
        cut = None if search is None else search.between(t, y, end, states[-1], onward)
        yield from ((w, x) for w, x in zip(stops[:-1], states, strict=False) if cut is None or w < cut[0])
        if cut is not None:
            yield cut
            return
        y = states[-1]


def _collect(first: dict[str, Any], rows: list[dict[str, Any]]) -> dict[str, Array]:
    run = {key: np.array([row[key] for row in rows]) for key in first}
    run["energy_balance"] = run["energy"] - first["energy"] - run.pop("work")
    loss = run.pop("loss")
    if "lyapunov" in run:
        run["dissipated"] = loss
        run["lyapunov_balance"] = first["lyapunov"] - run["lyapunov"] - loss
    return run
