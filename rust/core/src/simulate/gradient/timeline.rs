//! A run as a list of operations in time order: steps, samples and records.

use crate::error::{Error, Result};
use crate::interrupt;
use crate::memory::append;
use crate::plant::Touch;
use crate::simulate::adaptive::segments::Segments;
use crate::simulate::fixed::schedule::{Schedule, after_jump};
use crate::simulate::observer::run_observer::{Guard, RunObserver, Switched};
use crate::simulate::problem::Problem;
use crate::simulate::problem::sampling::Sampling;
use crate::simulate::problem::times::Times;
use crate::simulate::runs::division::Division;
use crate::simulate::runs::single::simulate_divided;
use crate::simulate::stop::Stop;
use crate::status::Status;

/// A time `t` counts as the end of a step if `|t - end| / h` is below this limit, dimensionless. `h` is the step size.
const ON_STEP: f64 = 1e-9;

/// One operation on the state of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Operation {
    /// The law is evaluated at sample `k`.
    Sample { k: u64, t: f64 },
    /// The held input changes.
    Act(Acting),
    /// A step of size `h` from `t`, with the contacts of `mode`. If the input jumps at the end, `end` is just before the jump. No stage
    /// evaluates the input after `end`.
    Step { t: f64, h: f64, end: f64, mode: usize },
    /// A contact changes.
    Switch { k: usize, t: f64 },
    /// Branch change `k` of the state rates ([`super::branches`]).
    Branch { k: usize, t: f64 },
    /// The state becomes state `k` of the run again, after a step that was divided at changes of branches.
    Restore(usize),
    /// The state and the input are stored as record `i`.
    Record { i: usize, t: f64 },
    /// Store the state. The operations up to `Rejoin` compute a record between two steps, and do not belong to the run.
    Leave,
    /// Restore the state that the last `Leave` stored.
    Rejoin,
}

/// The samples whose results are in the held input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Acting {
    /// The sample whose output acts on the plant. `None` means that no output acts yet, and the plant's input is zero.
    pub output: Option<u64>,
    /// The last sample, which has the rates of the law's state.
    pub rates: u64,
}

/// A change of the contacts from mode `before` to mode `after`, at a zero of guard number `guard`. A guard is a function whose change of
/// sign ends a mode.
#[derive(Clone, Copy, Debug)]
pub struct Switch {
    pub guard: usize,
    pub before: usize,
    pub after: usize,
}

/// A change of the state rates at the zero of a margin ([`super::branches`]).
#[derive(Clone, Debug)]
pub struct Crossing {
    /// The mode of the contacts.
    pub mode: usize,
    /// The index of the branch.
    pub branch: usize,
    /// Before the change, for each branch, a negative number if its comparison is true, otherwise a positive number.
    pub masks: Vec<f64>,
    /// The same numbers after the change.
    pub then: Vec<f64>,
}

/// The operations of a run whose steps are divided at jumps of the state rates.
#[derive(Default)]
pub struct Divided {
    pub operations: Vec<Operation>,
    pub crossings: Vec<Crossing>,
    /// The states of the run at the ends of the divided steps, one after another.
    pub states: Vec<f64>,
}

/// The contact modes of a run, and the changes between them.
#[derive(Clone, Debug)]
pub struct Contacts {
    /// The modes that occur. A run with fixed steps or without contacts has one empty mode.
    pub modes: Vec<Vec<Touch>>,
    pub guards: Vec<Guard>,
    pub switches: Vec<Switch>,
}

impl Contacts {
    /// The number of contacts that the run holds in their modes.
    pub fn held(&self) -> usize {
        self.modes.first().map_or(0, Vec::len)
    }

    /// The numbers of mode `k`, two for each contact.
    pub fn numbers(&self, k: usize) -> impl Iterator<Item = f64> {
        self.modes[k].iter().flat_map(|touch| touch.numbers())
    }
}

/// Return the index of `element` in `all`. A missing element is appended.
fn place<T: PartialEq>(all: &mut Vec<T>, element: T) -> usize {
    all.iter().position(|known| *known == element).unwrap_or_else(|| {
        all.push(element);
        all.len() - 1
    })
}

/// The operations of a run, and the settings of its sampled controller.
pub struct Timeline {
    pub contacts: Contacts,
    pub operations: Vec<Operation>,
    pub sampling: Option<Sampling>,
    pub grid: f64,
    pub records: usize,
    /// The changes of branches.
    pub crossings: Vec<Crossing>,
    /// The states of the run after divided steps, one after another.
    pub states: Vec<f64>,
}

/// Builds the operations of a run one after another.
struct TimelineBuilder<'a> {
    timeline: Timeline,
    breaks: &'a [f64],
    sampled: Option<u64>,
    acting: Option<Acting>,
    /// The present mode of the contacts.
    mode: usize,
}

