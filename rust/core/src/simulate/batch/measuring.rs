//! Metrics of the runs of a batch, computed during the runs. Only the last record is stored.
//!
//! A record is added to the sums of the metrics when the next record arrives, because its trapezoidal weight depends on both neighbours. If
//! a program (a recorded and compiled loop) computes the run, it also computes these sums, and [`Measuring::take`] receives them.

use crate::error::all_finite;
use crate::law::LawSpec;
use crate::motion::sample_all;
use crate::simulate::columns::Columns;
use crate::simulate::metrics::gauge::{Gauge, Identities, MetricInput, Start};
use crate::simulate::metrics::plan::Plan;
use crate::simulate::metrics::summary::Ends;
use crate::simulate::problem::Problem;
use crate::simulate::recorded_monitors::Monitors;

/// The metrics of one run, in progress.
pub struct Measuring<'a> {
    law: &'a LawSpec,
    columns: Columns,
    gauge: Gauge<f64>,
    monitor: Option<Monitors<'a>>,
    /// The monitors of the last record.
    pub values: Vec<f64>,
    desired: Vec<f64>,
    /// The sums and extrema from which the metrics are computed.
    stored: Vec<f64>,
    /// The number of records so far.
    count: usize,
    /// The time of the last record, s.
    pub t: f64,
    /// The state of the loop at the last record.
    pub x: Vec<f64>,
    /// The input of the plant at the last record.
    pub tau: Vec<f64>,
    first_time: f64,
    first: Vec<f64>,
    settled: Option<f64>,
    /// The time at which a monitor was not finite, s. Infinite if all were finite.
    pub fault: f64,
    /// Whether a program has computed the sums `stored`.
    given: bool,
}

impl<'a> Measuring<'a> {
    /// Create the metrics of run `run` of a problem with `monitors` monitors.
    pub fn new(problem: &'a Problem<'a>, run: usize, plan: &Plan, monitors: usize) -> Self {
        let (plant, law) = (problem.plant(run), problem.law(run));
        Measuring {
            law,
            columns: Columns::of(problem),
            gauge: Gauge::new(plan, plant.model()),
            monitor: (monitors > 0).then(|| Monitors::new(problem, run)),
            values: vec![0.0; monitors],
            desired: law.desired(0.0),
            stored: plan.start(),
            count: 0,
            t: f64::NAN,
            x: vec![0.0; problem.state_size()],
            tau: vec![0.0; plan.n],
            first_time: f64::NAN,
            first: vec![0.0; plan.n],
            settled: None,
            fault: f64::INFINITY,
            given: false,
        }
    }

    /// Add the last record to the sums `stored`. `t` is the time of the next record, s.
    fn add(&mut self, t: f64) {
        sample_all(self.law.motions(), self.t, &mut self.desired);
        let plan = &self.gauge.plan;
        let identities = match self.values.as_slice() {
            [skewness, energy, ..] if plan.energy => Identities {
                skewness: *skewness,
                energy: *energy,
                lyapunov: if plan.lyapunov { self.values[3] } else { 0.0 },
                quadratures: std::array::from_fn(|k| self.x[self.columns.places(0).z.end + k]),
            },
            _ => Identities::default(),
        };
        let parts = self.columns.split(&self.x, &self.tau);
        let seen = MetricInput { desired: &self.desired, q: parts.q, v: parts.v, tau: &self.tau, identities };
        let outside = plan.places.outside;
        self.gauge.add(&seen, t - self.t, Start::Requested, &mut self.stored);
        if self.count == 1 {
            self.settled = Some(self.t);
        }
        if !self.gauge.plan.places.error.is_empty() && self.stored[outside] == (self.count - 1) as f64 {
            self.settled = (t > self.t).then_some(t);
        }
    }

    pub fn record(&mut self, i: usize, t: f64, x: &[f64], tau: &[f64]) {
        if i == 0 {
            // Record 0 means that the run starts or restarts.
            self.stored = self.gauge.plan.start();
            (self.count, self.fault, self.given) = (0, f64::INFINITY, false);
            self.first_time = t;
            let n = self.first.len();
            self.first.copy_from_slice(&x[..n]);
        }
        if self.fault.is_finite() {
            return;
        }
        if self.count > 0 && !self.given {
            self.add(t);
        }
        if let Some(monitor) = &mut self.monitor {
            monitor.evaluate(t, x, tau, &mut self.values);
            if !all_finite(&self.values) {
                self.fault = t;
                return;
            }
        }
        self.count += 1;
        self.t = t;
        self.x.copy_from_slice(x);
        self.tau.copy_from_slice(tau);
    }

    /// Take the sums `stored` that a program has computed up to the present record. `time(i)` is the time of record `i`.
    pub fn take(&mut self, stored: &[f64], time: &dyn Fn(usize) -> f64) {
        self.given = true;
        self.stored.copy_from_slice(stored);
        let places = &self.gauge.plan.places;
        let records = stored[places.count];
        let after = if places.error.is_empty() { 0.0 } else { stored[places.outside] + 1.0 };
        self.settled = (after < records).then(|| time(after as usize));
    }

    /// Return the metrics of the run, after its last record.
    pub fn summary(&mut self) -> Vec<f64> {
        if !self.given {
            self.add(self.t);
        }
        sample_all(self.law.motions(), self.t, &mut self.desired);
        let ends = Ends { times: [self.first_time, self.t], settled: self.settled, q: &self.first, desired: &self.desired };
        self.gauge.plan.summary(&self.stored, &ends)
    }
}
