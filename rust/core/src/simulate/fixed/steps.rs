//! Runs of fixed steps. The run checks its state once per block of steps: all numbers must be finite, and the plant's states within their
//! limit ([`Bound`]).
//!
//! If a check fails, the block is repeated step by step, to find the time of the fault in each lane. A faulty lane is NaN from this time
//! on. The other lanes repeat the same operations, and their bits do not change.

use super::schedule::{Schedule, Within, after_jump, is_end};
use crate::integrate::FixedStep;
use crate::scalar::Real;
use crate::simulate::loops::simulated_loop::SimulatedLoop;
use crate::simulate::problem::bound::Bound;
use crate::simulate::stop::Stop;

/// The largest number of steps between two checks.
const BLOCK: usize = 32;

/// The faults of the lanes of a run. A fault is a state that is not finite or beyond the limit.
pub struct Faults {
    /// For each lane, the time of its fault, s. It is infinite for a lane without a fault.
    pub at: Vec<f64>,
    pub interrupted: bool,
    pub steps: u64,
}

/// Receives the records of a run of fixed steps.
pub trait Record<S, F> {
    fn record(&mut self, i: usize, t: f64, system: &mut F, x: &[S]);
    /// Accept the records that the system stored within the steps so far. If the system stores records, [`run`] calls this function after
    /// each block of steps and at the last record.
    fn accept(&mut self, system: &mut F);
}

/// Run `system` from the state `x`, with the steps and records of `schedule`. `hold`: the number of steps between two calls of the sampled
/// controller, or 0 without sampling.
pub fn run<S, F, M>(
    system: &mut F,
    method: &mut M,
    mut x: Vec<S>,
    schedule: &Schedule,
    hold: usize,
    stop: &dyn Stop,
    recorder: &mut impl Record<S, F>,
) -> Faults
where
    S: Real,
    F: SimulatedLoop<S>,
    M: FixedStep<S, F, Vec<S>>,
{
    let mut faults = Faults { at: vec![f64::INFINITY; S::LANES], interrupted: false, steps: 0 };
    let bound = schedule.bound;
    if !bound.holds(&x) {
        note_faults(&mut faults.at, &mut x, bound, 0.0);
    }
    let (mut step, mut i, mut next_break) = (0, 0, 0);
    let mut next = schedule.record(0);
    // A copy of the run's state. The run continues from this copy after `x` was advanced to a record between two steps.
    let (mut start, mut first_break, mut ahead) = (x.clone(), 0, false);
    loop {
        let here = next.filter(|record| record.step == step);
        let offset = here.map_or(0.0, |record| record.offset);
        if let Some(record) = here
            && (offset == 0.0 || ahead)
        {
            if hold != 0 && offset == 0.0 && step.is_multiple_of(hold) && schedule.is_on_grid(step) {
                system.sample(record.t, &x);
            }
            match schedule.within {
                Within::Notes { last, .. } => {
                    system.note(last, record.t, &x);
                    recorder.accept(system);
                }
                Within::Sums if step == schedule.steps => {
                    system.sum_up(record.t, 0.0, &mut x);
                    recorder.record(i, record.t, system, &x);
                }
                Within::Nothing | Within::Sums => recorder.record(i, record.t, system, &x),
            }
            next = schedule.record(i + 1);
            i += 1;
            if ahead {
                // Return to the state of the run.
                x.clone_from(&start);
                next_break = first_break;
                method.restart();
                ahead = false;
            }
            continue;
        }
        if here.is_none() && step == schedule.steps {
            return faults;
        }
        if stop.requested() {
            faults.interrupted = true;
            return faults;
        }
        let target = next.map_or(schedule.steps, |record| record.step);
        let to = if offset > 0.0 { step + 1 } else { target.min(step + block(step, hold)) };
        start.clone_from(&x);
        first_break = next_break;
        run_block(system, method, (schedule, hold), (step, to, offset), &mut faults.at, &mut next_break, (&start, &mut x));
        if let Within::Notes { .. } = schedule.within {
            recorder.accept(system);
        }
        faults.steps += (to - step) as u64;
        ahead = offset > 0.0;
        if !ahead {
            step = to;
        }
    }
}

/// Advance `x` over the block of steps `step..to`. If a check finds a new fault, repeat the block from `start` step by step.
fn run_block<S, F, M>(
    system: &mut F,
    method: &mut M,
    (schedule, hold): (&Schedule, usize),
    (step, to, offset): (usize, usize, f64),
    at: &mut [f64],
    next_break: &mut usize,
    (start, x): (&Vec<S>, &mut Vec<S>),
) where
    S: Real,
    F: SimulatedLoop<S>,
    M: FixedStep<S, F, Vec<S>>,
{
    let (bound, first_break) = (schedule.bound, *next_break);
    let mut careful = false;
    loop {
        let mut k = step;
        while k < to {
            let t = after_jump(&schedule.breaks[..*next_break], schedule.time(k));
            let smooth = if careful || offset > 0.0 { 0 } else { smooth_steps(schedule, k, to, *next_break) };
            if smooth > 0 && method.stride(system, k, smooth, schedule.dt, x) {
                k += smooth;
                continue;
            }
            if hold != 0 && k.is_multiple_of(hold) {
                system.sample(t, x);
                method.restart();
            }
            if let Some(i) = schedule.noted(k) {
                system.note(i, t, x);
            }
            if schedule.within == Within::Sums {
                system.sum_up(t, schedule.time(k + 1) - t, x);
                if careful && !bound.holds(x) {
                    note_faults(at, x, bound, t);
                }
            }
            one_step(system, method, schedule, k, offset, next_break, x);
            if careful && !bound.holds(x) {
                note_faults(at, x, bound, schedule.time(k + 1));
            }
            k += 1;
        }
        if careful || offset > 0.0 || bound.holds(x) || all_known(at, x, bound) {
            return;
        }
        careful = true;
        x.clone_from(start);
        *next_break = first_break;
        method.restart();
    }
}

