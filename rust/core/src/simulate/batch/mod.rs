//! Batches of runs. A group computes several runs at the same time, one per lane of a SIMD register. Threads compute different groups.
//!
//! Each group writes only its own rows of the results. So the bits do not depend on the number of threads or on the order of the groups. In
//! a group that is not full, the unused lanes repeat the last run.
//!
//! With an adaptive explicit method, a group is one run. Each lane of a thread takes the next group when its run ends.

pub mod measuring;
pub mod priority;
pub mod rows;
pub mod stepper;

use crate::error::{Error, Result};
use crate::memory;
use crate::parallel;
use crate::scalar::Real;
use crate::simulate::columns::Columns;
use crate::simulate::metrics::plan::Plan;
use crate::simulate::monitors;
use crate::simulate::problem::Problem;
use crate::simulate::problem::measures::Measures;
use crate::simulate::problem::times::Times;
use crate::simulate::record::rates::Rates;
use crate::simulate::runs::adaptive_lanes::AdaptiveLanes;
use crate::simulate::runs::division::{Division, Ended};
use crate::simulate::runs::run_group::RunGroup;
use crate::simulate::runs::structures::{self, Structures};
use crate::status::Status;
use crate::trace::pages::in_large_pages;
use rows::{BatchRuns, GroupRecorder};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// The results of each run that a batch stores.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// # use nalgebra::dvector;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 50.0)?, Gain::scalar("kd", 1, 20.0)?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Keep, Measures, Options, Problem, simulate_batch};
///
/// let mut problem = Problem::from_rest(&plant, &law, &dvector![0.0], Options::fixed(0.1, 0.01))?;
/// // Two runs, from 1 rad and from 2 rad.
/// problem.x0 = vec![1.0, 0.0, 2.0, 0.0];
/// let runs = |keep| simulate_batch(problem.clone(), keep, 1, &mut || false);
/// assert_eq!((runs(Keep::All)?.q.len(), runs(Keep::Final)?.q.len()), (2 * 11, 2));
/// let measured = runs(Keep::Metrics(Measures::default()))?;
/// assert_eq!((measured.q.len(), measured.metrics[1].0, measured.metrics[1].2.as_slice()), (2, "error_peak", &[1.0, 2.0][..]));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Keep {
    /// All records.
    All,
    /// The last record.
    Final,
    /// The last record, and metrics of all records.
    Metrics(Measures),
}

/// Return the number of runs that one thread computes at the same time if a program computes them. Otherwise a thread computes one run at a
/// time.
pub fn lanes() -> usize {
    structures::Lanes::LANES
}

