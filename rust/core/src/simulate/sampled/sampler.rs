//! The clock of a sampled loop. It evaluates the law at sample times, and selects the output that acts on the plant. The rates of the law's
//! state act from the sample on, because the controller updates its state at the sample. Only the output is delayed.

use super::torque_sensing::{Sensed, TorqueSensing};
use crate::scalar::Real;
use crate::simulate::problem::sampling::{CHANNELS, ON_TIME, Sampling};

/// The number of stored samples, in addition to those that delays require. A faulty block of steps is repeated from its start, and needs
/// its old input.
const CAPACITY: usize = 64;

/// One sample: the measurement and the output of the law.
#[derive(Clone, Debug)]
struct StoredSample<S> {
    index: u64,
    measured: Vec<S>,
    sensed: Sensed<S>,
    tau: Vec<S>,
    dz: Vec<S>,
}

#[derive(Clone, Debug)]
pub struct Sampler<S> {
    sampling: Sampling,
    /// The seed of the random numbers of each lane.
    seeds: Vec<u64>,
    /// The step size of a fixed-step method, s. The jitter is rounded down to a multiple of it. It is 0 for an adaptive method.
    grid: f64,
    ring: Vec<StoredSample<S>>,
    delayed: u64,
    sensing: Option<TorqueSensing<S>>,
    /// [`Definition::torque_states`](crate::law::Definition::torque_states), if the acting output can differ from the law's last output.
    torque_states: Option<usize>,
}

impl<S: Real> Sampler<S> {
    pub fn new(
        sampling: Sampling,
        seeds: Vec<u64>,
        grid: f64,
        (states, n, p): (usize, usize, usize),
        sensing: Option<TorqueSensing<S>>,
    ) -> Self {
        let delayed = (sampling.delay / sampling.period).ceil() as u64;
        let capacity = CAPACITY + delayed as usize + sampling.sensor_delay;
        let zeros = |k: usize| vec![S::zero(); k];
        let sensed = Sensed::new(if sensing.is_some() { n } else { 0 });
        let entry = StoredSample { index: u64::MAX, measured: zeros(states), sensed, tau: zeros(n), dz: zeros(p) };
        Sampler { ring: vec![entry; capacity], sampling, seeds, grid, delayed, sensing, torque_states: None }
    }

    /// Add the acting output to the rates of the law's state from `torque_states` on, instead of the output that the law computed.
    pub fn with_torque_states(mut self, torque_states: Option<usize>) -> Self {
        self.torque_states = torque_states.filter(|_| self.sampling.changes_output());
        self
    }

    fn instant(&self, k: u64) -> f64 {
        self.sampling.instant(self.seeds[0], k, self.grid)
    }

    fn slot(&self, k: u64) -> usize {
        (k % self.ring.len() as u64) as usize
    }

    /// Return sample `k`; `None` if it is not stored.
    fn stored(&self, k: u64) -> Option<&StoredSample<S>> {
        Some(&self.ring[self.slot(k)]).filter(|entry| entry.index == k)
    }

    /// Return the sample before sample `k` with its index; `None` if it is not stored.
    fn before(&self, k: u64) -> Option<(u64, &StoredSample<S>)> {
        let before = k.checked_sub(1)?;
        self.stored(before).map(|entry| (before, entry))
    }

