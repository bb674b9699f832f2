//! Stability of the motor loops of elastic joints at a controller's sample time, for locked links.

use crate::error::{Error, Result};
use crate::law::LockedMotors;
use crate::simulate::problem::Problem;

impl Problem<'_> {
    /// Return the sample time at which the motor loop of the first run becomes unstable, s. The search ends at the product of `times` and
    /// the problem's sample time. The result is `None` if the search finds no unstable sample time, or if the loop is unstable at the
    /// problem's sample time.
    pub fn sample_time_limit(&self, times: f64) -> Option<f64> {
        let period = self.options.sampling.as_ref()?.period;
        let (plant, law) = (self.plants.first()?.elastic()?, self.laws.first()?.reduction()?);
        let limit = LockedMotors::new(plant, law, f64::INFINITY).unstable_between(period, times * period);
        (limit > 0.0 && limit.is_finite()).then_some(limit)
    }

    /// Refuse a sample time at which a motor loop is unstable. Errors: `Input` names `sample_time`, and the run if it is not the first.
    pub(in crate::simulate) fn validate_motor_loops(&self, period: f64) -> Result<()> {
        for run in 0..self.plants.len().max(self.laws.len()) {
            let (Some(plant), Some(law)) = (self.plant(run).elastic(), self.law(run).reduction()) else { continue };
            let motors = LockedMotors::new(plant, law, f64::INFINITY);
            if motors.radius(period) >= 1.0 {
                let limit = motors.unstable_up_to(period);
                let bound = if limit > 0.0 && limit.is_finite() {
                    format!("expected below {} s, where it becomes unstable", six_digits(limit))
                } else {
                    "expected a loop that is stable at short sample times".to_owned()
                };
                let problem = format!("is too large for the motor loop: {bound}, got {period}");
                let error = Error::input("sample_time", problem);
                return Err(if run == 0 { error } else { error.at([run]) });
            }
        }
        Ok(())
    }
}

/// Round a positive number down to six digits. Rounding down keeps the reported sample time stable.
fn six_digits(x: f64) -> f64 {
    let scale = 10f64.powi(6 - x.log10().ceil() as i32);
    (x * scale).floor() / scale
}
