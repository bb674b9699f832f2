"""Integrate any initial-value problem `dy/dt = f(t, y)` with armlet's methods."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from .arguments import count, entries, instance, integer, number, require_partner, shown
from .border import border, bordered
from .errors import InputError, SolveError
from .pickling import sealed
from .status import Status, advice_on_run

__all__ = ["DenseOutput", "Integration", "integrate"]

#: Largest number of events, and of further arguments, of a call.
MOST = 10_000

Array: TypeAlias = NDArray[np.float64]


@bordered
@sealed
class DenseOutput:
    """The solution between the steps: `dense(t)` is `(n,)` for a number `t` and `(K, n)` for times of shape `(K,)`.

    Each step stores the values of its polynomial at Chebyshev points. Barycentric interpolation (Berrut and Trefethen 2004) evaluates the
    polynomial between them, up to rounding. Times outside of the run raise an InputError.
    """

    def __init__(self, start: float, ends: Array, positions: Array, nodes: Array) -> None:
        #: Times at the ends of the steps and at the start, (S + 1,), in the order of the run.
        self.t = np.concatenate([[start], ends])
        self._positions, self._nodes = positions, nodes
        weights = (-1.0) ** np.arange(positions.size)
        weights[[0, -1]] *= 0.5
        self._weights = weights

    def __call__(self, t: ArrayLike) -> Array:
        times = _core.numbers("DenseOutput", "t", t, (), ("K",))
        flat = np.atleast_1d(times)
        low, high = min(self.t[0], self.t[-1]), max(self.t[0], self.t[-1])
        if not np.all((flat >= low) & (flat <= high)):
            raise InputError(f"DenseOutput: t is not in the run: expected times from {low} to {high}, got {shown(t)}")
        if self.t.size == 1:
            raise InputError("DenseOutput: t is not in the run: expected a run of at least one step, got none")
        sign = 1.0 if self.t[-1] >= self.t[0] else -1.0
        step = np.clip(np.searchsorted(sign * self.t, sign * flat, side="left") - 1, 0, self.t.size - 2)
        where = (flat - self.t[step]) / (self.t[step + 1] - self.t[step])
        away = where[:, None] - self._positions
        hit = away == 0.0
        terms = self._weights / np.where(hit, 1.0, away)
        terms = np.where(hit.any(axis=1, keepdims=True), hit.astype(np.float64), terms)
        out: Array = np.einsum("kd,kdn->kn", terms, self._nodes[step]) / terms.sum(axis=1, keepdims=True)
        return out[0] if times.ndim == 0 else out

    def __repr__(self) -> str:
        return f"DenseOutput(t={self.t[0]:g}..{self.t[-1]:g}, n={self._nodes.shape[-1]}, {self.t.size - 1} steps)"


@bordered
@sealed
class Integration:
    """The result of `integrate`: times, states, events, and the numbers of evaluations and steps.

    Attributes:
        t: the recorded times, (K,).
        y: the states at these times, (K, n).
        status: the `armlet.Status` with which the run ended: SUCCESS, EVENT if an event ended it, or a failure.
        ended: the time reached.
        stats: numbers of evaluations of f (including evaluations for differences), steps, rejections, jacobians (0 for a constant one) and
            factorisations. With the status EXCESS_ACCURACY, `stats["coarsen"]` is the factor by which both tolerances must be multiplied.
        t_events, y_events: for each event, the times (m,) and states (m, n) of its zero crossings.
        dense: the solution between the steps, if `dense_output=True`; else None.
    """

    t: Array
    y: Array

    def __init__(self, fields: Mapping[str, Any], start: float) -> None:
        self.t, self.y = fields["t"], fields["y"]
        self.status = Status(fields["status"])
        self.ended: float = fields["ended"]
        self.stats: dict[str, int] = dict(fields["stats"])
        self.t_events: list[Array] = list(fields["t_events"])
        self.y_events: list[Array] = list(fields["y_events"])
        self.dense: DenseOutput | None = None
        if "nodes" in fields:
            self.dense = DenseOutput(start, fields["ends"], fields["node_positions"], fields["nodes"])

    @property
    def success(self) -> bool:
        """Whether the run reached the end of its span, or a terminal event."""
        return self.status in (Status.SUCCESS, Status.EVENT)

    def __repr__(self) -> str:
        k, n = self.y.shape
        return f"Integration({self.status.name.lower()} at t={self.ended:.6g}, y ({k}, {n}), {self.stats['steps']} steps)"


def _events(events: object) -> list[tuple[Callable[..., Any], float, int]]:
    """Check events in scipy's form. Return each function with its direction and the number of crossings that ends the run."""
    if events is None:
        return []
    given: list[Any] = entries("integrate", "events", events, MOST) if isinstance(events, Sequence) else [events]
    found: list[tuple[Callable[..., Any], float, int]] = []
    for k, event in enumerate(given):
        if not callable(event):
            raise InputError(f"integrate: events is not callable: expected g(t, y), got {type(event).__name__} (first bad index {k})")
        direction, terminal = getattr(event, "direction", 0.0), getattr(event, "terminal", False)
        try:
            found.append((event, number("integrate", "direction", direction), count("integrate", "terminal", terminal)))
            fine = np.isfinite(found[-1][1])
        except InputError:
            fine = False
        if not fine:
            raise InputError(
                "integrate: events has a bad direction or terminal: expected a finite number and a count >= 0, "
                f"got {shown(direction)}, {shown(terminal)} (first bad index {k})"
            )
    return found


