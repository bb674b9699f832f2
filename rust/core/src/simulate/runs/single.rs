//! One run on plain numbers, and its records.

use super::division::{Division, Ended};
use super::run_group::RunGroup;
use super::structures::{self, Structures};
use crate::error::{Error, Result, all_finite};
use crate::memory::{self, append};
use crate::plant::{FrictionTorque, Rubbed};
use crate::simulate::balances;
use crate::simulate::columns::Columns;
use crate::simulate::loops::log::Block;
use crate::simulate::loops::sink::Sink;
use crate::simulate::monitors;
use crate::simulate::observer::run_observer::RunObserver;
use crate::simulate::problem::Problem;
use crate::simulate::problem::times::require_memory;
use crate::simulate::record::rates::Rates;
use crate::simulate::recorded_monitors::Monitors;
use crate::simulate::stop::Stop;
use crate::status::Status;
use std::ops::Range;

/// The records of one run with `K` records. Arrays are row-major, and time is the first axis.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}, status::Status};
/// # use nalgebra::dvector;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 2.0)?, Gain::not_negative("kd", vec![0.0])?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Options, Problem};
///
/// // The joint oscillates with q = cos t.
/// let run = Problem::from_rest(&plant, &law, &dvector![1.0], Options::fixed(1.0, 0.01))?.run()?;
/// assert_eq!((run.status, run.t.len(), run.steps), (Status::Success, 101, 100));
/// assert!((run.positions()[100] - 1f64.cos()).abs() < 1e-9 && (run.velocities()[100] + 1f64.sin()).abs() < 1e-9);
/// // The energy changes by the supplied energy.
/// let balance = run.monitor("energy_balance").unwrap_or_default();
/// assert!(balance.len() == 101 && balance.iter().all(|error| error.abs() < 1e-9));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// Times of the records, shape `(K,)`, s.
    pub t: Vec<f64>,
    /// Joint positions, shape `(K, n)`, rad or m.
    pub q: Vec<f64>,
    /// Joint velocities, shape `(K, n)`, rad/s or m/s.
    pub v: Vec<f64>,
    /// Inputs of the plant, shape `(K, n)`, N m or N. They are velocities, rad/s or m/s, for a velocity-controlled plant.
    pub tau: Vec<f64>,
    /// Motor positions of an elastic plant, shape `(K, n)`, rad or m. Empty for other plants.
    pub theta: Vec<f64>,
    /// Motor velocities of an elastic plant, shape `(K, n)`, rad/s or m/s. Empty for other plants.
    pub theta_dot: Vec<f64>,
    /// States of the law, shape `(K, p)`.
    pub z: Vec<f64>,
    /// Bristle deflections of LuGre friction, shape `(K, n)`, rad or m. Empty without this friction.
    pub bristles: Vec<f64>,
    /// Torques of dry friction, shape `(K, n)`, N m or N. Empty without dry friction.
    pub friction: Vec<f64>,
    /// Name and values of each monitor, shape `(K,)`.
    pub monitors: Vec<(&'static str, Vec<f64>)>,
    /// The reason of the end of the run.
    pub status: Status,
    /// The end of the run, s: `t_end`, or the time of the fault or event that ended the run. After an interruption, it is the time reached
    /// with an adaptive method, and `t_end` with fixed steps.
    pub ended: f64,
    /// The number of evaluations of the state rates.
    pub evaluations: u64,
    /// The number of accepted steps.
    pub steps: u64,
    /// The number of rejected steps.
    pub rejections: u64,
    /// The engine of the programs (recorded loops), "machine" or "interpreter". It is "direct" if the law is not recorded.
    pub engine: &'static str,
    /// The residuals of the balances over the records, shape `(4,)`, see [`crate::simulate::BALANCES`]. `energy_missing` is in J, the other
    /// three residuals are dimensionless. NaN without monitors.
    pub balances: [f64; 4],
    /// The factor by which both tolerances must be multiplied to be feasible, dimensionless. It is zero unless the run ended with
    /// [`Status::ExcessAccuracy`], see [`crate::integrate::Work::coarsen`].
    pub coarsen: f64,
    /// Start and end of a change of the force, s, that fixed steps are too long for. Only a force that is a function of time is checked.
    pub unresolved: Option<[f64; 2]>,
}

struct RunRecorder<'a> {
    run: &'a mut Run,
    columns: Columns,
    /// The range of each quantity in a record.
    numbers: Vec<Range<usize>>,
    problem: &'a Problem<'a>,
    /// The monitors. They are created at the first record that has no monitors from a program, because creation compiles an arm.
    monitor: Option<Box<Monitors<'a>>>,
    values: Vec<f64>,
    /// The time at which a monitor was not finite, s. Infinite if all were finite.
    fault: f64,
    /// The error after which no more records are stored, because the memory is full.
    full: Result<()>,
}

