//! The times of a run: its steps, its records, and its restarts.

use super::bound::Bound;
use crate::error::{Error, Result, finite, positive};
use crate::interrupt::look;
use crate::memory;

/// A time this close to a step's end, in steps, is that end.
const ON_GRID: f64 = 1e-9;
/// More steps than this indicate an error in the arguments.
const MAX_STEPS: f64 = 1e12;
/// The least memory of one record: its place in the schedule, time, state, input and monitors of a small arm.
const BYTES_PER_RECORD: u128 = 160;

/// Records that are placed between two checks for a stop.
const LOOK: usize = 1 << 12;

/// The times of the records.
#[derive(Clone, Debug, PartialEq)]
pub enum Times {
    /// Fixed steps: the start and every `k`-th step, and the end; adaptive methods: every `k`-th accepted step.
    Every(usize),
    /// Exactly these times, increasing, within `[0, t_end]`.
    At(Vec<f64>),
}

/// Refuse times that do not increase or leave the run.
pub fn require_times(t_eval: &[f64], t_end: f64) -> Result<()> {
    finite("t_eval", t_eval)?;
    for (i, &t) in t_eval.iter().enumerate() {
        if t < 0.0 || t > t_end {
            return Err(Error::input("t_eval", format!("leaves the run: expected times in [0, {t_end}], got {t}")).at([i]));
        }
        if i > 0 && t <= t_eval[i - 1] {
            return Err(Error::input("t_eval", format!("is not increasing: expected > {}, got {t}", t_eval[i - 1])).at([i]));
        }
    }
    Ok(())
}

/// Refuse more records than memory holds, before any is made: the system refuses one large reservation, while many small ones would end the
/// process.
pub fn require_memory(records: u128) -> Result<()> {
    let bytes = records * BYTES_PER_RECORD;
    let refused = Error::Memory { bytes };
    let Ok(size) = usize::try_from(bytes) else { return Err(refused) };
    Vec::<u8>::new().try_reserve_exact(size).map_err(|_| refused)
}

/// A record of a fixed-step run: after `step` steps, and a further `offset` seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    pub step: usize,
    pub offset: f64,
    pub t: f64,
}

/// Which records a run has.
#[derive(Clone, Debug)]
enum Records {
    /// The start and every `k`-th step, and the end.
    Every(usize),
    /// The start and the end.
    Ends,
    /// The end.
    Last,
    At(Vec<Record>),
}

/// The additional results that the system computes within the steps of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Within {
    Nothing,
    /// Every step is added to sums in the state.
    Sums,
    /// A record is noted at regular steps, and as record `last` at the end.
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
    /// Times of jumps strictly inside the run, increasing.
    pub breaks: Vec<f64>,
    /// The bound of the state.
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
        // A last step shorter than the rest ends a run whose length is not a multiple of dt.
        let steps = (exact - ON_GRID * exact.max(1.0)).ceil().max(0.0) as usize;
        let breaks = breaks.iter().copied().filter(|&b| b > 0.0 && b < t_end).collect();
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

    /// The same steps, each added to sums in the state, with records only at the start and the end.
    pub fn summing_up(&self) -> Self {
        Schedule { records: Records::Ends, within: Within::Sums, ..self.clone() }
    }

    /// The same steps, with records at regular steps noted within; `None` for records at other times.
    pub fn noting(&self) -> Option<Self> {
        let Records::Every(every) = self.records else { return None };
        Some(Schedule { records: Records::Last, within: Within::Notes { every, last: self.count() - 1 }, ..self.clone() })
    }

    /// The record that is noted before step `step`, if there is one.
    #[inline(always)]
    pub fn noted(&self, step: usize) -> Option<usize> {
        match self.within {
            Within::Notes { every, .. } if step.is_multiple_of(every) => Some(step / every),
            _ => None,
        }
    }

    /// Number of records.
    pub fn count(&self) -> usize {
        match &self.records {
            Records::Every(every) => self.steps / every + 1 + usize::from(!self.steps.is_multiple_of(*every)),
            Records::Ends => 1 + usize::from(self.steps > 0),
            Records::Last => 1,
            Records::At(records) => records.len(),
        }
    }

    /// Record `i`; `None` behind the last one.
    pub fn record(&self, i: usize) -> Option<Record> {
        let on_step = |step: usize| {
            let step = step.min(self.steps);
            Record { step, offset: 0.0, t: self.time(step) }
        };
        match &self.records {
            Records::At(records) => records.get(i).copied(),
            Records::Every(every) => (i * every < self.steps + every).then(|| on_step(i * every)),
            Records::Ends => (i == 0 || i == 1 && self.steps > 0).then(|| on_step(i * self.steps)),
            Records::Last => (i == 0).then(|| on_step(self.steps)),
        }
    }

    /// The times of all records.
    pub fn record_times(&self) -> Result<Vec<f64>> {
        require_memory(self.count() as u128)?;
        let mut times = memory::reserved(self.count())?;
        for i in 0..self.count() {
            if i % LOOK == 0 {
                look();
            }
            times.extend(self.record(i).map(|record| record.t));
        }
        Ok(times)
    }

    /// The time after `step` steps.
    pub fn time(&self, step: usize) -> f64 {
        // Signed conversion is one instruction.
        if step >= self.steps { self.t_end } else { step as i64 as f64 * self.dt }
    }

    fn locate(&self, t: f64) -> Record {
        let step = ((t / self.dt).floor() as usize).min(self.steps);
        for near in [step, (step + 1).min(self.steps)] {
            if (t - self.time(near)).abs() <= ON_GRID * self.dt {
                return Record { step: near, offset: 0.0, t };
            }
        }
        Record { step, offset: t - self.time(step), t }
    }

    /// Whether every step is recorded.
    pub fn records_every_step(&self) -> bool {
        matches!(self.records, Records::Every(1))
    }

    /// Whether `t` is, up to rounding, the end of a step that ends at `end`.
    pub fn is_end(&self, t: f64, end: f64) -> bool {
        (t - end).abs() <= ON_GRID * self.dt
    }
}
