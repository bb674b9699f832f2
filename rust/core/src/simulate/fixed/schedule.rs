//! The times of a run: steps, records, and jumps of the input.

use crate::error::{Error, Result, positive};
use crate::interrupt;
use crate::memory;
use crate::simulate::problem::bound::Bound;
use crate::simulate::problem::times::{Times, require_memory, require_times};

/// A time `t` counts as the end of a step if `|t - end| / dt` is below this limit, dimensionless. `dt` is the step size.
const ON_GRID: f64 = 1e-9;
/// A larger number of steps indicates an error in the arguments.
const MAX_STEPS: f64 = 1e12;
/// The number of records whose times are computed between two checks for a stop.
const CHECK_PERIOD: usize = 1 << 12;

/// Return the time at which the input of a step that starts at `t` is evaluated. By rounding, `t` may be slightly before the last of the
/// jumps `passed`. Then the result is the time of this jump.
#[inline]
pub fn after_jump(passed: &[f64], t: f64) -> f64 {
    passed.last().map_or(t, |&jump| t.max(jump))
}

/// A record of a fixed-step run, `offset` seconds after the end of the first `step` steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordTime {
    pub step: usize,
    pub offset: f64,
    pub t: f64,
}

/// The records of a run.
#[derive(Clone, Debug)]
enum Records {
    /// One record at the start, one after every `k`-th step, and one at the end.
    Every(usize),
    /// One record at the start, and one at the end.
    Ends,
    /// Only one record at the end.
    Last,
    At(Vec<RecordTime>),
}

/// Results that the system computes within the steps of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Within {
    Nothing,
    /// Every step updates the metrics in the state.
    Sums,
    /// Every `every`-th step stores a record. Record `last` is at the end.
    Notes {
        every: usize,
        last: usize,
    },
}

/// The steps and records of a fixed-step run.
#[derive(Clone, Debug)]
pub struct Schedule {
    pub dt: f64,
    pub t_end: f64,
    pub steps: usize,
    records: Records,
    /// Times of the jumps of the input within the run, s, increasing. A jump at the end of the run is one of them.
    pub breaks: Vec<f64>,
    /// The limit of the absolute values of the plant's states.
    pub bound: Bound,
    pub within: Within,
}

impl Schedule {
    pub fn new(dt: f64, t_end: f64, times: &Times, breaks: &[f64], bound: Bound) -> Result<Self> {
        positive("dt", dt)?;
        let exact = t_end / dt;
        if exact > MAX_STEPS {
            return Err(Error::input("dt", format!("is too small for the run: expected at least {}, got {dt}", t_end / MAX_STEPS)));
        }
        // If the length of the run is not a multiple of `dt`, the last step is shorter.
        let steps = (exact - ON_GRID * exact.max(1.0)).ceil().max(0.0) as usize;
        let breaks = breaks.iter().copied().filter(|&b| b > 0.0 && b <= t_end).collect();
        let mut schedule = Schedule { dt, t_end, steps, records: Records::Ends, breaks, bound, within: Within::Nothing };
        schedule.records = match times {
            Times::Every(0) => return Err(Error::input("record_every", "is not positive: expected an integer >= 1, got 0")),
            Times::Every(every) => Records::Every(*every),
            Times::At(t_eval) => {
                require_times(t_eval, t_end)?;
                Records::At(memory::collected(t_eval.iter().map(|&t| schedule.locate(t)))?)
            }
        };
        Ok(schedule)
    }

    /// Return this schedule with an update of the metrics in every step, and with records only at the start and the end.
    pub fn summing_up(&self) -> Self {
        Schedule { records: Records::Ends, within: Within::Sums, ..self.clone() }
    }

    /// Return this schedule with records that steps store. The result is `None` if the records are not at regular steps.
    pub fn noting(&self) -> Option<Self> {
        let Records::Every(every) = self.records else { return None };
        Some(Schedule { records: Records::Last, within: Within::Notes { every, last: self.count() - 1 }, ..self.clone() })
    }

    /// Return the record that is stored before step `step`, if there is one.
    #[inline(always)]
    pub fn noted(&self, step: usize) -> Option<usize> {
        match self.within {
            Within::Notes { every, .. } if step.is_multiple_of(every) => Some(step / every),
            _ => None,
        }
    }

    /// The number of records.
    pub fn count(&self) -> usize {
        match &self.records {
            Records::Every(every) => self.steps / every + 1 + usize::from(!self.steps.is_multiple_of(*every)),
            Records::Ends => 1 + usize::from(self.steps > 0),
            Records::Last => 1,
            Records::At(records) => records.len(),
        }
    }

    /// Return record `i`, or `None` after the last record.
    pub fn record(&self, i: usize) -> Option<RecordTime> {
        let on_step = |step: usize| {
            let step = step.min(self.steps);
            RecordTime { step, offset: 0.0, t: self.time(step) }
        };
        match &self.records {
            Records::At(records) => records.get(i).copied(),
            Records::Every(every) => (i * every < self.steps + every).then(|| on_step(i * every)),
            Records::Ends => (i == 0 || i == 1 && self.steps > 0).then(|| on_step(i * self.steps)),
            Records::Last => (i == 0).then(|| on_step(self.steps)),
        }
    }

    /// Return the times of all records, s. Errors: [`Error::Memory`].
    pub fn record_times(&self) -> Result<Vec<f64>> {
        require_memory(self.count() as u128)?;
        let mut times = memory::reserved(self.count())?;
        for i in 0..self.count() {
            if i % CHECK_PERIOD == 0 {
                interrupt::check();
            }
            times.extend(self.record(i).map(|record| record.t));
        }
        Ok(times)
    }

    /// Return the time after `step` steps, s.
    pub fn time(&self, step: usize) -> f64 {
        // On x86-64, the conversion of a signed integer takes only one instruction.
        if step >= self.steps { self.t_end } else { step as i64 as f64 * self.dt }
    }

    /// Whether step `step` begins at a multiple of `dt`. The end of the run, which is the start of step `steps`, may be between two multiples.
    pub fn is_on_grid(&self, step: usize) -> bool {
        step < self.steps || self.is_end(self.t_end, step as f64 * self.dt)
    }

    fn locate(&self, t: f64) -> RecordTime {
        let step = ((t / self.dt).floor() as usize).min(self.steps);
        for near in [step, (step + 1).min(self.steps)] {
            if (t - self.time(near)).abs() <= ON_GRID * self.dt {
                return RecordTime { step: near, offset: 0.0, t };
            }
        }
        RecordTime { step, offset: t - self.time(step), t }
    }

    /// Whether every step is recorded.
    pub fn records_every_step(&self) -> bool {
        matches!(self.records, Records::Every(1))
    }

    /// Whether `t` equals, up to rounding, the end `end` of a step.
    pub fn is_end(&self, t: f64, end: f64) -> bool {
        is_end(self.dt, t, end)
    }
}

/// Whether `t` equals, up to rounding, the end `end` of a step of size `dt`, s.
pub fn is_end(dt: f64, t: f64, end: f64) -> bool {
    (t - end).abs() <= ON_GRID * dt
}