impl Sink for RunRecorder<'_> {
    fn record(&mut self, i: usize, _: usize, t: f64, x: &[f64], tau: &[f64]) {
        // A run that restarts overwrites its records.
        if i < self.run.t.len() || i == 0 {
            (self.fault, self.full) = (f64::INFINITY, Ok(()));
            self.run.truncate(i);
        }
        if self.fault.is_finite() || self.full.is_err() {
            return;
        }
        if !self.values.is_empty() {
            let monitor = self.monitor.get_or_insert_with(|| Box::new(Monitors::new(self.problem, 0)));
            monitor.evaluate(t, x, tau, &mut self.values);
            if !all_finite(&self.values) {
                self.fault = t;
                return;
            }
        }
        self.full = self.append_record(t, x, tau);
    }

    fn block(&mut self, block: &Block) {
        if block.first == 0 {
            (self.fault, self.full) = (f64::INFINITY, Ok(()));
            self.run.truncate(0);
        }
        if self.fault.is_finite() || self.full.is_err() {
            return;
        }
        self.full = self.append_block(block);
    }
}

impl RunRecorder<'_> {
    fn reserve(&mut self, records: usize) -> Result<()> {
        let Columns { kind, n, p, bristles } = self.columns;
        let run = &mut *self.run;
        memory::more(&mut run.t, records)?;
        for series in [&mut run.q, &mut run.v, &mut run.tau] {
            memory::more(series, n * records)?;
        }
        if kind.has_motors() {
            memory::more(&mut run.theta, n * records)?;
            memory::more(&mut run.theta_dot, n * records)?;
        }
        memory::more(&mut run.z, p * records)?;
        memory::more(&mut run.bristles, bristles * records)?;
        for (_, series) in &mut run.monitors {
            memory::more(series, records)?;
        }
        Ok(())
    }

    /// Append the records of a block that precede the first record with a monitor that is not finite.
    fn append_block(&mut self, block: &Block) -> Result<()> {
        let (run, monitors) = (&mut *self.run, self.values.len());
        let (mut sound, numbers) = (true, &self.numbers);
        let own = [&mut run.q, &mut run.v, &mut run.tau, &mut run.theta, &mut run.theta_dot, &mut run.z, &mut run.bristles];
        for (series, numbers) in own.into_iter().zip(numbers) {
            block.append(numbers.clone(), series)?;
        }
        for ((_, series), numbers) in run.monitors.iter_mut().zip(&numbers[numbers.len() - monitors..]) {
            sound &= block.append(numbers.clone(), series)?;
        }
        for i in 0..block.count {
            append(&mut run.t, &[block.time(i)])?;
        }
        let fault = if sound { None } else { block.fault(block.width() - monitors..block.width(), 0) };
        if let Some(i) = fault {
            self.fault = block.time(i);
            run.truncate(run.t.len() - block.count + i);
        }
        Ok(())
    }

    fn append_record(&mut self, t: f64, x: &[f64], tau: &[f64]) -> Result<()> {
        let run = &mut *self.run;
        let parts = self.columns.split(x, tau);
        append(&mut run.t, &[t])?;
        append(&mut run.q, parts.q)?;
        append(&mut run.v, parts.v)?;
        append(&mut run.tau, tau)?;
        append(&mut run.theta, parts.theta)?;
        append(&mut run.theta_dot, parts.theta_dot)?;
        append(&mut run.z, parts.z)?;
        append(&mut run.bristles, parts.bristles)?;
        for ((_, series), &value) in run.monitors.iter_mut().zip(&self.values) {
            append(series, &[value])?;
        }
        Ok(())
    }
}

/// Run the one run of `problem`. If a fault occurs, the result has the records before the fault, and the status of the fault. Errors: those
/// of [`Problem::validate`], and [`Error::Memory`] if the records exceed the memory.
pub fn simulate(problem: &Problem, stop: &dyn Stop) -> Result<Run> {
    simulate_observed(problem, stop, None)
}

/// Run like [`simulate`]. With an adaptive method, the observer also receives the events, the contact modes and the polynomials of the
/// steps, as requested. Errors: those of [`simulate`], and [`Error::Input`] for an observer with a method of fixed steps.
pub fn simulate_observed(problem: &Problem, stop: &dyn Stop, observer: Option<&mut RunObserver>) -> Result<Run> {
    let division = problem.divide(stop)?;
    let unresolved = problem.unresolved_force(&division, stop);
    let plants = problem.sticking_plants()?;
    let sticking = plants.as_deref().map(|plants| problem.clone().with_plants(plants));
    Ok(Run { unresolved, ..simulate_divided(sticking.as_ref().unwrap_or(problem), &division, stop, observer)? })
}

