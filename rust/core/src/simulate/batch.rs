//! Many runs: lanes side by side, groups of lanes over threads.
//!
//! Each group writes its own rows, so the bits do not depend on how many threads there are or who took what.
//! A group that is not full repeats its last run in the spare lanes.

use super::columns::Columns;
use super::general::General;
use super::measures::{Measures, Plan};
use super::measuring::Measuring;
use super::monitors::{self, Monitor};
use super::problem::{Division, Ended, Problem};
use super::programs::{self, Structures};
use super::rates_programs::Rates;
use super::schedule::Times;
use super::sink::Sink;
use crate::error::{Error, Result, all_finite};
use crate::memory;
use crate::parallel;
use crate::scalar::Real;
use crate::status::Status;
use rayon::iter::{IndexedParallelIterator, IntoParallelRefMutIterator, ParallelIterator};
use std::sync::atomic::{AtomicBool, Ordering};

/// What a batch keeps of each run.
#[derive(Clone, Debug, PartialEq)]
pub enum Keep {
    All,
    /// The last record.
    Final,
    /// The last record, and the numbers that sum all records up.
    Metrics(Measures),
}

/// A quantity of a summary: its name, its width where a run has several numbers, and the numbers, row-major.
pub type Metric = (&'static str, Option<usize>, Vec<f64>);

/// The records of a batch; arrays are row-major, `(B, K, ..)`.
#[derive(Clone, Debug, Default)]
pub struct BatchRuns {
    pub t: Vec<f64>,
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub tau: Vec<f64>,
    /// Motors of elastic plants; else empty.
    pub theta: Vec<f64>,
    pub theta_dot: Vec<f64>,
    pub z: Vec<f64>,
    pub monitors: Vec<(&'static str, Vec<f64>)>,
    /// What the runs are summed up by; NaN for one that did not reach its end.
    pub metrics: Vec<Metric>,
    pub status: Vec<Status>,
    /// When each run ended.
    pub ended: Vec<f64>,
    pub interrupted: bool,
    /// How the runs were computed: "machine", "portable" or "direct".
    pub engine: &'static str,
}

/// The rows of one group.
struct Rows<'a> {
    problem: &'a Problem<'a>,
    records: usize,
    columns: Columns,
    q: &'a mut [f64],
    v: &'a mut [f64],
    tau: &'a mut [f64],
    theta: &'a mut [f64],
    theta_dot: &'a mut [f64],
    z: &'a mut [f64],
    monitors: Vec<&'a mut [f64]>,
    checks: Vec<Monitor<'a>>,
    status: &'a mut [Status],
    ended: &'a mut [f64],
    values: Vec<f64>,
    /// When a monitor of each run stopped being finite.
    faults: Vec<f64>,
    /// The runs that are summed up, and where their numbers go.
    summed: Vec<Measuring<'a>>,
    metrics: Vec<&'a mut [f64]>,
}

impl Sink for Rows<'_> {
    fn record(&mut self, i: usize, lane: usize, t: f64, x: &[f64], tau: &[f64]) {
        // The spare lanes of a group that is not full have no rows.
        if lane >= self.status.len() {
            return;
        }
        if let Some(run) = self.summed.get_mut(lane) {
            run.record(i, t, x, tau);
            return;
        }
        if self.faults[lane].is_finite() {
            return;
        }
        if let Some(check) = self.checks.get_mut(lane) {
            check.evaluate(t, x, tau, &mut self.values);
            if !all_finite(&self.values) {
                self.faults[lane] = t;
                return;
            }
        }
        self.write(lane * self.records + i, x, tau);
    }

    fn take(&mut self, lane: usize, kept: &[f64], time: &dyn Fn(usize) -> f64) {
        if let Some(run) = self.summed.get_mut(lane) {
            run.take(kept, time);
        }
    }
}

impl Rows<'_> {
    /// Row `at`, with the monitors in `self.values`.
    fn write(&mut self, at: usize, x: &[f64], tau: &[f64]) {
        let parts = self.columns.split(x, tau);
        let rows: [(&mut [f64], &[f64]); 6] = [
            (self.q, parts.q),
            (self.v, parts.v),
            (self.tau, tau),
            (self.theta, parts.theta),
            (self.theta_dot, parts.theta_dot),
            (self.z, parts.z),
        ];
        for (to, from) in rows {
            to[from.len() * at..from.len() * (at + 1)].copy_from_slice(from);
        }
        for (series, &value) in self.monitors.iter_mut().zip(&self.values) {
            series[at] = value;
        }
    }
}

