"""What a simulation returns: arrays over time, how it ended, what it cost, and the identities it was checked against.

Time is the first axis of a run: `q` is (K, n); a batch of B runs puts its rows before it: (B, K, n).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..border import bordered
from ..errors import InputError
from ..integration import DenseOutput
from ..status import Status
from .events import Events, State

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from .metrics import Metrics

__all__ = ["BatchRun", "Run"]

Array: TypeAlias = NDArray[np.float64]

# Quantities recorded over time, in the order in which tables and files hold them.
SERIES = ("q", "v", "tau", "estimate", "theta", "theta_dot")
# Laws whose target is a joint position, and laws whose motion is not one of joints.
JOINT_TARGETS = ("PDGravity", "JointImpedance", "MotorPD", "StateFeedback")
TASK_MOTIONS = ("ElasticTracking", "PriorityVelocity", "PriorityAcceleration")
# Fields without a time axis that may be there.
OTHERS = ("parameters", "target", "limits", "position_error")
LIMITS = ("q_min", "q_max", "v_max", "effort")


class _Recorded:
    """What `Run` and `BatchRun` share: the fields, and where they came from."""

    t: Array
    q: Array
    v: Array
    tau: Array | None
    estimate: Array | None
    theta: Array | None
    theta_dot: Array | None
    monitors: dict[str, Array]
    stats: dict[str, Any]
    #: "Adaptive", ..: decides which figure `plot` draws.
    law_name: str
    #: The (first) plant's arm; None in a run that was read from a file.
    arm: Any

    def __init__(self, fields: Mapping[str, Any], law: Any = None, motion: Any = None, plant: Any = None) -> None:
        given = dict(fields)
        who = type(self).__name__
        t = _core.numbers(who, "t", given.pop("t"))
        self.t = t if t.ndim else t.reshape(1)
        for name in SERIES:
            value = given.pop(name) if name in ("q", "v") else given.pop(name, None)
            setattr(self, name, None if value is None else _core.numbers(who, name, value))
        self.monitors = {name: _core.numbers(who, name, value) for name, value in (given.pop("monitors", None) or {}).items()}
        self.stats = dict(given.pop("stats", None) or {})
        laws, plants = _rows(law), _rows(plant)
        self.law_name = given.pop("law_name", None) or ("" if law is None else type(laws[0]).__name__)
        self._desired: tuple[Array, ...] | None = given.pop("desired", None)
        motions = [None] if self.law_name in TASK_MOTIONS else [getattr(each, "motion", None) for each in laws]
        motions = motions if motion is None else _rows(motion)
        if len(motions) > 1 and all(each == motions[0] for each in motions):
            motions = motions[:1]  # one motion made many times: sampled once
        self._motions = motions if None not in motions else []
        arms: list[Any] = [getattr(each, "arm", None) for each in plants]
        self._laws, self._made_by, self._arms, self.arm = laws, law, arms, arms[0]
        # What was given stands in the way of the properties below, which ask the plant and the law: few runs are asked for them.
        stated = {name: given.pop(name, None) for name in ("parameters", "target", "limits", "units")}
        if stated["parameters"] is not None:
            stated["parameters"] = _core.numbers(who, "parameters", stated["parameters"])
        if stated["units"]:
            stated["units"] = tuple(stated["units"])
        self.__dict__.update((name, value) for name, value in stated.items() if value is not None and len(value))
        self._position_error: Array | None = given.pop("position_error", None)
        self._set_status(given.pop("status", Status.SUCCESS))
        self.events: Events | None = given.pop("events", None)
        self._dense: tuple[DenseOutput, int] | None = given.pop("dense", None)
        if given:
            raise InputError(f"{type(self).__name__}: fields are unknown: expected those of a run, got {sorted(given)}")

    @cached_property
    def parameters(self) -> Array | None:
        """The plant's true parameters, for comparison with `estimate`; None where unknown."""
        if None in self._arms:
            return None
        parameters = [arm.parameters for arm in self._arms] if len(self._arms) > 1 else self._arms[0].parameters
        return np.asarray(parameters, dtype=np.float64)

    @cached_property
    def target(self) -> Array | None:
        """The joint position that a law of joints holds, (n,) or (B, n); None for other laws."""
        if self.law_name not in JOINT_TARGETS or self._made_by is None:
            return None
        targets = [each.__getnewargs_ex__()[1]["target"] for each in _rows(self._made_by)]
        return np.array(targets if len(targets) > 1 else targets[0], dtype=np.float64)

    @cached_property
    def limits(self) -> dict[str, Array] | None:
        """The arm's `q_min`, `q_max`, `v_max`, `effort`, (n,) or (B, n) each; None where unknown."""
        return _limits(self._arms)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Unit of each joint's position, "rad" or "m"."""
        types = getattr(self.arm, "joint_types", None) or ("revolute",) * self.q.shape[-1]
        return tuple("m" if kind in ("prismatic", "P") else "rad" for kind in types)

    def _set_status(self, status: Any) -> None:
        raise NotImplementedError

    def _items(self) -> dict[str, Any]:
        """Every field by name, as `__init__` takes them."""
        items = {name: getattr(self, name) for name in ("t", *SERIES, *OTHERS) if getattr(self, name) is not None}
        items |= {"monitors": self.monitors, "stats": self.stats, "law_name": self.law_name, "units": self.units, "status": self._status()}
        desired = self.desired()
        return items if desired is None else items | {"desired": desired}

    def _status(self) -> Any:
        raise NotImplementedError

    def desired(self) -> tuple[Array, Array, Array] | None:
        """The desired motion `(q_d, v_d, a_d)` at the times of the run, each (K, n); None where the law follows none.

        In a batch whose rows differ in motion or times each is (B, K, n).
        """
        if self._desired is None and self._motions:
            if len(self._motions) == 1 and self.t.ndim == 1:
                self._desired = _sampled(self._motions[0], self.t, self.q.shape[-1])
            else:
                shape = (self.q.shape[0], self.t.shape[-1])
                motions = self._motions * (shape[0] if len(self._motions) == 1 else 1)
                rows = [_sampled(m, t, self.q.shape[-1]) for m, t in zip(motions, np.broadcast_to(self.t, shape), strict=True)]
                self._desired = tuple(np.stack(parts) for parts in zip(*rows, strict=True))
        return self._desired  # type: ignore[return-value]  # three by construction

    @property
    def position_error(self) -> Array | None:
        """How far the frame of each task is from its target, (K, tasks) or (B, K, tasks), m; None for laws without such tasks."""
        if self._position_error is None and self._laws[0] is not None and self.arm is not None:
            from .task_errors import position_errors

            self._position_error = position_errors(self._laws, self._arms, self.t, self.q)
            self._laws = [None]  # asked once
        return self._position_error

    def reference(self) -> tuple[Array, Array | None] | None:
        """What the joints should do, `(q_d, v_d)`, that broadcast to `q`: the motion, or the target of a law of joints; else None."""
        desired = self.desired()
        if desired is not None:
            return desired[0], desired[1]
        return None if self.target is None else (self.target[..., None, :], None)

    def metrics(self, **keywords: Any) -> Metrics:
        """Errors, settling time, overshoot, torques, time outside limits, violated monitors: see `armlet.metrics`."""
        from .metrics import metrics

        return metrics(self, **keywords)  # type: ignore[arg-type]  # Run and BatchRun are all there is

    @property
    def input_units(self) -> tuple[str, ...]:
        """Unit of each joint's input: a force, or a velocity where that is what the law commands."""
        if self.law_name == "PriorityVelocity":
            return tuple(f"{unit}/s" for unit in self.units)
        return tuple("N" if unit == "m" else "N m" for unit in self.units)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the run to one file, whole or not at all; `armlet.load` reads it back. No pickle inside."""
        from .storage import save

        save(self, path)

    def __reduce__(self) -> tuple[Any, ...]:
        return _core._seal(type(self), (self._items() | {"events": self.events, "dense": self._dense},))

    def _table(self, row: tuple[Any, ...] = ()) -> dict[str, Array]:
        """Columns over time: q1.., v1.., tau1.., the recorded states and the monitors."""
        columns: dict[str, Array] = {}
        for name in SERIES:
            values = getattr(self, name)
            if values is not None:
                columns |= {f"{name}{i + 1}": values[(*row, slice(None), i)] for i in range(values.shape[-1])}
        return columns | {name: values[row] for name, values in self.monitors.items()}


def _limits(arms: list[Any]) -> dict[str, Array] | None:
    """The limits of the plants' arms; None where one of them states none."""
    stated: list[Any] = [getattr(arm, "limits", None) for arm in (arms if any(arm is not arms[0] for arm in arms) else arms[:1])]
    if not all(stated):
        return None
    return {name: np.array([each[name] for each in stated] if len(stated) > 1 else stated[0][name]) for name in LIMITS}