/// Run like [`simulate_observed`] with the time grid `division`.
pub fn simulate_divided(problem: &Problem, division: &Division, stop: &dyn Stop, mut observer: Option<&mut RunObserver>) -> Result<Run> {
    problem.require_memory(1)?;
    if let (Some(observer), Division::Fixed(_)) = (&observer, division) {
        let what = if observer.events.is_empty() { "dense" } else { "events" };
        let method = problem.options.method.name();
        let problem = format!("needs a method with dense output: expected one of dopri5, dop853, radau5, rodas4, got {method}");
        return Err(Error::input(what, problem));
    }
    let mut run = Run::default();
    let columns = Columns::of(problem);
    let names = monitors::names(problem);
    run.monitors = names.iter().map(|&name| (name, Vec::new())).collect();
    let values = vec![0.0; names.len()];
    let numbers = columns.series(problem.state_size(), names.len());
    let mut sink = RunRecorder { run: &mut run, columns, numbers, problem, monitor: None, values, fault: f64::INFINITY, full: Ok(()) };
    if let Division::Fixed(fixed) = division {
        require_memory(fixed.schedule.count() as u128)?;
        sink.reserve(fixed.schedule.count())?;
    }
    let general = RunGroup { problem, division, first: 0, stop, sink: &mut sink, observer: observer.as_deref_mut() };
    let (ended, engine) = match (division, Structures::of(problem, division, false)) {
        (Division::Fixed(fixed), Some(structures)) => (structures::run::<f64>(&structures, general, fixed), structures.engine(1).name()),
        _ => {
            let rates = Rates::of(problem);
            (general.run_single(&rates), rates.engine())
        }
    };
    let (fault, full) = (sink.fault, sink.full);
    full?;
    observer.and_then(|observer| observer.full.take()).map_or(Ok(()), Err)?;
    run.engine = engine;
    match ended {
        Ended::Fixed(faults) => {
            run.steps = faults.steps;
            run.evaluations = problem.options.method.evaluations_per_step().unwrap_or(0) * faults.steps;
            let fault = faults.at[0].min(fault);
            run.ended = fault.min(problem.options.t_end);
            run.status = match (faults.interrupted, fault.is_finite()) {
                (true, _) => Status::Interrupted,
                (_, true) => Status::Diverged,
                _ => Status::Success,
            };
            if run.status == Status::Diverged {
                run.truncate_before(run.ended);
            }
        }
        Ended::Adaptive(outcome) => {
            (run.status, run.ended) = if fault <= outcome.t { (Status::Diverged, fault) } else { (outcome.status, outcome.t) };
            (run.evaluations, run.steps, run.rejections) = (outcome.work.evaluations, outcome.work.steps, outcome.work.rejections);
            run.coarsen = outcome.work.coarsen;
        }
    }
    run.compute_friction(problem)?;
    run.balances = balances::open(|name| run.monitors.iter().find(|(known, _)| *known == name).map(|(_, series)| series.as_slice()));
    Ok(run)
}

impl Run {
    /// Remove the records from time `t` on.
    fn truncate_before(&mut self, t: f64) {
        self.truncate(self.t.iter().position(|&s| s >= t).unwrap_or(self.t.len()));
    }

    /// Compute the torques of friction of all records.
    fn compute_friction(&mut self, problem: &Problem) -> Result<()> {
        let Some(mut friction) = FrictionTorque::of(problem.plant(0), problem.force_frame(), self.t.len()) else { return Ok(()) };
        let mut torques = memory::zeros(self.q.len())?;
        let Run { t, q, v, theta, theta_dot, bristles, tau, .. } = &*self;
        let wrench = |k: usize| problem.force(0).map_or([0.0; 6], |force| force.at(t[k]));
        friction.series(&Rubbed { q, v, theta, theta_dot, bristles, tau }, wrench, &mut torques);
        self.friction = torques;
        Ok(())
    }

    /// Remove all records but the first `k`.
    fn truncate(&mut self, k: usize) {
        if k >= self.t.len() {
            return;
        }
        let records = self.t.len();
        self.t.truncate(k);
        for series in [&mut self.q, &mut self.v, &mut self.tau, &mut self.theta, &mut self.theta_dot, &mut self.z, &mut self.bristles] {
            series.truncate(series.len() / records * k);
        }
        for (_, series) in &mut self.monitors {
            series.truncate(k);
        }
    }
}
