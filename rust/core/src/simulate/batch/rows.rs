//! The results of one group of runs, which are rows of the result arrays of a batch. Only this group writes to these rows.
//!
//! Large arrays are not initialised. The thread that writes a row is the first to access its memory. If a run ends early, its missing
//! records are NaN.

use super::measuring::Measuring;
use crate::error::{Result, all_finite};
use crate::memory;
use crate::plant::{FrictionTorque, Rubbed};
use crate::simulate::balances;
use crate::simulate::columns::Columns;
use crate::simulate::loops::log::Block;
use crate::simulate::loops::sink::Sink;
use crate::simulate::metrics::plan::Plan;
use crate::simulate::monitors;
use crate::simulate::problem::Problem;
use crate::simulate::recorded_monitors::Monitors;
use crate::simulate::runs::division::Ended;
use crate::status::Status;
use std::ops::Range;
use std::slice::ChunksMut;
use std::sync::Arc;

/// A quantity of a summary: its name, the number of its values per run (`None` for one value), and the values of all runs, row-major.
pub type Metric = (&'static str, Option<usize>, Vec<f64>);

/// The records of a batch of `B` runs with `K` records. Arrays are row-major. After an interruption, the content of the arrays is
/// undefined.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}, status::Status};
/// # use nalgebra::dvector;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 2.0)?, Gain::not_negative("kd", vec![0.0])?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{BatchRuns, Keep, Options, Problem, simulate_batch};
///
/// // The joint oscillates with q = q0 cos t, from 1 rad and from 2 rad.
/// let mut problem = Problem::from_rest(&plant, &law, &dvector![0.0], Options::fixed(1.0, 0.01))?;
/// problem.x0 = vec![1.0, 0.0, 2.0, 0.0];
/// let BatchRuns { q, status, ended, .. } = simulate_batch(problem, Keep::Final, 1, &mut || false)?;
/// assert_eq!((status, ended), (vec![Status::Success; 2], vec![1.0; 2]));
/// assert!((q[0] - 1f64.cos()).abs() < 1e-9 && (q[1] - 2.0 * 1f64.cos()).abs() < 1e-9);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct BatchRuns {
    /// Times of the records, shape `(K,)`, s.
    pub t: Vec<f64>,
    /// Joint positions, shape `(B, K, n)`, rad or m.
    pub q: Vec<f64>,
    /// Joint velocities, shape `(B, K, n)`, rad/s or m/s.
    pub v: Vec<f64>,
    /// Inputs of the plant, shape `(B, K, n)`, N m or N. They are velocities, rad/s or m/s, for a velocity-controlled plant.
    pub tau: Vec<f64>,
    /// Motor positions of elastic plants, shape `(B, K, n)`, rad or m. Empty for other plants.
    pub theta: Vec<f64>,
    /// Motor velocities of elastic plants, shape `(B, K, n)`, rad/s or m/s. Empty for other plants.
    pub theta_dot: Vec<f64>,
    /// States of the laws, shape `(B, K, p)`.
    pub z: Vec<f64>,
    /// Bristle deflections of LuGre friction, shape `(B, K, n)`, rad or m. Empty without this friction.
    pub bristles: Vec<f64>,
    /// Torques of dry friction, shape `(B, K, n)`, N m or N. Empty without dry friction.
    pub friction: Vec<f64>,
    /// Name and values of each monitor, shape `(B, K)`.
    pub monitors: Vec<(&'static str, Vec<f64>)>,
    /// Residuals of the balances over the stored records, shape `(B,)` each, see [`crate::simulate::BALANCES`]. They are NaN without monitors and in
    /// a batch with metrics. They are also NaN for a run that did not reach its end.
    pub balances: [Vec<f64>; 4],
    /// The metrics of the runs. All metrics of a run that did not reach its end are NaN.
    pub metrics: Vec<Metric>,
    /// Status of each run, shape `(B,)`.
    pub status: Vec<Status>,
    /// Time at which each run ended, shape `(B,)`, s.
    pub ended: Vec<f64>,
    /// Whether the caller interrupted the batch.
    pub interrupted: bool,
    /// The engine of the programs (recorded loops), "machine" or "interpreter". It is "direct" if the law is not recorded.
    pub engine: &'static str,
}

/// The rows of one result array that belong to the runs of the group, shape `(runs, records, numbers)`. The array stores the range
/// `numbers` of each record `[x, tau, monitors]`.
struct ArrayRows<'a> {
    numbers: Range<usize>,
    rows: &'a mut [f64],
}

