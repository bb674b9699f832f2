//! Joint torque sensors in a sampled loop. With the torque `tau_J = K (theta - q)` of the plant's springs at sample `k`,
//!
//! `tau_f_dot = w_c (tau_J - tau_f)` over the time since sample `k - 1`, `reading = round((tau_f + bias + noise)/step) step`,
//! `q = theta - K_law^-1 reading`,
//!
//! where `tau_f` is the filtered torque, and `bias` and `noise` are errors of the sensor. `w_c` is the bandwidth of the sensor, `step` its
//! resolution, and `K_law` the law's stiffness. This `q` replaces the measured link position, so that `K_law (theta - q)` in the law is the
//! reading. At the first sample, `tau_f = tau_J`. `theta` is the motor position. Without a resolution, the reading is not rounded.

use crate::error::{Error, Result};
use crate::linalg::gain::AnyGain;
use crate::plant::sensors::TorqueSensor;
use crate::simulate::problem::Problem;
use crate::simulate::problem::sampling::{CHANNELS, Sampling, gaussian};

/// The random channel of the torque sensor of joint `i` is `TORQUE + i`. No other measurement uses these channels.
const TORQUE: u64 = 1 << 32;

/// The exact and the filtered torques of one sample, shape `(n,)` each, N m or N.
#[derive(Clone, Debug)]
pub struct Sensed {
    torque: Vec<f64>,
    filtered: Vec<f64>,
}

impl Sensed {
    pub fn new(n: usize) -> Self {
        Sensed { torque: vec![0.0; n], filtered: vec![0.0; n] }
    }
}

/// The torque sensors of all joints of one run.
#[derive(Clone, Debug)]
pub struct TorqueSensing {
    sensor: TorqueSensor,
    /// The stiffness `K` of the plant.
    stiffness: AnyGain<f64>,
    /// The inverse `K_law^-1` of the law's stiffness. `K_law` is `K` for a law without a stiffness.
    compliance: AnyGain<f64>,
    stretch: Vec<f64>,
    readings: Vec<f64>,
}

impl TorqueSensing {
    /// Return the sensors of run `run` of a problem, or `None` without sensors.
    pub fn of(problem: &Problem, sampling: &Sampling, run: usize) -> Option<Self> {
        let sensor = sampling.torque_sensor.clone()?;
        let stiffness = &problem.plant(run).elastic()?.stiffness;
        let compliance = problem.law(run).joint_stiffness().unwrap_or(stiffness).inverse();
        let zeros = vec![0.0; problem.plant(0).n()];
        Some(TorqueSensing {
            sensor,
            stiffness: AnyGain::new(stiffness),
            compliance: AnyGain::new(&compliance),
            stretch: zeros.clone(),
            readings: zeros,
        })
    }

    /// Compute the torques `now` at sample `k` and plant state `x`, and write the link positions to `measured`. `before`: the torques at
    /// the previous sample and the time since then, s.
    pub fn sense(&mut self, seed: u64, k: u64, x: &[f64], before: Option<(&Sensed, f64)>, now: &mut Sensed, measured: &mut [f64]) {
        let n = self.stretch.len();
        for i in 0..n {
            self.stretch[i] = x[2 * n + i] - x[i];
        }
        self.stiffness.multiply(&self.stretch, &mut now.torque);
        for i in 0..n {
            let torque = now.torque[i];
            now.filtered[i] = before.map_or(torque, |(before, dt)| self.sensor.filtered(before.filtered[i], before.torque[i], torque, dt));
            let normal = if self.sensor.noise > 0.0 { gaussian(seed, k, TORQUE + i as u64) } else { 0.0 };
            self.readings[i] = self.sensor.reading(i, now.filtered[i], normal);
        }
        self.compliance.multiply(&self.readings, &mut self.stretch);
        for i in 0..n {
            measured[i] = measured[2 * n + i] - self.stretch[i];
        }
    }
}

impl Problem<'_> {
    /// Refuse noise and resolution of quantities that are no states of the plant. Refuse torque sensors for a plant without elastic joints,
    /// a `bias` of another length, and noise or resolution of `q` with a torque sensor.
    pub(in crate::simulate) fn validate_sensors(&self, sampling: &Sampling) -> Result<()> {
        let plant = self.plant(0);
        let measured = plant.seen() / plant.n();
        for (name, values) in [("noise", sampling.noise), ("resolution", sampling.resolution)] {
            if let Some(i) = (measured..CHANNELS.len()).find(|&i| values[i] != 0.0) {
                let (kind, states) = (plant.kind().name(), CHANNELS[..measured].join(", "));
                let problem =
                    format!("takes effect only on states of the plant: expected quantities of {kind} ({states}), got {}", CHANNELS[i]);
                return Err(Error::input(name, problem));
            }
        }
        let Some(sensor) = &sampling.torque_sensor else { return Ok(()) };
        if plant.elastic().is_none() {
            let problem = format!("has nothing to sense: expected a plant with elastic joints, got {}", plant.kind().name());
            return Err(Error::input("torque_sensor", problem));
        }
        if !sensor.bias.is_empty() && sensor.bias.len() != plant.n() {
            return Err(Error::wrong_shape("bias", &[plant.n()], &[sensor.bias.len()]));
        }
        for (name, values) in [("noise", sampling.noise), ("resolution", sampling.resolution)] {
            if values[0] != 0.0 {
                let problem = format!("is not used: expected none for q, which is known through torque_sensor, got {}", values[0]);
                return Err(Error::input(name, problem));
            }
        }
        Ok(())
    }
}
