"""Run a closed loop, once or many times."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Sized
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..arguments import choice, instance
from ..border import border
from ..errors import SolveError
from ..integration import DenseOutput
from ..progress import reporter
from ..status import Status, advice_on_run
from .balances import Balances, warn_of_balances
from .batches import batch_of, forces_of_runs, in_pieces, measured_by_records, require_measures
from .events import Event, Events, watched
from .records import BatchRun, Run
from .sampling import Sampling
from .sensitivity import of_run, require_names, vary

__all__ = ["simulate", "simulate_batch"]

Force: TypeAlias = ArrayLike | Sequence[tuple[float, ArrayLike]] | Callable[[float], ArrayLike] | None


@border
def simulate(
    plant: _core.Plant,
    law: _core.Law | Callable[..., ArrayLike],
    q0: ArrayLike,
    *,
    t_end: float,
    dt: float | None = None,
    v0: ArrayLike | None = None,
    theta0: ArrayLike | None = None,
    theta_dot0: ArrayLike | None = None,
    method: str = "rk4",
    rtol: float | None = None,
    atol: float | None = None,
    sample_time: float | Sampling | None = None,
    record_every: int = 1,
    t_eval: ArrayLike | None = None,
    force: Force = None,
    force_frame: str | None = None,
    tau_max: ArrayLike | None = None,
    monitors: bool = True,
    state_limit: float = 1e6,
    events: Event | Callable[..., float] | Sequence[Event | Callable[..., float]] | None = None,
    dense: bool = False,
    sensitivity: str | Sequence[str] | None = None,
    throw: bool = True,
) -> Run:
    """Close the loop of `plant` and `law` and run it from rest, or from `v0`, with no Python inside.

    Args:
        plant: what is controlled, such as `RigidArm(arm)`.
        law: what controls it, made for an arm with as many joints; or any callable `law(t, q, v) -> tau` (`law(t, q)` for a VelocityArm,
            `law(t, q, v, theta, theta_dot)` for an ElasticArm), which is Python inside the loop, asked once per sample: slow.
        q0: initial position, (n,), rad or m.
        t_end: length of the run, s.
        dt: step of a fixed-step method, s; a last shorter step ends a run that is not a multiple of it. None for an adaptive method; with
            a fixed-step method and a `sample_time` None is that time.
        v0: initial velocity, (n,); zero if None.
        theta0, theta_dot0: initial motor positions and velocities of elastic arms, (n,); None: the springs carry gravity, the motors
            move with the links.
        method: "euler", "semi_implicit", "rk4", "ros2" (fixed steps, need `dt`; ros2 is implicit and L-stable) or "dopri5", "dop853",
            "radau5", "rodas4" (adaptive, `rtol` and `atol`; the last two are implicit, for stiff plants).
        rtol, atol: relative and absolute error allowed per step of an adaptive method; None: 1e-8 and 1e-10, and always None for a
            fixed-step method.
        sample_time: None evaluates the law inside every stage; a period in s holds its output that long, as a real controller does; a
            `Sampling` adds delay, jitter, noise, quantisation, joint-torque sensors and a rate limit.
        record_every: record the start and every so many steps, and the end.
        t_eval: record exactly these times instead, increasing, in [0, t_end].
        force: external force: None, constant, `[(t_start, F), ...]` piecewise constant, or a callable `F(t)`; in the law's axes at its
            frame, N or N m. A callable is Python inside the loop, and slow.
        force_frame: the frame at which the force acts instead; then it is (3,), or (6,) as [f; m], in world axes.
        tau_max: the input saturates at this magnitude, scalar or (n,), N m or N.
        monitors: integrate and record the identities that theory promises: see `Run.monitors`. A monitor that is not finite ends the run.
        state_limit: a position or velocity of the plant (links and motors) beyond this ends the run with `Status.DIVERGED`, rad or m and
            per second; `math.inf` for no limit.
        events: zero crossings to be located in a run of an adaptive method: `Event`s, or functions `g(t, q, v)`, which are Python inside
            the loop; `Run.events` has them. One that stops the run ends it with `Status.EVENT`.
        dense: keep the polynomial of every step of an adaptive method: `run.sample(t)` is the state at any time.
        sensitivity: names of numbers of the loop such as `["law.kp", "arm.parameters", "q0"]`: `Run.sensitivity` has the derivatives of all
            series with respect to them, by explicit methods. An unknown name is refused with the names there are; the page on gradients
            has the rules.
        throw: raise where the run does not reach its end; False returns what there is, with its status.

    Returns:
        The recorded run.

    Raises:
        InputError: an argument is not what it should be.
        SolveError: the run did not reach its end; `.status`, `.t` and `.partial` say how, when and what there is.

    Warns:
        UserWarning: the energy balance misses more than a tenth of the energy turned over, or the Lyapunov function of a law that acts at
            every instant rises tenfold: the steps are too coarse for the loop. `metrics(run)["energy_error"]` is that fraction.

    >>> import armlet as al
    >>> arm = al.planar_pr(2.0, 0.5, 0.5)
    >>> law = al.ComputedTorque(arm, al.Hold([1.0, 0.0]), kp=100.0, kd=20.0)
    >>> run = al.simulate(al.RigidArm(arm), law, [0.0, 0.0], t_end=2.0, dt=1e-3)
    >>> run.q.shape
    (2001, 2)
    """
    instance("simulate", "throw", throw, (bool, np.bool_), "True or False")
    keywords = locals()  # a dictionary of its own; the plant, the law and q0 among it are not asked for
    keywords["events"] = searched = watched(events)
    names = None if sensitivity is None else require_names("simulate", "sensitivity", sensitivity)
    if names is not None:
        vary("simulate", plant, law, q0, keywords, names)  # what is wrong with the names is said before the run
    fields = _core.simulate(plant, law, q0, keywords)
    ended, balances = fields.pop("ended"), Balances(**fields.pop("balances"))
    if searched:
        fields["events"] = Events(names=tuple(event.name for event in searched), **fields["events"])
    if dense:
        states, *polynomials = fields["dense"]
        fields["dense"] = DenseOutput(0.0, *polynomials), states
    if names is not None and fields["status"] == Status.SUCCESS:
        fields["sensitivity"] = of_run(plant, law, q0, keywords, names, fields["t"])
    run = Run(fields, law=law, plant=plant)
    if throw and run.status not in (Status.SUCCESS, Status.EVENT):
        advice = advice_on_run(run.status, method, rtol, atol, run.stats)
        message = f"simulate: the run ended at t = {ended:.9g} s: {run.status.name.lower()}: {advice}{_fastest(run)}"
        raise SolveError(message, run.status, ended, run)
    undisturbed = sample_time is None and tau_max is None and force is None
    if run.monitors:
        warn_of_balances("simulate", balances, np.asarray(run.status in (Status.SUCCESS, Status.EVENT)), undisturbed)
    return run


def _fastest(run: Run) -> str:
    """The joint that runs away, by the last record of a run that diverged."""
    if run.status != Status.DIVERGED or not len(run.t):
        return ""
    i = int(np.abs(run.v[-1]).argmax())
    return f"; the fastest joint at the last record, t = {run.t[-1]:.9g} s: v[{i}] = {run.v[-1, i]:.4g}"


@border
def simulate_batch(
    plant: _core.Plant | Sequence[_core.Plant],
    law: _core.Law | Sequence[_core.Law],
    q0: ArrayLike,
    *,
    t_end: float,
    dt: float | None = None,
    v0: ArrayLike | None = None,
    theta0: ArrayLike | None = None,
    theta_dot0: ArrayLike | None = None,
    method: str = "rk4",
    rtol: float | None = None,
    atol: float | None = None,
    sample_time: float | Sampling | None = None,
    record_every: int = 1,
    t_eval: ArrayLike | None = None,
    force: ArrayLike | Sequence[tuple[float, ArrayLike]] | Sequence[Sequence[tuple[float, ArrayLike]]] | None = None,
    force_frame: str | None = None,
    tau_max: ArrayLike | None = None,
    monitors: bool = True,
    state_limit: float = 1e6,
    threads: int | None = None,
    keep: Literal["all", "final", "metrics"] = "all",
    metrics: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], object] | bool | None = None,
    out: Mapping[str, NDArray[Any]] | None = None,
) -> BatchRun:
    """Run B closed loops side by side, in lanes and threads; the fields are those of a run with a leading axis B.

    A run that fails or passes `state_limit` does not raise: `status` has one entry per run, its rows are NaN from the fault on, and the
    other runs keep their bits. One warning names how many runs have balances that do not close. The same inputs give the same bits for
    every number of threads.

    Args:
        plant, law: one for all runs, or a list with one per run.
        q0, v0, theta0, theta_dot0: initial states, (B, n).
        force: one for all runs as for `simulate` (no callable), or one per run: constants (B, k), or a list of B lists
            `[(t_start, F), ...]`.
        threads: worker threads, 1 to 1024; None follows ARMLET_NUM_THREADS, then the cores. No more start than there are groups of runs.
        t_eval: needed by an adaptive method that keeps "all": its runs step at different times. With keep="metrics" None measures each
            accepted step.
        keep: "all" records, the "final" state alone, or the "metrics" of each run with its last record. The metrics are reduced while the
            runs go, so the memory does not depend on the number of steps; `batch.metrics()` has the numbers of `armlet.metrics`.
        metrics: with keep="metrics", what `armlet.metrics` takes beside the run: `band`, `settle`, `tolerance`, `reference`, `frame`.
        progress: True writes the runs done and the remaining time to standard error; a function is called as `progress(done, runs)` after
            every piece of the batch.
        out: arrays of yours by name ("q", "v", "tau", "status", ..) that get the rows piece by piece: after Ctrl-C they hold what was
            finished, and NaN and `Status.INTERRUPTED` elsewhere.
        (the rest): as for `simulate`.

    Raises:
        InputError: an argument is not what it should be.
        MemoryError: the records do not fit in memory; said before the batch starts.

    >>> import numpy as np
    >>> import armlet as al
    >>> arm = al.planar_pr(2.0, 0.5, 0.5)
    >>> law = al.ComputedTorque(arm, al.Hold([1.0, 0.0]), kp=100.0, kd=20.0)
    >>> batch = al.simulate_batch(al.RigidArm(arm), law, np.zeros((64, 2)), t_end=1.0, dt=1e-3, record_every=100)
    >>> batch.q.shape
    (64, 11, 2)
    """
    keywords = {name: value for name, value in locals().items() if name not in ("plant", "law", "q0", "progress", "out")}
    plants = list(plant) if isinstance(plant, Sequence) else plant
    laws = list(law) if isinstance(law, Sequence) else law
    if force is not None:
        keywords["force"] = forces_of_runs(force, len(q0) if isinstance(q0, Sized) else 0)
    undisturbed = sample_time is None and tau_max is None and force is None
    choice("simulate_batch", "keep", keep, ("all", "final", "metrics"))
    report = reporter("simulate_batch", progress, "runs")
    keywords["metrics"] = require_measures(keep, metrics)
    if report is not None or out is not None or measured_by_records(keywords):
        return in_pieces(plants, laws, q0, keywords, report, out, undisturbed)
    return batch_of(plants, laws, q0, keywords, undisturbed)