impl ArrayRows<'_> {
    /// Return the range in `rows` that contains the records `records` of run `run`. Every run has `all` records.
    fn place(&self, run: usize, all: usize, records: &Range<usize>) -> Range<usize> {
        let width = self.numbers.len();
        (run * all + records.start) * width..(run * all + records.end) * width
    }
}

/// Receives the records of one group, and writes them to the rows of the group.
pub struct GroupRecorder<'a> {
    problem: &'a Problem<'a>,
    records: usize,
    /// All series, one after another. The series of the monitors are last.
    series: Vec<ArrayRows<'a>>,
    monitors: usize,
    /// The torques of friction, shape `(runs, records, n)`, or empty.
    friction: &'a mut [f64],
    /// The computation of these torques, if all runs have the same plant.
    rubbing: Option<Arc<FrictionTorque>>,
    times: &'a [f64],
    /// For each run, its monitors. They are created at the first record that no program computes, because creation compiles an arm.
    checks: Vec<Option<Box<Monitors<'a>>>>,
    first: usize,
    status: &'a mut [Status],
    ended: &'a mut [f64],
    balances: [&'a mut [f64]; 4],
    /// Memory for the present record.
    record: Vec<f64>,
    /// For each run, the number of written records.
    written: Vec<usize>,
    /// For each run, the time at which a monitor was not finite, s. Infinite if all were finite.
    faults: Vec<f64>,
    /// For each run, its metrics in progress.
    summed: Vec<Measuring<'a>>,
    /// For each run, the row to which its final metrics are written.
    metrics: Vec<&'a mut [f64]>,
}

impl Sink for GroupRecorder<'_> {
    fn record(&mut self, i: usize, lane: usize, t: f64, x: &[f64], tau: &[f64]) {
        // In a group that is not full, the unused lanes have no rows.
        if lane >= self.status.len() {
            return;
        }
        if let Some(run) = self.summed.get_mut(lane) {
            run.record(i, t, x, tau);
            return;
        }
        if i == 0 {
            // Record 0 means that the run starts or restarts.
            (self.faults[lane], self.written[lane]) = (f64::INFINITY, 0);
        }
        if self.faults[lane].is_finite() {
            return;
        }
        if self.monitors > 0 {
            let (problem, run) = (self.problem, self.first + lane);
            let check = self.checks[lane].get_or_insert_with(|| Box::new(Monitors::new(problem, run)));
            let values = &mut self.record[x.len() + tau.len()..];
            check.evaluate(t, x, tau, values);
            if !all_finite(values) {
                self.faults[lane] = t;
                return;
            }
        }
        self.write(lane, i, x, tau);
    }

    fn block(&mut self, block: &Block) {
        let (rows, at_once) = (self.status.len(), block.at_once());
        let lanes = block.lanes.map(|lane| lane.filter(|&lane| lane < rows && !self.faults[lane].is_finite()));
        for (k, lanes) in lanes.chunks(at_once).enumerate() {
            let first = k * at_once;
            if let &[Some(a), Some(b), Some(c), Some(d)] = lanes {
                self.write_block(block, first, [a, b, c, d]);
            } else {
                lanes
                    .iter()
                    .enumerate()
                    .filter_map(|(i, lane)| Some((i, (*lane)?)))
                    .for_each(|(i, run)| self.write_block(block, first + i, [run]));
            }
        }
    }

    fn take(&mut self, lane: usize, stored: &[f64], time: &dyn Fn(usize) -> f64) {
        if let Some(run) = self.summed.get_mut(lane) {
            run.take(stored, time);
        }
    }
}