/// How many runs a batch takes side by side.
pub fn lanes() -> usize {
    programs::Lanes::LANES
}

/// Run every run of `problem` on `threads` threads. `poll` is asked every 20 ms whether to stop.
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
    problem.require_room(threads.min(runs))?;
    let plans = problem.plans()?;
    let mut out = allocate(&problem, times, plans.first())?;
    if runs == 0 {
        return Ok(out);
    }
    let structures = Structures::of(&problem, &division, true);
    let rates = Rates::of(&problem);
    let lanes = if structures.is_some() { lanes() } else { 1 };
    let mut groups = split(&problem, &mut out, lanes)?;
    let interrupted = parallel::run(threads, groups.len(), poll, |stop| {
        let stop: &AtomicBool = stop;
        let go = |(g, rows): (usize, &mut Rows)| {
            let (problem, first) = (&problem, g * lanes);
            if stop.load(Ordering::Relaxed) {
                return true;
            }
            rows.watch(first, &plans);
            let group = General { problem, division: &division, first, stop, sink: &mut *rows, asked: None, rates: rates.as_ref() };
            let ended = match (&division, &structures) {
                (Division::Fixed(fixed), Some(structures)) => programs::run::<programs::Lanes>(structures, group, fixed),
                _ => group.run_single(),
            };
            rows.finish(&ended, problem.options.t_end)
        };
        groups.par_iter_mut().enumerate().with_max_len(1).map(go).reduce(|| false, |a, b| a | b)
    });
    drop(groups);
    out.engine = structures.map_or_else(|| rates.map_or("direct", |rates| rates.engine()), |structures| structures.engine().name());
    out.interrupted = interrupted;
    Ok(out)
}

/// Room for the records, NaN until written; an error at once where it does not fit.
fn allocate(problem: &Problem, t: Vec<f64>, plan: Option<&Plan>) -> Result<BatchRuns> {
    let (runs, records, columns) = (problem.runs(), t.len(), Columns::of(problem));
    let (n, p) = (columns.n, columns.p);
    let rows = |records: usize, width: usize| -> Result<Vec<f64>> {
        let bytes = runs as u128 * records as u128 * width as u128 * 8;
        let len = runs.checked_mul(records).and_then(|n| n.checked_mul(width)).ok_or(Error::Memory { bytes })?;
        memory::filled(len, f64::NAN)
    };
    let room = |width: usize| rows(records, width);
    let columns_of = plan.map_or_else(Vec::new, Plan::columns);
    let metrics = columns_of.into_iter().map(|(name, width)| Ok((name, width, rows(1, width.unwrap_or(1))?))).collect::<Result<_>>()?;
    let names = monitors::names(problem);
    let monitors = names.iter().map(|&name| room(1).map(|series| (name, series))).collect::<Result<_>>()?;
    Ok(BatchRuns {
        q: room(n)?,
        v: room(n)?,
        tau: room(n)?,
        theta: room(columns.motors())?,
        theta_dot: room(columns.motors())?,
        z: room(p)?,
        monitors,
        metrics,
        status: memory::filled(runs, Status::Interrupted)?,
        ended: memory::zeros(runs)?,
        interrupted: false,
        engine: "direct",
        t,
    })
}

