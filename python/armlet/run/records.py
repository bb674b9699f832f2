"""The result of a simulation: arrays over time, status, counts of steps and evaluations, and monitors that check the result."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..border import border, bordered
from ..errors import InputError
from ..status import Status
from .active_limits import LimitHold, limit_holds
from .events import State
from .export import pandas_for, to_csv, to_parquet, to_xarray
from .metrics import Metrics, metrics
from .recorded import SERIES, Array, Recorded
from .sensitivity import of_row
from .speeds import speed_ratio
from .storage import read, save
from .task_errors import unstacked

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from ..figures.animation import Film

__all__ = ["BatchRun", "Run", "load"]


class _Stored(Recorded):
    """The methods that single runs and batches have in common."""

    def metrics(self, **keywords: Any) -> Metrics:
        """Compute errors, settling time, overshoot, torques, time outside of limits, violated monitors: see `armlet.metrics`."""
        return metrics(self, **keywords)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the run to one file, without pickle. The file is complete or absent. `armlet.load` reads it."""
        save(self, path)


@bordered
class Run(_Stored):
    """One simulated run: its status, its motion and torques over time, and its monitors.

    Attributes:
        t: times, (K,), s.
        q, v: joint positions and velocities, (K, n), rad or m, rad/s or m/s.
        tau: the plant's input, (K, n), N m or N. At a jump it is the input after the jump. For elastic arms it is the torque of the motors.
            Under velocity control it is the commanded velocity, rad/s or m/s.
        estimate: the state of the law, (K, p); None for laws without a state. For Adaptive it is the parameter estimate, and then the
            filters of a composite law. For CartesianImpedance it is the integral wrench, and for PID the integral torque, with `ki`, and
            then the filters. For Guarded it is the state of the inner law, and then that of the observer.
        theta, theta_dot: motor positions and velocities of elastic arms, (K, n), rad or m, rad/s or m/s; else None.
        friction: torques of the `StickSlip` or `LuGre` friction of the joints or motors, (K, n), N m or N; else None.
        bristles: the deflections of the bristles of `LuGre` friction, (K, n), rad or m; else None.
        status: how the run ended (`armlet.Status`), with advice.
        stats: counts of steps, evaluations and rejected steps. With the status EXCESS_ACCURACY, `stats["coarsen"]` is the factor by which
            both tolerances must be multiplied.
        monitors: the monitored quantities by name, (K,) each, such as `energy_balance` in J.
        events: the crossings of the events (`armlet.Events`); None without events.
        sensitivity: derivatives of the series (`armlet.Sensitivity`) by the names of `simulate(sensitivity=)`. None without
            names, and for a run that ended early.
    """

    status: Status

    @cached_property
    def active(self) -> list[LimitHold] | None:
        """The bounds that hold a level of a priority law, and when: a list of `armlet.LimitHold`. None for other laws, and from a file.

        The law is evaluated at the records, without the delay and the noise of a `Sampling`.
        """
        return limit_holds(self._laws[0], self._period, self.t, self.q, self.v)

    def sample(self, t: ArrayLike) -> State:
        """Evaluate the state at times between the records, from the polynomials that `simulate(dense=True)` stored.

        Args:
            t: a time of the run, or K times, (K,), s.

        Returns:
            An `armlet.State`: positions, velocities and the other states at these times, `(n,)` or `(K, n)`.

        Raises:
            InputError: the run stored no polynomials, or a time is outside of the run.

        >>> import armlet as al
        >>> law = al.PDGravity(al.pendulum(1.0, 5.0), [0.5], kp=20.0, kd=5.0)
        >>> run = al.simulate(al.RigidArm(al.pendulum(1.0, 5.0)), law, [0.0], t_end=1.0, method="dop853", dense=True)
        >>> run.sample([0.25, 0.5]).q.shape
        (2, 1)
        """
        if self._dense is None:
            raise InputError("Run.sample: the run kept no polynomials: expected a run of simulate(dense=True) with an adaptive method")
        dense, states = self._dense
        values, n = dense(t), self.q.shape[-1]
        parts = [values[..., k : k + n] if k < states else None for k in range(n, 4 * n, n)]
        estimate = values[..., states:] if values.shape[-1] > states else None
        return State(values[..., :n], parts[0], parts[1], parts[2], estimate)

    __call__ = sample

    def _set_status(self, status: Any) -> None:
        self.status = Status(int(status))

    def plot(self, fig: Any = None) -> Any:
        """Draw the figure for the run's law, and return its axes. It requires matplotlib (extra `plot`).

        Args:
            fig: a matplotlib figure for the drawing; None makes one with pyplot.

        Returns:
            The axes of the figure, an array of `matplotlib.axes.Axes`.
        """
        from ..figures.run import plot

        return plot(self, fig)

    def animate(self, path: str | PathLike[str], arm: Any = None, **keywords: Any) -> Film:
        """Write a film of the arm in motion, GIF or MP4. It requires matplotlib (extra `plot`). A notebook shows the film below the cell.

        Args:
            path: path of the file. The format is MP4 if the name ends in .mp4, else GIF.
            arm: the arm. It is required for a run that was loaded from a file, which has no arm.
            **keywords: options of `armlet.figures.animation.animate`: `fps`, `speed`, `size` and `view`.

        Returns:
            The film, an `armlet.figures.animation.Film`, which is a path of the file.
        """
        from ..figures.animation import animate

        return animate(self, path, arm, **keywords)

    def report(self, path: str | PathLike[str], *, title: str | None = None, inputs: Mapping[str, Any] | None = None) -> None:
        """Write a report as one HTML file without network: figure, metrics, monitors with verdicts, the loop's numbers, versions.

        Without matplotlib (extra `plot`) the report has a sentence in place of the figure.

        Args:
            path: path of the file. The file is complete or absent.
            title: heading of the report. None means the name of the law.
            inputs: tables that the report shows as text, such as `scenario.data` with the method and the seeds.

        Raises:
            InputError: an argument is not valid; the message names it.
            OSError: the file cannot be written.
        """
        from ..reports.runs import write_run

        write_run(self, path, title, inputs)

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the table of `to_pandas` with its index as CSV. pandas is not required.

        Args:
            path: path of the file. Every number has enough digits to be read back exactly.
        """
        to_csv({"t": self.t, **self._table()}, path)

    def to_parquet(self, path: str | PathLike[str]) -> None:
        """Write the table of `to_pandas` as Parquet. It requires pyarrow (extra `data`).

        Args:
            path: path of the file.
        """
        to_parquet({"t": self.t, **self._table()}, path)

    def to_xarray(self) -> xr.Dataset:
        """Convert the series of the run to a dataset of xarray. It requires xarray (extra `data`).

        Returns:
            A dataset with the coordinates `t` (s) and `joint`. The attribute `units` of each series is its unit.
        """
        return to_xarray(self)

    def to_pandas(self) -> pd.DataFrame:
        """Convert the series of the run to a table of pandas. It requires pandas (extra `data`).

        Returns:
            A table with one row per recorded time (index `t`, s) and the columns q1.., v1.., tau1.., .., and the monitors.
        """
        pandas = pandas_for("Run.to_pandas")
        frame: pd.DataFrame = pandas.DataFrame(self._table(), index=pandas.Index(self.t, name="t"))
        return frame

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        if not len(self.t):
            return f"Run({self.law_name}, no times recorded, {self.status.name.lower()})"
        text = f"Run({self.law_name}, n={self.q.shape[-1]}, t={self.t[0]:g}..{self.t[-1]:g} s in {len(self.t)} records"
        text += f", {self.status.name.lower()}"
        if "lyapunov_balance" in self.monitors:
            text += f", lyapunov balance {np.max(np.abs(self.monitors['lyapunov_balance'])):.1e}"
        if "energy_balance" in self.monitors:
            text += f", energy balance {np.max(np.abs(self.monitors['energy_balance'])):.1e} J"
        ratio = speed_ratio(self)
        if ratio is not None and ratio.any():
            text += f", commands up to {ratio.max():.3g} times the speed limits"
        return text + ")"


@bordered
class BatchRun(_Stored):
    """B runs of one batch: the fields of `Run` with the axis B before the time axis. `batch[i]` is one `Run`.

    Attributes:
        status: how each run ended, (B,), integers of `armlet.Status`. The arrays of a failed run are NaN after its failure.
        t: times, s, (K,) if all runs have the same times, else (B, K).
        sensitivity: derivatives by the names of `simulate_batch(sensitivity=)`, with the axis B before the time axis.
    """

    status: NDArray[np.int32]

    def _set_status(self, status: Any) -> None:
        rows = np.asarray(status, dtype=np.int32)
        self.status = np.broadcast_to(rows, (self.q.shape[0],)).copy()

    def __len__(self) -> int:
        return len(self.status)

    def __getitem__(self, i: int) -> Run:
        if not -len(self) <= i < len(self):
            raise IndexError(f"BatchRun: row is out of range: expected {-len(self)}..{len(self) - 1}, got {i}")
        if self.q.ndim != 3:
            raise InputError('BatchRun: rows have no time axis: expected a batch run with keep="all"')
        items = {name: getattr(self, name)[i] for name in SERIES if getattr(self, name) is not None}
        items |= {"t": self._times(i), "monitors": {name: values[i] for name, values in self.monitors.items()}}
        items |= {"status": self.status[i], "law_name": self.law_name}
        items["stats"] = {name: np.asarray(value)[i] if np.ndim(value) else value for name, value in self.stats.items()}
        items["sensitivity"] = self.sensitivity and {name: of_row(one, i) for name, one in self.sensitivity.items()}
        if self._laws[0] is None or self.arm is None:
            return Run(items | self._stored_row(i))
        # The other fields follow from the law and the plant of the row, as for a single run.
        law, plant = (each[i if len(each) > 1 else 0] for each in (self._laws, self._plants))
        return Run(items | {"sampled": self._period or self._sampled}, law=law, plant=plant)

    def _stored_row(self, i: int) -> dict[str, Any]:
        """Return the fields of row `i` of a batch without laws and plants, such as a batch from a file."""
        items: dict[str, Any] = {"units": self.units, "input_units": self.input_units}
        for name in ("target", "parameters"):
            values = getattr(self, name)
            items[name] = values if values is None or values.ndim == 1 else unstacked(values[i])
        items["limits"] = self.limits and {name: each[i] if each.ndim == 2 else each for name, each in self.limits.items()}
        for name in ("residual", "touched", "contact_state"):
            values = getattr(self, name)
            items[name] = None if values is None else values[i]
        for name in ("position_error", "orientation_error"):
            values = getattr(self, name)
            items[name] = None if values is None else unstacked(values[i])
        force = self.contact_force
        items["contact_force"] = None if force is None or np.isnan(force[i]).all() else force[i]
        # Where other rows track a motion, `desired` of the batch has a motion at rest for a row with a constant target.
        if self._desired is not None and items["target"] is None:
            items["desired"] = tuple(part if part.ndim == 2 else part[i] for part in self._desired)
        return items

    def _times(self, i: int) -> Array:
        return self.t if self.t.ndim == 1 else self.t[i]

    def __iter__(self) -> Iterator[Run]:
        return (self[i] for i in range(len(self)))

    def report(self, path: str | PathLike[str], *, title: str | None = None, inputs: Mapping[str, Any] | None = None) -> None:
        """Write a report as one HTML file without network: statuses, the range of the runs over time, metrics, failed runs, versions.

        Args:
            path: path of the file. The file is complete or absent.
            title: heading of the report. None means the name of the law.
            inputs: tables that the report shows as text, such as `scenario.data`.

        Raises:
            InputError: an argument is not valid; the message names it.
            OSError: the file cannot be written.
        """
        from ..reports.runs import write_batch

        write_batch(self, path, title, inputs)

    def to_pandas(self) -> pd.DataFrame:
        """Convert the series of all runs to one table of pandas. It requires pandas (extra `data`).

        Returns:
            A table with the columns of `Run.to_pandas`, indexed by (run, t).
        """
        pandas = pandas_for("BatchRun.to_pandas")
        if self.q.ndim != 3:
            raise InputError('BatchRun.to_pandas: rows have no time axis: expected a batch run with keep="all"')
        frames = [pandas.DataFrame(self._table((i,)), index=pandas.Index(self._times(i), name="t")) for i in range(len(self))]
        table: pd.DataFrame = pandas.concat(frames, keys=range(len(self)), names=["run", "t"])
        return table

    def __repr__(self) -> str:
        counts = [f"{np.sum(self.status == s)} {s.name.lower()}" for s in Status if np.any(self.status == s)]
        return f"BatchRun({self.law_name}, {len(self)} runs, n={self.q.shape[-1]}, {', '.join(counts) or 'empty'})"


@border
def load(path: str | PathLike[str]) -> Run | BatchRun:
    """Read a run from a file that `run.save` wrote.

    Args:
        path: path of the file.

    Returns:
        The run or the batch. Its arrays have the same bits as the saved arrays.

    Raises:
        FormatError: the file is not a run of armlet, is damaged or cut short, or has another format version.
        OSError: the file cannot be read.

    Source: docs/plants_and_laws.md.

    >>> import armlet as al, tempfile
    >>> from pathlib import Path
    >>> arm = al.planar_pr(2.0, 0.5, 0.5)
    >>> law = al.ComputedTorque(arm, al.Hold([1.0, 0.0]), kp=100.0, kd=20.0)
    >>> run = al.simulate(al.RigidArm(arm), law, [0.0, 0.0], t_end=0.1, dt=1e-2)
    >>> path = Path(tempfile.mkdtemp()) / "run.npz"
    >>> run.save(path)
    >>> (al.load(path).q == run.q).all()
    np.True_
    """
    kind, fields = read(path)
    return (Run if kind == "Run" else BatchRun)(fields)
