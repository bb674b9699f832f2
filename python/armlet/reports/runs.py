"""The reports of a run and of a batch: `run.report(path)` and `batch.report(path)`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arguments import instance, require_shallow
from ..figures.batch import plot as plot_batch
from ..figures.panels import joint_names
from ..figures.run import plot as plot_run
from ..run.metrics import PER_JOINT, PER_RUN, PER_TASK, TOLERANCE, Metrics, metrics, violations
from ..run.named_numbers import named_numbers
from ..run.recorded import Recorded
from ..scenario.toml import toml_text
from ..status import Status
from .page import figure_section, section, table, write_report

__all__ = ["write_batch", "write_run"]

#: Largest number of entries of a number of the loop that the table shows.
SHOWN = 12
#: Largest number of failed runs of a batch in the table.
FAILED = 50


def write_run(run: Recorded, path: str | PathLike[str], title: str | None, inputs: Mapping[str, Any] | None) -> None:
    """Write the report of a run. `title` is the heading, None for the name of the law. `inputs` are tables that are shown as TOML."""
    found = _measured(run)
    status: Status = run.status
    end = f"to {run.t[-1]:g} s in {len(run.t)} records" if len(run.t) else "without records"
    verdict = "ok" if status in (Status.SUCCESS, Status.EVENT) else "FAILED"
    body = [
        f'<p class="{verdict}">{escape(f"{status.name.lower()}: {status.advice}")}</p>',
        f"<p>{escape(f'{_who(run)}, {end}')}</p>",
        _figures(run, plot_run, "Run over time", len(run.t) > 1),
    ]
    if found is not None:
        body += [_joints(run, found), _whole(found), _monitors(run)]
    body += [_numbers(run), _statistics(run)]
    _write("Run.report", path, title or f"Run of {run.law_name or 'a loop'}", inputs, body)


def write_batch(batch: Recorded, path: str | PathLike[str], title: str | None, inputs: Mapping[str, Any] | None) -> None:
    """Write the report of a batch, like `write_run`."""
    ended = [(each, np.flatnonzero(batch.status == int(each))) for each in Status]
    counts = [[each.name.lower(), str(len(rows)), each.advice] for each, rows in ended if len(rows)]
    failed = [(int(row), each) for each, rows in ended if each not in (Status.SUCCESS, Status.EVENT) for row in rows]
    body = [f"<p>{escape(f'{_who(batch)}, {len(batch.status)} runs')}</p>"]
    body.append(section("Ends of the runs", table("Number of runs by status", ["status", "runs", "meaning"], counts)))
    recorded = batch.q.ndim == 3 and batch.q.shape[1] > 1 and batch.t.ndim == 1
    body.append(_figures(batch, plot_batch, "Runs over time: median, and range from the smallest to the largest value", recorded))
    found = _measured(batch)
    if found is not None:
        body.append(_spread(found))
    if failed:
        rows = [[f"run {row}", each.name.lower()] for row, each in sorted(failed)[:FAILED]]
        body.append(section("Runs that ended early", table(f"The first {len(rows)} of {len(failed)} runs", ["run", "status"], rows)))
    body.append(_statistics(batch))
    _write("BatchRun.report", path, title or f"Batch of {batch.law_name or 'a loop'}", inputs, body)


def _write(function: str, path: str | PathLike[str], title: str, inputs: Mapping[str, Any] | None, body: list[str]) -> None:
    if inputs is not None:
        instance(function, "inputs", inputs, Mapping, "tables by name, such as scenario.data")
        require_shallow(function, "inputs", inputs)
        text = escape(toml_text(inputs))
        body.append(section("Inputs", f"<details open><summary>Tables, with methods and seeds</summary><pre>{text}</pre></details>"))
    write_report(function, path, title, body)


def _who(run: Recorded) -> str:
    plant = "" if run._plants[0] is None else f" on {type(run._plants[0]).__name__}"
    joints = run.q.shape[-1]
    return f"{run.law_name or 'a loop'}{plant}, {joints} joint{'s' if joints > 1 else ''}"


def _figures(run: Recorded, draw: Any, what: str, recorded: bool) -> str:
    if not recorded:
        return section("Figure", "<p>No figure: the runs have no common series over time.</p>")
    return figure_section(lambda figure: draw(run, figure), what)


def _measured(run: Recorded) -> Metrics | None:
    """Return the metrics of a run or batch, or None if it has only its last record."""
    last_only = run.q.shape[-2] == 1 and np.any(run.t > 0.0) and "error_rms" not in run.stats
    return None if last_only or not run.q.shape[-2] else metrics(run)


def _names(run: Recorded) -> list[str]:
    return [name.replace(r"\$", "$") for name in joint_names(run)]


def _text(value: float, unit: str = "1") -> str:
    return "-" if np.isnan(value) else f"{value:.6g}" + (f" {unit}" if unit != "1" else "")


def _joints(run: Recorded, found: Metrics) -> str:
    names = [name for name in PER_JOINT if name in found]
    rows = [[joint, *(_text(float(found[name][i]), found.unit(name, i)) for name in names)] for i, joint in enumerate(_names(run))]
    return section("Joints", table("Errors and inputs of each joint", ["joint", *names], rows))


def _whole(found: Metrics) -> str:
    rows = [[name, _text(float(found[name]), found.unit(name))] for name in PER_RUN if name in found]
    for name in PER_TASK:
        rows += [[f"{name}, task {i + 1}", _text(float(value), "m")] for i, value in enumerate(found.get(name, ()))]
    return section("Run", table("Numbers of the whole run", ["metric", "value"], rows))


def _monitors(run: Recorded) -> str:
    if not run.monitors:
        return section("Monitors", "<p>The run has no monitors.</p>")
    judged = violations(run.monitors, TOLERANCE)
    rows = []
    for name, values in run.monitors.items():
        known = np.abs(values[np.isfinite(values)])
        count = judged.get(name)
        verdict = "-" if count is None else "FAILED" if count > 0 else "ok"
        rows.append([name, _text(float(known.max()) if len(known) else np.nan), "-" if count is None else f"{int(count)}", verdict])
    caption = f"Largest magnitude, and number of records above the relative tolerance {TOLERANCE:g}"
    return section("Monitors", table(caption, ["monitor", "largest", "records above", "verdict"], rows))


def _numbers(run: Recorded) -> str:
    plant, law = run._plants[0], run._laws[0]
    if plant is None or law is None:
        return section("Loop", "<p>A run from a file has no plant and law.</p>")
    start = {"q0": run.q[0], "v0": run.v[0]} if len(run.t) else {}
    rows = [[name, _entries(value)] for name, value in named_numbers(plant, law, start).items()]
    return section("Loop", table("Numbers of plant, law and start, in rad, m, kg, s, N", ["number", "value"], rows))


def _entries(value: NDArray[np.float64]) -> str:
    flat = value.ravel()
    text = ", ".join(f"{each:.6g}" for each in flat[:SHOWN])
    shape = "x".join(map(str, value.shape))
    return text + (f", .. ({shape} numbers)" if len(flat) > SHOWN else "")


def _statistics(run: Recorded) -> str:
    rows = [[name, f"{value:.6g}" if isinstance(value, float) else str(value)] for name, value in run.stats.items() if np.ndim(value) == 0]
    return section("Statistics", table("Counts of the integration", ["count", "value"], rows)) if rows else ""


def _spread(found: Metrics) -> str:
    rows: list[Sequence[str]] = []
    for name, values in found.columns().items():
        known = np.flatnonzero(np.isfinite(values))
        if len(known):
            column = np.asarray(values)[known]
            parts = (column.min(), np.median(column), column.max())
            rows.append([name, *(_text(float(part)) for part in parts), str(known[int(column.argmax())])])
    head = ["metric", "smallest", "median", "largest", "run of the largest"]
    return section("Metrics", table("Metrics over the runs that reached their end, in rad, m, s, N m or N", head, rows))
