//! Settings of a sampled controller: sample times, measurements, and the times at which outputs act.
//!
//! Sample `k` is taken at `t_k = k T + j_k`, where the jitter `j_k` is uniform in [0, jitter). The law receives the measurement that is
//! `sensor_delay` samples old. The measurement contains noise and is rounded to the resolution of the encoders. The law's output acts from
//! `t_k + delay` on, with a limited rate of change. Every random number is a function of seed, sample and channel (splitmix64; Steele, Lea
//! and Flood 2014). So a repeated run, and a run that continues from an intermediate state, have the same random numbers.

use super::times::require_memory;
use crate::error::{Error, Result, positive};
use crate::plant::sensors::TorqueSensor;

/// The largest number of stored samples for delayed outputs and measurements. More samples indicate an error in the arguments.
const MOST_LATE: f64 = 1e5;
/// More samples than this limit in one run also indicate an error.
const MOST_SAMPLES: f64 = 1e12;

/// A time `t` counts as an instant of the controller if `|t - instant| / period` is below this limit, dimensionless.
pub(in crate::simulate) const ON_TIME: f64 = 1e-9;

/// The measured quantities of a plant, in the order of its state.
pub const CHANNELS: [&str; 4] = ["q", "v", "theta", "theta_dot"];

/// The settings of a sampled law.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// # use nalgebra::dvector;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 50.0)?, Gain::scalar("kd", 1, 20.0)?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Options, Problem, Sampling};
///
/// // The law is evaluated every 10 ms. Its output acts 20 ms later.
/// let sampling = Sampling { delay: 0.02, ..Sampling::every(0.01) };
/// let options = Options { sampling: Some(sampling), ..Options::fixed(0.1, 0.01) };
/// let run = Problem::from_rest(&plant, &law, &dvector![1.0], options)?.run()?;
/// assert_eq!((run.tau[0], run.tau[1], run.tau[2]), (0.0, 0.0, -50.0));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Sampling {
    /// The sample period `T`, s.
    pub period: f64,
    /// The time from a sample until the law's output acts, s.
    pub delay: f64,
    /// The largest delay of a sample after its nominal time, s.
    pub jitter: f64,
    /// The age of a measurement when the law receives it, in samples.
    pub sensor_delay: usize,
    /// Standard deviations of the noise of the four channels, in the units of the channels.
    pub noise: [f64; 4],
    /// Resolutions of the four channels, in the units of the channels. Zero means no rounding.
    pub resolution: [f64; 4],
    /// The largest change of the input per second, in the unit of [`Run::tau`](crate::simulate::Run::tau) per s. Infinity means no limit.
    pub rate_limit: f64,
    /// The joint torque sensors of a plant with elastic joints. The law then computes link positions from sensors and motor encoders.
    pub torque_sensor: Option<TorqueSensor>,
    /// The seed of all random numbers.
    pub seed: u64,
}

impl Sampling {
    /// Return a controller that only holds the law's output, with the sample period `period`, s.
    pub fn every(period: f64) -> Self {
        Sampling {
            period,
            delay: 0.0,
            jitter: 0.0,
            sensor_delay: 0,
            noise: [0.0; 4],
            resolution: [0.0; 4],
            rate_limit: f64::INFINITY,
            torque_sensor: None,
            seed: 0,
        }
    }

    /// Refuse numbers that are out of range. Errors: [`Error::Input`].
    pub fn validate(&self) -> Result<()> {
        positive("sample_time", self.period)?;
        let nonnegative = |name: &str, x: f64| {
            if x >= 0.0 && x.is_finite() {
                return Ok(());
            }
            Err(Error::input(name, format!("is negative or not finite: expected a number >= 0, got {x}")))
        };
        nonnegative("delay", self.delay)?;
        nonnegative("jitter", self.jitter)?;
        if self.jitter >= self.period {
            return Err(Error::input("jitter", format!("is not below the period: expected < {}, got {}", self.period, self.jitter)));
        }
        for (name, late) in [("delay", self.delay / self.period), ("sensor_delay", self.sensor_delay as f64)] {
            if late > MOST_LATE {
                return Err(Error::input(name, format!("is too long: expected at most {MOST_LATE} periods, got {late}")));
            }
        }
        for (name, values) in [("noise", self.noise), ("resolution", self.resolution)] {
            for (channel, x) in CHANNELS.iter().zip(values) {
                nonnegative(&format!("{name}[{channel:?}]"), x)?;
            }
        }
        if !(self.rate_limit > 0.0) {
            return Err(Error::input("rate_limit", format!("is not positive: expected > 0, got {}", self.rate_limit)));
        }
        Ok(())
    }