/// Return the rows of each group of `lanes` runs.
pub fn split<'a>(problem: &'a Problem, out: &'a mut BatchRuns, lanes: usize) -> Result<Vec<GroupRecorder<'a>>> {
    let (records, monitors) = (out.t.len(), out.monitors.len());
    let numbers = Columns::of(problem).series(problem.state_size(), monitors);
    let width = problem.state_size() + problem.plant(0).n() + monitors;
    let own = [&mut out.q, &mut out.v, &mut out.tau, &mut out.theta, &mut out.theta_dot, &mut out.z, &mut out.bristles];
    let arrays = own.into_iter().chain(out.monitors.iter_mut().map(|(_, series)| series));
    let chunks = |(array, numbers): (&'a mut Vec<f64>, &Range<usize>)| {
        let of_run = records * numbers.len();
        array.chunks_mut((lanes * of_run).max(1))
    };
    let mut arrays: Vec<_> = arrays.zip(&numbers).map(chunks).collect();
    let of_run = records * problem.plant(0).n();
    let times = out.t.as_slice();
    let shared = problem.plants.len() == 1 && !out.friction.is_empty();
    let torque = || FrictionTorque::of(problem.plant(0), problem.force_frame(), out.t.len() * out.status.len());
    let rubbing = shared.then(torque).flatten().map(Arc::new);
    let mut friction = out.friction.chunks_mut((lanes * of_run).max(1));
    let mut metrics: Vec<_> = out.metrics.iter_mut().map(|(_, width, numbers)| numbers.chunks_mut(lanes * width.unwrap_or(1))).collect();
    let ended = out.ended.chunks_mut(lanes);
    let mut balances = out.balances.each_mut().map(|numbers| numbers.chunks_mut(lanes));
    // The estimate of the required memory includes the small vectors of each group.
    let parts = arrays.len() * size_of::<ArrayRows>() + metrics.len() * size_of::<&mut [f64]>() + 8 * width;
    memory::require(ended.len() * (size_of::<GroupRecorder>() + parts + 32))?;
    let mut series = || {
        let of = |(rows, numbers): (&mut ChunksMut<'a, f64>, &Range<usize>)| ArrayRows {
            numbers: numbers.clone(),
            rows: rows.next().unwrap_or_default(),
        };
        arrays.iter_mut().zip(&numbers).map(of).collect()
    };
    memory::collected(out.status.chunks_mut(lanes).zip(ended).enumerate().map(|(group, (status, ended))| GroupRecorder {
        problem,
        records,
        series: series(),
        monitors,
        friction: friction.next().unwrap_or_default(),
        rubbing: rubbing.clone(),
        times,
        checks: Vec::new(),
        first: group * lanes,
        record: vec![0.0; width],
        written: Vec::new(),
        faults: Vec::new(),
        summed: Vec::new(),
        metrics: metrics.iter_mut().map(|m| m.next().unwrap_or_default()).collect(),
        status,
        ended,
        balances: balances.each_mut().map(|numbers| numbers.next().unwrap_or_default()),
    }))
}

