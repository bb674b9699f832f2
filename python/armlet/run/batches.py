"""Run a batch in pieces, one after another, so that progress, finished rows and metrics are available before the batch ends.

A *piece* is a group of consecutive runs of a batch.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Sized
from dataclasses import replace
from typing import Any, TypeAlias, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..arguments import choice, finite, instance, shown
from ..errors import InputError
from ..status import Status, having
from .balances import Balances, together, warn_of_balances
from .contradictions import warn_of_contradictions
from .metrics import MEASURES, metrics, require_one_band
from .options import BatchOptions, PieceOptions, Starts, Steps, starts
from .recorded import SERIES
from .records import BatchRun
from .sampling import Sampling, period_of
from .speeds import warn_of_speeds

__all__ = ["batch_of", "forces_of_runs", "in_pieces", "measured_by_records", "require_measures"]

#: Largest size of the records of one piece, bytes. A piece has at least LEAST runs, even if their records are larger.
PIECE = 1 << 26
LEAST = 64
#: Smallest number of pieces of a batch with the argument `out`, if each piece then has at least LEAST runs.
PARTS = 32
#: The starts of the runs by name, (B, n).
States: TypeAlias = Mapping[str, NDArray[np.float64] | None]
#: Options of a piece. The whole batch was checked before, so a piece does not warn of joint limits and of the sample time.
CHECKED: PieceOptions = {"check_limits": False, "check_sampling": False}


def forces_of_runs(force: Any, rows: int) -> Any:
    """Return `force` as `[[(t_start, F), ...], ...]` if it has one entry per run: `(B, k)` or such a list. Else return it unchanged."""
    if _is_nested(force):
        return [list(steps) if isinstance(steps, list | tuple) else steps for steps in force]
    rows_of_numbers = isinstance(force, list | tuple) and bool(force) and isinstance(force[0], list | tuple | np.ndarray)
    # A pair `(t_start, F)` has an entry with a length, `F`. A row of numbers has no such entry.
    if not (all(not isinstance(x, Sized) for x in force[0]) if rows_of_numbers else getattr(force, "ndim", 0) == 2):
        return force
    values = finite("simulate_batch", "force", _core.numbers("simulate_batch", "force", force, (rows, "k")))
    return [[(0.0, row)] for row in values]


def _is_nested(force: Any) -> TypeGuard[list[Steps]]:
    """Return whether `force` is a list of lists of pairs `(t_start, F)`."""
    for _ in range(2):
        if not isinstance(force, list | tuple) or not force:
            return False
        force = force[0]
    return isinstance(force, list | tuple)


def require_measures(keep: str, given: Mapping[str, Any] | None) -> dict[str, Any]:
    """Check the argument `metrics` of a batch, and return it as a dict without the entries that are None.

    Raises:
        InputError: `given` is not a dict of arguments of `armlet.metrics`, or `keep` is not "metrics".
    """
    if given is None:
        return {}
    instance("simulate_batch", "metrics", given, Mapping, "a table of arguments of armlet.metrics")
    if keep != "metrics":
        raise InputError(f'simulate_batch: metrics is not used: expected None with keep="{keep}", got {shown(given)}')
    for name in given:
        choice("simulate_batch", "a name of metrics", name, MEASURES)
    require_one_band("simulate_batch", given.get("band"), given.get("settle"))
    stated = {name: value for name, value in given.items() if value is not None}
    if "reference" in stated:
        stated["reference"] = _core.numbers("simulate_batch", 'metrics["reference"]', stated["reference"])
    return stated


def measured_by_records(options: BatchOptions) -> bool:
    """Return whether the metrics of a batch require its records. They do if the reference has one value per record."""
    return options["keep"] == "metrics" and np.ndim(options["metrics"].get("reference", 0.0)) > 1


def batch_of(plant: Any, law: Any, q0: ArrayLike, options: BatchOptions, undisturbed: bool) -> BatchRun:
    """Run one batch, and warn if the residual of a balance is too large."""
    batch, balances = _with_balances(plant, law, q0, options)
    _warn(batch, [balances], undisturbed)
    warn_of_speeds("simulate_batch", batch)
    warn_of_contradictions("simulate_batch", batch)
    return batch


def _warn(batch: BatchRun, pieces: Sequence[Balances | None], undisturbed: bool) -> None:
    """Warn once if a residual of a balance of `pieces`, the parts of the batch, is too large. Without monitors they are None."""
    known = [each for each in pieces if each is not None]
    if known:
        warn_of_balances("simulate_batch", together(known), having(batch.status, Status.SUCCESS), undisturbed)


def _with_balances(plant: Any, law: Any, q0: ArrayLike, options: BatchOptions) -> tuple[BatchRun, Balances | None]:
    """Run one batch. Return it with the residuals of its balances, which are None without monitors."""
    fields = _core.simulate_batch(plant, law, q0, options)
    fields["stats"] = {"ended": fields.pop("ended"), "engine": fields.pop("engine")}
    found, balances = fields.pop("metrics"), Balances(**fields.pop("balances"))
    if found:
        rest = {name: found.pop(name) for name in ("energy_missing", "lyapunov_rise", "lyapunov_error")}
        balances = Balances(found["energy_error"], **rest)
        completed = having(fields["status"], Status.SUCCESS).astype(np.float64)
        fields["stats"] |= found | {"completed": completed}
    fields["sampled"] = period_of(options.get("sample_time"))
    batch = BatchRun(fields, law=law, plant=plant)
    return batch, balances if found or batch.monitors else None


def in_pieces(
    plant: _core.Plant | list[_core.Plant],
    law: _core.Law | list[_core.Law],
    q0: ArrayLike,
    options: BatchOptions,
    progress: Callable[[int, int], object] | None,
    out: Mapping[str, NDArray[Any]] | None,
    undisturbed: bool,
) -> BatchRun:
    """Run the batch of `simulate_batch` in pieces, and join the results.

    Warnings and errors are those of the whole batch. If the metrics require the records, each piece is reduced to its metrics before the
    next piece runs.
    """
    one = plant[0] if isinstance(plant, list) and plant else plant
    n = instance("simulate_batch", "plant", one, _core.Plant, "a plant such as RigidArm, or a list of them").arm.n
    start = _core.numbers("simulate_batch", "q0", q0, ("B", n))
    rows = len(start)
    summed = measured_by_records(options)
    measures = options["metrics"]
    if summed:
        options = {**options, "keep": "all", "metrics": {}}
    states = {name: None if x is None else _core.numbers("simulate_batch", name, x, ("B", n)) for name, x in starts(options).items()}
    _check(plant, law, start, states, options)
    size = _runs_per_piece(n, options)
    if out is not None:
        _require_rows(out, rows)
        # Ctrl-C loses the piece that is running, so a piece is at most 1/PARTS of the batch, or LEAST runs if this is more.
        size = min(size, max(LEAST, rows // PARTS // LEAST * LEAST))
    pieces: list[BatchRun] = []
    balances: list[Balances | None] = []
    for first in range(0, max(rows, 1), size):
        last = min(first + size, rows)
        own: PieceOptions = {**options, **_starts(states, slice(first, last)), **CHECKED}
        if _is_nested(options["force"]):
            own["force"] = options["force"][first:last]
        if isinstance(sampling := options["sample_time"], Sampling):
            # Row i of the whole batch uses `seed + i`, so the first row of this piece uses `seed + first`.
            own["sample_time"] = replace(sampling, seed=sampling.seed + first)
        plants = plant[first:last] if isinstance(plant, list) and len(plant) > 1 else plant
        laws = law[first:last] if isinstance(law, list) and len(law) > 1 else law
        piece, residuals = _with_balances(plants, laws, start[first:last], own)
        pieces.append(_summed(piece, measures, first, last, rows) if summed else piece)
        balances.append(residuals)
        if out is not None:
            _write(out, pieces[-1], first, last)
        if progress is not None:
            progress(last, rows)
    batch = pieces[0] if len(pieces) == 1 else _joined(pieces, law, plant)
    _warn(batch, balances, undisturbed)
    warn_of_speeds("simulate_batch", batch)
    warn_of_contradictions("simulate_batch", batch)
    return batch


def _check(plant: Any, law: Any, start: NDArray[np.float64], states: States, options: BatchOptions) -> None:
    """Raise the errors of invalid arguments and issue the warnings about arguments, with the rows of the whole batch."""
    # A batch of zero runs checks the arguments that all runs share, such as the times of the records.
    none: PieceOptions = {**options, **_starts(states, slice(0)), **CHECKED}
    if _is_nested(options["force"]):
        none["force"] = none["force_frame"] = None
    _core.simulate_batch(plant[:1] if isinstance(plant, list) else plant, law[:1] if isinstance(law, list) else law, start[:0], none)
    # The result has at least 2 n numbers per run. If they do not fit in memory, the MemoryError is raised here, before the first piece.
    np.empty((len(start), 2 * start.shape[1]))
    # A batch of all runs that end at their start checks the arguments of each run. It has no step and no monitors.
    checks: PieceOptions = {"check_sampling": True, "check_monitors": options["monitors"], "monitors": False}
    short: PieceOptions = {**options, **_starts(states, slice(None)), **checks, "t_end": 0.0, "t_eval": None}
    short["keep"] = "metrics" if options["keep"] == "metrics" else "final"
    _core.simulate_batch(plant, law, start, short)


def _runs_per_piece(n: int, options: BatchOptions) -> int:
    records = 1.0
    if options["keep"] == "all":
        if options["t_eval"] is not None:
            records = float(np.size(options["t_eval"]))
        else:
            sampling = options["sample_time"]
            step = options["dt"] or (sampling.period if isinstance(sampling, Sampling) else sampling) or np.inf
            records = options["t_end"] / step / options["record_every"] + 2.0
    bytes_per_run = 8.0 * records * (5 * n + 10 * n + 5)
    return max(LEAST, int(PIECE / max(bytes_per_run, 1.0)) // LEAST * LEAST)


def _require_rows(out: Mapping[str, NDArray[Any]], rows: int) -> None:
    """Raise an error for arrays of `out` that cannot receive `rows` rows, and mark all rows as not finished."""
    instance("simulate_batch", "out", out, Mapping, "a table of arrays by name")
    for name, array in out.items():
        choice("simulate_batch", "a name of out", name, (*SERIES, "status"))
        wanted = "integers" if name == "status" else "float64"
        plain = isinstance(array, np.ndarray) and not isinstance(array, np.ma.MaskedArray)
        fits = plain and array.shape[:1] == (rows,) and array.flags.writeable
        if not fits or (array.dtype.kind != "i" if name == "status" else array.dtype != np.float64):
            got = f"{array.dtype} {array.shape}" if isinstance(array, np.ndarray) else type(array).__name__
            raise InputError(f'simulate_batch: out["{name}"] is not fit: expected a writeable array ({rows}, ..) of {wanted}, got {got}')
        array[...] = Status.INTERRUPTED if name == "status" else np.nan


def _write(out: Mapping[str, NDArray[Any]], piece: BatchRun, first: int, last: int) -> None:
    for name, array in out.items():
        values = getattr(piece, name)
        if values is None or array.shape[1:] != values.shape[1:]:
            expected = "no such rows" if values is None else f"({len(array)}, {', '.join(map(str, values.shape[1:]))})"
            raise InputError(f'simulate_batch: out["{name}"] has the wrong shape: expected {expected}, got {array.shape}')
        array[first:last] = values


def _starts(states: States, rows: slice) -> Starts:
    v0, theta0, theta_dot0 = (None if (x := states[name]) is None else x[rows] for name in ("v0", "theta0", "theta_dot0"))
    return {"v0": v0, "theta0": theta0, "theta_dot0": theta_dot0}


def _summed(piece: BatchRun, measures: Mapping[str, Any], first: int, last: int, rows: int) -> BatchRun:
    """Reduce a piece to the last record of each run, with the metrics in `stats`.

    The piece has the rows `first` to `last` of a batch of `rows` runs.
    """
    if first == 0:
        records = piece.q.shape[1:]
        _core.numbers("metrics", "reference", measures["reference"], records[1:], records, (rows, *records))
    if np.ndim(measures["reference"]) == 3:
        measures = {**measures, "reference": measures["reference"][first:last]}
    found = metrics(piece, **measures)
    fields: dict[str, Any] = {name: getattr(piece, name)[:, -1:] for name in SERIES if getattr(piece, name) is not None}
    fields |= {"t": piece.t[-1:], "status": piece.status, "monitors": {name: values[:, -1:] for name, values in piece.monitors.items()}}
    fields |= {"stats": piece.stats | dict(found), "law_name": piece.law_name, "parameters": piece.parameters}
    fields |= {"units": piece.units, "input_units": piece.input_units}
    return BatchRun(fields)


def _joined(pieces: Sequence[BatchRun], law: Any, plant: Any) -> BatchRun:
    first = pieces[0]

    def together(values: list[Any]) -> Any:
        return np.concatenate([np.asarray(value) for value in values])

    fields: dict[str, Any] = {name: together([getattr(p, name) for p in pieces]) for name in SERIES if getattr(first, name) is not None}
    fields |= {"t": first.t, "status": together([p.status for p in pieces])}
    fields |= {
        "monitors": {name: together([p.monitors[name] for p in pieces]) for name in first.monitors},
        "sampled": first._period or first._sampled,
    }
    stats = {name: [p.stats[name] for p in pieces] for name in first.stats}
    fields["stats"] = {name: together(values) if np.ndim(values[0]) else values[0] for name, values in stats.items()}
    return BatchRun(fields, law=law, plant=plant)
