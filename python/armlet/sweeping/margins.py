"""The margin of a run: the smallest relative distance of its numbers from their bounds. A smaller margin is worse.

    margin = min over i of  1 - x_i / b_i

`x_i` is a metric of the run, such as the largest error of joint `i`, and `b_i > 0` is its bound. The margin is 0 at a bound, and negative
beyond it. The number `limits` is the used share of the arm's limits, with the bound 1:

    limits = max over joints and times of   |q - q_mid| / q_half,   |v| / v_max,   |tau| / effort

`q_mid` and `q_half` are the middle and half the width of the range of a joint. A run that ends early has the margin -infinity, and so has
a run that does not settle.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..arguments import number, shown
from ..errors import InputError
from ..run.metrics import ALL, PER_JOINT, PER_TASK, _weights
from ..run.recorded import Recorded
from ..run.records import BatchRun, Run
from ..run.speeds import commands_speeds
from ..status import Status, having
from .chunk import Columns, Measure

__all__ = ["Criterion"]

Array: TypeAlias = NDArray[np.float64]

LIMITS = "limits"
#: Names of a criterion. `completed` is absent, because a run that ends early is always worst.
NAMES = (LIMITS, *(name for name in ALL if name != "completed"))
#: Metrics with derivatives along the records of a run.
SLOPED = (LIMITS, "error_rms", "error_peak", "error_final", "tau_rms", "tau_peak", "input_ratio")


class Criterion:
    """The margin of the runs of one scenario.

    Args:
        function: name of the function in messages.
        given: bounds by name of the metric, the name of one metric without a bound, or a function of a run. Without a bound, the margin is
            the largest value of the metric with a minus sign. The function returns a margin, or a margin and its slopes as
            `armlet.gradient` expects them.
        metrics: arguments of `armlet.metrics`.
    """

    def __init__(self, function: str, given: Any, metrics: Mapping[str, Any]) -> None:
        self.function, self.metrics = function, metrics
        self.call: Callable[[Run], Any] | None = None
        self.bounds: dict[str, Array | None] = {}
        if isinstance(given, str):
            self.bounds = {self._name(given): np.array(1.0) if given == LIMITS else None}
        elif isinstance(given, Mapping) and given:
            self.bounds = {self._name(name): self._bound(name, value) for name, value in given.items()}
        elif callable(given):
            self.call = given
        else:
            expected = "bounds by metric such as {'error_peak': 0.05}, the name of a metric, or a function of a run"
            raise InputError(f"{function}: criterion is of the wrong type: expected {expected}, got {shown(given)}")
        #: Whether the criterion may have derivatives. For a function it is known after its first call.
        self.may_have_slopes = self.call is not None or any(name in SLOPED for name in self.bounds)

    def __str__(self) -> str:
        if self.call is not None:
            return getattr(self.call, "__name__", "a function")
        values = {name: "" if bound is None else f" <= {bound.tolist()}" for name, bound in self.bounds.items()}
        return ", ".join(name + text for name, text in values.items())

    @property
    def measures_errors(self) -> bool:
        """Whether the margin is measured from the reference of the joints."""
        return any("error_" in name or name in ("overshoot", "settling_time") for name in self.bounds)

    @property
    def measure(self) -> Measure | None:
        """The function that computes the column `margin` from the records of a batch. None if the metrics are sufficient."""
        return self._of_batch if self.call is not None or LIMITS in self.bounds else None

    def of_table(self, table: Columns) -> Array:
        """Return the margins of the rows of a table that `run_chunk` made with `measure`, (B,)."""
        return table["margin"] if "margin" in table else self._of_columns(table)

    def of_run(self, run: Run) -> float:
        """Return the margin of one run."""
        if run.status != Status.SUCCESS:
            return -math.inf
        return self._called(run) if self.call is not None else float(self._of_columns(self._columns(run))[0])

    def loss(self, run: Run) -> Any:
        """Return the margin and its slopes by series, as a loss of `armlet.gradient`. The slopes are zero where they are not known."""
        if self.call is not None:
            return self.call(run)
        table = self._columns(run)
        terms = self._terms(table)
        column, bound = min(terms, key=lambda term: float(self._margin(table, *term)[0]))
        slopes = _slopes_of_limits(run) if column == LIMITS else self._slopes(run, column)
        scale = -1.0 if bound is None else -1.0 / bound
        return float(self._margin(table, column, bound)[0]), {name: scale * values for name, values in slopes.items()}

    def _name(self, name: Any) -> str:
        if name not in NAMES:
            near = difflib.get_close_matches(str(name), NAMES, 1)
            hint = f" (did you mean {near[0]}?)" if near else ""
            raise InputError(
                f"{self.function}: criterion has an unknown name{hint}: expected names of {', '.join(NAMES)}, got {shown(name)}"
            )
        return str(name)

    def _bound(self, name: str, value: Any) -> Array:
        values = value if isinstance(value, list | tuple | np.ndarray) else [value]
        bounds = np.array([number(self.function, f"criterion[{name!r}]", each) for each in values])
        if not (bounds.size and np.isfinite(bounds).all() and (bounds > 0.0).all()):
            raise InputError(f"{self.function}: criterion[{name!r}] is not a bound: expected finite numbers > 0, got {shown(value)}")
        return bounds if isinstance(value, list | tuple | np.ndarray) else bounds[0]

    def _of_batch(self, batch: BatchRun) -> Columns:
        good = having(batch.status, Status.SUCCESS)
        if self.call is None:
            table = {**self._columns(batch), "status": batch.status}
            return {"margin": self._of_columns(table)}
        return {"margin": np.array([self._called(batch[i]) if good[i] else -math.inf for i in range(len(batch))])}

    def _called(self, run: Run) -> float:
        assert self.call is not None
        found = self.call(run)
        self.may_have_slopes = isinstance(found, tuple) and len(found) == 2
        margin = number(self.function, "the value of criterion", found[0] if self.may_have_slopes else found)
        if math.isnan(margin):
            raise InputError(f"{self.function}: criterion returned NaN: expected a number, or -inf for the worst run")
        return margin

    def _columns(self, run: Recorded) -> Columns:
        """Return the metrics of a run or batch by column, (1,) or (B,), with the column `limits` if the criterion has it."""
        table: Columns = {}
        if set(self.bounds) != {LIMITS}:
            table = {name: np.atleast_1d(values) for name, values in run.metrics(**self.metrics).columns().items()}  # type: ignore[attr-defined]
        if LIMITS in self.bounds:
            used = _used(self.function, run)
            with np.errstate(invalid="ignore"):
                table[LIMITS] = np.atleast_1d(np.max([values.max(axis=(-2, -1)) for values in used.values()], axis=0))
        return table

    def _terms(self, table: Columns) -> list[tuple[str, float | None]]:
        """Return the columns of the criterion and their bounds."""
        terms: list[tuple[str, float | None]] = []
        for name, bound in self.bounds.items():
            parts = [name]
            if name in PER_JOINT or name in PER_TASK:
                parts = [f"{name}{i + 1}" for i in range(len(table)) if f"{name}{i + 1}" in table]
            if not parts or parts[0] not in table:
                raise InputError(f"{self.function}: criterion {name} is not a metric of this loop: expected some of {', '.join(table)}")
            if bound is not None and bound.ndim and bound.shape != (len(parts),):
                expected = f"a number or ({len(parts)},)" if len(parts) > 1 or name in PER_JOINT else "a number"
                raise InputError(f"{self.function}: criterion[{name!r}] has the wrong shape: expected {expected}, got {bound.shape}")
            each = [None] * len(parts) if bound is None else np.broadcast_to(bound, len(parts)).tolist()
            terms += zip(parts, each, strict=True)
        return terms

    def _margin(self, table: Columns, column: str, bound: float | None) -> Array:
        values = np.asarray(table[column], dtype=np.float64)
        if column == "settling_time":
            values = np.where(np.isnan(values), math.inf, values)  # the error is outside of the band at the end
        return -values if bound is None else 1.0 - values / bound

    def _of_columns(self, table: Columns) -> Array:
        good = having(table["status"], Status.SUCCESS) if "status" in table else np.array([True])
        lowest = np.full(len(good), math.inf)
        for column, bound in self._terms(table):
            margin = np.where(good, self._margin(table, column, bound), -math.inf)
            if np.isnan(margin).any():
                reasons = "a law with a reference of the joints, a motion that ends at rest, limits of the arm, monitors"
                raise InputError(
                    f"{self.function}: criterion {column} has no value in this loop: expected what it requires, such as {reasons}"
                )
            lowest = np.minimum(lowest, margin)
        return lowest

    def _slopes(self, run: Run, column: str) -> dict[str, Array]:
        """Return the derivatives of a metric of a joint with respect to the records. They are zero for a metric without derivatives."""
        name, joint = column.rstrip("0123456789"), int(column[len(column.rstrip("0123456789")) :] or 1) - 1
        reference = self.metrics.get("reference")
        if name == "input_ratio":
            return _slopes_of_limits(run, ("tau",))
        if name not in SLOPED:
            return {"q": np.zeros_like(run.q)}
        if name.startswith("tau"):
            assert run.tau is not None, "a run of simulate has recorded inputs"
            series, values = "tau", run.tau
        else:
            desired = np.asarray(reference) if reference is not None else run.reference()[0]  # type: ignore[index]  # the metric has a value
            series, values = "q", run.q - np.broadcast_to(desired, run.q.shape)
        x, slopes = values[:, joint], np.zeros_like(values)
        if name.endswith("rms"):
            weights = _weights(run.t)
            size = math.sqrt(float((weights * x**2).sum()))
            slopes[:, joint] = weights * x / size if size > 0.0 else 0.0
        else:
            k = len(x) - 1 if name == "error_final" else int(np.abs(x).argmax())
            slopes[k, joint] = np.sign(x[k])
        return {series: slopes}


def _used(function: str, run: Recorded) -> dict[str, Array]:
    """Return the used share of each limit at each record, (K, n) or (B, K, n) by series. A limit that is infinite or zero is not used."""
    if run.limits is None:
        raise InputError(f"{function}: criterion limits is not possible for this arm: expected an arm with limits, such as a robot file")
    low, high, speed, effort = (run.limits[name][..., None, :] for name in ("q_min", "q_max", "v_max", "effort"))
    input_limit = speed if commands_speeds(run) else effort
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        middle, half = (low + high) / 2.0, (high - low) / 2.0
        shares = {"q": (run.q - middle) / half, "v": run.v / speed}
        if run.tau is not None:
            shares["tau"] = run.tau / input_limit
    limits = {"q": half, "v": speed, "tau": input_limit}
    bounded = {name: np.isfinite(limits[name]) & (limits[name] > 0.0) for name in shares}
    if not any(each.any() for each in bounded.values()):
        raise InputError(f"{function}: criterion limits is not possible for this arm: expected a finite limit above zero")
    return {name: np.where(bounded[name], np.abs(values), 0.0) for name, values in shares.items()}


def _slopes_of_limits(run: Run, series: tuple[str, ...] = ("q", "v", "tau")) -> dict[str, Array]:
    """Return the derivatives of `limits` with respect to the records. They are not zero at the record with the largest share."""
    used = {name: values for name, values in _used("worst_case", run).items() if name in series}
    name = max(used, key=lambda each: float(used[each].max()))
    k, joint = np.unravel_index(int(used[name].argmax()), used[name].shape)
    recorded: Array = getattr(run, name)
    slopes = np.zeros_like(recorded)
    limits = run.limits
    assert limits is not None, "used shares require limits"
    middle = (limits["q_min"][joint] + limits["q_max"][joint]) / 2.0 if name == "q" else 0.0
    away = recorded[k, joint] - middle
    slopes[k, joint] = np.sign(away) * (used[name][k, joint] / abs(away) if away else 0.0)
    return {name: slopes}