/// Return the number of steps in the block that starts at `step`. A block that starts between two samples ends at the next sample or
/// earlier. So a repeated block uses the same held input.
fn block(step: usize, hold: usize) -> usize {
    if hold == 0 {
        return BLOCK;
    }
    let inside = step % hold;
    if inside > 0 { (hold - inside).min(BLOCK) } else { BLOCK / hold.min(BLOCK) * hold.min(BLOCK) }
}

/// Return the number of equal steps from `step` on, up to `to` at most. In these steps the exogenous input does not jump.
fn smooth_steps(schedule: &Schedule, step: usize, to: usize, next_break: usize) -> usize {
    // If the system computes metrics or records within steps, the first step is computed separately. A step is also computed separately if
    // the last jump equals its start up to rounding, but is later.
    let start = schedule.time(step);
    if schedule.within != Within::Nothing && step == 0 || after_jump(&schedule.breaks[..next_break], start) > start {
        return 0;
    }
    // The last step is excluded, because it may be shorter. A step in which the input jumps, or at whose end it jumps, is excluded, too.
    let mut end = to.min(schedule.steps - 1);
    if let Some(jump) = schedule.breaks.get(next_break) {
        end = end.min(((jump / schedule.dt) as usize).saturating_sub(1));
    }
    end.saturating_sub(step)
}

/// Compute step number `step`, or only its part of size `offset`.
fn one_step<S, F, M>(system: &mut F, method: &mut M, schedule: &Schedule, step: usize, offset: f64, next_break: &mut usize, x: &mut Vec<S>)
where
    S: Real,
    F: SimulatedLoop<S>,
    M: FixedStep<S, F, Vec<S>>,
{
    let (t, mut end) = (schedule.time(step), schedule.time(step + 1));
    let mut h = if step + 1 < schedule.steps { schedule.dt } else { end - t };
    if offset > 0.0 {
        (end, h) = (t + offset, offset);
    }
    divided_step(system, method, (&schedule.breaks, schedule.dt, next_break), (t, h, end), x);
}

/// Compute a step of size `h` from `t` to `end`, s. It is divided where the input jumps, inside or at its end. Each part uses the input on
/// its side of the jump. `breaks` are the jumps, s, `dt` is the size of a whole step, and `next_break` counts the jumps passed.
pub fn divided_step<S, F, M>(
    system: &mut F,
    method: &mut M,
    (breaks, dt, next_break): (&[f64], f64, &mut usize),
    (mut t, mut h, end): (f64, f64, f64),
    x: &mut Vec<S>,
) where
    S: Real,
    F: SimulatedLoop<S>,
    M: FixedStep<S, F, Vec<S>>,
{
    loop {
        let (mut piece, mut input_end, mut jumps) = (h, end, false);
        if let Some(&jump) = breaks.get(*next_break) {
            let last = is_end(dt, jump, end);
            if jump <= end || last {
                jumps = true;
                input_end = jump.min(end).next_down();
                piece = if last { end - t } else { jump - t };
            }
        }
        if system.enter_step(t, x) {
            method.restart();
        }
        method.step(system, after_jump(&breaks[..*next_break], t), piece, input_end, x);
        if system.leave_step(x) {
            method.restart();
        }
        if !jumps {
            return;
        }
        *next_break += 1;
        method.restart();
        t += piece;
        h = end - t;
        if is_end(dt, t, end) {
            return;
        }
    }
}

/// Whether every lane with a fault is already marked.
#[cold]
#[inline(never)]
fn all_known<S: Real>(at: &[f64], x: &[S], bound: Bound) -> bool {
    (0..S::LANES).all(|lane| at[lane].is_finite() || bound.holds_lane(x, lane))
}

/// Mark the lanes that have a fault at time `t`, and set all their numbers to NaN.
#[cold]
#[inline(never)]
fn note_faults<S: Real>(at: &mut [f64], x: &mut [S], bound: Bound, t: f64) {
    for lane in 0..S::LANES {
        if at[lane].is_finite() || bound.holds_lane(x, lane) {
            continue;
        }
        at[lane] = t;
        for x in &mut *x {
            *x = S::from_lanes(|i| if i == lane { f64::NAN } else { x.lane(i) });
        }
    }
}
