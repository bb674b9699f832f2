//! The time grid of a problem. This file also validates the times.

use crate::error::{Error, Result, finite, positive};
use crate::simulate::adaptive::segments::{Clock, Outcome, Segments};
use crate::simulate::fixed::schedule::Schedule;
use crate::simulate::fixed::steps::Faults;
use crate::simulate::problem::Problem;
use crate::simulate::problem::bound::Bound;

/// The prepared time grid of a run: fixed steps, or segments of an adaptive method.
pub enum Division {
    Fixed(Fixed),
    Adaptive(Segments),
}

/// The end of the runs of a group, for each kind of time grid.
pub enum Ended {
    Fixed(Faults),
    Adaptive(Outcome),
}

/// The time grid of a method with fixed steps.
pub struct Fixed {
    pub schedule: Schedule,
    /// The number of steps between two calls of the sampled controller. It is 1 if the controller does more than hold the law's output, and
    /// 0 without sampling.
    pub hold: usize,
}

impl Problem<'_> {
    /// Validate the problem and return its time grid. Errors: [`Error::Input`] or [`Error::WrongShape`] for an invalid argument,
    /// [`Error::Memory`] if the records exceed the memory.
    pub fn validate(&self) -> Result<Division> {
        let o = &self.options;
        if !(o.t_end >= 0.0 && o.t_end.is_finite()) {
            return Err(Error::input("t_end", format!("is not a duration: expected a finite number >= 0, got {}", o.t_end)));
        }
        finite("initial state", &self.x0)?;
        self.validate_loop()?;
        if !(o.state_limit > 0.0) {
            return Err(Error::input("state_limit", format!("is not positive: expected > 0, got {}", o.state_limit)));
        }
        let bound = Bound::new(self.plants[0].states(), o.state_limit);
        let breaks = self.breaks()?;
        // Arguments that the method does not use are also checked.
        o.dt.map_or(Ok(()), |dt| positive("dt", dt))?;
        positive("rtol", o.rtol)?;
        if let Some(step) = o.max_step.filter(|step| !(*step > 0.0)) {
            return Err(Error::input("max_step", format!("is not positive: expected > 0, got {step}")));
        }
        if o.rtol < 1e-15 {
            return Err(Error::input("rtol", format!("is below what a double resolves: expected at least 1e-15, got {}", o.rtol)));
        }
        if !(o.atol >= 0.0 && o.atol.is_finite()) {
            return Err(Error::input("atol", format!("is negative or not finite: expected a number >= 0, got {}", o.atol)));
        }
        if o.method.is_adaptive() {
            if let Some(sampling) = &o.sampling {
                sampling.require_memory(o.t_end)?;
            }
            let clock = match &o.sampling {
                None => Clock::None,
                Some(sampling) if sampling.is_plain() => Clock::Every(sampling.period),
                Some(_) => Clock::Breaks,
            };
            let segments = Segments::new(o.t_end, o.times.clone(), &breaks, clock, bound)?;
            return Ok(Division::Adaptive(Segments { max_step: o.max_step.unwrap_or(f64::INFINITY), ..segments }));
        }
        let Some(dt) = o.dt.or(o.sampling.as_ref().map(|sampling| sampling.period)) else {
            return Err(Error::input("dt", "is missing: expected a step in seconds for a fixed-step method, got None"));
        };
        let schedule = Schedule::new(dt, o.t_end, &o.times, &breaks, bound)?;
        let steps = |name: &str, duration: f64, least: f64| {
            let ratio = duration / dt;
            if ratio.round() < least || (ratio - ratio.round()).abs() > 1e-9 * ratio.max(1.0) {
                return Err(Error::input(name, format!("is not a multiple of dt: expected k * {dt}, got {duration}")));
            }
            Ok(ratio.round() as usize)
        };
        let hold = match &o.sampling {
            None => 0,
            Some(sampling) => {
                let period = steps("sample_time", sampling.period, 1.0)?;
                steps("delay", sampling.delay, 0.0)?;
                // A controller that does more than hold the law's output, such as delay it, is called at every step.
                if sampling.is_plain() { period } else { 1 }
            }
        };
        Ok(Division::Fixed(Fixed { schedule, hold }))
    }
}
