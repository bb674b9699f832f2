//! A joint-torque sensor. A controller reads the joint torque `tau_J = K (theta - q)` as
//!
//! `tau_f' = w_c (tau_J - tau_f)`, `reading = round((tau_f + bias + noise) / step) step`,
//!
//! with the filtered torque `tau_f`, its time derivative `tau_f'`, the bandwidth `w_c` and the resolution `step`. Units are those of
//! revolute joints; for a prismatic joint, replace N m by N.
//!
//! Controllers of light-weight arms measure joint torques and motor positions. They compute the link positions as
//! `q = theta - K^-1 reading`.

use crate::error::{Error, Result, finite};

/// A joint-torque sensor: noise, bias, resolution and bandwidth.
///
/// ```
/// use armlet_core::plant::sensors::TorqueSensor;
///
/// // No noise, a bias of 0.2 N m, steps of 0.5 N m, and a filter with 100 rad/s.
/// let sensor = TorqueSensor::new(0.0, vec![0.2], 0.5, 100.0)?;
/// assert_eq!(sensor.reading(0, 3.0, 0.0), 3.0);
/// assert_eq!(sensor.reading(0, 3.1, 0.0), 3.5);
/// // After one time constant, 63 % of a constant torque.
/// assert!((sensor.filtered(0.0, 1.0, 1.0, 0.01) - (1.0 - (-1.0f64).exp())).abs() < 1e-14);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueSensor {
    /// Standard deviation of the noise, N m.
    pub noise: f64,
    /// Bias of each joint, `(n,)`, N m; empty for no bias.
    pub bias: Vec<f64>,
    /// Step of the reading, N m; 0 for no rounding.
    pub resolution: f64,
    /// Bandwidth `w_c`, rad/s; infinite without a filter.
    pub bandwidth: f64,
}

impl TorqueSensor {
    /// Create a sensor. `noise`, `bias` and `resolution` are in N m, `bandwidth` is in rad/s.
    ///
    /// Errors: `Input` for a negative or infinite `noise` or `resolution`, a `bias` that is not finite, or a `bandwidth` that is not
    /// positive.
    pub fn new(noise: f64, bias: Vec<f64>, resolution: f64, bandwidth: f64) -> Result<Self> {
        for (name, x) in [("noise", noise), ("resolution", resolution)] {
            if !(x >= 0.0 && x.is_finite()) {
                return Err(Error::input(name, format!("is negative or not finite: expected a number >= 0, got {x}")));
            }
        }
        finite("bias", &bias)?;
        if !(bandwidth > 0.0) {
            return Err(Error::input("bandwidth", format!("is not positive: expected rad/s > 0, got {bandwidth}")));
        }
        Ok(TorqueSensor { noise, bias, resolution, bandwidth })
    }

    /// The filter's state, N m, after the time `dt`, s. The state is exact for a torque that changes linearly from `before` to `now`.
    pub fn filtered(&self, state: f64, before: f64, now: f64, dt: f64) -> f64 {
        let turn = self.bandwidth * dt;
        if !turn.is_finite() {
            return now;
        }
        if turn == 0.0 {
            return state;
        }
        // With `turn = bandwidth dt` and `e = exp(-turn)`, the exact solution of `y' = bandwidth (torque - y)` is
        // `y(dt) = e y(0) + now - e before - (now - before) (1 - e)/turn`.
        let decay = (-turn).exp();
        let share = -(-turn).exp_m1() / turn;
        decay * (state - before) + now - (now - before) * share
    }

    /// The reading of joint `i`, N m, from the filter's state. `normal` is a standard normal number.
    pub fn reading(&self, i: usize, filtered: f64, normal: f64) -> f64 {
        let x = filtered + self.bias.get(i).copied().unwrap_or(0.0) + self.noise * normal;
        if self.resolution > 0.0 { (x / self.resolution).round() * self.resolution } else { x }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_filter_is_exact_on_ramps_and_at_its_ends() {
        let sensor = |bandwidth| TorqueSensor::new(0.0, vec![], 0.0, bandwidth).expect("valid");
        // Many small steps must have the same result as one long step.
        let (slope, dt, steps) = (30.0, 2e-3, 1000);
        let at = |k: usize| 5.0 + slope * dt * k as f64 / steps as f64;
        let fine = (0..steps).fold(1.0, |y, k| sensor(900.0).filtered(y, at(k), at(k + 1), dt / steps as f64));
        let coarse = sensor(900.0).filtered(1.0, at(0), at(steps), dt);
        assert!((fine - coarse).abs() < 1e-12, "{fine} {coarse}: a thousand roundings of 1e-15");
        assert_eq!(sensor(f64::INFINITY).filtered(1.0, 2.0, 3.0, dt), 3.0);
        assert_eq!(sensor(900.0).filtered(1.0, 2.0, 3.0, 0.0), 1.0);
        // This filter is too slow to follow: its state moves by 1e-9 of the change.
        assert!((sensor(1e-6).filtered(1.0, 2.0, 2.0, 1e-3) - 1.0 - 1e-9).abs() < 1e-15);
    }

    #[test]
    fn readings_have_bias_noise_and_steps() {
        let sensor = TorqueSensor::new(0.5, vec![0.0, 1.0], 0.25, f64::INFINITY).expect("valid");
        assert_eq!(sensor.reading(0, 3.1, 0.0), 3.0);
        assert_eq!(sensor.reading(1, 3.1, 0.2), 4.25);
        assert!(TorqueSensor::new(-1.0, vec![], 0.0, 1.0).is_err());
        assert!(TorqueSensor::new(0.0, vec![f64::NAN], 0.0, 1.0).is_err());
        assert!(TorqueSensor::new(0.0, vec![], f64::INFINITY, 1.0).is_err());
        assert!(TorqueSensor::new(0.0, vec![], 0.0, f64::NAN).is_err());
    }
}