    /// At time `t` and plant state `x`, evaluate the law if a sample is due, and select the acting output. `law(measured, tau, dz)`
    /// evaluates the law for a sample. On return, `tau` is the acting output, and `dz` has the rates of the law's state.
    pub fn run(&mut self, t: f64, x: &[S], n: usize, mut law: impl FnMut(&[S], &mut [S], &mut [S]), tau: &mut [S], dz: &mut [S]) {
        // At an instant with both a record and the start of a step, the law is evaluated only once.
        if let Some(k) = self.sampling.due(self.seeds[0], self.grid, t).filter(|&k| self.stored(k).is_none()) {
            let slot = self.slot(k);
            let empty = StoredSample { index: k, measured: Vec::new(), sensed: Sensed::new(0), tau: Vec::new(), dz: Vec::new() };
            let mut entry = std::mem::replace(&mut self.ring[slot], empty);
            entry.index = k;
            self.measure(k, x, n, &mut entry.measured);
            self.sense(k, x, &mut entry);
            let seen = k.saturating_sub(self.sampling.sensor_delay as u64);
            if seen == k {
                law(&entry.measured, &mut entry.tau, &mut entry.dz);
            } else {
                let old = self.slot(seen);
                law(&self.ring[old].measured, &mut entry.tau, &mut entry.dz);
            }
            if let Some(first) = self.torque_states {
                entry.dz[first..].iter_mut().zip(&entry.tau).for_each(|(rate, &tau)| *rate -= tau);
            }
            self.limit_rate(k, &mut entry.tau);
            self.ring[slot] = entry;
        }
        match self.sampling.acting(self.seeds[0], self.grid, t) {
            // No output acts on the plant yet.
            None => tau.fill(S::zero()),
            Some(k) => {
                if let Some(entry) = self.stored(k) {
                    tau.copy_from_slice(&entry.tau);
                }
            }
        }
        match self.sampling.last_sample(self.seeds[0], self.grid, t) {
            None => dz.fill(S::zero()),
            Some(k) => {
                if let Some(entry) = self.stored(k) {
                    dz.copy_from_slice(&entry.dz);
                    if let Some(first) = self.torque_states {
                        dz[first..].iter_mut().zip(&*tau).for_each(|(rate, &tau)| *rate += tau);
                    }
                }
            }
        }
    }

    fn measure(&self, k: u64, x: &[S], n: usize, measured: &mut [S]) {
        for (at, (to, from)) in measured.iter_mut().zip(x).enumerate() {
            let channel = at / n;
            if channel >= CHANNELS.len() || (self.sampling.noise[channel] == 0.0 && self.sampling.resolution[channel] == 0.0) {
                *to = *from;
            } else {
                *to = S::from_lanes(|lane| self.sampling.measure(self.seeds[lane], k, channel, at % n, from.lane(lane)));
            }
        }
    }

    /// Compute the reading of the torque sensors. Their filters continue from the previous sample.
    fn sense(&mut self, k: u64, x: &[S], entry: &mut StoredSample<S>) {
        let Some(mut sensing) = self.sensing.take() else { return };
        let before = self.before(k);
        let before = before.map(|(before, entry)| (&entry.sensed, self.instant(k) - self.instant(before)));
        sensing.sense(&self.seeds, k, x, before, &mut entry.sensed, &mut entry.measured);
        self.sensing = Some(sensing);
    }

    /// Limit the change of the output since the previous sample. The first output changes from zero.
    fn limit_rate(&self, k: u64, tau: &mut [S]) {
        if !self.sampling.rate_limit.is_finite() {
            return;
        }
        let before = self.before(k);
        let since = before.map_or(self.sampling.period, |(before, _)| self.instant(k) - self.instant(before));
        let most = S::splat(self.sampling.rate_limit * since);
        for (i, tau) in tau.iter_mut().enumerate() {
            let last = before.map_or(S::zero(), |(_, entry)| entry.tau[i]);
            *tau = tau.clamped(last - most, last + most);
        }
    }

    /// Discard the sample that is due at time `t`, s, so that it is taken again. With `failed`, discard it only if its output is not finite.
    pub fn discard_at(&mut self, t: f64, failed: bool) {
        let Some(k) = self.sampling.due(self.seeds[0], self.grid, t) else { return };
        let slot = self.slot(k);
        let entry = &mut self.ring[slot];
        let sound = || entry.tau.iter().chain(&entry.dz).all(|x| (0..S::LANES).all(|lane| x.lane(lane).is_finite()));
        if entry.index == k && !(failed && sound()) {
            entry.index = u64::MAX;
        }
    }

    /// Discard all samples, because the run restarts.
    pub fn clear(&mut self) {
        self.ring.iter_mut().for_each(|entry| entry.index = u64::MAX);
    }

    /// Return all sample times and the times at which their outputs act, within the run, s, increasing.
    pub fn instants(&self, t_end: f64) -> Vec<f64> {
        let samples = (t_end / self.sampling.period).ceil() as u64 + 1;
        let mut all: Vec<f64> =
            (0..samples + self.delayed).flat_map(|k| [self.instant(k), self.instant(k) + self.sampling.delay]).collect();
        all.retain(|&t| t > 0.0 && t < t_end);
        all.sort_by(f64::total_cmp);
        all.dedup_by(|a, b| (*a - *b).abs() <= ON_TIME * self.sampling.period);
        all
    }
}
