//! Many runs: lanes side by side, groups of lanes over threads.
//!
//! Each group writes its own rows, so the bits do not depend on the number of threads or on the order of the groups.
//! A group that is not full repeats its last run in the spare lanes.

use super::batch_rows::{self, GroupRecorder};
use super::columns::Columns;
use super::general::General;
use super::measures::{Measures, Plan};
use super::monitors;
use super::problem::{Division, Problem};
use super::programs::{self, Structures};
use super::rates_programs::Rates;
use super::schedule::Times;
use crate::error::{Error, Result};
use crate::memory;
use crate::parallel;
use crate::scalar::Real;
use crate::status::Status;
use crate::trace::pages::in_large_pages;
use std::sync::atomic::{AtomicBool, Ordering};

/// The results that a batch keeps of each run.
#[derive(Clone, Debug, PartialEq)]
pub enum Keep {
    /// All records.
    All,
    /// The last record.
    Final,
    /// The last record, and metrics of all records.
    Metrics(Measures),
}

/// A quantity of a summary: its name, its width where a run has several numbers, and the numbers, row-major.
pub type Metric = (&'static str, Option<usize>, Vec<f64>);

/// The records of a batch; arrays are row-major, `(B, K, ..)`. The arrays of an interrupted batch have no meaning.
#[derive(Clone, Debug, Default)]
pub struct BatchRuns {
    /// Times of the records `(K,)`, s.
    pub t: Vec<f64>,
    /// Positions `(B, K, n)`.
    pub q: Vec<f64>,
    /// Velocities `(B, K, n)`.
    pub v: Vec<f64>,
    /// Inputs of the plant `(B, K, n)`.
    pub tau: Vec<f64>,
    /// Motors of elastic plants; else empty.
    pub theta: Vec<f64>,
    /// Motor velocities.
    pub theta_dot: Vec<f64>,
    /// States of the laws `(B, K, p)`.
    pub z: Vec<f64>,
    /// Deflections of the bristles of LuGre friction, `(B, K, n)`; else empty.
    pub bristles: Vec<f64>,
    /// Torques of dry friction, `(B, K, n)`; empty without.
    pub friction: Vec<f64>,
    /// Monitors by name, `(B, K)` each.
    pub monitors: Vec<(&'static str, Vec<f64>)>,
    /// Residuals of the balances of recorded runs, see [`super::BALANCES`]; NaN for a run that did not reach its end.
    pub balances: [Vec<f64>; 4],
    /// The metrics of the runs; NaN for a run that did not reach its end.
    pub metrics: Vec<Metric>,
    /// How each run ended.
    pub status: Vec<Status>,
    /// When each run ended.
    pub ended: Vec<f64>,
    /// Whether the caller interrupted the batch.
    pub interrupted: bool,
    /// How the runs were computed: "machine", "portable" or "direct".
    pub engine: &'static str,
}

/// The number of runs that a batch computes side by side.
pub fn lanes() -> usize {
    programs::Lanes::LANES
}

/// Run every run of `problem` on `threads` threads. `poll` is called every 20 ms, and may stop the runs.
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
pub fn simulate_batch(mut problem: Problem, keep: Keep, threads: usize, poll: &mut dyn FnMut() -> bool) -> Result<BatchRuns> {
    let runs = problem.runs();
    match keep {
        Keep::All => {}
        Keep::Final => problem.options.times = Times::At(vec![problem.options.t_end]),
        Keep::Metrics(measures) => problem.measures = Some(measures),
    }
    let division = problem.validate()?;
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
    let lanes = if structures.is_some() { lanes() } else { 1 };
    let mut groups = batch_rows::split(&problem, &mut out, lanes)?;
    let interrupted = parallel::run(threads, groups.len(), poll, |stop| {
        let stop: &AtomicBool = stop;
        let go = |g: usize, rows: &mut GroupRecorder| {
            let (problem, first) = (&problem, g * lanes);
            if stop.load(Ordering::Relaxed) {
                return true;
            }
            rows.watch(&plans);
            let group = General { problem, division: &division, first, stop, sink: &mut *rows, observer: None, rates: rates.as_ref() };
            let ended = match (&division, &structures) {
                (Division::Fixed(fixed), Some(structures)) => programs::run::<programs::Lanes>(structures, group, fixed),
                _ => group.run_single(),
            };
            rows.finish(&ended, problem.options.t_end)
        };
        parallel::any(&mut groups, go)
    });
    drop(groups);
    out.engine = structures.map_or_else(|| rates.map_or("direct", |rates| rates.engine()), |structures| structures.engine().name());
    out.interrupted = interrupted;
    Ok(out)
}

/// Memory for the records, which nothing accesses before the groups write their rows. If it does not fit, there is an error at once.
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