def _rows(value: Any) -> list[Any]:
    """One object for all rows, or one per row."""
    return list(value) if isinstance(value, list | tuple) else [value]


def _sampled(motion: Any, t: Array, n: int) -> tuple[Array, ...]:
    samples = [motion(float(time)) for time in t]
    return tuple(np.array([sample[i] for sample in samples], dtype=np.float64).reshape(len(t), n) for i in range(3))


@bordered
class Run(_Recorded):
    """One simulated run.

    Attributes:
        t: times, (K,), s.
        q, v: joint positions and velocities, (K, n), rad or m, rad/s or m/s.
        tau: the plant's input, (K, n), N m or N; right-continuous; the motors' torque for elastic arms.
        estimate: the law's parameter estimate, (K, p); None for laws without one.
        theta, theta_dot: motor positions and velocities of elastic arms, (K, n), rad, rad/s; else None.
        status: how the run ended (`armlet.Status`), with advice.
        stats: what it cost: counts of steps, evaluations, rejections; where the status is EXCESS_ACCURACY `coarsen`: times this both
            tolerances can be met.
        monitors: the identities that were watched, by name, each (K,).
        events: the crossings of the events asked for (`armlet.Events`); None where none were.
    """

    status: Status

    def sample(self, t: ArrayLike) -> State:
        """The state at the time `t` or at times `(K,)` of the run, s, from the polynomials that `simulate(dense=True)` kept.

        Raises:
            InputError: the run kept none, or a time lies outside of it.

        >>> import armlet as al
        >>> law = al.PDGravity(al.pendulum(1.0, 5.0), [0.5], kp=20.0, kd=5.0)
        >>> run = al.simulate(al.RigidArm(al.pendulum(1.0, 5.0)), law, [0.0], t_end=1.0, method="dop853", dense=True)
        >>> run.sample([0.25, 0.5]).q.shape
        (2, 1)
        """
        if self._dense is None:
            raise InputError("Run.sample: the run kept no polynomials: expected one of simulate(dense=True) with an adaptive method")
        dense, states = self._dense
        values, n = dense(t), self.q.shape[-1]
        parts = [values[..., k : k + n] if k < states else None for k in range(n, 4 * n, n)]
        estimate = values[..., states:] if values.shape[-1] > states else None
        return State(values[..., :n], parts[0], parts[1], parts[2], estimate)

    __call__ = sample

    def _set_status(self, status: Any) -> None:
        self.status = Status(int(status))

    def _status(self) -> Status:
        return self.status

    def plot(self, fig: Any = None) -> Any:
        """Draw the figure that belongs to the law; returns the axes as an array. Needs matplotlib (`armlet[plot]`).

        Args:
            fig: a matplotlib figure to draw into; None makes one with pyplot.
        """
        from ..figures.run import plot

        return plot(self, fig)

    def animate(self, path: str | PathLike[str], arm: Any = None, **keywords: Any) -> None:
        """Write a GIF of a planar arm in motion: see `armlet.figures.animation.animate`. Needs matplotlib (`armlet[plot]`)."""
        from ..figures.animation import animate

        animate(self, path, arm, **keywords)

    def to_csv(self, path: str | PathLike[str]) -> None:
        """Write the table of `to_pandas` with its index as CSV, every number with the digits that give it back; needs no pandas."""
        from .export import to_csv

        to_csv({"t": self.t, **self._table()}, path)

    def to_parquet(self, path: str | PathLike[str]) -> None:
        """Write the same table as Parquet. Needs pyarrow (`armlet[data]`)."""
        from .export import to_parquet

        to_parquet({"t": self.t, **self._table()}, path)

    def to_xarray(self) -> xr.Dataset:
        """A dataset over `t` and `joint` with units as attributes. Needs xarray (`armlet[data]`)."""
        from .export import to_xarray

        return to_xarray(self)

    def to_pandas(self) -> pd.DataFrame:
        """A table with one row per recorded time (index `t`, s) and columns q1.., v1.., tau1.., and the monitors."""
        pandas = _pandas("Run.to_pandas")
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
        return text + ")"


