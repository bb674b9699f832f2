"""Initial value problems dy/dt = f(t, y): methods with fixed steps, and one adaptive method of a family that the core does not use.

    euler          y+ = y + h f
    semi_implicit  v+ = v + h a(t, q, v),  q+ = q + h v+,  and euler for all other states
    rk4            y+ = y + h (k1 + 2 k2 + 2 k3 + k4)/6
    gbs            Gragg's modified midpoint rule with 2, 4, 6, .. substeps, extrapolated in h^2 (Bulirsch and Stoer 1966;
                   Hairer, Norsett, Wanner, Solving ODEs I, II.9)

y+ is the state after a step of length h, k1 to k4 are the slopes of the stages, and a is the acceleration. The extrapolation method has no
formula in common with the Runge-Kutta pairs of the core.
"""

from collections.abc import Callable, Iterable

import numpy as np

from .lagrange import Array

Field = Callable[[float, Array], Array]
Step = Callable[[Field, float, Array, float], Array]


class IntegrationError(RuntimeError):
    """The error of an integration that ended early. `t` is the last time, s."""

    def __init__(self, message: str, t: float) -> None:
        super().__init__(f"{message} at t = {t!r}")
        self.t = t


def euler(f: Field, t: float, y: Array, h: float) -> Array:
    """One explicit Euler step."""
    return y + h * f(t, y)


def rk4(f: Field, t: float, y: Array, h: float) -> Array:
    """One step of the classical fourth-order method."""
    k1 = f(t, y)
    k2 = f(t + h / 2, y + h / 2 * k1)
    k3 = f(t + h / 2, y + h / 2 * k2)
    k4 = f(t + h, y + h * k3)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def semi_implicit(positions: slice, velocities: slice) -> Step:
    """The symplectic Euler step for a state whose entries `velocities` are the rates of its entries `positions`."""

    def step(f: Field, t: float, y: Array, h: float) -> Array:
        y = y + h * f(t, y) * _outside(y.size, positions)
        y[positions] += h * y[velocities]
        return y

    return step


def _outside(size: int, positions: slice) -> Array:
    mask = np.ones(size)
    mask[positions] = 0.0
    return mask


STEPS: dict[str, Step] = {"euler": euler, "rk4": rk4}


def midpoint(f: Field, t: float, y: Array, h: float, substeps: int, slope: Array) -> Array:
    """Gragg's smoothed midpoint value at t + h. The expansion of its error has only even powers of the substep."""
    delta = h / substeps
    before, now = y, y + delta * slope
    for m in range(1, substeps):
        before, now = now, before + 2 * delta * f(t + m * delta, now)
    return 0.5 * (before + now + delta * f(t + h, now))


def gbs(
    f: Field,
    t0: float,
    y0: Array,
    t_eval: Iterable[float],
    *,
    rtol: float = 1e-12,
    atol: float = 1e-12,
    columns: int = 7,
    breaks: Iterable[float] = (),
    first_step: float = 0.0,
    max_steps: int = 1_000_000,
) -> Array:
    """The states at `t_eval` (increasing, from t0 on), shape (len(t_eval), len(y0)). No step crosses a time of `breaks`.

    `first_step` is the first step, s. With 0, the right-hand side at t0 determines it.
    """
    t, y = float(t0), np.array(y0, dtype=np.float64)
    targets = [float(target) for target in t_eval]
    corners = sorted({float(b) for b in breaks if t0 < b < (targets[-1] if targets else t0)})
    out = np.empty((len(targets), y.size))
    h = first_step
    budget = max_steps
    for row, target in enumerate(targets):
        for stop in [*[c for c in corners if t < c < target], target]:
            t, y, h, budget = _advance(f, t, y, stop, h, rtol, atol, columns, budget)
        out[row] = y
    return out


def _advance(
    f: Field, t: float, y: Array, stop: float, h: float, rtol: float, atol: float, columns: int, budget: int
) -> tuple[float, Array, float, int]:
    """Integrate from t to stop, and return the time, the state, the next proposed step and the remaining number of steps.

    f may jump at `stop`, so evaluations at `stop` use its limit from the left.
    """
    order = 2 * columns - 1
    limit = float(np.nextafter(stop, -np.inf))

    def inside(s: float, x: Array) -> Array:
        return f(min(s, limit), x)

    while t < stop:
        slope = f(t, y)
        if not np.isfinite(slope).all():
            raise IntegrationError("the state stopped being finite", t)
        if h <= 0.0:
            scale = atol + rtol * np.abs(y)
            h = min(stop - t, 0.1 / max(1e-8, float(np.max(np.abs(slope) / (np.abs(y) + scale + 1e-3)))))
        last = t + h >= stop - 1e-14 * max(abs(stop), 1.0)
        step = stop - t if last else h
        with np.errstate(over="ignore", invalid="ignore"):  # a trial step that overflows is rejected below
            value, error = _extrapolate(inside, t, y, step, slope, columns)
        budget -= 1
        if budget <= 0:
            raise IntegrationError("the largest number of steps was reached", t)
        scale = atol + rtol * np.maximum(np.abs(y), np.abs(value))
        size = float(np.max(np.abs(error) / scale)) if np.isfinite(value).all() else np.inf
        factor = 0.1 if not np.isfinite(size) else min(4.0, max(0.1, 0.9 * (size + 1e-300) ** (-1.0 / order)))
        if size <= 1.0:
            t, y = (stop if last else t + step), value
            # A step that was shortened to end at `stop` is no reason to shorten the next step.
            h = max(h, step * factor) if last else step * factor
        else:
            h = step * factor
            if t + h == t:
                raise IntegrationError("the step fell below the resolution of time", t)
    return t, y, h, budget


def _extrapolate(f: Field, t: float, y: Array, h: float, slope: Array, columns: int) -> tuple[Array, Array]:
    """Aitken-Neville extrapolation in (h/substeps)^2: the last diagonal value, and its difference from the previous diagonal value."""
    table: list[Array] = []
    for row in range(1, columns + 1):
        entries = [midpoint(f, t, y, h, 2 * row, slope)]
        for k in range(1, row):
            ratio = (row / (row - k)) ** 2
            entries.append(entries[k - 1] + (entries[k - 1] - table[k - 1]) / (ratio - 1.0))
        table = entries
    return table[-1], table[-1] - table[-2]
