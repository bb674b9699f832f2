//! A timing that exceeds its limits because of friction, slowed down until it satisfies them.
//!
//! Under friction, the limits are reduced repeatedly, and sometimes no feasible path speed remains. A slower motion multiplies the squared
//! speed `x` and the path acceleration `u` by `c < 1`. Its torques are nearer to the torques that hold the arm at rest:
//!
//! ```text
//! tau(s) = g + d q' sqrt(c x) + c (M q'' + C q') x + c M q' u
//! ```
//!
//! `q' = dq/ds`, `d` is the viscous friction coefficient, and `g` the static torque with Coulomb friction. `M` is the mass matrix, and `C`
//! the matrix of Coriolis and centrifugal torques. Bisection finds a `c` that satisfies all limits. The result is not the fastest timing.

use super::search::Search;
use super::timing::TimePath;
use super::tuning::{SLOWEST_SHARE, SLOWING_ACCURACY, TOLERANCE};
use crate::error::Result;

impl Search<'_> {
    /// Slow down the profile that exceeded its limits least, and store the timing in `slowed` if it is faster than the timing there. Only
    /// with friction and from rest to rest is a slower motion nearer to the limits.
    pub fn slow_down(&mut self) -> Result<()> {
        let rows = &self.problem.rows;
        if self.problem.friction.is_none() || rows.x_start > 0.0 || rows.x_end > 0.0 || self.profile.least_exceeding.len() != rows.s.len() {
            return Ok(());
        }
        let (x, u_slope) = (self.profile.least_exceeding.clone(), rows.u_slope.clone());
        // First try the slopes of `u` of the faster profile, then zero slopes. With the slopes of the faster profile, `x`
        // may reach zero between two points. Then the duration is not finite, and only the motion with zero slopes counts.
        for u_slope in [u_slope, vec![0.0; x.len() - 1]] {
            let Some(timing) = self.slowed_down(&x, &u_slope)? else { continue };
            let duration = timing.motion.duration();
            if duration.is_finite() && self.slowed.as_ref().is_none_or(|slowed| duration < slowed.motion.duration()) {
                self.slowed = Some(timing);
            }
        }
        Ok(())
    }

    /// The timing with `c x` and `c u_slope` for the largest `c <= 1` that bisection finds; `None` if even `SLOWEST_SHARE` exceeds a limit.
    fn slowed_down(&mut self, x: &[f64], u_slope: &[f64]) -> Result<Option<TimePath>> {
        let mut margin = f64::NAN;
        let mut fits = |search: &mut Self, c: f64| {
            search.problem.rows.u_slope.iter_mut().zip(u_slope).for_each(|(to, from)| *to = c * from);
            search.profile.x.iter_mut().zip(x).for_each(|(to, from)| *to = c * from);
            search.profile.x_changed.fill(true);
            let check = search.samples.examine(&search.problem, &mut search.profile);
            margin = check.margin;
            check.excess <= TOLERANCE
        };
        if !fits(self, SLOWEST_SHARE) {
            return Ok(None);
        }
        let (mut high, mut low) = (1.0, 1.0);
        while !fits(self, low) {
            (high, low) = (low, (0.5 * low).max(SLOWEST_SHARE));
        }
        while high > low * (1.0 + SLOWING_ACCURACY) {
            let middle = (low * high).sqrt();
            if fits(self, middle) { low = middle } else { high = middle }
        }
        fits(self, low);
        Ok(Some(TimePath { motion: self.motion()?, margin, reason: None }))
    }
}
