//! The clock of a sampled controller in steps of equal size.

use crate::simulate::problem::sampling::Sampling;

/// The steps at which samples are taken, and at which outputs of the law begin to act.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// The number of steps between two nominal samples.
    period: usize,
    /// The number of steps from a sample until its output acts.
    delay: usize,
    /// The largest delay of a sample after its nominal step and the step size, s, and the seed of the random numbers.
    jitter: [f64; 2],
    seed: u64,
}

impl Clock {
    /// Return the clock of a controller whose period and delay are multiples of the step size `dt`, s.
    pub fn new(sampling: &Sampling, dt: f64, seed: u64) -> Self {
        let steps = |duration: f64| (duration / dt).round() as usize;
        Clock { period: steps(sampling.period).max(1), delay: steps(sampling.delay), jitter: [sampling.jitter, dt], seed }
    }

    /// The number of steps between two nominal samples.
    pub fn period(&self) -> usize {
        self.period
    }

    /// The number of steps from a sample until its output acts.
    pub fn delay(&self) -> usize {
        self.delay
    }

    /// The step that begins with sample `k`.
    fn step(&self, k: usize) -> usize {
        let [jitter, dt] = self.jitter;
        k * self.period + if jitter > 0.0 { (jitter * Sampling::lateness(self.seed, k as u64) / dt) as usize } else { 0 }
    }

    /// Return the last sample up to the start of step `step`. The result is `None` before the first sample.
    pub fn last(&self, step: usize) -> Option<usize> {
        let k = step / self.period;
        if self.step(k) <= step { Some(k) } else { k.checked_sub(1) }
    }

    /// Return the sample at the start of step `step`, if there is one.
    pub fn due(&self, step: usize) -> Option<usize> {
        self.last(step).filter(|&k| self.step(k) == step)
    }

    /// Return the sample whose output acts in step `step`.
    pub fn acting(&self, step: usize) -> Option<usize> {
        step.checked_sub(self.delay).and_then(|step| self.last(step))
    }

    /// Return the first step after `step` that begins with a sample, or in which another output acts.
    pub fn next(&self, step: usize) -> usize {
        let after = |sample: Option<usize>| self.step(sample.map_or(0, |k| k + 1));
        let sample = after(self.last(step));
        if self.delay == 0 { sample } else { sample.min(self.delay + after(self.acting(step))) }
    }

    /// Whether every step begins with a sample whose output acts at once.
    pub fn is_every_step(&self) -> bool {
        self.period == 1 && self.delay == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The events of the clock are those of the sampling at the times of the steps.
    #[test]
    fn steps_are_instants() {
        let dt = 1e-3;
        for (period, delay, jitter) in [(1, 0, 0.0), (4, 0, 0.0), (4, 3, 0.0), (4, 9, 0.0), (4, 0, 3.5), (4, 5, 3.0)] {
            let sampling = Sampling { delay: delay as f64 * dt, jitter: jitter * dt, ..Sampling::every(period as f64 * dt) };
            let clock = Clock::new(&sampling, dt, 3);
            let events = |step: usize| {
                let t = step as f64 * dt;
                let all = [sampling.last_sample(3, dt, t), sampling.acting(3, dt, t), sampling.due(3, dt, t)];
                all.map(|sample| sample.map(|k| k as usize))
            };
            for step in 0..100 {
                let [last, acting, due] = events(step);
                assert_eq!((clock.last(step), clock.acting(step), clock.due(step)), (last, acting, due), "{clock:?}, step {step}");
                let changes = |next: &usize| events(*next)[2].is_some() || events(*next)[1] != acting;
                assert_eq!((step + 1..).find(changes), Some(clock.next(step)), "{clock:?}, step {step}");
            }
        }
    }
}