@bordered
class BatchRun(_Recorded):
    """B runs side by side: the fields of `Run` with B before the time axis; `batch[i]` is one `Run`.

    Attributes:
        status: how each run ended, (B,), integers of `armlet.Status`; rows hold NaN after their fault.
        t: times, (K,) where all rows share them, else (B, K).
    """

    status: NDArray[np.int32]

    def _set_status(self, status: Any) -> None:
        rows = np.asarray(status, dtype=np.int32)
        self.status = np.broadcast_to(rows, (self.q.shape[0],)).copy()

    def _status(self) -> NDArray[np.int32]:
        return self.status

    def __len__(self) -> int:
        return len(self.status)

    def __getitem__(self, i: int) -> Run:
        if not -len(self) <= i < len(self):
            raise IndexError(f"BatchRun: row is out of range: expected {-len(self)}..{len(self) - 1}, got {i}")
        if self.q.ndim != 3:
            raise InputError('BatchRun: rows have no time axis: expected a batch run with keep="all"')
        items = {name: getattr(self, name)[i] for name in SERIES if getattr(self, name) is not None}
        items |= {"t": self._times(i), "monitors": {name: values[i] for name, values in self.monitors.items()}}
        items |= {"status": self.status[i], "law_name": self.law_name, "units": self.units}
        items["target"] = self.target[i] if self.target is not None and self.target.ndim == 2 else self.target
        items["limits"] = self.limits and {name: each[i] if each.ndim == 2 else each for name, each in self.limits.items()}
        items["parameters"] = self.parameters[i] if self.parameters is not None and self.parameters.ndim == 2 else self.parameters
        items["stats"] = {name: np.asarray(value)[i] if np.ndim(value) else value for name, value in self.stats.items()}
        error = self.position_error
        items["position_error"] = None if error is None else error[i]
        if self._desired is not None:
            items["desired"] = tuple(part if part.ndim == 2 else part[i] for part in self._desired)
        return Run(items, motion=self._motions[i if len(self._motions) > 1 else 0] if self._motions else None)

    def _times(self, i: int) -> Array:
        return self.t if self.t.ndim == 1 else self.t[i]

    def __iter__(self) -> Iterator[Run]:
        return (self[i] for i in range(len(self)))

    def to_pandas(self) -> pd.DataFrame:
        """A table of all rows, indexed by (run, t)."""
        pandas = _pandas("BatchRun.to_pandas")
        if self.q.ndim != 3:
            raise InputError('BatchRun.to_pandas: rows have no time axis: expected a batch run with keep="all"')
        frames = [pandas.DataFrame(self._table((i,)), index=pandas.Index(self._times(i), name="t")) for i in range(len(self))]
        table: pd.DataFrame = pandas.concat(frames, keys=range(len(self)), names=["run", "t"])
        return table

    def __repr__(self) -> str:
        counts = [f"{np.sum(self.status == s)} {s.name.lower()}" for s in Status if np.any(self.status == s)]
        return f"BatchRun({self.law_name}, {len(self)} runs, n={self.q.shape[-1]}, {', '.join(counts) or 'empty'})"


def _pandas(caller: str) -> Any:
    try:
        import pandas
    except ImportError:
        raise ImportError(f"{caller}: pandas is not installed: pip install 'armlet[data]'") from None
    return pandas