@border
def integrate(
    f: Callable[..., ArrayLike],
    t_span: tuple[float, float],
    y0: ArrayLike,
    *,
    method: str = "dopri5",
    rtol: ArrayLike = 1e-8,
    atol: ArrayLike = 1e-10,
    dt: float | None = None,
    t_eval: ArrayLike | None = None,
    dense_output: bool = False,
    events: Callable[..., float] | Sequence[Callable[..., float]] | None = None,
    jac: Callable[..., Any] | ArrayLike | None = None,
    jac_sparsity: ArrayLike | None = None,
    args: tuple[Any, ...] = (),
    max_step: float | None = None,
    first_step: float | None = None,
    positions: int = 0,
    lists: bool = False,
    vectorized: bool = False,
    throw: bool = True,
) -> Integration:
    """Solve `dy/dt = f(t, y)`, `y(t0) = y0`, from `t0` to `t1`, forward or backward in time.

    Args:
        f: the right-hand side, f(t, y, *args) -> (n,): an array, or a list or tuple of floats.
        t_span: start and end, in the unit of `t`. The end may be infinite if a terminal event ends the run and the method is adaptive.
        y0: initial state, (n,), in the units of `f`.
        method: fixed step: "euler", "semi_implicit", "rk4", and "ros2" for stiff problems; adaptive: "dopri5", "dop853", and "radau5" and
            "rodas4" for stiff problems. "stiff" is "radau5".
        rtol, atol: relative and absolute error allowed per step, each a number or (n,); rtol >= 2.22e-14. Only for adaptive methods.
        dt: the step of a fixed-step method. If the span is not a multiple of it, the last step is shorter.
        t_eval: record exactly these times, in the order of the span; None: record every step.
        events: functions g(t, y, *args) -> float. Their zero crossings are located to rounding. The attribute `direction` of a function
            selects crossings that rise (> 0) or fall (< 0) in the direction of the run. The attribute `terminal` is the number of crossings
            that ends the run (True: one).

    Other Args:
        dense_output: store the polynomials of the steps, for `result.dense(t)`.
        jac: df/dy for the implicit methods, jac(t, y, *args) -> (n, n) or a constant (n, n). A sparse matrix becomes dense.
            None: differences of f. They are forward differences for "radau5" and "ros2", which tolerate their error, and central
            differences for "rodas4", whose order requires them. "rodas4" and "ros2" also take differences of f in time.
        jac_sparsity: pattern (n, n), zero where df/dy is always zero. Columns without a common row then need only one evaluation of f for
            their differences [CurtisPowellReid1974]. It has no effect if `jac` is not None.
        args: further arguments of f, jac and events.
        max_step, first_step: largest step and first step of adaptive methods; first_step is not longer than the span.
        positions: number of positions for "semi_implicit": y = [q, v, rest], where q and v have this length and dq/dt = v.
        lists: pass y to f, jac and events as a list of floats, for functions that read single elements of y.
        vectorized: f accepts states as columns, y (n, k), and returns their rates, (n, k). Then one call computes all differences of a
            Jacobian. jac and events still receive y (n,).
        throw: raise an error if the run reaches neither its end nor a terminal event; False returns the partial run with its status.

    Returns:
        An `Integration` with times, states, status, statistics and events.

    Raises:
        InputError: an argument has a wrong type, shape or value.
        SolveError: the run reached neither its end nor a terminal event. `.status` is its status, `.t` its last time, and `.partial` the
            partial run.
        (any): the error of f, jac or an event, with its traceback.

    >>> import armlet as al
    >>> run = al.integrate(lambda t, y: [y[1], -y[0]], (0.0, 3.141592653589793), [1.0, 0.0], method="dop853")
    >>> float(run.y[-1, 0].round(7))
    -1.0
    """
    try:
        t0, t1 = t_span
    except (TypeError, ValueError):
        raise InputError(f"integrate: t_span is not a pair: expected (start, end), got {shown(t_span)}") from None
    positions = integer("integrate", "positions", positions)
    sizes = {"rtol": (rtol, 1e-8), "atol": (atol, 1e-10), "max_step": (max_step, None), "first_step": (first_step, None)}
    for name, (value, default) in sizes.items():
        require_partner("integrate", name, value, "an adaptive method, without dt", dt is None, default)
    instance("integrate", "throw", throw, (bool, np.bool_), "True or False")
    fields = _core.integrate(
        f,
        t0,
        t1,
        y0,
        method,
        rtol,
        atol,
        dt,
        t_eval,
        dense_output,
        _events(events),
        jac,
        jac_sparsity,
        tuple(entries("integrate", "args", args, MOST)),
        max_step,
        first_step,
        positions,
        lists,
        vectorized,
    )
    result = Integration(fields, float(t0))
    if throw and not result.success:
        advice = advice_on_run(result.status, method, rtol, atol, result.stats)
        message = f"integrate: the run ended at t = {result.ended:.9g}: {result.status.name.lower()}: {advice}"
        raise SolveError(message, result.status, result.ended, result)
    return result
