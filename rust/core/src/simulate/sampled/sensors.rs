//! The measurements of the sampled controller of one run: encoders with noise and resolution, torque sensors, and a delay in samples.

use super::torque_sensing::{Sensed, TorqueSensing};
use crate::simulate::problem::sampling::{CHANNELS, Sampling};

/// The number of stored samples, in addition to those that delays require. A faulty block of steps is repeated from its start, and needs
/// its old samples.
pub const CAPACITY: usize = 64;

/// The measurement of one sample.
#[derive(Clone, Debug)]
struct Reading {
    index: u64,
    measured: Vec<f64>,
    sensed: Sensed,
}

/// The sensors of one run.
#[derive(Clone, Debug)]
pub struct Sensors {
    sampling: Sampling,
    /// The seed of the random numbers of the run.
    seed: u64,
    /// The step size of a fixed-step method, s. The jitter is rounded down to a multiple of it. It is 0 for an adaptive method.
    grid: f64,
    /// The number of joints.
    n: usize,
    torque: Option<TorqueSensing>,
    readings: Vec<Reading>,
}

impl Sensors {
    /// Create the sensors of a plant with `n` joints, of which `states` states are measured.
    pub fn new((sampling, seed, grid): (&Sampling, u64, f64), [states, n]: [usize; 2], torque: Option<TorqueSensing>) -> Self {
        let sensed = Sensed::new(if torque.is_some() { n } else { 0 });
        let reading = Reading { index: u64::MAX, measured: vec![0.0; states], sensed };
        Sensors { readings: vec![reading; CAPACITY + sampling.sensor_delay], sampling: sampling.clone(), seed, grid, n, torque }
    }

    /// Return the time of sample `k`, s.
    pub fn instant(&self, k: u64) -> f64 {
        self.sampling.instant(self.seed, k, self.grid)
    }

    /// Return the last sample at or before time `t`, s. The result is `None` before the first sample.
    pub fn last_sample(&self, t: f64) -> Option<u64> {
        self.sampling.last_sample(self.seed, self.grid, t)
    }

    /// Return the sample whose output acts at time `t`, s.
    pub fn acting(&self, t: f64) -> Option<u64> {
        self.last_sample(t - self.sampling.delay)
    }

    /// Return the sample that is due at time `t`, s, if any.
    pub fn due(&self, t: f64) -> Option<u64> {
        self.sampling.due(self.seed, self.grid, t)
    }

    /// Return the largest change of the output from sample `k - 1` to sample `k`, with the limited rate. The first output changes from zero.
    pub fn largest_change(&self, k: u64) -> f64 {
        self.sampling.rate_limit * if k == 0 { self.sampling.period } else { self.instant(k) - self.instant(k - 1) }
    }

    /// Measure the state `x` of the plant at sample `k`. Return the measurement that the law receives at this sample.
    pub fn measure(&mut self, k: u64, x: &[f64]) -> &[f64] {
        let stored = self.readings.len() as u64;
        let at = |k: u64| (k % stored) as usize;
        let (now, seen) = (at(k), at(k.saturating_sub(self.sampling.sensor_delay as u64)));
        let mut reading = std::mem::replace(&mut self.readings[now], Reading { index: k, measured: Vec::new(), sensed: Sensed::new(0) });
        reading.index = k;
        for (i, (to, &from)) in reading.measured.iter_mut().zip(x).enumerate() {
            let channel = i / self.n;
            *to = if channel < CHANNELS.len() { self.sampling.measure(self.seed, k, channel, i % self.n, from) } else { from };
        }
        if let Some(torque) = &mut self.torque {
            let before =
                k.checked_sub(1).map(|before| (before, &self.readings[at(before)])).filter(|(before, reading)| reading.index == *before);
            let since = |before| self.sampling.instant(self.seed, k, self.grid) - self.sampling.instant(self.seed, before, self.grid);
            let before = before.map(|(before, reading)| (&reading.sensed, since(before)));
            torque.sense(self.seed, k, x, before, &mut reading.sensed, &mut reading.measured);
        }
        self.readings[now] = reading;
        &self.readings[seen].measured
    }

    /// Forget all samples, because the run restarts.
    pub fn clear(&mut self) {
        self.readings.iter_mut().for_each(|reading| reading.index = u64::MAX);
    }
}