impl Timeline {
    /// Whether operation `k` is a record at the start of a step of a continuous loop. Then the first stage of that step computes the
    /// recorded input.
    pub fn steps_on(&self, k: usize) -> bool {
        match (self.operations.get(k), self.operations.get(k + 1)) {
            (Some(Operation::Record { t: at, .. }), Some(Operation::Step { t, .. })) => self.sampling.is_none() && at == t,
            _ => false,
        }
    }

    /// Replace the operations of the run by those with divided steps.
    pub fn divide(&mut self, Divided { operations, crossings, states }: Divided) {
        (self.operations, self.crossings, self.states) = (operations, crossings, states);
    }

    /// List the operations of the one run of a problem. The options contain the times of the records. An adaptive run is computed first, to
    /// obtain its samples and contact changes. Then the list has no records and only the steps between these times, and the second result is
    /// the path of the run. Error: `Solve` if that run ends early.
    pub fn of(problem: &Problem, stop: &dyn Stop) -> Result<(Self, Option<AdaptivePath>)> {
        match problem.divide(stop)? {
            Division::Fixed(fixed) => {
                let mut listing = TimelineBuilder::new(problem, &fixed.schedule.breaks);
                listing.timeline.contacts.modes.push(Vec::new());
                Ok((listing.fixed(&fixed.schedule, fixed.hold)?, None))
            }
            Division::Adaptive(segments) => {
                let mut dense = problem.clone();
                dense.options.times = Times::Every(1);
                let mut observer = RunObserver { contacts: Some(Vec::new()), ..RunObserver::default() };
                let breaks = segments.breaks.clone();
                let division = Division::Adaptive(Segments { times: Times::Every(1), ..segments });
                let run = simulate_divided(&dense, &division, stop, Some(&mut observer))?;
                if run.status != Status::Success {
                    let problem = format!("the run ended at t = {} s: {}", run.ended, run.status.name());
                    return Err(Error::Solve { status: run.status, t: run.ended, problem });
                }
                let (switched, sampled) = (observer.contacts.unwrap_or_default(), problem.options.sampling.is_some());
                let path = AdaptivePath::of(run.t, switched, breaks, sampled)?;
                let timeline = TimelineBuilder::new(problem, &path.breaks).adaptive(&path, &[])?;
                Ok((timeline, Some(path)))
            }
        }
    }
}

/// The steps of an adaptive run.
pub struct AdaptivePath {
    /// The times at which the steps of the derivatives begin and end, s.
    times: Vec<f64>,
    switched: Vec<Switched>,
    breaks: Vec<f64>,
    /// The ends of all steps of the run, s.
    pub steps: Vec<f64>,
}

impl AdaptivePath {
    /// Return the path of a run with the ends `steps` of its steps. Its times are those that the derivatives require: the ends of the run,
    /// jumps of the input, samples and contact changes.
    fn of(steps: Vec<f64>, switched: Vec<Switched>, breaks: Vec<f64>, sampled: bool) -> Result<Self> {
        // The number of jumps of the input and of contact changes up to `t`.
        let passed = |t: f64| breaks.partition_point(|&jump| jump <= t) + switched.partition_point(|switch| switch.t <= t);
        let mut times = Vec::new();
        for (i, &t) in steps.iter().enumerate() {
            if sampled || i == 0 || i + 1 == steps.len() || passed(steps[i - 1]) < passed(t) {
                append(&mut times, &[t])?;
            }
        }
        Ok(AdaptivePath { times, switched, breaks, steps })
    }

    /// Divide the steps at the times `more`, s.
    pub fn divided(mut self, more: &[f64]) -> Result<Self> {
        append(&mut self.times, more)?;
        self.times.sort_by(f64::total_cmp);
        Ok(self)
    }

    /// List the operations of the run with these steps, and its records.
    pub fn timeline(&self, problem: &Problem) -> Result<Timeline> {
        let records: &[f64] = if let Times::At(records) = &problem.options.times { records } else { &[] };
        TimelineBuilder::new(problem, &self.breaks).adaptive(self, records)
    }
}

impl<'a> TimelineBuilder<'a> {
    /// Begin a list without operations. `breaks`: the times at which the input jumps, s.
    fn new(problem: &Problem, breaks: &'a [f64]) -> Self {
        let contacts = Contacts { modes: Vec::new(), guards: Vec::new(), switches: Vec::new() };
        let (sampling, grid) = (problem.options.sampling.clone(), problem.options.grid());
        let (operations, crossings, states) = Default::default();
        let timeline = Timeline { contacts, operations, sampling, grid, records: 0, crossings, states };
        TimelineBuilder { timeline, breaks, sampled: None, acting: None, mode: 0 }
    }

    fn push(&mut self, operation: Operation) -> Result<()> {
        append(&mut self.timeline.operations, &[operation])
    }

