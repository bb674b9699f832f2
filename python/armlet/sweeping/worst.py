"""Search for the worst case of a closed loop over a box of its values: `armlet.worst_case`.

    minimise over p in the box   margin(run with the values p)

`margins` defines the margin, and `cube_search` the search. The smallest margin that was found bounds the worst case from one side only: the
true worst case is at least as bad.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..arguments import integer, shown
from ..border import border, bordered
from ..errors import InputError, SolveError
from ..pickling import sealed
from ..progress import search_reporter
from ..run.balances import quiet
from ..run.gradients import MOVING
from ..run.records import Run
from ..scenario import Scenario
from ..status import Status, having
from .chunk import run_chunk
from .cube_search import Axis, CubeSearch
from .derivatives import loss_and_slopes
from .execution import SweepTable, metrics_arguments
from .margins import Criterion
from .parameter_space import MOST, Cells, ListedCells, columns, drawn, place_in, rate_in, value_at

__all__ = ["WorstCase", "worst_case"]

Array: TypeAlias = NDArray[np.float64]
Row: TypeAlias = dict[str, Any]

#: Largest number of runs whose records are kept at once.
MOST_RECORDED = 64
#: Paths of `[run]` with derivatives. All other ones change the method or the samples.
STARTS = ("run.q0", "run.v0", "run.theta0", "run.theta_dot0")
SEED = "run.sample_time.seed"


@bordered
@sealed
@dataclass(frozen=True, eq=False)
class WorstCase:
    """The result of `worst_case`: a lower bound of how bad the worst case is. The true smallest margin is at most `margin`.

    Attributes:
        margin: the smallest margin, that of `run`. It is -infinity for a run that ended early.
        values: the values of this run by path.
        scenario: the scenario with these values.
        run: the run of `scenario`. A run that ended early is partial.
        criterion: the criterion as text.
        tried: every run of the search, in order: `cell`, a column per path, `status`, `margin`, and the `stage` "start", "gradient" or
            "local".
        runs: number of runs.
        gradients: number of computed gradients.
        failed: number of runs that ended early.
        converged: whether the local search reached its smallest step.
        notes: reasons why a part of the search was left out, such as a loop without derivatives.
    """

    margin: float
    values: dict[str, Any]
    scenario: Scenario
    run: Run
    criterion: str
    tried: SweepTable
    runs: int
    gradients: int
    failed: int
    converged: bool
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        at = ", ".join(f"{path} = {value:.5g}" if isinstance(value, float) else f"{path} = {value}" for path, value in self.values.items())
        stages = ", ".join(f"{np.sum(self.tried['stage'] == name)} {name}" for name in ("start", "gradient", "local"))
        lines = [
            f"smallest margin found {self.margin:.6g} of {self.criterion} (lower bound of the worst case: the true one is at least as bad)",
            f"at {at}",
            f"{self.runs} runs ({stages}) and {self.gradients} gradients; {self.failed} runs ended early; "
            + ("converged" if self.converged else "stopped at the largest number of runs"),
        ]
        if self.run.status != Status.SUCCESS:
            lines.append(f"this run ended early: {self.run.status.name.lower()}")
        return "\n".join([*lines, *self.notes])

    def __repr__(self) -> str:
        return f"WorstCase(margin {self.margin:.6g}, {self.runs} runs, {self.run.status.name.lower()})"


@border
def worst_case(
    scenario: Scenario | str | PathLike[str],
    vary: Mapping[str, Any] | None = None,
    criterion: str | Mapping[str, Any] | Callable[[Any], Any] | None = None,
    *,
    runs: int | None = None,
    starts: int | None = None,
    seed: int | None = None,
    threads: int | None = None,
    progress: Callable[[int, float], object] | bool | None = None,
    **metrics: Any,
) -> WorstCase:
    """Search for the values of a scenario in a box with the smallest margin of a criterion.

    The result is a lower bound of how bad the worst case is: a worse one may exist. The search has three stages. Half of the runs are
    starts: the values of the scenario, corners of the box, and a Latin hypercube. From the best starts, projected steps follow the gradient
    of the margin (adjoint method) for all values with derivatives. A local search then varies all values. The same seed has the same
    result, to the bit, for every number of threads.

    A run that ends early has the margin -infinity, is counted, and ends the search after its stage.

    Args:
        scenario: the scenario, or the path of its file.
        vary: the box by path: `{"uniform": [low, high]}`, `{"log_uniform": [low, high]}`, `{"integers": [low, high]}`, a list of
            values, or `{"linspace": [a, b, n]}`. Every value of a scenario has a path: `"arm.payload.mass"`, `"run.q0[1]"`,
            `"plant.friction.coulomb[0]"`, `"run.sample_time.delay"`, `"run.sample_time.seed"`. None means the box of `[worst]`.
        criterion: one of three forms. None means the criterion of `[worst]`.
            Bounds by metric, one number or one per joint: `{"error_peak": 0.05, "tau_peak": [40.0, 20.0]}`. The margin is the smallest
            `1 - value / bound`. The name "limits" is the used share of the arm's limits of position, speed and torque.
            The name of a metric without a bound: the margin is its largest value with a minus sign, in its unit. "limits" has the bound 1.
            A function of a run: it returns the margin, or `(margin, slopes)` with slopes as for `armlet.gradient`. Without slopes, no
            gradient is used.
        runs: largest number of runs and gradients together, >= 8. None means the number of `[worst]`, or 400.
        starts: largest number of starts whose gradient is followed. None means the number of `[worst]`, or 4.
        seed: seed of the search. It does not affect the noise, whose seed is the value "run.sample_time.seed" of the scenario. None means
            the seed of `[worst]`, or 0.
        threads: number of threads, as for `simulate_batch`.
        progress: True writes the number of finished runs and the remaining time to standard error. A function is called with the number of
            finished runs and the smallest margin so far.
        **metrics: arguments of `armlet.metrics`: `band`, `settle`, `tolerance`, `reference`, `frame`.

    Returns:
        The values with the smallest margin, their scenario and run, and the table of all runs.

    Raises:
        InputError: an argument, or a scenario of the box, is not valid; the message names it.

    Source: docs/worst_case.md.

    >>> import armlet as al
    >>> law = {"kind": "ComputedTorque", "kp": 100.0, "kd": 20.0}
    >>> arm, motion = {"kind": "planar_pr", "A": 2.0, "B": 0.5, "C": 0.5}, {"kind": "Hold", "q": [1.0, 0.0]}
    >>> run = {"q0": [0.9, 0.0], "t_end": 1.0, "dt": 2e-3}
    >>> scenario = al.Scenario({"arm": arm, "model": arm, "motion": motion, "law": law, "run": run})
    >>> box = {"arm.A": {"uniform": [1.5, 3.0]}, "run.q0[0]": {"uniform": [0.9, 1.1]}}
    >>> found = al.worst_case(scenario, box, {"tau_peak": 25.0}, runs=60)
    >>> round(found.margin, 3), round(abs(found.values["run.q0[0]"] - 1.0), 3)  # at most 20 N, at an end of the interval
    (0.2, 0.1)
    """
    base = scenario if isinstance(scenario, Scenario) else Scenario.load(scenario)
    stated = base.data.get("worst", {})
    given: dict[str, Any] = {"vary": vary, "criterion": criterion, "runs": runs, "starts": starts, "seed": seed}
    given = {"runs": 400, "starts": 4, "seed": 0} | stated | {name: value for name, value in given.items() if value is not None}
    for name in ("vary", "criterion"):
        if name not in given:
            raise InputError(f"worst_case: {name} is missing: expected it as an argument or in the scenario's [worst]")
    budget, count = integer("worst_case", "runs", given["runs"], 8, MOST), integer("worst_case", "starts", given["starts"], 1, MOST)
    bare = Scenario({name: table for name, table in base.data.items() if name not in ("sweep", "worst")}, base.folder, base.name)
    measured = Criterion("worst_case", given["criterion"], metrics_arguments("worst_case", metrics, base))
    with _renamed():
        box = _box(given["vary"], given["seed"])
    loops = _Loops(bare, box, measured, threads)
    search = CubeSearch(loops.margins, loops.slope, [_axis(path, spec, measured) for path, spec in box.items()], budget, int(given["seed"]))
    report = search_reporter("worst_case", progress, "runs", budget)
    search.search(np.array([place_in(spec, value_at(bare.data, path)) for path, spec in box.items()]), count, report)
    if progress is True and search.left:
        report(budget, 0.0)
    values = loops.rows[search.best]
    found = base.replace(values)
    with quiet():
        run = found.run(throw=False)
    tried = {"cell": np.arange(len(loops.rows))} | columns(loops.rows) | {"status": np.concatenate(loops.status)}
    table = SweepTable(tried | {"margin": np.array(search.values), "stage": np.array(search.stages)})
    failed, notes = int(np.sum(~having(table["status"], Status.SUCCESS))), tuple(dict.fromkeys(loops.notes))
    counts = len(loops.rows), search.gradients, failed
    return WorstCase(measured.of_run(run), values, found, run, str(measured), table, *counts, search.converged, notes)


class _Loops:
    """The margins of the scenario at points of the unit cube, and their gradients."""

    def __init__(self, scenario: Scenario, box: Mapping[str, Any], criterion: Criterion, threads: int | None) -> None:
        self.scenario, self.box, self.criterion, self.threads = scenario, box, criterion, threads
        self.smooth = [path for path, spec in box.items() if _axis(path, spec, criterion).kind == "smooth"]
        #: Every run: its values and its status.
        self.rows: list[Row] = []
        self.status: list[NDArray[np.int32]] = []
        self.notes: list[str] = []

    def values(self, point: Array) -> Row:
        """Return the values by path at a point of the cube, (k,)."""
        return {path: drawn(spec, float(x)) for (path, spec), x in zip(self.box.items(), point, strict=True)}

    def margins(self, points: Array) -> Array:
        """Return the margins of S points (S, k), as (S,)."""
        rows, measure, found = [self.values(point) for point in points], self.criterion.measure, []
        cells = ListedCells({}, None, 0, rows, own_seeds=True)
        size = len(rows) if measure is None else MOST_RECORDED
        for start in range(0, len(rows), size):
            with _renamed():
                stop, metrics = min(start + size, len(rows)), self.criterion.metrics
                table = run_chunk(self.scenario, cells, start, stop, self.threads, metrics, strict=True, measure=measure)
            found.append(self.criterion.of_table(table))
            self.status.append(table["status"])
        self.rows += rows
        return np.concatenate(found)

    def slope(self, point: Array) -> Array | None:
        """Return the gradient of the margin at a point, (k,), zero for values without derivatives. Return None if it cannot be computed."""
        if not self.criterion.may_have_slopes:
            return None
        row = self.values(point)
        while self.smooth:
            try:
                with quiet():
                    _, slopes = loss_and_slopes("worst_case", self.criterion.loss, self.scenario, row, self.smooth)
            except (InputError, SolveError) as error:
                refused = [path for path in self.smooth if path.partition("[")[0] == str(getattr(error, "argument", "")).partition("[")[0]]
                self.notes.append(f"without {'a gradient' if not refused else 'the derivative by ' + ', '.join(refused)}: {error}")
                if not refused:
                    return None
                self.smooth = [path for path in self.smooth if path not in refused]
                continue
            each = dict(zip(self.smooth, slopes, strict=True))
            return np.array([each[path] * rate_in(spec, row[path]) if path in each else 0.0 for path, spec in self.box.items()])
        return None


def _box(vary: Any, seed: Any) -> Mapping[str, Any]:
    """Return the box by path. Raise InputError if an entry is not an interval or a list."""
    box = Cells.of(vary, 1, seed).vary
    for path, spec in box.items():
        if isinstance(spec, Mapping) and "normal" in spec:
            expected = "uniform, log_uniform, integers or a list of values"
            raise InputError(f'worst_case: vary."{path}" has no bounds: expected {expected}, got {shown(vary[path])}')
    return box


def _axis(path: str, spec: Any, criterion: Criterion) -> Axis:
    """Return the coordinate of a path. The gradient omits values of `[run]` other than the start, and references of measured errors."""
    if not isinstance(spec, Mapping):
        numbers = all(isinstance(value, int | float) for value in spec)
        sorted_numbers = numbers and path != SEED and (spec == sorted(spec) or spec == sorted(spec, reverse=True))
        return Axis("ordered" if sorted_numbers else "free", len(spec))
    ((kind, (low, high)),) = spec.items()
    if kind == "integers":
        seed = path == SEED
        return Axis("free" if seed else "ordered", high - low + 1, consecutive=seed)
    still = path.startswith("run.") and not path.startswith(STARTS)
    moving = criterion.measures_errors and MOVING.match(path)
    return Axis("ordered" if still or moving or not criterion.may_have_slopes else "smooth")


@contextmanager
def _renamed() -> Iterator[None]:
    """Name `worst_case` in errors about cells, instead of `sweep`."""
    try:
        yield
    except InputError as error:
        raise InputError(re.sub(r"^sweep: (\$\.sweep\.)?", "worst_case: ", str(error))) from None
