"""Search for gains with scipy's differential evolution [storn1997differential]. The candidates of each generation run as batches. For
losses with a gradient, search with scipy's L-BFGS-B from several starts: see `descent`.

    minimise over u in [0, 1]^k   max_c cost(metrics of the run with gains g(u) under condition c),   or the mean over c

A *candidate* is one set of gains, and a *condition* is one set of other values under which each candidate runs. `g` maps `u` to the search
intervals: "uniform" searches on a linear scale, and "log_uniform" on a logarithmic scale.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..arguments import choice, integer, number, require_partner, shown
from ..border import border, bordered
from ..errors import InputError
from ..extras import extra
from ..pickling import sealed
from ..progress import search_reporter
from ..scenario import Scenario
from ..status import Status, having
from .chunk import run_chunk
from .descent import Descent
from .execution import SweepTable, metrics_arguments
from .parameter_space import MOST, Cells, ListedCells, columns, drawn

__all__ = ["Tuning", "tune"]

Array: TypeAlias = NDArray[np.float64]

#: Cost of a run that failed, or whose cost is not finite.
FAILED = 1e30


@bordered
@sealed
@dataclass(frozen=True, eq=False)
class Tuning:
    """The result of `tune`: the best values, their cost, and every candidate of the search.

    Attributes:
        best: the best values by path.
        cost: the cost of the best values.
        scenario: the scenario with the best values.
        costs: the lowest cost so far, after each generation. The first entry is that of the initial candidates. With gradients: the lowest
            cost so far, after each iteration and at the end.
        tried: every candidate, in order: `cell`, a column per path, and `cost`.
        runs: number of runs. With gradients, the computations of the derivatives are not counted.
        method: the name of the search method.
        converged: whether the candidates met the tolerance before the last generation. With gradients: whether the search from every start
            converged.
    """

    best: dict[str, Any]
    cost: float
    scenario: Scenario
    costs: Array
    tried: SweepTable
    runs: int
    converged: bool
    method: str = "differential_evolution"

    @property
    def _turn(self) -> str:
        return "iteration" if self.method == "gradient" else "generation"

    def __str__(self) -> str:
        shown = ", ".join(f"{path} = {value:.5g}" if isinstance(value, float) else f"{path} = {value}" for path, value in self.best.items())
        end = "converged" if self.converged else f"stopped at the last {self._turn}"
        return f"cost {self.cost:.6g} at {shown} ({self.runs} runs, {len(self.costs)} {self._turn}s, {end})"

    def __repr__(self) -> str:
        return f"Tuning({self})"


@border
def tune(
    scenario: Scenario | str | PathLike[str],
    vary: Mapping[str, Any],
    cost: str | Mapping[str, float] | Callable[[Any], Any],
    *,
    method: Literal["differential_evolution", "gradient"] = "differential_evolution",
    over: Mapping[str, Any] | None = None,
    by: Literal["worst", "mean"] = "worst",
    candidates: int = 32,
    generations: int = 50,
    starts: int = 4,
    tolerance: float | None = None,
    seed: int = 0,
    threads: int | None = None,
    progress: Callable[[int, float], object] | bool | None = None,
    **metrics: Any,
) -> Tuning:
    """Search for the gains, or any other values of a scenario, with the lowest cost. It requires scipy (extra `tune`).

    The candidates of a generation, under all conditions, run as batches. The same seed has the same result, to the bit, for every number of
    threads.

    Args:
        scenario: the scenario, or the path of its file.
        vary: search intervals by path (`"law.kd[0]"`): `{"uniform": [low, high]}` or `{"log_uniform": [low, high]}`.
        cost: name of a metric's column (`"error_rms1"`, `"settling_time"`), or a function of the table of a generation. The table has the
            columns of `sweep` and one row per run, and the function returns one number per row. A failed run, NaN and infinity cost 1e30.
            With gradients it is a loss of `armlet.gradient`: names such as `{"error_rms": 1.0, "tau_rms": 1e-4}`, or a function of a run.
        method: "differential_evolution" accepts any cost and searches the whole intervals. "gradient" follows the gradient of a loss from
            several starts by scipy's L-BFGS-B. It finds minima near its starts.
        over: conditions for each candidate, a grid as in `sweep`: `{"arm.masses[1]": [2.0, 3.0]}`. None runs each candidate once, with the
            values of the scenario.

    Other Args:
        by: "worst": the cost of a candidate is the largest cost of its conditions. "mean": it is the mean cost of its conditions. It
            requires `over`.
        candidates: number of candidates per generation, >= 5; not with gradients.
        generations: largest number of generations after the first. With gradients: largest number of iterations per start.
        starts: number of starts of a gradient search; only with gradients. The first start has the scenario's values. All other starts are
            random.
        tolerance: the search ends when the standard deviation of the candidates' costs, divided by their mean, is below this value. With
            gradients a search from one start ends when an iteration lowers its cost by less than this fraction. None means 0.01, and 1e-6
            with gradients.
        seed: seed of the search, and of noise and jitter in the runs.
        threads: number of threads, as for `simulate_batch`.
        progress: True writes the number of finished generations and the remaining time to standard error. A function is called with the
            number of the generation and the lowest cost so far. With gradients the iterations of all starts are counted.
        **metrics: arguments of `armlet.metrics`: `band`, `settle`, `reference`, `frame`; not used with gradients.

    Returns:
        The best values by path, their cost, and the table of all candidates.

    Raises:
        InputError: an argument is not valid; the message names it.
        ImportError: scipy is not installed.

    Source: [storn1997differential]; with gradients [ByrdEtAl1995].

    >>> import armlet as al
    >>> law = {"kind": "ComputedTorque", "kp": 100.0, "kd": 20.0}
    >>> arm, motion = {"kind": "planar_pr", "A": 2.0, "B": 0.5, "C": 0.5}, {"kind": "Hold", "q": [1.0, 0.0]}
    >>> scenario = al.Scenario({"arm": arm, "motion": motion, "law": law, "run": {"q0": [0.0, 0.0], "t_end": 1.0, "dt": 2e-3}})
    >>> found = al.tune(scenario, {"law.kd": {"uniform": [5.0, 40.0]}}, "settling_time", candidates=16, generations=10)
    >>> 14.0 < found.best["law.kd"] < 17.0  # a damping ratio of 0.78, whose overshoot is the band
    True
    """
    optimize = _scipy()
    base = scenario if isinstance(scenario, Scenario) else Scenario.load(scenario)
    bare = Scenario({name: table for name, table in base.data.items() if name != "sweep"}, base.folder, base.name)
    candidates, generations = integer("tune", "candidates", candidates, 5), integer("tune", "generations", generations, 0, MOST)
    choice("tune", "by", by, ("worst", "mean"))
    choice("tune", "method", method, ("differential_evolution", "gradient"))
    starts = integer("tune", "starts", starts, 1, MOST)
    require_partner("tune", "by", by, "over", over is not None, "worst")
    require_partner("tune", "candidates", candidates, 'method="differential_evolution"', method != "gradient", 32)
    require_partner("tune", "starts", starts, 'method="gradient"', method == "gradient", 4)
    tolerance = (1e-6 if method == "gradient" else 0.01) if tolerance is None else number("tune", "tolerance", tolerance)
    if not isinstance(cost, str) and not callable(cost) and not (method == "gradient" and isinstance(cost, Mapping)):
        raise InputError(f"tune: cost is of the wrong type: expected the name of a metric or a function, got {shown(cost)}")
    metrics = metrics_arguments("tune", metrics, base)
    listener = search_reporter("tune", progress, "generations", generations)
    space = _ranges(vary, seed)
    conditions = _conditions(over, seed, candidates)
    if method == "gradient":
        if metrics:
            raise InputError(f"tune: {next(iter(metrics))} is not used: expected no arguments of armlet.metrics with gradients")
        search = Descent(bare, space, conditions, cost, by == "worst", FAILED)
        listener = search_reporter("tune", progress, "iterations", starts * generations)
        return _descended(optimize, base, search, (starts, generations, tolerance, seed), listener)
    assert not isinstance(cost, Mapping), "a table of terms requires the gradient method"
    tried: list[dict[str, Any]] = []
    paid: list[Array] = []
    raised: list[Exception] = []

    def run(rows: list[dict[str, Any]]) -> Array:
        """Return the cost of each candidate in `rows`."""
        cells = ListedCells({}, None, seed, [row | condition for row in rows for condition in conditions])
        table = SweepTable(run_chunk(bare, cells, 0, len(cells), threads, metrics, strict=True))
        each = _costs(table, cost).reshape(len(rows), len(conditions))
        found: Array = each.max(axis=1) if by == "worst" else each.mean(axis=1)
        tried.extend(rows)
        paid.append(found)
        return found

    def evaluate(u: Array) -> Array:
        """Return the costs, (S,), of the S candidates in the columns of `u`, (k, S)."""
        rows = [{path: drawn(spec, float(x)) for (path, spec), x in zip(space.items(), column, strict=True)} for column in u.T]
        try:
            return run(rows)
        except Exception as error:
            raised.append(error)
            raise

    def report(intermediate_result: Any) -> None:
        listener(len(paid) - 1, float(intermediate_result.fun))

    result = _evolved(optimize, evaluate, len(space), (candidates, generations, tolerance, seed), report, raised)
    if progress is True:
        listener(generations, 0.0)
    table = SweepTable({"cell": np.arange(len(tried))} | columns(tried) | {"cost": np.concatenate(paid)})
    least = int(np.argmin(table["cost"]))
    costs = np.minimum.accumulate([generation.min() for generation in paid])
    best, runs = tried[least], len(tried) * len(conditions)
    return Tuning(best, float(table["cost"][least]), base.replace(best), costs, table, runs, bool(result.success))


def _evolved(
    optimize: Any, evaluate: Any, size: int, how: tuple[int, int, float, int], report: Callable[..., None], raised: list[Exception]
) -> Any:
    """Return scipy's result of the differential evolution."""
    candidates, generations, tolerance, seed = how
    first = np.random.default_rng(seed).permuted(np.tile((np.arange(candidates) + 0.5) / candidates, (size, 1)), axis=1)
    try:
        return optimize.differential_evolution(
            evaluate,
            [(0.0, 1.0)] * size,
            init=first.T,
            maxiter=generations,
            tol=tolerance,
            rng=np.random.default_rng([seed, 1]),
            polish=False,
            updating="deferred",
            vectorized=True,
            callback=report,
        )
    except RuntimeError:
        # scipy replaces a ValueError of `evaluate` by this RuntimeError, so the error of `evaluate` is raised here.
        if raised:
            raise raised[0] from None
        raise