    fn record(&mut self, t: f64) -> Result<()> {
        let i = self.timeline.records;
        self.timeline.records += 1;
        self.push(Operation::Record { i, t })
    }

    /// Append the operations of the controller at time `t`: samples, and changes of the held input.
    fn sample(&mut self, t: f64) -> Result<()> {
        let Some(sampling) = &self.timeline.sampling else { return Ok(()) };
        let (seed, grid) = (sampling.seed, self.timeline.grid);
        let due = sampling.due(seed, grid, t);
        let acting = sampling.last_sample(seed, grid, t).map(|rates| Acting { output: sampling.acting(seed, grid, t), rates });
        if let Some(k) = due.filter(|&k| self.sampled != Some(k)) {
            self.sampled = Some(k);
            self.push(Operation::Sample { k, t })?;
        }
        if let Some(acting) = acting.filter(|&acting| self.acting != Some(acting)) {
            self.acting = Some(acting);
            self.push(Operation::Act(acting))?;
        }
        Ok(())
    }

    /// The jumps of the input up to `t + close`.
    fn passed(&self, t: f64, close: f64) -> &[f64] {
        &self.breaks[..self.breaks.partition_point(|&jump| jump <= t + close)]
    }

    /// Append the steps from `t` to `end` to the operations. A step of size `h` is divided where the input jumps.
    fn step(&mut self, mut t: f64, mut h: f64, end: f64) -> Result<()> {
        let close = ON_STEP * h;
        let passed = self.passed(t, close);
        let first = passed.len();
        t = after_jump(passed, t);
        for i in first..self.breaks.len() {
            let jump = self.breaks[i];
            if jump >= end - close {
                let ends = jump <= end + close;
                return self.push(Operation::Step { t, h, end: if ends { jump.min(end).next_down() } else { end }, mode: self.mode });
            }
            self.push(Operation::Step { t, h: jump - t, end: jump.next_down(), mode: self.mode })?;
            (t, h) = (jump, end - jump);
        }
        self.push(Operation::Step { t, h, end, mode: self.mode })
    }

    /// Append a record at `t` between two steps. A step from `from` to `t` computes its state, and does not belong to the run.
    fn aside(&mut self, from: f64, t: f64) -> Result<()> {
        self.push(Operation::Leave)?;
        self.step(from, t - from, t)?;
        self.record(t)?;
        self.push(Operation::Rejoin)
    }

    fn fixed(mut self, schedule: &Schedule, hold: usize) -> Result<Timeline> {
        for step in 0..=schedule.steps {
            interrupt::check();
            let t = schedule.time(step);
            if hold != 0 && step.is_multiple_of(hold) && schedule.is_on_grid(step) {
                self.sample(after_jump(self.passed(t, ON_STEP * schedule.dt), t))?;
            }
            while let Some(record) = schedule.record(self.timeline.records).filter(|record| record.step == step) {
                if record.offset == 0.0 { self.record(record.t)? } else { self.aside(t, t + record.offset)? }
            }
            if step < schedule.steps {
                let end = schedule.time(step + 1);
                self.step(t, if step + 1 < schedule.steps { schedule.dt } else { end - t }, end)?;
            }
        }
        Ok(self.timeline)
    }

    /// Append the contact change at `t` to the operations.
    fn switch(&mut self, t: f64, Switched { by, touches, .. }: &Switched) -> Result<()> {
        let (before, contacts) = (self.mode, &mut self.timeline.contacts);
        self.mode = place(&mut contacts.modes, touches.clone());
        let &Some(by) = by else { return Ok(()) };
        let (guard, k) = (place(&mut contacts.guards, by), contacts.switches.len());
        append(&mut contacts.switches, &[Switch { guard, before, after: self.mode }])?;
        self.push(Operation::Switch { k, t })
    }

    fn adaptive(mut self, path: &AdaptivePath, records: &[f64]) -> Result<Timeline> {
        let mut switched = path.switched.iter().peekable();
        for (j, &t) in path.times.iter().enumerate() {
            interrupt::check();
            while let Some(next) = switched.next_if(|next| next.t <= t) {
                self.switch(t, next)?;
            }
            if self.timeline.contacts.modes.is_empty() {
                self.timeline.contacts.modes.push(Vec::new());
            }
            self.sample(t)?;
            let next = path.times.get(j + 1).copied();
            let close = next.map_or(f64::INFINITY, |next| ON_STEP * (next - t));
            while let Some(&at) = records.get(self.timeline.records).filter(|&&at| next.is_none_or(|next| at < next - close)) {
                if at - t <= close { self.record(at)? } else { self.aside(t, at)? }
            }
            if let Some(next) = next {
                self.step(t, next - t, next)?;
            }
        }
        Ok(self.timeline)
    }
}
