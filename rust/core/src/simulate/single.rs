//! One run, on one number.

use super::monitors::{self, Monitor};
use super::planar_pr::{Group, Sink};
use super::problem::{Division, Problem};
use crate::error::Result;
use crate::scalar::run_scalar;
use crate::status::Status;
use std::sync::atomic::AtomicBool;

/// The records of one run; arrays are row-major with time first.
#[derive(Clone, Debug, Default)]
pub struct Run {
    pub t: Vec<f64>,
    /// `(K, n)`
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub tau: Vec<f64>,
    /// The law's state, `(K, p)`.
    pub z: Vec<f64>,
    /// `(K,)` per monitor.
    pub monitors: Vec<(&'static str, Vec<f64>)>,
    pub status: Status,
    /// When it ended: `t_end`, or the time of the fault.
    pub ended: f64,
    pub evaluations: u64,
    pub steps: u64,
    pub rejections: u64,
}

struct Rows<'a> {
    run: &'a mut Run,
    p: usize,
    monitor: Option<Monitor<'a>>,
    values: Vec<f64>,
}

impl Sink for Rows<'_> {
    fn record(&mut self, _: usize, _: usize, t: f64, x: &[f64], tau: &[f64]) {
        let run = &mut *self.run;
        run.t.push(t);
        run.q.extend_from_slice(&x[..2]);
        run.v.extend_from_slice(&x[2..4]);
        run.tau.extend_from_slice(tau);
        run.z.extend_from_slice(&x[4..4 + self.p]);
        if let Some(monitor) = &mut self.monitor {
            monitor.evaluate(t, x, &mut self.values);
            for ((_, series), &value) in run.monitors.iter_mut().zip(&self.values) {
                series.push(value);
            }
        }
    }
}

impl Rows<'_> {
    fn reserve(&mut self, records: usize) {
        let run = &mut *self.run;
        run.t.reserve_exact(records);
        for series in [&mut run.q, &mut run.v, &mut run.tau] {
            series.reserve_exact(2 * records);
        }
        run.z.reserve_exact(self.p * records);
        for (_, series) in &mut run.monitors {
            series.reserve_exact(records);
        }
    }
}

/// Run the one run of `problem`. What it recorded before a fault is in the result, with the status.
pub fn simulate(problem: &Problem, stop: &AtomicBool) -> Result<Run> {
    let division = problem.validate()?;
    let mut run = Run::default();
    let p = problem.law(0).initial_state().len();
    let names: &[&str] = if problem.options.monitors { monitors::names(problem.law(0)) } else { &[] };
    run.monitors = names.iter().map(|&name| (name, Vec::new())).collect();
    let monitor = problem.options.monitors.then(|| Monitor::new(problem.plant(0), problem.law(0)));
    let values = vec![0.0; names.len()];
    let mut sink = Rows { run: &mut run, p, monitor, values };
    match &division {
        Division::Fixed(fixed) => {
            sink.reserve(fixed.schedule.records.len());
            let faults = run_scalar(Group { problem, division: fixed, tabulated: None, first: 0, stop, sink: &mut sink });
            run.steps = faults.steps;
            run.evaluations = 4 * faults.steps;
            run.ended = faults.at[0].min(problem.options.t_end);
            run.status = match (faults.interrupted, faults.at[0].is_finite()) {
                (true, _) => Status::Interrupted,
                (_, true) => Status::Diverged,
                _ => Status::Success,
            };
            if run.status == Status::Diverged {
                run.keep_before(run.ended);
            }
        }
        Division::Adaptive(segments) => {
            let outcome = run_scalar(Group { problem, division: segments, tabulated: None, first: 0, stop, sink: &mut sink });
            (run.status, run.ended) = (outcome.status, outcome.t);
            (run.evaluations, run.steps, run.rejections) = (outcome.work.evaluations, outcome.work.steps, outcome.work.rejections);
        }
    }
    Ok(run)
}

impl Run {
    /// Drop the records from the fault on.
    fn keep_before(&mut self, t: f64) {
        let k = self.t.iter().position(|&s| s >= t).unwrap_or(self.t.len());
        let p = self.z.len() / self.t.len().max(1);
        self.t.truncate(k);
        self.q.truncate(2 * k);
        self.v.truncate(2 * k);
        self.tau.truncate(2 * k);
        self.z.truncate(p * k);
        for (_, series) in &mut self.monitors {
            series.truncate(k);
        }
    }
}