def _descended(
    optimize: Any, base: Scenario, search: Descent, how: tuple[int, int, float, int], listener: Callable[[int, float], object]
) -> Tuning:
    """Search by gradients from several starts, and return the result."""
    starts, steps, tolerance, seed = how
    random = np.random.default_rng([seed, 2]).random((starts - 1, len(search.space)))
    costs: list[float] = []

    def after() -> None:
        costs.append(min(search.paid))
        listener(len(costs), costs[-1])

    ended = [search.search(optimize, u, steps, tolerance, after) for u in [search.own(), *random]]
    table = SweepTable({"cell": np.arange(len(search.tried))} | columns(search.tried) | {"cost": np.array(search.paid)})
    least = int(np.argmin(search.paid))
    best, runs = search.tried[least], len(search.tried) * len(search.conditions)
    costs.append(search.paid[least])
    return Tuning(best, search.paid[least], base.replace(best), np.array(costs), table, runs, all(ended), "gradient")


def _scipy() -> Any:
    return extra("tune", "scipy.optimize", "tune")


def _ranges(vary: Mapping[str, Any], seed: int) -> Mapping[str, Any]:
    """Return the search intervals by path. Raise InputError if an entry is not an interval."""
    space = Cells.of(vary, 1, seed).vary
    for path, spec in space.items():
        if not isinstance(spec, Mapping) or not set(spec) & {"uniform", "log_uniform"}:
            raise InputError(f'tune: vary."{path}" is no range: expected a table with uniform or log_uniform, got {shown(vary[path])}')
    return space


def _conditions(over: Mapping[str, Any] | None, seed: int, candidates: int) -> list[dict[str, Any]]:
    """Return the values by path of each condition. Raise InputError if a generation has too many runs."""
    grid = None if over is None else Cells.of(over, None, seed)
    runs = candidates * (1 if grid is None else grid.count)
    if runs > MOST:
        raise InputError(f"tune: candidates are too many: expected at most {MOST:,} runs in a generation, got {runs}")
    return [{}] if grid is None else [grid[i] for i in range(len(grid))]


def _costs(table: SweepTable, cost: str | Callable[[SweepTable], ArrayLike]) -> Array:
    if isinstance(cost, str):
        if cost not in table or table[cost].dtype.kind != "f":
            known = ", ".join(name for name, column in table.items() if column.dtype.kind == "f")
            raise InputError(f"tune: cost is no metric: expected one of {known}, got {shown(cost)}")
        values = table[cost]
    else:
        values = _core.numbers("tune", "cost", cost(table), (table.rows,))
    good = np.isfinite(values) & having(table["status"], Status.SUCCESS)
    return np.where(good, values, FAILED)
