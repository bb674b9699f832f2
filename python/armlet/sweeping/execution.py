"""Many runs of one scenario: every cell of a grid, or random draws. They run on threads, processes or a cluster, and can be resumed.

A *cell* is one run with one set of values of the varied paths. A *chunk* is a group of consecutive cells, which a worker of the executor
runs as batches. The calling process stores the finished chunks. On one instruction set, the division into chunks does not affect the bits
of the table.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..arguments import choice, file_path, integer, number, shown
from ..border import border, bordered
from ..errors import InputError
from ..pickling import sealed
from ..progress import Progress, reporter
from ..run.export import pandas_for, to_csv
from ..run.metrics import MEASURES, require_one_band
from ..scenario import Scenario
from ..status import Status
from .chunk import Chunk, Columns, joined, of_cell
from .parameter_space import Cells, columns
from .store import Store

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["SweepTable", "sweep"]

# Largest number of integration steps of a chunk, summed over its cells. A chunk of 8 cells, the smallest size, may have more.
STEPS = 10_000_000


@bordered
@sealed
class SweepTable(dict[str, NDArray[Any]]):
    """The table of a sweep, a dict of columns with one row per cell.

    The columns are `cell`, the varied paths, `status` (integers of `armlet.Status`) and the metrics. If a cell raised an error or its
    worker died, a last column `error` contains the text of the error. The text is empty for the other cells.
    """

    def to_pandas(self) -> pd.DataFrame:
        """Convert the table to a table of pandas. It requires pandas (extra `data`).

        Returns:
            A pandas table, indexed by `cell`.
        """
        frame: pd.DataFrame = pandas_for("SweepTable.to_pandas").DataFrame(dict(self)).set_index("cell")
        return frame

    def to_csv(self, path: str | PathLike[str]) -> Path:
        """Write the table as CSV. The file is complete or absent.

        Args:
            path: path of the file.

        Returns:
            The path of the file.
        """
        to_csv(self, path)
        return Path(path)

    def plot(self, quantity: str | None = None, fig: Figure | None = None) -> Axes:
        """Draw a metric over the first two varied quantities.

        Args:
            quantity: name of the metric's column; None means the first metric.
            fig: a matplotlib figure for the drawing; None makes one with pyplot.

        Returns:
            The axes.

        Raises:
            InputError: no number is varied, or no column has this name.
            ImportError: matplotlib is not installed.
        """
        from ..figures.sweep import plot

        return plot(self, quantity, fig)

    @property
    def rows(self) -> int:
        """The number of cells."""
        return len(self["cell"])

    def __str__(self) -> str:
        status = self.get("status", np.empty(0))  # the table of a search has no status
        ended = ", ".join(f"{np.sum(status == each)} {each.name.lower()}" for each in Status if np.any(status == each))
        head = f"{self.rows} runs: {ended}" if ended else f"{self.rows} rows"
        errors = self.get("error", np.empty(0, dtype=str))
        if np.any(errors != ""):
            first = int(np.argmax(errors != ""))
            head += f"\n{np.sum(errors != '')} cells have an error; cell {self['cell'][first]}: {errors[first]}"
        lines = [head, f"{'column':<28} {'least':>12} {'median':>12} {'largest':>12}"]
        for name, values in self.items():
            if name not in ("cell", "status") and values.dtype.kind == "f":
                known = values[np.isfinite(values)]
                parts = (known.min(), np.median(known), known.max()) if len(known) else ()
                lines.append(f"{name:<28} " + (" ".join(f"{part:12.5g}" for part in parts) or f"{'-':>12}"))
        return "\n".join(lines)

    __repr__ = __str__


@border
def sweep(
    scenario: Scenario | str | PathLike[str],
    vary: Mapping[str, Any] | None = None,
    *,
    draws: int | None = None,
    seed: int | None = None,
    out: str | PathLike[str] | None = None,
    executor: Executor | None = None,
    chunk: int | None = None,
    threads: int | None = None,
    progress: Callable[[int, int], object] | bool | None = None,
    **metrics: Any,
) -> SweepTable:
    """Run a scenario for every cell of a grid, or for random draws, and compute the metrics of every run.

    The table has the same bits for every executor and every number of workers (on one instruction set). With `out`, finished chunks are
    stored in this folder. The same call resumes an interrupted sweep.

    Args:
        scenario: the scenario, or the path of its file.
        vary: values by path (`"law.kd[0]"`): a list, `{"linspace": [a, b, n]}` or `{"geomspace": [a, b, n]}`. With `draws` also
            `{"uniform": [a, b]}`, `{"log_uniform": [a, b]}`, `{"normal": [mean, deviation]}`. None means the scenario's `[sweep]`.
        draws: number of random cells, at most 10^8. None runs every combination of the listed values. If `vary` is None too, the draws of
            `[sweep]` are used.
        seed: seed of the draws, and of noise and jitter in the runs. None means the seed of `[sweep]`, or 0 if it has none.
        out: path of the folder for finished chunks and the file `sweep.json`; None stores nothing.
        executor: any `concurrent.futures.Executor`, such as `ProcessPoolExecutor(8)` or dask's `client.get_executor()`. None uses the
            threads of this process.
        chunk: number of cells per chunk. None means that of `[sweep]`. If it has none: up to 256, and fewer for long runs.
        threads: number of threads per chunk. None means 1 with an executor, and else the default of `simulate_batch`.
        progress: True writes the number of finished cells and the remaining time to standard error. A function is called with the number
            of finished cells and the number of all cells.
        **metrics: arguments of `armlet.metrics`: `band`, `settle`, `tolerance`, `reference`, `frame`.

    Returns:
        The table. The metrics of a failed run are NaN. A cell that raises an error, or whose worker dies, is tried at most three times.
        Then it has `Status.INTERRUPTED`, NaN and the text in the column `error`, and the sweep continues.

    Raises:
        InputError: an argument, or the first or the last cell is not valid, cells have different metrics, or the folder `out` has another
            sweep.
        FormatError: the file `sweep.json` in `out` is damaged, or another version wrote it.
        SolveError: the executor's workers died and cannot be replaced, or new workers cannot start. A `ProcessPoolExecutor` is replaced,
            and Dask replaces its workers. Finished chunks remain in `out`.

    Source: docs/sweeps.md.

    >>> import armlet as al
    >>> law = {"kind": "ComputedTorque", "kp": 100.0, "kd": 20.0}
    >>> arm, motion = {"kind": "planar_pr", "A": 2.0, "B": 0.5, "C": 0.5}, {"kind": "Hold", "q": [1.0, 0.0]}
    >>> scenario = al.Scenario({"arm": arm, "motion": motion, "law": law, "run": {"q0": [0.0, 0.0], "t_end": 2.0, "dt": 1e-3}})
    >>> table = al.sweep(scenario, {"law.kp": [50.0, 100.0], "law.kd": {"linspace": [10.0, 20.0, 3]}})
    >>> table["law.kd"], table["settling_time"].round(2)
    (array([10., 15., 20., 10., 15., 20.]), array([0.84, 0.92, 1.4 , 0.81, 0.58, 0.58]))
    """
    base = scenario if isinstance(scenario, Scenario) else Scenario.load(scenario)
    stated = base.data.get("sweep", {})
    cells = cells_of(base, vary, draws, seed)
    given = stated.get("chunk") if chunk is None else chunk
    chunk = _chunk_size(base.data["run"]) if given is None else integer("sweep", "chunk", given, 1)
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise InputError(f"sweep: executor is of the wrong type: expected an Executor of concurrent.futures or None, got {shown(executor)}")
    report = reporter("sweep", progress, "cells")
    if threads is not None:
        threads = integer("sweep", "threads", threads, 1)
    folder = None if out is None else file_path("sweep", out, "out")
    metrics = metrics_arguments("sweep", metrics, base)
    bare = Scenario({name: table for name, table in base.standalone().data.items() if name != "sweep"}, base.folder, base.name)
    rehearse(bare, cells)
    store = None
    if folder is not None:
        what = {"scenario": bare.data, "vary": cells.vary, "draws": cells.draws, "seed": cells.seed, "metrics": metrics}
        store = Store(Path(folder), what | {"armlet": _core.__version__}, chunk)
        chunk = store.chunk
    done: dict[int, Columns] = {}
    missing = []
    for start in range(0, len(cells), chunk):
        stored = store.read(start, min(start + chunk, len(cells))) if store else None
        if stored is None:
            missing.append(start)
        else:
            done[start] = stored
    finished = sum(len(stored["cell"]) for stored in done.values())
    if isinstance(report, Progress):
        report.start(finished)
    each = threads if executor is None else threads or 1
    chunks = (Chunk(bare, cells, start, min(start + chunk, len(cells)), each, metrics) for start in missing)
    from .workers import results  # imported here, because the import of process pools is slow

    for start, result in results(chunks, executor, out):
        if store:
            store.write(start, result)
        done[start] = result
        finished += len(result["cell"])
        if report is not None:
            report(finished, len(cells))
    if store:
        store.tidy()
    return SweepTable(joined([done[start] for start in sorted(done)]))


def cells_of(scenario: Scenario, vary: Mapping[str, Any] | None = None, draws: int | None = None, seed: int | None = None) -> Cells:
    """Return the cells of the arguments. Without `vary`, the values and draws of `[sweep]` are used; without `seed`, its seed or 0."""
    stated = scenario.data.get("sweep", {})
    if vary is None and "vary" not in stated:
        raise InputError("sweep: vary is missing: expected values by path, as an argument or in the scenario's [sweep]")
    if draws is None and vary is None:
        draws = stated.get("draws")
    return Cells.of(stated["vary"] if vary is None else vary, draws, stated.get("seed", 0) if seed is None else seed)


def rehearse(scenario: Scenario, cells: Cells) -> None:
    """Check the first and the last cell, so that most errors are raised before the sweep writes a file.

    Raises:
        InputError: a cell is not a valid scenario.
    """
    ends = sorted({0, len(cells) - 1})
    for i in ends:
        of_cell(i, cells[i], lambda changes: scenario.replace(changes).check())
    columns([cells[i] for i in ends])


def _chunk_size(run: Mapping[str, Any]) -> int:
    steps = run["t_end"] / run["dt"] if "dt" in run else 1000
    return int(min(256, max(8, STEPS // (steps + 1) // 8 * 8)))


def metrics_arguments(function: str, given: Mapping[str, Any], scenario: Scenario) -> dict[str, Any]:
    """Return the keywords of `armlet.metrics` as numbers, lists and the name `frame`, which JSON can store."""
    n = len(scenario.data["run"]["q0"])
    shapes: dict[str, list[tuple[int | str, ...]]] = {"band": [(), (n,)], "reference": [(n,), ("K", n)]}
    plain: dict[str, Any] = {}
    for name, value in given.items():
        choice(function, "metrics", name, MEASURES)
        if value is None or name == "frame":
            plain[name] = value
        elif name in shapes:
            plain[name] = _core.numbers(function, name, value, *shapes[name]).tolist()
        else:
            plain[name] = number(function, name, value)
    require_one_band(function, plain.get("band"), plain.get("settle"))
    return plain