    /// Refuse a run of length `t_end`, s, whose samples exceed the memory. Errors: [`Error::Input`] for more than 1e12 samples,
    /// [`Error::Memory`] if the samples exceed the memory.
    pub fn require_memory(&self, t_end: f64) -> Result<()> {
        if t_end / self.period > MOST_SAMPLES {
            let least = t_end / MOST_SAMPLES;
            return Err(Error::input("sample_time", format!("is too small for the run: expected at least {least}, got {}", self.period)));
        }
        // With an adaptive method, a controller that does more than hold the law's output stores all its instants in advance.
        if self.is_plain() { Ok(()) } else { require_memory((t_end / self.period) as u128) }
    }

    /// Whether the controller only holds the law's output.
    pub fn is_plain(&self) -> bool {
        *self == Sampling { seed: self.seed, ..Sampling::every(self.period) }
    }

    /// The parts of the controller that are recorded with its loop.
    pub(in crate::simulate) fn parts(&self) -> Parts {
        let encoders = self.noise.iter().chain(&self.resolution).any(|&x| x > 0.0);
        let measures = encoders || self.sensor_delay > 0 || self.torque_sensor.is_some();
        Parts { measures, delays: self.delay > 0.0, limits_rate: self.rate_limit.is_finite() }
    }

    /// The number of samples that are taken before an output acts.
    pub(in crate::simulate) fn delayed(&self) -> u64 {
        (self.delay / self.period).ceil() as u64
    }

    /// Return the jitter of sample `k` as a part of the largest jitter.
    pub(in crate::simulate) fn lateness(seed: u64, k: u64) -> f64 {
        uniform(seed, k, JITTER)
    }

    /// Whether the input of the plant can differ from the law's last output.
    pub(in crate::simulate) fn changes_output(&self) -> bool {
        self.delay > 0.0 || self.rate_limit.is_finite()
    }

    /// Return the time of sample `k`, s. If `grid > 0`, the jitter is rounded down to a multiple of `grid`, s.
    pub fn instant(&self, seed: u64, k: u64, grid: f64) -> f64 {
        let late = if self.jitter > 0.0 { self.jitter * Self::lateness(seed, k) } else { 0.0 };
        let late = if grid > 0.0 { (late / grid).floor() * grid } else { late };
        k as f64 * self.period + late
    }

    /// Return the last sample at or before time `t`. The result is `None` before the first sample.
    pub(in crate::simulate) fn last_sample(&self, seed: u64, grid: f64, t: f64) -> Option<u64> {
        let slack = ON_TIME * self.period;
        let k = ((t + slack) / self.period).floor().max(0.0) as u64;
        if self.instant(seed, k, grid) <= t + slack { Some(k) } else { k.checked_sub(1) }
    }

    /// Return the sample whose output acts at time `t`.
    pub(in crate::simulate) fn acting(&self, seed: u64, grid: f64, t: f64) -> Option<u64> {
        self.last_sample(seed, grid, t - self.delay)
    }

    /// Return the sample that is due at time `t`, if any.
    pub(in crate::simulate) fn due(&self, seed: u64, grid: f64, t: f64) -> Option<u64> {
        let k = self.last_sample(seed, grid, t)?;
        ((self.instant(seed, k, grid) - t).abs() <= ON_TIME * self.period).then_some(k)
    }

    /// Return the measurement of element `i` of channel `channel` at sample `k`. `x` is the exact value. Both have the unit of the channel.
    pub fn measure(&self, seed: u64, k: u64, channel: usize, i: usize, x: f64) -> f64 {
        let noise = self.noise[channel];
        let x = if noise > 0.0 { x + noise * gaussian(seed, k, (4 * i + channel) as u64) } else { x };
        let step = self.resolution[channel];
        if step > 0.0 { (x / step).round() * step } else { x }
    }
}

/// The parts of a sampled controller that are recorded with its loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Parts {
    /// Whether the law receives a measurement that differs from the state.
    pub measures: bool,
    /// Whether outputs act later than they are computed.
    pub delays: bool,
    /// Whether the rate of the output is limited.
    pub limits_rate: bool,
}

/// The random channel of the jitter. No measurement uses it.
const JITTER: u64 = u64::MAX;

/// Return a pseudo-random 64-bit number that depends on `seed`, `k` and `channel`.
fn mixed(seed: u64, k: u64, channel: u64) -> u64 {
    let mut z = seed;
    for word in [k, channel] {
        z = z.wrapping_add(0x9e37_79b9_7f4a_7c15).wrapping_add(word.wrapping_mul(0xd134_2543_de82_ef95));
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
    }
    z
}

/// Return a random number that is uniform in [0, 1).
fn uniform(seed: u64, k: u64, channel: u64) -> f64 {
    (mixed(seed, k, channel) >> 11) as f64 / (1u64 << 53) as f64
}

/// Return a random number with the standard normal distribution (Box and Muller 1958).
pub(in crate::simulate) fn gaussian(seed: u64, k: u64, channel: u64) -> f64 {
    let (a, b) = (uniform(seed, k, 2 * channel), uniform(seed, k, 2 * channel + 1));
    (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
}
