//! Whether the motor loops of elastic joints with locked links are stable at a controller's sample time.

use super::problem::Problem;
use crate::error::{Error, Result};
use crate::law::LockedMotors;

impl Problem<'_> {
    /// The sample time at which the motor loop of the first run becomes unstable with locked links. `None` if it exceeds `times` the sample
    /// time of the problem or does not exist, or if the sample time itself is unstable.
    pub fn sample_time_limit(&self, times: f64) -> Option<f64> {
        let period = self.options.sampling.as_ref()?.period;
        let (plant, law) = (self.plants.first()?.elastic()?, self.laws.first()?.reduction()?);
        let limit = LockedMotors::new(plant, law, f64::INFINITY).unstable_between(period, times * period);
        (limit > 0.0 && limit.is_finite()).then_some(limit)
    }

    /// Refuse a sample time at which no motor loop is stable.
    pub(super) fn validate_motor_loops(&self, period: f64) -> Result<()> {
        for run in 0..self.plants.len().max(self.laws.len()) {
            let (Some(plant), Some(law)) = (self.plant(run).elastic(), self.law(run).reduction()) else { continue };
            let motors = LockedMotors::new(plant, law, f64::INFINITY);
            // Stable intervals beyond the first limit are not used.
            let limit = if run == 0 || motors.radius(period) >= 1.0 { motors.unstable_up_to(period) } else { f64::INFINITY };
            if period >= limit {
                let problem = format!(
                    "is too large for the motor loop: expected below {} s, where it becomes unstable, got {period}",
                    six_digits(limit)
                );
                let error = Error::input("sample_time", problem);
                return Err(if run == 0 { error } else { error.at([run]) });
            }
        }
        Ok(())
    }
}

/// A positive number rounded down to six digits, so that the reported sample time is stable.
fn six_digits(x: f64) -> f64 {
    let scale = 10f64.powi(6 - x.log10().ceil() as i32);
    (x * scale).floor() / scale
}