impl GroupRecorder<'_> {
    /// Create the buffers that the group needs during its runs.
    pub fn watch(&mut self, plans: &[Plan]) {
        let rows = self.status.len();
        (self.faults, self.written) = (vec![f64::INFINITY; rows], vec![0; rows]);
        if plans.is_empty() {
            self.checks = (0..rows).map(|_| None).collect();
            return;
        }
        let plan = |i: usize| &plans[if plans.len() == 1 { 0 } else { i }];
        self.summed = (self.first..self.first + rows).map(|i| Measuring::new(self.problem, i, plan(i), self.monitors)).collect();
    }

    /// Write record `i` of a run. Its monitors are already in `self.record`.
    fn write(&mut self, run: usize, i: usize, x: &[f64], tau: &[f64]) {
        self.record[..x.len()].copy_from_slice(x);
        self.record[x.len()..x.len() + tau.len()].copy_from_slice(tau);
        for series in &mut self.series {
            let place = series.place(run, self.records, &(i..i + 1));
            series.rows[place].copy_from_slice(&self.record[series.numbers.clone()]);
        }
        self.written[run] = i + 1;
    }

    /// Write the records of a block to the rows of `runs`. These runs are in lane `lane` and the following lanes.
    fn write_block<const R: usize>(&mut self, block: &Block, lane: usize, runs: [usize; R]) {
        let (records, own) = (block.first..block.first + block.count, self.series.len() - self.monitors);
        let mut sound = true;
        for (k, series) in self.series.iter_mut().enumerate().filter(|(_, series)| !series.numbers.is_empty()) {
            let places = runs.map(|run| series.place(run, self.records, &records));
            let Ok(mut rows) = series.rows.get_disjoint_mut(places) else { unreachable!("runs have separate rows") };
            let finite = block.write(series.numbers.clone(), lane, &mut rows);
            sound &= finite || k < own;
        }
        let monitors = block.width() - self.monitors..block.width();
        for (i, run) in runs.into_iter().enumerate() {
            let fault = if sound { None } else { block.fault(monitors.clone(), lane + i) };
            self.written[run] = fault.map_or(records.end, |i| records.start + i);
            if let Some(i) = fault {
                self.faults[run] = block.time(i);
            }
        }
    }

    /// Write status and end time of each run, and fill its missing records with NaN. Return whether the group was interrupted.
    pub fn finish(&mut self, ended: &Ended, t_end: f64) -> bool {
        self.checks = Vec::new();
        let mut summed = std::mem::take(&mut self.summed);
        let measured = !summed.is_empty();
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
                    // A lane continues after its fault, and its later records are not valid.
                    if fault.is_finite() {
                        self.written[lane] = self.written[lane].min(self.times.partition_point(|&t| t < fault));
                    }
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
        (0..self.status.len()).filter(|_| !(interrupted || measured)).for_each(|run| self.balance(run));
        let written = std::mem::take(&mut self.written);
        if !interrupted {
            self.write_friction(&written);
        }
        for (run, &written) in written.iter().enumerate().filter(|_| !interrupted) {
            for series in &mut self.series {
                let place = series.place(run, self.records, &(written..self.records));
                series.rows[place].fill(f64::NAN);
            }
        }
        self.record = Vec::new();
        interrupted
    }

    /// Compute the torques of friction for the written records. Other records are NaN.
    fn write_friction(&mut self, written: &[usize]) {
        if self.friction.is_empty() {
            return;
        }
        let (n, all) = (self.problem.plant(0).n(), self.records);
        let mut shared = self.rubbing.as_deref().cloned();
        for (run, &written) in written.iter().enumerate() {
            let out = &mut self.friction[run * all * n..(run + 1) * all * n];
            out[written * n..].fill(f64::NAN);
            let mut own = None;
            if shared.is_none() {
                own = FrictionTorque::of(self.problem.plant(self.first + run), self.problem.force_frame(), written);
            }
            let Some(friction) = shared.as_mut().or(own.as_mut()) else { continue };
            let force = self.problem.force(self.first + run);
            let wrench = |k: usize| force.map_or([0.0; 6], |force| force.at(self.times[k]));
            let [q, v, tau, theta, theta_dot, bristles] = [0, 1, 2, 3, 4, 6].map(|k| {
                let series = &self.series[k];
                &series.rows[series.place(run, all, &(0..written))]
            });
            friction.series(&Rubbed { q, v, theta, theta_dot, bristles, tau }, wrench, &mut out[..written * n]);
        }
    }

    /// Compute the residuals of the balances of a run that reached its end.
    fn balance(&mut self, run: usize) {
        if self.status[run] != Status::Success || self.written[run] < self.records {
            return;
        }
        let all = &self.series[self.series.len() - self.monitors..];
        let names = monitors::names(self.problem);
        let series = |name: &str| {
            let of = &all[names.iter().position(|known| *known == name)?];
            Some(&of.rows[run * self.records..(run + 1) * self.records])
        };
        let open = balances::open(series);
        self.balances.iter_mut().zip(open).for_each(|(to, open)| to[run] = open);
    }

    /// Write the last record of a run and its metrics.
    fn write_summary(&mut self, lane: usize, run: &mut Measuring) {
        let summary = run.summary();
        let place = self.record.len() - self.monitors;
        self.record[place..].copy_from_slice(&run.values);
        self.write(lane, 0, &run.x, &run.tau);
        let (rows, mut rest) = (self.status.len(), summary.as_slice());
        for to in &mut self.metrics {
            let width = to.len() / rows;
            let (numbers, behind) = rest.split_at(width);
            to[lane * width..(lane + 1) * width].copy_from_slice(numbers);
            rest = behind;
        }
    }
}