/// The rows of each group of `lanes` runs.
fn split<'a>(problem: &'a Problem, out: &'a mut BatchRuns, lanes: usize) -> Result<Vec<Rows<'a>>> {
    let (records, columns) = (out.t.len(), Columns::of(problem));
    let (n, motors) = (columns.n, columns.motors());
    let per_group = |w: usize| (lanes * records * w).max(1);
    let (mut q, mut v, mut tau) = (out.q.chunks_mut(per_group(n)), out.v.chunks_mut(per_group(n)), out.tau.chunks_mut(per_group(n)));
    let (mut theta, mut theta_dot) = (out.theta.chunks_mut(per_group(motors)), out.theta_dot.chunks_mut(per_group(motors)));
    let mut z = out.z.chunks_mut(per_group(columns.p));
    let mut monitors: Vec<_> = out.monitors.iter_mut().map(|(_, series)| series.chunks_mut(per_group(1))).collect();
    let mut metrics: Vec<_> = out.metrics.iter_mut().map(|(_, width, numbers)| numbers.chunks_mut(lanes * width.unwrap_or(1))).collect();
    let ended = out.ended.chunks_mut(lanes);
    // The parts of the monitors and the metrics are many small vectors.
    memory::require(ended.len() * (size_of::<Rows>() + (monitors.len() + metrics.len()) * size_of::<&mut [f64]>() + 32))?;
    memory::collected(out.status.chunks_mut(lanes).zip(ended).map(|(status, ended)| Rows {
        problem,
        records,
        columns,
        q: q.next().unwrap_or_default(),
        v: v.next().unwrap_or_default(),
        tau: tau.next().unwrap_or_default(),
        theta: theta.next().unwrap_or_default(),
        theta_dot: theta_dot.next().unwrap_or_default(),
        z: z.next().unwrap_or_default(),
        values: Vec::new(),
        monitors: monitors.iter_mut().map(|m| m.next().unwrap_or_default()).collect(),
        checks: Vec::new(),
        faults: Vec::new(),
        summed: Vec::new(),
        metrics: metrics.iter_mut().map(|m| m.next().unwrap_or_default()).collect(),
        status,
        ended,
    }))
}

impl Rows<'_> {
    /// Make what the group, whose first run is `first`, needs while it runs, and its monitors, each of which compiles an arm.
    fn watch(&mut self, first: usize, plans: &[Plan]) {
        self.values = vec![0.0; self.monitors.len()];
        self.faults = vec![f64::INFINITY; self.status.len()];
        let problem = self.problem;
        let runs = first..first + self.status.len();
        if !plans.is_empty() {
            let plan = |i: usize| &plans[if plans.len() == 1 { 0 } else { i }];
            self.summed = runs.map(|i| Measuring::new(problem, i, plan(i), self.monitors.len())).collect();
        } else if !self.monitors.is_empty() {
            self.checks = runs.map(|i| Monitor::new(problem, i)).collect();
        }
    }

    /// Note how each run of the group ended; whether it was interrupted.
    fn finish(&mut self, ended: &Ended, t_end: f64) -> bool {
        self.checks = Vec::new();
        let mut summed = std::mem::take(&mut self.summed);
        let mut faults = std::mem::take(&mut self.faults);
        for (fault, run) in faults.iter_mut().zip(&summed) {
            *fault = run.fault;
        }
        let interrupted = match ended {
            Ended::Fixed(of) if of.interrupted => true,
            Ended::Fixed(of) => {
                for (lane, (status, ended)) in self.status.iter_mut().zip(self.ended.iter_mut()).enumerate() {
                    let fault = of.at[lane].min(faults[lane]);
                    *status = if fault.is_finite() { Status::Diverged } else { Status::Success };
                    *ended = fault.min(t_end);
                }
                false
            }
            Ended::Adaptive(outcome) => {
                let fault = faults[0];
                let ended = if fault <= outcome.t { (Status::Diverged, fault) } else { (outcome.status, outcome.t) };
                (self.status[0], self.ended[0]) = ended;
                outcome.status == Status::Interrupted
            }
        };
        for (lane, run) in summed.iter_mut().enumerate() {
            if self.status[lane] == Status::Success && self.records > 0 {
                self.write_summary(lane, run);
            }
        }
        self.values = Vec::new();
        interrupted
    }

    /// The last record of a run and the numbers that sum it up.
    fn write_summary(&mut self, lane: usize, run: &mut Measuring) {
        let summary = run.summary();
        self.values.copy_from_slice(&run.values);
        self.write(lane * self.records, &run.x, &run.tau);
        let (rows, mut rest) = (self.status.len(), summary.as_slice());
        for to in &mut self.metrics {
            let width = to.len() / rows;
            let (numbers, behind) = rest.split_at(width);
            to[lane * width..(lane + 1) * width].copy_from_slice(numbers);
            rest = behind;
        }
    }
}
