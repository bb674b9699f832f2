"""Identify numbers of a closed loop from its records, by least squares:

    minimise over p   sum_k |(x_k(p) - x_k) / sigma|^2

`x_k` are recorded positions and velocities, and `x_k(p)` is the simulated state with the numbers `p`. `sigma` is the standard deviation
of the records. Each step solves the linear least-squares problem of the tangents `dx_k/dp`, with the damping of Levenberg and Marquardt
[Marquardt1963].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import _core
from ..arguments import instance, integer, number, shown
from ..border import border, bordered
from ..errors import InputError, SolveError
from ..pickling import sealed
from .named_numbers import START, loop_with, named_numbers
from .recorded import Array
from .records import Run
from .sensitivity import require_names
from .simulation import simulate

__all__ = ["RunIdentification", "identify_from_runs"]

SHOWN = ("q", "v")
# Singular values below this fraction of the largest singular value count as zero, because they are rounding errors of the tangents.
CUTOFF = 1e-10
# Initial damping, and the damping above which the search ends because no step lowers the sum.
FIRST, LAST = 1e-3, 1e12


@bordered
@sealed
@dataclass(frozen=True, eq=False)
class RunIdentification:
    """Numbers of a loop that were identified from records, with their standard deviations.

    Attributes:
        values: the identified numbers by name, each with the shape of the number. The starts `q0` and `v0` have one row per run, (R, n).
        deviations: standard deviations of the numbers, in the same shapes; infinite for numbers that the records do not determine.
        covariance: covariance of all P numbers, one name after another, (P, P). It is zero along combinations of numbers that the records
            do not determine.
        rank: number of independent combinations of the numbers that the records determine.
        condition: largest divided by smallest singular value of the tangents, whose columns are scaled to the norm one. It is infinite
            if the rank is below P.
        residuals: root mean square of the differences between records and runs, by series: (n,), rad or m for q, rad/s or m/s for v.
        plant: the plant with the identified numbers.
        laws: the law of each run with the identified numbers.
        runs: the runs of the identified loop, at the times of the records.
        iterations: number of steps of the search.
        converged: whether the last step lowered the sum by less than the tolerance, or no step lowers the sum.
    """

    values: dict[str, Array]
    deviations: dict[str, Array]
    covariance: Array
    rank: int
    condition: float
    residuals: dict[str, Array]
    plant: _core.Plant
    laws: tuple[_core.Law, ...]
    runs: tuple[Run, ...]
    iterations: int
    converged: bool

    def __str__(self) -> str:
        size = len(self.covariance)
        end = "converged" if self.converged else "not converged"
        lines = [f"rank {self.rank} of {size}, condition {self.condition:.3g}, {self.iterations} iterations, {end}"]
        for name, value in self.values.items():
            for index in np.ndindex(value.shape):
                place = f"[{', '.join(map(str, index))}]" if index else ""
                lines.append(f"  {value[index]: .6g} +- {self.deviations[name][index]:.2g}  {name}{place}")
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"<RunIdentification: rank {self.rank} of {len(self.covariance)}, {len(self.runs)} runs>"


@border
def identify_from_runs(
    runs: Run | Sequence[Run],
    names: str | Sequence[str],
    *,
    plant: _core.Plant | None = None,
    law: _core.Law | Sequence[_core.Law] | None = None,
    noise: Mapping[str, Any] | None = None,
    iterations: int = 50,
    tolerance: float = 1e-9,
    **keywords: Any,
) -> RunIdentification:
    """Identify numbers of a plant, or of its law, from records of closed loops: inertial parameters, stiffness, damping.

        minimise over p   sum_k |(x_k(p) - x_k) / sigma|^2

    `x_k` are the recorded positions and velocities, and `sigma` is their standard deviation. `x_k(p)` is the simulated run with the numbers
    `p`, which starts at the first record. No measured acceleration or torque is required, because the law computes its input in the
    simulated loop.

    Args:
        runs: one record or a list of records. A record of a robot is `Run({"t": t, "q": q, "v": v})`, with times from t = 0 in s,
            positions in rad or m, and velocities in rad/s or m/s.
        names: names of numbers as for `simulate(sensitivity=)`: `"arm.parameters"`, `"plant.stiffness"`, `"plant.joint_damping"`.
            `"q0"` and `"v0"` identify the starts of every run. Without these names the first record is assumed to be exact.
        plant: the plant with the initial values of the numbers; None: the plant of the first run.
        law: the law, one for all runs or a list with one per run; None: the laws of the runs.
        noise: standard deviations of the records by series, `{"q": 1e-4, "v": 1e-3}`, scalar or (n,), rad or m, rad/s or m/s. None: each
            deviation is the same fraction of the recorded range of the position or velocity. The residuals determine this fraction.
        iterations: largest number of steps of the search.
        tolerance: the search ends when a step lowers the sum by less than this fraction.
        keywords: keywords of `simulate` for every run, such as `dt`, `method`, `sample_time`, `tau_max`.

    Returns:
        The identified numbers with their standard deviations, and the plant with these numbers.

    Raises:
        InputError: an argument is not valid; the message names it.
        SolveError: the run with the initial numbers does not reach its end.

    Source: [Marquardt1963]; docs/identification.md.

    >>> import armlet as al
    >>> arm = al.pendulum(1.0, 5.0)
    >>> law = al.MotorPD(arm, [0.8], kp=20.0, kd=2.0, joint_stiffness=100.0)
    >>> run = al.simulate(al.ElasticArm(arm, 120.0, 0.1), law, [0.0], t_end=1.0, dt=1e-3, record_every=20)
    >>> found = al.identify_from_runs(run, "plant.stiffness", plant=al.ElasticArm(arm, [100.0], 0.1), dt=1e-3)
    >>> found.values["plant.stiffness"].round(6).tolist()
    [120.0]
    """
    problem = _Problem(runs, require_names("identify_from_runs", "names", names), plant, law, noise, keywords)
    steps, tolerance = integer("identify_from_runs", "iterations", iterations), number("identify_from_runs", "tolerance", tolerance)
    p, (misses, slopes, found) = problem.first, problem.evaluate(problem.first)
    damping, taken, converged = FIRST, 0, False
    while taken < steps and not converged and damping <= LAST:
        scale = _sizes(slopes)
        rows = np.vstack([slopes / scale, np.sqrt(damping) * np.eye(len(p))])
        step = -np.linalg.lstsq(rows, np.concatenate([misses, np.zeros(len(p))]), rcond=None)[0] / scale
        try:
            tried = problem.evaluate(p + step)
        except (SolveError, InputError):
            damping *= 10.0
            continue
        before, after = float(misses @ misses), float(tried[0] @ tried[0])
        if after <= before:
            p, (misses, slopes, found) = p + step, tried
            damping, taken = max(damping / 10.0, 1e-15), taken + 1
            converged = before - after <= tolerance * before
        else:
            damping *= 10.0
    return problem.identification(p, misses, slopes, found, taken, converged or damping > LAST)


def _sizes(slopes: Array) -> Array:
    """Return the norm of each column. The result is 1 for a column of zeros."""
    sizes = np.linalg.norm(slopes, axis=0)
    return np.where(sizes > 0.0, sizes, 1.0)


class _Problem:
    """The least-squares problem: the records, their weights, and the simulated runs that are compared with the records."""

    def __init__(self, runs: Any, names: list[str], plant: Any, law: Any, noise: Any, keywords: Mapping[str, Any]) -> None:
        self.runs = [runs] if isinstance(runs, Run) else list(runs) if isinstance(runs, Sequence) else []
        if not self.runs or not all(isinstance(run, Run) for run in self.runs):
            raise InputError(f"identify_from_runs: runs is of the wrong type: expected a Run or a list of them, got {shown(runs)}")
        made = self.runs[0]._plants[0] if plant is None else plant
        self.plant = instance("identify_from_runs", "plant", made, _core.Plant, "a plant such as RigidArm")
        laws = [run._laws[0] for run in self.runs] if law is None else list(law) if isinstance(law, Sequence) else [law] * len(self.runs)
        if len(laws) != len(self.runs):
            raise InputError(f"identify_from_runs: law has the wrong length: expected {len(self.runs)}, one per run, got {len(laws)}")
        self.laws = [instance("identify_from_runs", "law", each, _core.Law, "a law of armlet such as Adaptive") for each in laws]
        for name in ("t_end", "t_eval", "record_every", "sensitivity", "throw", "events", "dense", "v0", "q0", "monitors"):
            if name in keywords:
                raise InputError(f"identify_from_runs: {name} is not used: the records determine the times and the starts")
        self.keywords = {"check_limits": False, **keywords, "monitors": False}
        for i, run in enumerate(self.runs):
            self._require_record(i, run)
        self.shared = [name for name in names if name not in START]
        self.starts = [name for name in names if name in START]
        known = named_numbers(self.plant, self.laws[0], {"q0": self.runs[0].q[0], **dict.fromkeys(START[1:])})
        for i, name in enumerate(names):
            if name not in known or name in names[:i]:
                raise InputError(
                    f"identify_from_runs: names is wrong: expected names of {sorted(known)} once, got {shown(name)} (first bad index {i})"
                )
        self.names, self.known = names, known
        parts = [known[name].ravel() for name in self.shared]
        for run in self.runs:
            parts += [self._start(run)[name] for name in self.starts]
        self.first = np.concatenate([np.zeros(0), *parts])
        self.places = self._places()
        self.noise_known = noise is not None
        self.weights = [self._weights(run, noise) for run in self.runs]
        if sum(run.q.size + run.v.size for run in self.runs) <= len(self.first):
            raise InputError(f"identify_from_runs: runs are too short: expected more than {len(self.first)} recorded numbers")

    def _require_record(self, i: int, run: Run) -> None:
        n = self.plant.arm.n
        if len(run.t) < 2 or run.t[0] != 0.0 or run.q.shape != (len(run.t), n):
            problem = f"expected at least two records from t = 0 of {n} joints, got q of shape {run.q.shape}"
            raise InputError(f"identify_from_runs: runs has no such record: {problem} (first bad index {i})")
        if not (np.isfinite(run.q).all() and np.isfinite(run.v).all()):
            raise InputError(f"identify_from_runs: runs is not finite: expected finite records (first bad index {i})")

    @staticmethod
    def _start(run: Run) -> dict[str, Array]:
        return {"q0": run.q[0], "v0": run.v[0]}

    def _weights(self, run: Run, noise: Any) -> Array:
        """Return 1 divided by the standard deviation of each recorded number, (K, 2 n)."""
        n = run.q.shape[1]
        parts = []
        for name in SHOWN:
            if noise is None:
                spread = np.ptp(np.concatenate([getattr(each, name) for each in self.runs]), axis=0)
                parts.append(1.0 / np.where(spread > 0.0, spread, 1.0))
                continue
            if not isinstance(noise, Mapping) or set(noise) != set(SHOWN):
                raise InputError(f"identify_from_runs: noise is wrong: expected deviations of {list(SHOWN)}, got {shown(noise)}")
            given = np.broadcast_to(_core.numbers("identify_from_runs", f"noise[{name!r}]", noise[name]), (n,))
            if not (np.isfinite(given).all() and (given > 0.0).all()):
                raise InputError(f"identify_from_runs: noise[{name!r}] is out of range: expected numbers > 0, got {shown(noise[name])}")
            parts.append(1.0 / given)
        weights: Array = np.broadcast_to(np.concatenate(parts), (len(run.t), 2 * n))
        return weights

    def loop(self, r: int, p: Array) -> tuple[Any, Any, dict[str, Array]]:
        """Return the plant, the law and the start of run `r` with the numbers `p`, (P,)."""
        plant, law, places = self.plant, self.laws[r], self.places[r]
        for name in self.shared:
            plant, law, _ = loop_with(plant, law, {}, name, p[places[name]].reshape(self.known[name].shape))
        return plant, law, self._start(self.runs[r]) | {name: p[places[name]] for name in self.starts}

    def evaluate(self, p: Array) -> tuple[Array, Array, list[Run]]:
        """Return the weighted differences between runs and records, (N,), their derivatives with respect to `p`, (N, P), and the runs."""
        misses, slopes, found = [], [], []
        for r, record in enumerate(self.runs):
            plant, law, start = self.loop(r, p)
            times = {"t_end": float(record.t[-1]), "t_eval": record.t}
            options: dict[str, Any] = {**self.keywords, "v0": start["v0"], **times}
            run = simulate(plant, law, start["q0"], sensitivity=self.names, **options)
            assert run.sensitivity is not None, "the run reached its end"
            weights = self.weights[r]
            left = np.concatenate([run.q - record.q, run.v - record.v], axis=1)
            columns = np.zeros((*left.shape, len(p)))
            for name, one in run.sensitivity.items():
                columns[..., self.places[r][name]] = np.concatenate([one.q, one.v], axis=1)
            misses.append((left * weights).ravel())
            slopes.append((columns * weights[..., None]).reshape(-1, len(p)))
            found.append(run)
        return np.concatenate(misses), np.concatenate(slopes), found

    def _places(self) -> list[dict[str, slice]]:
        """Return, for each run, the slice of each name's numbers in the vector of all numbers."""
        shared: dict[str, slice] = {}
        at, n = 0, self.plant.arm.n
        for name in self.shared:
            shared[name] = slice(at, at + self.known[name].size)
            at = shared[name].stop
        starts = [slice(at + k * n, at + (k + 1) * n) for k in range(len(self.starts) * len(self.runs))]
        each = len(self.starts)
        return [shared | dict(zip(self.starts, starts[r * each : (r + 1) * each], strict=True)) for r in range(len(self.runs))]

    def identification(self, p: Array, misses: Array, slopes: Array, found: list[Run], taken: int, converged: bool) -> RunIdentification:
        """Return the result of the search, which ended at the numbers `p`."""
        scale = _sizes(slopes)
        _, singular, rows = np.linalg.svd(slopes / scale, full_matrices=False)
        seen = singular > CUTOFF * max(float(singular.max(initial=0.0)), 1e-300)
        variance = 1.0 if self.noise_known else float(misses @ misses) / max(len(misses) - int(seen.sum()), 1)
        half = rows[seen] / singular[seen, None] / scale
        covariance = variance * half.T @ half
        unseen = np.linalg.norm(rows[~seen], axis=0) > 1e-6
        deviations = np.where(unseen, np.inf, np.sqrt(np.diag(covariance)))
        condition = float(singular[0] / singular[-1]) if seen.all() and len(singular) else np.inf
        values: dict[str, Array] = {}
        sigmas: dict[str, Array] = {}
        for name in self.names:
            for of_name, numbers in ((values, p), (sigmas, deviations)):
                if name in self.shared:
                    of_name[name] = numbers[self.places[0][name]].reshape(self.known[name].shape)
                else:
                    of_name[name] = np.stack([numbers[places[name]] for places in self.places])
        left = {
            name: np.sqrt(
                np.mean(np.concatenate([getattr(a, name) - getattr(b, name) for a, b in zip(found, self.runs, strict=True)]) ** 2, axis=0)
            )
            for name in SHOWN
        }
        loops = [self.loop(r, p) for r in range(len(self.runs))]
        laws = tuple(law for _, law, _ in loops)
        return RunIdentification(
            values, sigmas, covariance, int(seen.sum()), condition, left, loops[0][0], laws, tuple(found), taken, converged
        )
