"""A chunk of a sweep: consecutive cells that one worker runs as batches. A *cell* is one run with one set of values of the
varied paths.

If a cell raises an error, the other cells still run. All cells must have the same metrics.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..errors import ArmletError, InputError
from ..run.balances import quiet
from ..run.records import BatchRun
from ..run.sampling import Sampling
from ..run.simulation import simulate_batch
from ..scenario import Scenario
from ..status import Status, having
from .parameter_space import Cells, columns

__all__ = ["TRIES", "Chunk", "Columns", "Measure", "joined", "of_cell", "run_chunk"]

Columns = dict[str, NDArray[Any]]
#: A function that computes columns from the records of a batch, one row per run.
Measure = Callable[[BatchRun], Columns]
STATES = ("q0", "v0", "theta0", "theta_dot0")
#: Largest number of attempts to run a cell that raises an error or ends its worker process.
TRIES = 3
#: Largest number of characters of an error text in the table.
LONGEST = 500


@dataclass(frozen=True)
class Chunk:
    """The cells from `start` (inclusive) to `stop` (exclusive) of a sweep, with the scenario and the options of their runs."""

    scenario: Scenario
    cells: Cells
    start: int
    stop: int
    threads: int | None
    metrics: Mapping[str, Any]

    def __len__(self) -> int:
        return self.stop - self.start

    def run(self) -> Columns:
        """Run the cells, and return their rows of the table."""
        return run_chunk(self.scenario, self.cells, self.start, self.stop, self.threads, self.metrics)

    def singles(self) -> list[Chunk]:
        """Return one chunk for each cell."""
        return [replace(self, start=i, stop=i + 1) for i in range(self.start, self.stop)]

    def failed(self, error: str) -> Columns:
        """Return the rows of a chunk without a result. Each row has the text `error`."""
        values = [self.cells[i] for i in range(self.start, self.stop)]
        return _rows(self.start, values, dict.fromkeys(range(len(self)), error), np.full(len(self), Status.INTERRUPTED, dtype=np.int32), {})


def of_cell(i: int, changes: Mapping[str, Any], make: Callable[[Mapping[str, Any]], Any]) -> Any:
    """Return `make(changes)`. The number `i` and the values of the cell are added to the text of an error."""
    try:
        return make(changes)
    except ArmletError as error:
        shown = ", ".join(f"{path} = {value}" for path, value in changes.items())
        raise InputError(f"sweep: cell {i} ({shown}): {error}") from None


def run_chunk(
    scenario: Scenario,
    cells: Cells,
    start: int,
    stop: int,
    threads: int | None,
    metrics: Mapping[str, Any],
    *,
    strict: bool = False,
    measure: Measure | None = None,
) -> Columns:
    """Run the cells from `start` (inclusive) to `stop` (exclusive), and return their rows of the table.

    A cell that raises an error has `Status.INTERRUPTED`, NaN, and the text in the column `error`. This column is absent if no cell of the
    chunk has an error. With `strict` the first error is raised instead. `measure` computes the columns from the records of a batch. None
    means the metrics.
    """
    made: dict[str, Any] = {}
    errors: dict[int, str] = {}

    def build(changes: Mapping[str, Any]) -> tuple[Scenario, Any]:
        one = scenario._varied(changes)
        return one, one._build(made)

    values = [cells[i] for i in range(start, stop)]
    options, shown = dict[str, Any](), ""
    groups: dict[tuple[Any, ...], list[tuple[int, Any]]] = {}
    seeds: dict[tuple[Any, ...], int] = {}
    for row in range(stop - start):
        try:
            one, built = of_cell(start + row, values[row], build)
        except Exception as error:
            if strict:
                raise
            errors[row] = _text(error)
            continue
        before, options = options, {key: value for key, value in one.data["run"].items() if key not in STATES}
        sampling = options.get("sample_time")
        if isinstance(sampling, Mapping):
            options["sample_time"] = {key: value for key, value in sampling.items() if key != "seed"}
        if options != before:
            shown = repr(options)
        kind = (type(built.plant).__name__, type(built.law).__name__, built.plant.arm.n, shown)
        key = (*kind, 0)
        if isinstance(sampling, Mapping):
            # Row j of a batch has the seed `seed + j`. So cells with noise or jitter share a batch only if their seeds are consecutive.
            seed = cells.sampling_seed(start + row, sampling.get("seed", 0))
            key = next((k for k in groups if k[:-1] == kind and seeds[k] == seed - 1), (*kind, row))
            seeds[key] = seed
        groups.setdefault(key, []).append((row, built))
    found: Columns = {}
    status = np.full(stop - start, Status.INTERRUPTED, dtype=np.int32)
    for members in groups.values():
        for ran, batch in _batches(members, start, cells, (threads, metrics, measure), None if strict else errors):
            index = [row for row, _ in ran]
            part = batch.metrics().columns() if measure is None else measure(batch)
            if found and set(part) != set(found):
                raise InputError("sweep: cells have different metrics: expected one number of joints and one kind of plant in all cells")
            for name, column in part.items():
                found.setdefault(name, np.full(stop - start, np.nan))[index] = column
            status[index] = batch.status
    return _rows(start, values, errors, status, found)


def _rows(start: int, values: Sequence[Mapping[str, Any]], errors: Mapping[int, str], status: NDArray[np.int32], found: Columns) -> Columns:
    """Return the rows of the table from cell `start` on. `values` are the values of the cells by path."""
    table: Columns = {"cell": np.arange(start, start + len(values))} | columns(values) | {"status": status} | found
    return table | ({"error": np.array([errors.get(row, "") for row in range(len(values))])} if errors else {})


Members = list[tuple[int, Any]]
#: Number of threads, arguments of `armlet.metrics`, and the function of `run_chunk`.
How = tuple[int | None, Mapping[str, Any], Measure | None]


def _batches(
    members: Members, start: int, cells: Cells, how: How, errors: dict[int, str] | None, tried: int = 1
) -> list[tuple[Members, BatchRun]]:
    """Run the cells as one batch. If the batch raises an error, run each cell alone, and store the errors of single cells in `errors`.

    If `errors` is None, raise the error of the batch.
    """
    try:
        return [(members, _batch(members, start, cells, *how))]
    except Exception as error:
        if errors is None:
            raise
        if len(members) > 1:
            return [each for member in members for each in _batches([member], start, cells, how, errors, tried + 1)]
        # An ArmletError of an invalid cell would be raised again, so the cell is not repeated.
        if tried < TRIES and not isinstance(error, ArmletError):
            return _batches(members, start, cells, how, errors, tried + 1)
        errors[members[0][0]] = _text(error)
        return []


def _text(error: Exception) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())[:LONGEST]


def _batch(
    members: Members, start: int, cells: Cells, threads: int | None, metrics: Mapping[str, Any], measure: Measure | None
) -> BatchRun:
    given = dict(members[0][1].arguments)
    given.pop("sensitivity", None)
    for name in STATES:
        if name in given:
            given[name] = np.array([built.arguments[name] for _, built in members], dtype=np.float64)
    if given.get("method", "rk4") in _core.ADAPTIVE_METHODS and given.get("t_eval") is None:
        given |= {"t_eval": np.linspace(0.0, given["t_end"], 1001), "record_every": 1}
    if isinstance(sampling := given.get("sample_time"), Sampling):
        given["sample_time"] = replace(sampling, seed=cells.sampling_seed(start + members[0][0], sampling.seed))
    plants, laws = [built.plant for _, built in members], [built.law for _, built in members]
    with quiet():  # the table has the columns `energy_error` and `input_ratio`
        given.setdefault("check_limits", False)  # in a sweep `rehearse` has checked the first and the last cell
        kept: dict[str, Any] = {"keep": "metrics", "metrics": metrics} if measure is None else {"keep": "all"}
        return simulate_batch(plants, laws, **given, threads=threads, **kept)


def joined(parts: Sequence[Columns]) -> Columns:
    """Join the columns of chunks. The metrics are NaN in the rows of a chunk in which all cells failed."""
    names = dict.fromkeys(name for part in parts for name in part)
    known = [set(part) - {"error"} for part in parts if not having(part["status"], Status.INTERRUPTED).all()]
    if any(each != known[0] for each in known):
        raise InputError("sweep: cells have different metrics: expected one number of joints and one kind of plant in all cells")

    def column(name: str, part: Columns) -> NDArray[Any]:
        return part[name] if name in part else np.full(len(part["cell"]), "" if name == "error" else np.nan)

    order = [name for name in names if name != "error"] + ["error"] * ("error" in names)
    return {name: np.concatenate([column(name, part) for part in parts]) for name in order}
