"""Metrics: numbers that summarise a run.

The error is e = q_d - q, and T is the length of the run. Integrals use the trapezoidal rule over the recorded times. A metric has one value
per joint if the table does not state otherwise.

=====================  ==============  ====================================================================================
name                   unit            definition
=====================  ==============  ====================================================================================
error_rms              rad or m        sqrt(1/T int e^2 dt)
error_peak             rad or m        max |e|
error_final            rad or m        |e| at the end
overshoot              1               distance of q beyond the farthest point of the reference, divided by the distance from q at the
                                       start to the final reference. NaN if the divisor is zero, or if the reference moves at the end
settling_time          s               the time after which |e| stays within the band for all joints; NaN if |e| is outside at the end
position_error_rms,    m               root mean square, maximum and final value of the distance between the frame of each task and its
position_error_peak,                   target (`Run.position_error`), one value per task; absent for laws without such tasks
position_error_final
tau_rms, tau_peak      N m or N        sqrt(1/T int tau^2 dt), max |tau|; of an arm under velocity control rad/s or m/s
time_outside_limits    s               total time in which any joint is beyond its position, velocity or effort limits; NaN if unknown
input_ratio            1               largest tau_peak of a joint divided by its effort limit, under velocity control by its speed limit;
                                       NaN without finite limits above zero
monitor_violations     1               number of records at which a monitor is violated, summed over the monitors: see `metrics`
energy_error           1               largest |energy_balance| as a fraction of the largest energy stored or exchanged; NaN without
                                       this monitor
completed              1               1 for a run that reached its end or an event that stops it, else 0
=====================  ==============  ====================================================================================

The settling time and the last five metrics are one number per run. If a run reached neither its end nor an event that stops it, all metrics
except `completed` are NaN. A law without a reference in joint space (neither a motion of the joints nor a joint target) requires the
argument `reference`. Without it the errors, the overshoot and the settling time are NaN.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import _core
from ..arguments import choice, instance, integer, number, require_partner
from ..border import border, bordered
from ..errors import InputError
from ..status import Status
from .balances import energy_error
from .recorded import Array, Recorded
from .speeds import commands_speeds, input_ratio
from .task_errors import frame_errors

__all__ = ["Metrics", "metrics", "violations"]

PER_JOINT = ("error_rms", "error_peak", "error_final", "overshoot", "tau_rms", "tau_peak")
PER_TASK = ("position_error_rms", "position_error_peak", "position_error_final")
PER_RUN = ("settling_time", "time_outside_limits", "input_ratio", "monitor_violations", "energy_error", "completed")
ALL = (*PER_JOINT, *PER_TASK, *PER_RUN)
SETTLE, TOLERANCE = 0.02, 1e-6
#: Names of the arguments of `metrics`, without the run.
MEASURES = ("reference", "band", "settle", "tolerance", "frame")


@bordered
class Metrics(dict[str, Array]):
    """Metrics by name. A value is (n,), (tasks,) or a number for a run, and (B, n), (B, tasks) or (B,) for a batch.

    `columns()` splits the arrays into one column per joint or task.
    """

    units: tuple[str, ...]
    input_units: tuple[str, ...]

    def __init__(self, values: Mapping[str, Array], units: tuple[str, ...], input_units: tuple[str, ...]) -> None:
        super().__init__(values)
        self.units, self.input_units = units, input_units

    def unit(self, name: str, joint: int = 0) -> str:
        """Return the unit of a metric.

        Args:
            name: name of the metric.
            joint: index of the joint. The unit of some metrics depends on the joint.

        Returns:
            The unit, such as "rad".

        Raises:
            InputError: no metric has this name, or no joint has this index.
        """
        choice("Metrics.unit", "name", name, ALL)
        if integer("Metrics.unit", "joint", joint) >= len(self.units):
            raise InputError(f"Metrics.unit: joint is out of range: expected 0..{len(self.units) - 1}, got {joint}")
        if name in ("settling_time", "time_outside_limits"):
            return "s"
        if name in ("overshoot", "input_ratio", "monitor_violations", "energy_error", "completed"):
            return "1"
        if name in PER_TASK:
            return "m"
        return (self.input_units if name.startswith("tau") else self.units)[joint]

    def columns(self) -> dict[str, Array]:
        """Split the metrics into columns, one per joint or task: `error_rms1`, `error_rms2`, .., `settling_time`, ..

        Returns:
            A dict with one entry per column: a number for a run, an array (B,) for a batch.
        """
        table: dict[str, Array] = {}
        for name, values in self.items():
            if name in PER_JOINT or name in PER_TASK:
                table |= {f"{name}{i + 1}": values[..., i] for i in range(values.shape[-1])}
            else:
                table[name] = values
        return table

    def __reduce__(self) -> tuple[Any, ...]:
        return _core._seal(type(self), (dict(self), self.units, self.input_units))

    def __str__(self) -> str:
        lines = []
        for name, values in self.items():
            if name in (*PER_JOINT, *PER_TASK) and values.ndim == 1:
                text = "  ".join(_shown(value, self.unit(name, i)) for i, value in enumerate(values))
            else:
                text = _shown(float(values), self.unit(name)) if values.ndim == 0 else f"{len(values)} rows"
            lines.append(f"{name:<20} {text}")
        return "\n".join(lines)


def _shown(value: float, unit: str) -> str:
    return "-" if np.isnan(value) else f"{value:.6g}" + (f" {unit}" if unit != "1" else "")


@border
def metrics(
    run: Recorded,
    *,
    reference: ArrayLike | None = None,
    band: ArrayLike | None = None,
    settle: float = SETTLE,
    tolerance: float = TOLERANCE,
    frame: str | None = None,
) -> Metrics:
    """Compute the metrics of a run, or of every run of a batch: errors, settling time, overshoot, torques, limits and monitors.

    `simulate_batch(keep="metrics")` computes the same numbers during the runs, without records. `monitor_violations` counts the records in
    which a condition is met, and sums the counts of these conditions:

    - `lyapunov` has risen since the previous record by more than `tolerance` times its largest value so far;
    - `|lyapunov_balance|` exceeds `tolerance` times the largest Lyapunov function so far;
    - `|energy_balance|` exceeds `tolerance` times the largest magnitude of the energy so far;
    - `skewness`, the largest absolute entry of `N + N'` with `N = dM/dt - 2 C` and the transpose `'`, exceeds `tolerance`.

    Args:
        run: the run, or the batch.
        reference: a reference in place of the law's motion or target, (n,) or (K, n), for a batch also (B, K, n), rad or m.
        band: band of the settling time, a number or (n,), rad or m. None means `settle` times the largest error of the joints with the
            same unit.
        settle: relative band of the settling time, dimensionless. It requires `band=None`.
        tolerance: relative tolerance of the monitors, dimensionless.
        frame: name of the frame whose position error is measured, in place of the frames of the law's tasks. Its target is the frame's
            position at the joints' reference.

    Returns:
        A dict of the metrics by name. Values are (n,), (tasks,) or a number for a run, with a leading axis B for a batch. `unit(name)` is
        the unit.

    Raises:
        InputError: the batch kept no records, or a shape is wrong.

    Source: docs/scenarios.md.

    >>> import armlet as al
    >>> arm = al.planar_pr(2.0, 0.5, 0.5)
    >>> law = al.ComputedTorque(arm, al.Hold([1.0, 0.0]), kp=100.0, kd=20.0)
    >>> run = al.simulate(al.RigidArm(arm), law, [0.0, 0.0], t_end=2.0, dt=1e-3)
    >>> found = al.metrics(run)
    >>> float(found["error_peak"][0]), float(found["settling_time"].round(2)), float(found["overshoot"][0])
    (1.0, 0.58, 0.0)
    """
    instance("metrics", "run", run, Recorded, "a run of simulate or simulate_batch")
    settle, tolerance = number("metrics", "settle", settle), number("metrics", "tolerance", tolerance)
    require_one_band("metrics", band, settle)
    if run.q.shape[-2] == 1 and np.any(run.t > 0.0):
        if "error_rms" not in run.stats:
            raise InputError('metrics: run has only its last record: expected a batch run with keep="all"')
        if reference is not None or band is not None or frame is not None or (settle, tolerance) != (SETTLE, TOLERANCE):
            raise InputError("metrics: run kept its metrics alone: expected no other argument, or simulate_batch(metrics={..})")
        # A batch with keep="metrics" stores its metrics in `stats`.
        kept = {name: run.stats[name] for name in ALL if name in run.stats}
        if "tau_peak" in kept:
            kept.setdefault("input_ratio", input_ratio(run, np.asarray(kept["tau_peak"])))
        return Metrics({name: kept[name] for name in ALL if name in kept}, run.units, run.input_units)
    q, t = run.q, run.t
    n = q.shape[-1]
    desired = run.reference()
    q_d, v_d = (None, None) if desired is None else desired
    if reference is not None:
        shapes = dict.fromkeys([(n,), q.shape[-2:], q.shape])
        q_d, v_d = _core.numbers("metrics", "reference", reference, *shapes), None
    completed = np.isin(np.asarray(run.status), (Status.SUCCESS, Status.EVENT))
    bad = np.asarray(~np.isfinite(q).all(axis=(-2, -1)) | ~completed)
    found: dict[str, Array] = {}
    per_joint, per_run = (*q.shape[:-2], n), q.shape[:-2]
    weights = _weights(t)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        if q_d is None or not q.shape[-2]:
            found |= {name: np.full(per_joint, np.nan) for name in PER_JOINT[:4]}
            found["settling_time"] = np.full(per_run, np.nan)
        else:
            q_d = np.broadcast_to(q_d, q.shape)
            error = q_d - q
            size = np.abs(error)
            found["error_rms"] = _rms(error, weights)
            found["error_peak"] = size.max(axis=-2)
            found["error_final"] = size[..., -1, :]
            found["overshoot"] = _overshoot(q, q_d, v_d)
            found["settling_time"] = _settling(t, size, _band(band, settle, found["error_peak"], run.units))
        distance = run.position_error if frame is None else _of_frame(run, frame, q_d)
        if distance is not None and q.shape[-2]:
            found |= {PER_TASK[0]: _rms(distance, weights), PER_TASK[1]: distance.max(axis=-2), PER_TASK[2]: distance[..., -1, :]}
        if run.tau is not None and q.shape[-2]:
            found["tau_rms"] = _rms(run.tau, weights)
            found["tau_peak"] = np.abs(run.tau).max(axis=-2)
            found["input_ratio"] = input_ratio(run, found["tau_peak"])
        found["time_outside_limits"] = _outside(run, t)
        found["monitor_violations"] = np.zeros(per_run) + sum(violations(run.monitors, tolerance).values())
        missing = energy_error(run.monitors)
        found["energy_error"] = np.full(per_run, np.nan) if missing is None else missing
    for name, values in found.items():
        # The metrics of an incomplete run are NaN, because its first part does not characterise the loop.
        found[name] = np.where(bad[..., None] if values.ndim > np.ndim(bad) else bad, np.nan, values)
    found["completed"] = completed.astype(np.float64)
    return Metrics({name: found[name] for name in ALL if name in found}, run.units, run.input_units)


def _of_frame(run: Recorded, frame: str, q_d: Array | None) -> Array:
    if q_d is None or run.arm is None:
        lacks = "no reference of joints" if q_d is None else "no arm, as a run that was read from a file"
        raise InputError(f"metrics: frame is given for a run with {lacks}: expected None")
    return frame_errors(run._arms, frame, run.q, np.broadcast_to(q_d, run.q.shape))


def _weights(t: Array) -> Array:
    """Return the weights of the trapezoidal rule for the times `t`, divided by the length of the run. Their sum is 1."""
    if t.shape[-1] < 2:
        return np.ones_like(t)
    step = np.diff(t, axis=-1)
    zero = np.zeros_like(step[..., :1])
    weights: Array = (np.concatenate([step, zero], -1) + np.concatenate([zero, step], -1)) / 2
    weights /= weights.sum(axis=-1, keepdims=True)
    return weights


def _rms(values: Array, weights: Array) -> Array:
    result: Array = np.sqrt((values**2 * weights[..., None]).sum(axis=-2))
    return result


def _overshoot(q: Array, q_d: Array, v_d: Array | None) -> Array:
    end, start = q_d[..., -1, :], q[..., 0, :]
    displacement = end - start
    forward = np.sign(displacement)[..., None, :]
    beyond = (q * forward).max(axis=-2) - (q_d * forward).max(axis=-2)
    result: Array = np.where(np.abs(displacement) > 1e-9, np.maximum(beyond, 0.0) / np.abs(displacement), np.nan)
    if v_d is not None:
        result[np.abs(np.broadcast_to(v_d, q.shape)[..., -1, :]) > 1e-9] = np.nan
    return result


def require_one_band(function: str, band: ArrayLike | None, settle: float | None) -> None:
    """Refuse a relative band of the settling time in addition to an absolute one."""
    require_partner(function, "settle", SETTLE if settle is None else settle, "band=None", band is None, SETTLE)


def _band(band: ArrayLike | None, settle: float, peak: Array, units: tuple[str, ...]) -> Array:
    if band is not None:
        return np.broadcast_to(_core.numbers("metrics", "band", band, (), (peak.shape[-1],)), peak.shape)
    result = np.empty_like(peak)
    for unit in set(units):
        same = [i for i, each in enumerate(units) if each == unit]
        result[..., same] = settle * peak[..., same].max(axis=-1, keepdims=True)
    return result


def _settling(t: Array, size: Array, band: Array) -> Array:
    """Return the time from the start to the first record after the last record outside of the band, s.

    The result is NaN if the last record is outside of the band.
    """
    outside = np.asarray(~(size <= band[..., None, :]).all(axis=-1))
    count = outside.shape[-1]
    after = np.where(outside.any(axis=-1), count - np.argmax(outside[..., ::-1], axis=-1), 0)
    times = np.broadcast_to(t, outside.shape)
    inside = np.take_along_axis(times, np.minimum(after, count - 1)[..., None], axis=-1)[..., 0] - times[..., 0]
    result: Array = np.where(after < count, inside, np.nan)
    return result


def _outside(run: Recorded, t: Array) -> Array:
    if run.limits is None:
        return np.full(run.q.shape[:-2], np.nan)
    low, high, speed, effort = (run.limits[name][..., None, :] for name in ("q_min", "q_max", "v_max", "effort"))
    out = ((run.q < low) | (run.q > high) | (np.abs(run.v) > speed)).any(axis=-1)
    if run.tau is not None:
        effort = speed if commands_speeds(run) else effort
        out = out | (np.abs(run.tau) > effort).any(axis=-1)
    span = t[..., -1] - t[..., 0] if t.shape[-1] else np.zeros(t.shape[:-1])
    result: Array = (out * _weights(t)).sum(axis=-1) * span
    return result


def violations(monitors: Mapping[str, Array], tolerance: float) -> dict[str, Array]:
    """Return the number of records that violate each monitor with a condition, () or (B,) each."""
    found: dict[str, Array] = {}
    for name, scale in (("lyapunov_balance", "lyapunov"), ("energy_balance", "energy"), ("skewness", None)):
        if name in monitors and monitors[name].shape[-1]:
            size = _largest_so_far(np.abs(monitors[scale])) if scale is not None and scale in monitors else 1.0
            found[name] = (~(np.abs(monitors[name]) <= tolerance * size)).sum(axis=-1)
    if "lyapunov" in monitors and monitors["lyapunov"].shape[-1]:
        values = monitors["lyapunov"]
        found["lyapunov"] = (np.diff(values, axis=-1) > tolerance * _largest_so_far(values)[..., 1:]).sum(axis=-1)
    return found


def _largest_so_far(values: Array) -> Array:
    result: Array = np.maximum.accumulate(values, axis=-1)
    return result