/// Run all runs of `problem` on `threads` threads, and return their records. `poll` is called every 20 ms. If it returns true, the runs
/// stop. Errors: those of [`Problem::validate`],
/// [`Problem::require_same_monitors`] and of invalid metrics, [`Error::Input`] for an adaptive method without record times, and
/// [`Error::Memory`] if the records exceed the memory.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use armlet_core::law::{Gain, LawSpec, PdGravitySpec};
/// use armlet_core::plant::{PlantSpec, RigidSpec};
/// use armlet_core::simulate::{Keep, Options, Problem, default_threads, simulate_batch};
/// use nalgebra::dvector;
///
/// let model = Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?);
/// let law = PdGravitySpec::new(model.clone(), dvector![0.0, 0.0], Gain::scalar("kp", 2, 40.0)?, Gain::scalar("kd", 2, 8.0)?)?;
/// let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model)));
/// let mut problem = Problem::from_rest(&plant, &law, &dvector![0.0, 0.0], Options::fixed(0.5, 1e-3))?;
/// // One hundred starts: positions, then velocities.
/// problem.x0 = (0..100).flat_map(|k| [0.01 * f64::from(k), 0.0, 0.0, 0.0]).collect();
/// let runs = simulate_batch(problem, Keep::Final, default_threads(), &mut || false)?;
/// assert_eq!((runs.q.len(), runs.status.len()), (200, 100));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub fn simulate_batch(problem: Problem, keep: Keep, threads: usize, poll: &mut dyn FnMut() -> bool) -> Result<BatchRuns> {
    let plants = problem.sticking_plants()?;
    let mut problem = match &plants {
        Some(plants) => problem.with_plants(plants),
        None => problem,
    };
    let runs = problem.runs();
    match keep {
        Keep::All => {}
        Keep::Final => problem.options.times = Times::At(vec![problem.options.t_end]),
        Keep::Metrics(measures) => problem.measures = Some(measures),
    }
    let division = problem.limit_by_shared_tables(problem.validate()?);
    if problem.options.monitors {
        problem.require_same_monitors()?;
    }
    let times = match (&division, &problem.measures) {
        (Division::Fixed(fixed), None) => fixed.schedule.record_times()?,
        (Division::Fixed(fixed), _) => {
            fixed.schedule.count().checked_sub(1).and_then(|last| fixed.schedule.record(last)).map(|r| r.t).into_iter().collect()
        }
        (Division::Adaptive(segments), measures) => match (&segments.times, measures) {
            (Times::At(t), None) => memory::copied(t)?,
            (Times::At(t), _) => t.last().copied().into_iter().collect(),
            (Times::Every(_), Some(_)) => vec![problem.options.t_end],
            (Times::Every(_), None) => {
                return Err(Error::input("t_eval", "is missing: expected times at which an adaptive batch is recorded, got None"));
            }
        },
    };
    problem.require_memory(threads.min(runs))?;
    let plans = problem.plans()?;
    let mut out = allocate(&problem, times, plans.first())?;
    if runs == 0 {
        return Ok(out);
    }
    let structures = Structures::of(&problem, &division, true);
    let rates = Rates::of(&problem);
    let lanes = structures.as_ref().map_or(1, Structures::lanes);
    let mut groups = rows::split(&problem, &mut out, lanes)?;
    let interrupted = parallel::run(threads, groups.len(), poll, |stop| {
        let stop: &AtomicBool = stop;
        if let Some(method) = problem.in_lanes(&division) {
            let groups = Mutex::new(groups.iter_mut().enumerate());
            let waiting = || {
                let (run, rows) = groups.lock().unwrap_or_else(PoisonError::into_inner).next()?;
                rows.watch(&plans);
                Some((run, rows))
            };
            let finish = |rows: &mut GroupRecorder, ended: &Ended| rows.finish(ended, problem.options.t_end);
            let on_thread = |_, _: &mut ()| {
                let (problem, division, rates) = (&problem, &division, &rates);
                AdaptiveLanes { problem, division, rates, stop, waiting: &waiting, finish: &finish }.run(method)
            };
            return parallel::any(&mut vec![(); threads.min(runs)], on_thread) | stop.load(Ordering::Relaxed);
        }
        let go = |g: usize, rows: &mut GroupRecorder| {
            let (problem, first) = (&problem, g * lanes);
            if stop.load(Ordering::Relaxed) {
                return true;
            }
            rows.watch(&plans);
            let group = RunGroup { problem, division: &division, first, stop, sink: &mut *rows, observer: None };
            let ended = match (&division, &structures) {
                (Division::Fixed(fixed), Some(structures)) if lanes == 1 => structures::run::<f64>(structures, group, fixed),
                (Division::Fixed(fixed), Some(structures)) => structures::run::<structures::Lanes>(structures, group, fixed),
                _ => group.run_single(&rates),
            };
            rows.finish(&ended, problem.options.t_end)
        };
        parallel::any(&mut groups, go)
    });
    drop(groups);
    out.engine = structures.map_or_else(|| rates.engine(), |structures| structures.engine(runs).name());
    out.interrupted = interrupted;
    Ok(out)
}

/// Reserve memory for the records without writing to it. The group that computes a run is the first to write its records. Errors:
/// [`Error::Memory`].
fn allocate(problem: &Problem, t: Vec<f64>, plan: Option<&Plan>) -> Result<BatchRuns> {
    let (runs, records, columns) = (problem.runs(), t.len(), Columns::of(problem));
    let (n, p) = (columns.n, columns.p);
    let size = |records: usize, width: usize| {
        let bytes = runs as u128 * records as u128 * width as u128 * 8;
        runs.checked_mul(records).and_then(|n| n.checked_mul(width)).ok_or(Error::Memory { bytes })
    };
    let allocated = |width: usize| size(records, width).and_then(memory::untouched).map(in_large_pages);
    let nan = || memory::filled(runs, f64::NAN);
    let metric = |(name, width): (_, Option<usize>)| Ok((name, width, memory::filled(size(1, width.unwrap_or(1))?, f64::NAN)?));
    let metrics = plan.map_or_else(Vec::new, Plan::columns).into_iter().map(metric).collect::<Result<_>>()?;
    let monitors = monitors::names(problem).iter().map(|&name| allocated(1).map(|series| (name, series))).collect::<Result<_>>()?;
    Ok(BatchRuns {
        q: allocated(n)?,
        v: allocated(n)?,
        tau: allocated(n)?,
        theta: allocated(columns.motors())?,
        theta_dot: allocated(columns.motors())?,
        z: allocated(p)?,
        bristles: allocated(columns.bristles)?,
        friction: allocated(if problem.plant(0).friction().is_some() { n } else { 0 })?,
        monitors,
        balances: [nan()?, nan()?, nan()?, nan()?],
        metrics,
        status: memory::filled(runs, Status::Interrupted)?,
        ended: memory::zeros(runs)?,
        interrupted: false,
        engine: "direct",
        t,
    })
}
