//! The clock of a sampled loop whose law is evaluated outside of the programs of its steps. It evaluates the law at sample times, and
//! selects the output that acts on the plant. The rates of the law's state act from the sample on, because the controller updates its
//! state at the sample. Only the output is delayed.

use super::outputs::Outputs;
use super::sensors::Sensors;
use crate::scalar::Real;
use crate::simulate::problem::sampling::{ON_TIME, Sampling};

#[derive(Clone, Debug)]
pub struct Sampler {
    sampling: Sampling,
    sensors: Sensors,
    outputs: Outputs,
    /// The number of samples that are taken before an output acts.
    delayed: u64,
    /// [`Definition::torque_states`](crate::law::Definition::torque_states), if the acting output can differ from the law's last output.
    torque_states: Option<usize>,
    /// The output that acts, and the rates of the law's state.
    pub tau: Vec<f64>,
    pub dz: Vec<f64>,
    /// Memory for the state that the controller measures, and for the results of the law.
    measured: Vec<f64>,
    results: [Vec<f64>; 2],
}

impl Sampler {
    /// Create the clock of a law with `n` outputs and `p` other results in a loop with `size` states. `torque_states`: the first of these
    /// results to which the acting output is added, instead of the output that the law computed.
    pub fn new(sampling: &Sampling, sensors: Sensors, [n, p, size]: [usize; 3], torque_states: Option<usize>) -> Self {
        let zeros = |count| vec![0.0; count];
        Sampler {
            sensors,
            outputs: Outputs::new(sampling, [n, p]),
            delayed: sampling.delayed(),
            torque_states: torque_states.filter(|_| sampling.changes_output()),
            tau: zeros(n),
            dz: zeros(p),
            measured: zeros(size),
            results: [zeros(n), zeros(p)],
            sampling: sampling.clone(),
        }
    }

    /// At time `t` and state `x = [plant, law, ..]`, evaluate the law if a sample is due, and select the acting output. `law(measured, tau,
    /// dz)` evaluates the law for a sample.
    pub fn run(&mut self, t: f64, x: &[f64], mut law: impl FnMut(&[f64], &mut [f64], &mut [f64])) {
        // At an instant with both a record and the start of a step, the law is evaluated only once.
        if let Some(k) = self.sensors.due(t).filter(|&k| self.outputs.get(k).is_none()) {
            self.measured.copy_from_slice(x);
            let seen = self.sensors.measure(k, x);
            self.measured[..seen.len()].copy_from_slice(seen);
            let [tau, dz] = &mut self.results;
            law(&self.measured, tau, dz);
            if let Some(first) = self.torque_states {
                dz[first..].iter_mut().zip(&*tau).for_each(|(rate, &tau)| *rate -= tau);
            }
            self.limit_rate(k);
            self.outputs.store(k).into_iter().zip(&self.results).for_each(|(to, from)| to.copy_from_slice(from));
        }
        match self.sensors.acting(t).map(|k| self.outputs.get(k)) {
            // No output acts on the plant yet.
            None => self.tau.fill(0.0),
            Some(Some([tau, _])) => self.tau.copy_from_slice(tau),
            Some(None) => (),
        }
        match self.sensors.last_sample(t).map(|k| self.outputs.get(k)) {
            None => self.dz.fill(0.0),
            Some(Some([_, dz])) => {
                self.dz.copy_from_slice(dz);
                if let Some(first) = self.torque_states {
                    self.dz[first..].iter_mut().zip(&self.tau).for_each(|(rate, &tau)| *rate += tau);
                }
            }
            Some(None) => (),
        }
    }

    /// Limit the change of the output of sample `k` since the previous sample. The first output changes from zero.
    fn limit_rate(&mut self, k: u64) {
        if !self.sampling.rate_limit.is_finite() {
            return;
        }
        let before = k.checked_sub(1).and_then(|before| self.outputs.get(before)).map(|[tau, _]| tau);
        let most = if before.is_some() { self.sensors.largest_change(k) } else { self.sensors.largest_change(0) };
        for (i, tau) in self.results[0].iter_mut().enumerate() {
            let last = before.map_or(0.0, |before| before[i]);
            *tau = Real::clamped(*tau, last - most, last + most);
        }
    }

    /// Discard the sample that is due at time `t`, s, so that it is taken again. With `failed`, discard it only if a result is not finite.
    pub fn discard_at(&mut self, t: f64, failed: bool) {
        if let Some(k) = self.sensors.due(t) {
            self.outputs.discard(k, failed);
        }
    }

    /// Discard all samples, because the run restarts.
    pub fn clear(&mut self) {
        self.sensors.clear();
        self.outputs.clear();
    }

    /// Return all sample times and the times at which their outputs act, within the run, s, increasing.
    pub fn instants(&self, t_end: f64) -> Vec<f64> {
        let samples = (t_end / self.sampling.period).ceil() as u64 + 1;
        let instant = |k| self.sensors.instant(k);
        let mut all: Vec<f64> = (0..samples + self.delayed).flat_map(|k| [instant(k), instant(k) + self.sampling.delay]).collect();
        all.retain(|&t| t > 0.0 && t < t_end);
        all.sort_by(f64::total_cmp);
        all.dedup_by(|a, b| (*a - *b).abs() <= ON_TIME * self.sampling.period);
        all
    }
}
