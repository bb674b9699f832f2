"""Run a closed loop, once or many times."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Sized
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _core
from ..arguments import choice, instance, shown
from ..border import border
from ..errors import InputError, SolveError
from ..integration import DenseOutput
from ..progress import reporter
from ..status import Status, advice_on_run
from .balances import Balances, warn_of_balances, warn_of_force
from .batches import batch_of, forces_of_runs, in_pieces, measured_by_records, require_measures
from .contradictions import warn_of_contradictions
from .events import Event, Events, watched
from .options import BatchOptions, Force, RunOptions
from .records import BatchRun, Run
from .sampling import Sampling, period_of
from .sensitivity import of_rows, of_run, require_names, vary, vary_rows
from .speeds import warn_of_speeds
from .turns import require_timing, warn_of_turns

__all__ = ["simulate", "simulate_batch"]


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
    max_step: float | None = None,
    sample_time: float | Sampling | None = None,
    record_every: int = 1,
    t_eval: ArrayLike | None = None,
    force: Force = None,
    force_frame: str | None = None,
    tau_max: ArrayLike | None = None,
    monitors: bool = True,
    state_limit: float = 1e6,
    check_limits: bool | None = None,
    events: Event | Callable[..., float] | Sequence[Event | Callable[..., float]] | None = None,
    dense: bool = False,
    sensitivity: str | Sequence[str] | None = None,
    throw: bool = True,
) -> Run:
    """Simulate the closed loop of `plant` and `law` from rest, or from the velocity `v0`, without Python inside the loop.

    The exceptions are laws, forces and events that are Python functions.

    Args:
        plant: the controlled system, such as `RigidArm(arm)`.
        law: the control law, for an arm with the same number of joints. A Python function `law(t, q, v) -> tau` is also accepted. Its
            arguments are `(t, q)` for a VelocityArm, and `(t, q, v, theta, theta_dot)` for an ElasticArm. Such a function is slow.
        q0: initial position, (n,), rad or m.
        t_end: length of the run, s.
        dt: step of a fixed-step method, s. If `t_end` is not a multiple of `dt`, the last step is shorter. None means the period of
            `sample_time`. An adaptive method requires None.
        v0: initial velocity, (n,), rad/s or m/s; zero if None. A VelocityArm requires None.
        method: "euler", "semi_implicit", "rk4" or "ros2" take fixed steps; "ros2" is implicit and L-stable. "dopri5",
            "dop853", "radau5" and "rodas4" are adaptive and use `rtol` and `atol`. "radau5" and "rodas4" are implicit, for stiff plants.
            "stiff" is "rodas4" with `sample_time`, otherwise "radau5".
        sample_time: None evaluates the law in every stage. A period in s holds the law's output for that time, as a real controller does. A
            `Sampling` adds delay, jitter, noise, quantisation, joint-torque sensors and a rate limit.
        force: external force, N or N m: None, a constant, a piecewise constant list `[(t_start, F), ...]`, or a function `F(t)`. The force
            acts at the law's frame, in the law's axes. A function is Python inside the loop, and slow. Before the run, an adaptive method
            evaluates it at 4,097 times and searches its jumps, with at most 4,096 further calls. So the steps do not pass over its changes.
            A change that is shorter than `t_end / 4096` may be missed: then use a list, or `max_step`. A VelocityArm
            requires None.
        tau_max: largest magnitude of the input, at which it saturates, scalar or (n,), N m or N; rad/s or m/s under velocity control.
        sensitivity: names of numbers of the loop, such as `["law.kp", "arm.parameters", "q0"]`. `Run.sensitivity` has the derivatives of
            all series with respect to these numbers, for explicit methods. The error for an unknown name lists the valid names. See
            docs/gradients.md.

    Other Args:
        theta0, theta_dot0: initial motor positions and velocities of elastic arms, (n,), rad or m, rad/s or m/s. With None the spring
            torques balance gravity, and the motors have the velocity of the links.
        rtol, atol: relative and absolute error per step of an adaptive method; None: 1e-8 and 1e-10. A fixed-step method requires None.
        max_step: largest step of an adaptive method, s; None: no limit, except near changes of a `force` that is a function. `math.inf`
            also omits this exception. A fixed-step method requires None.
        record_every: number of steps between records. The start and the end are always recorded.
        t_eval: times of the records, (K,), increasing, in [0, t_end], s. They replace `record_every`, which must be 1.
        force_frame: name of another frame at which the force acts, required for a law without a frame. The force is then (3,), or (6,) as
            [f; m], in world axes.
        monitors: compute and record the monitors: see `Run.monitors`. A monitor that is not finite ends the run.
        state_limit: largest magnitude of a position or velocity of links or motors, rad or m, rad/s or m/s. A larger value ends the run
            with `Status.DIVERGED`. `math.inf` sets no limit.
        check_limits: action if `q0`, the target of the law or an end of its motion is outside of the joint limits. None warns, True
            raises an error, and False does neither.
        events: zero crossings that an adaptive method locates: `Event`s, or functions `g(t, q, v)`, which are Python inside
            the loop. `Run.events` contains the crossings. An event with `stop` ends the run with `Status.EVENT`.
        dense: store the polynomial of every step of an adaptive method. `run.sample(t)` then evaluates the state at any time.
        throw: True raises an error if the run ends early, unless an event with `stop` ended it. False returns the partial run with its
            status.

    Returns:
        The recorded run. Time is the first axis of its arrays: `run.q` is (K, n).

    Raises:
        InputError: an argument is not valid, or a position is outside of the joint limits; the message names it.
        SolveError: the run ended early, but not by an event. Its attributes `status`, `t` and `partial` are the reason, the time and the
            partial run.

    Warns:
        UserWarning: commands pass the finite speed limits of the arm: the inputs of a VelocityArm, or the velocities of the joints under a
            `PriorityAcceleration`. Priority laws keep these limits with `limits=True`, and omit the warning with `limits=False`.
        UserWarning: torque limits of a `PriorityAcceleration` contradict its other limits, which are then missed (`run.active`).
        UserWarning: a position is outside of the joint limits, such as an angle in degrees. Or the steps are too coarse for the loop.
            They are too coarse if the residual of the energy balance exceeds 1e-6 J and a tenth of the energy stored or exchanged. There
            is a second criterion for a law that acts at every instant without `tau_max` and `force`. The steps are too coarse if the
            Lyapunov function rises tenfold and the residual of its balance exceeds a tenth of it. Without `monitors` the steps are not
            checked.
        UserWarning: a continuous joint starts more than half a turn from its target, so that another turn is nearer (`Arm.nearest`).
            `check_limits=False` omits this.
        UserWarning: a `force` that is a function and changes within less than half of a fixed step.
            `metrics(run)["energy_error"]` is the residual of the energy balance as a fraction of the energy.

    Source: [HairerNorsettWanner1993, HairerWanner1996] for the methods; docs/plants_and_laws.md.

    >>> import armlet as al
    >>> arm = al.planar_pr(2.0, 0.5, 0.5)
    >>> law = al.ComputedTorque(arm, al.Hold([1.0, 0.0]), kp=100.0, kd=20.0)
    >>> run = al.simulate(al.RigidArm(arm), law, [0.0, 0.0], t_end=2.0, dt=1e-3)
    >>> run.q.shape
    (2001, 2)
    """
    instance("simulate", "throw", throw, (bool, np.bool_), "True or False")
    require_timing("simulate", law)
    searched = watched(events)
    options = RunOptions(
        t_end=t_end, dt=dt, v0=v0, theta0=theta0, theta_dot0=theta_dot0, method=method, rtol=rtol, atol=atol, max_step=max_step,
        sample_time=sample_time, record_every=record_every, t_eval=t_eval, force=force, force_frame=force_frame, tau_max=tau_max,
        monitors=monitors, state_limit=state_limit, check_limits=check_limits, events=searched, dense=dense,
    )  # fmt: skip
    names = None if sensitivity is None else require_names("simulate", "sensitivity", sensitivity)
    # `vary` raises the errors of invalid names before the run.
    loops = None if names is None else vary("simulate", plant, law, q0, options, names)
    fields = _core.simulate(plant, law, q0, options)
    fields |= {"sampled": period_of(sample_time), "tau_max": tau_max}
    ended, unresolved, balances = fields.pop("ended"), fields.pop("unresolved"), Balances(**fields.pop("balances"))
    if searched:
        fields["events"] = Events(names=tuple(event.name for event in searched), **fields["events"])
    if dense:
        states, *polynomials = fields["dense"]
        fields["dense"] = DenseOutput(0.0, *polynomials), states
    if loops is not None and fields["status"] == Status.SUCCESS:
        fields["sensitivity"] = of_run(loops, options, fields["t"])
    run = Run(fields, law=law, plant=plant)
    if throw and run.status not in (Status.SUCCESS, Status.EVENT):
        advice = advice_on_run(run.status, method, rtol, atol, run.stats)
        message = f"simulate: the run ended at t = {ended:.9g} s: {run.status.name.lower()}: {advice}{_ran_away(plant, run)}"
        raise SolveError(message, run.status, ended, run)
    if unresolved is not None:
        warn_of_force("simulate", unresolved, run.stats["dt"])
    undisturbed = sample_time is None and tau_max is None and force is None
    if run.monitors:
        warn_of_balances("simulate", balances, np.asarray(run.status in (Status.SUCCESS, Status.EVENT)), undisturbed)
    warn_of_speeds("simulate", run)
    warn_of_contradictions("simulate", run)
    if check_limits is not False:
        warn_of_turns("simulate", plant, law, q0)
    return run


def _ran_away(plant: _core.Plant, run: Run) -> str:
    """Describe a run that diverged, for the text of an error. The result is empty for other runs.

    The text names an input that is not finite at the last record, or a mass matrix that is not positive definite there. Otherwise it names
    the fastest joint at the last record, and the first joint outside of its limits in the records.
    """
    if run.status != Status.DIVERGED or not len(run.t):
        return ""
    if run.tau is not None and not np.isfinite(run.tau[-1]).all():
        i = int(np.flatnonzero(~np.isfinite(run.tau[-1]))[0])
        return f"; the input of the law is not finite at the last record, t = {run.t[-1]:.9g} s: tau[{i}] = {run.tau[-1, i]}"
    torques = run.input_units[0] in ("N", "N m")
    if torques and not np.linalg.eigvalsh(plant.arm.mass_matrix(run.q[-1]))[0] > 0.0:
        return (
            f"; the mass matrix is not positive definite at the last record, t = {run.t[-1]:.9g} s. "
            "Add <inertial> elements to the file, or use arm.with_payload(frame, mass) or arm.with_drives(armature=..)"
        )
    i = int(np.abs(run.v[-1]).argmax())
    text = f"; the fastest joint at the last record, t = {run.t[-1]:.9g} s: v[{i}] = {run.v[-1, i]:.4g}"
    limits = plant.arm.limits
    if not limits:  # arms in closed form have no limits
        return text
    left = (run.q < limits["q_min"]) | (run.q > limits["q_max"]) | (np.abs(run.v) > limits["v_max"])
    first = np.flatnonzero(left.any(axis=1))
    if not len(first):
        return text
    k = int(first[0])
    i = int(left[k].argmax())
    name = plant.arm.joint_names[i]
    return f"{text}; {name} left its limits first, at t = {run.t[k]:.9g} s: q[{i}] = {run.q[k, i]:.4g}, v[{i}] = {run.v[k, i]:.4g}"


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
    max_step: float | None = None,
    sample_time: float | Sampling | None = None,
    record_every: int = 1,
    t_eval: ArrayLike | None = None,
    force: ArrayLike | Sequence[tuple[float, ArrayLike]] | Sequence[Sequence[tuple[float, ArrayLike]]] | None = None,
    force_frame: str | None = None,
    tau_max: ArrayLike | None = None,
    monitors: bool = True,
    state_limit: float = 1e6,
    check_limits: bool | None = None,
    threads: int | None = None,
    keep: Literal["all", "final", "metrics"] = "all",
    metrics: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], object] | bool | None = None,
    out: Mapping[str, NDArray[Any]] | None = None,
    sensitivity: str | Sequence[str] | None = None,
) -> BatchRun:
    """Simulate B closed loops in SIMD lanes and threads. The result has the fields of a run with a leading axis B.

    A failed run raises no error. `status` has one entry per run, and the rows of a failed run are NaN from its failure on. The bits of the
    other runs do not change. The results have the same bits for every number of threads. One warning per balance (energy, Lyapunov) counts
    the runs with a large residual. Others count the runs whose commands pass the arm's
    speed limits, and those in which torque limits contradict other limits. A batch with `progress`, `out` or a reference per record
    issues them after its last piece.

    Args:
        plant, law: one for all runs, or a list with one per run. All runs have the same kinds of plant, joints, friction and law. They also
            have the same monitors, unless `monitors` is False.
        q0, v0, theta0, theta_dot0: initial positions and velocities of joints and motors, (B, n), rad or m, rad/s or m/s.
        t_end, dt: length of all runs and step of a fixed-step method, s, as for `simulate`.
        method, rtol, atol, max_step: method, error per step and largest step, as for `simulate`.
        sample_time: period of the law in s, or a `Sampling`, as for `simulate`.
        force: external force, N or N m. One force for all runs has the forms of `simulate`, except a function. One force per run is an
            array of constants (B, k), or a list of B lists `[(t_start, F), ...]`.
        threads: number of worker threads, 1 to 1024; None means ARMLET_NUM_THREADS, or else the number of cores. The batch uses at most
            one thread per group of runs that one SIMD register computes together.
        keep: "all" keeps all records, "final" only the last state, and "metrics" the metrics of each run and its last record. Metrics are
            computed during the runs. So the memory does not depend on the number of steps, unless `reference` has one row per record.
            `batch.metrics()` has the numbers of `armlet.metrics`.
        metrics: arguments of `armlet.metrics` with keep="metrics": `band`, `settle`, `tolerance`, `reference`, `frame`.

    Other Args:
        record_every: number of steps between records.
        t_eval: times of the records, (K,), s. An adaptive method with keep="all" requires it, because its runs step at different times.
            With keep="metrics", None means that the metrics use every accepted step.
        force_frame, tau_max: frame of the force, and largest magnitude of the input, as for `simulate`.
        monitors, state_limit, check_limits: as for `simulate`. One warning counts the rows outside of the joint limits.
        progress: True writes the number of finished runs and the remaining time to standard error. A function is called as
            `progress(done, runs)` after every piece of the batch. A piece is a group of consecutive runs.
        out: arrays of the caller by name ("q", "v", "tau", "status", ..) that receive the rows of each finished piece. After Ctrl-C they
            have the finished rows. The other rows are NaN, with `Status.INTERRUPTED`.
        sensitivity: names of numbers, as for `simulate`, with keep="all". `batch.sensitivity` has the derivatives, (B, K, n, size). They
            are equal to the derivatives of the single runs.

    Returns:
        The runs. `batch.q` is (B, K, n), `batch.status` is (B,), and `batch[i]` is the `Run` of row i.

    Raises:
        InputError: an argument is not valid; the message names it.
        MemoryError: the records do not fit in memory; raised before the batch starts.

    Source: docs/batches.md.

    >>> import numpy as np
    >>> import armlet as al
    >>> arm = al.planar_pr(2.0, 0.5, 0.5)
    >>> law = al.ComputedTorque(arm, al.Hold([1.0, 0.0]), kp=100.0, kd=20.0)
    >>> batch = al.simulate_batch(al.RigidArm(arm), law, np.zeros((64, 2)), t_end=1.0, dt=1e-3, record_every=100)
    >>> batch.q.shape
    (64, 11, 2)
    """
    plants = list(plant) if isinstance(plant, Sequence) else plant
    laws = list(law) if isinstance(law, Sequence) else law
    undisturbed = sample_time is None and tau_max is None and force is None
    forces = None if force is None else forces_of_runs(force, len(q0) if isinstance(q0, Sized) else 0)
    choice("simulate_batch", "keep", keep, ("all", "final", "metrics"))
    report = reporter("simulate_batch", progress, "runs")
    options = BatchOptions(
        t_end=t_end, dt=dt, v0=v0, theta0=theta0, theta_dot0=theta_dot0, method=method, rtol=rtol, atol=atol, max_step=max_step,
        sample_time=sample_time, record_every=record_every, t_eval=t_eval, force=forces, force_frame=force_frame, tau_max=tau_max,
        monitors=monitors, state_limit=state_limit, check_limits=check_limits, threads=threads, keep=keep,
        metrics=require_measures(keep, metrics),
    )  # fmt: skip
    loops = None
    if sensitivity is not None:
        if keep != "all":
            raise InputError(f'simulate_batch: sensitivity is not used: expected None with keep="{keep}", got {shown(sensitivity)}')
        # `vary_rows` raises the errors of invalid names before the runs.
        loops = vary_rows("simulate_batch", plants, laws, q0, options, require_names("simulate_batch", "sensitivity", sensitivity))
    if report is not None or out is not None or measured_by_records(options):
        batch = in_pieces(plants, laws, q0, options, report, out, undisturbed)
    else:
        batch = batch_of(plants, laws, q0, options, undisturbed)
    if loops is not None:
        batch.sensitivity = of_rows(loops, options, batch.t, batch.status, threads)
    if check_limits is not False and not isinstance(plants, list) and not isinstance(laws, list):
        warn_of_turns("simulate_batch", plants, laws, q0)
    return batch
