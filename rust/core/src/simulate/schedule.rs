//! The times of a run: its steps, what is recorded, where it restarts.

use super::bound::Bound;
use crate::error::{Error, Result, finite, positive};
use crate::interrupt::look;
use crate::memory;

/// A time this close to a step's end, in steps, is that end.
const ON_GRID: f64 = 1e-9;
/// More steps than this is a mistake in the arguments, not a run.
const MAX_STEPS: f64 = 1e12;
/// What one record takes at least: its place in the schedule, time, state, input and monitors of a small arm.
const BYTES_PER_RECORD: u128 = 160;

/// Records that are placed between two looks whether to stop.
const LOOK: usize = 1 << 12;

/// What is recorded.
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
            return Err(Error::input("t_eval", format!("leaves the run: expected times in [0, {t_end}], got {t} (first bad index {i})")));
        }
        if i > 0 && t <= t_eval[i - 1] {
            return Err(Error::input("t_eval", format!("is not increasing: expected > {}, got {t} (first bad index {i})", t_eval[i - 1])));
        }
    }
    Ok(())
}

/// Refuse more records than memory holds, before any is made: one large reservation is refused at once where
/// many small ones would end the process.
pub(super) fn require_memory(records: u128) -> Result<()> {
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

/// The steps and records of a fixed-step run.
#[derive(Clone, Debug)]
pub struct Schedule {
    pub dt: f64,
    pub t_end: f64,
    pub steps: usize,
    pub records: Vec<Record>,
    /// Times of jumps strictly inside the run, increasing.
    pub breaks: Vec<f64>,
    /// What the state must keep to.
    pub bound: Bound,
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
        let mut schedule = Schedule { dt, t_end, steps, records: Vec::new(), breaks: Vec::new(), bound };
        match times {
            Times::Every(0) => return Err(Error::input("record_every", "is not positive: expected an integer >= 1, got 0")),
            Times::Every(every) => {
                require_memory(steps as u128 / *every as u128)?;
                let last = if steps.is_multiple_of(*every) { None } else { Some(steps) };
                let on_grid = (0..=steps).step_by(*every).chain(last);
                let record = |step| Record { step, offset: 0.0, t: schedule.time(step) };
                let looked = |(k, step)| {
                    if k % LOOK == 0 {
                        look();
                    }
                    record(step)
                };
                schedule.records = on_grid.enumerate().map(looked).collect();
            }
            Times::At(t_eval) => {
                require_times(t_eval, t_end)?;
                schedule.records = memory::collected(t_eval.iter().map(|&t| schedule.locate(t)))?;
            }
        }
        schedule.breaks = breaks.iter().copied().filter(|&b| b > 0.0 && b < t_end).collect();
        Ok(schedule)
    }

    /// The time after `step` steps.
    #[inline(always)]
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

    /// Whether every record falls on a step.
    pub fn on_grid(&self) -> bool {
        self.records.iter().all(|r| r.offset == 0.0)
    }

    /// Whether `t` is, up to rounding, the end of a step that ends at `end`.
    #[inline(always)]
    pub fn is_end(&self, t: f64, end: f64) -> bool {
        (t - end).abs() <= ON_GRID * self.dt
    }
}
