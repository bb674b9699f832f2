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

use super::check::TOLERANCE;
use super::reach::Profile;
use super::samples::Samples;
use super::setup::PathProblem;
use super::timing::TimePath;
use crate::error::Result;
use crate::motion::TimedPath;

/// The smallest factor `c` by which the squared path speed is multiplied.
const SLOWEST: f64 = 1e-12;
/// The relative accuracy of the factor `c` that multiplies the squared path speed.
const SHARE: f64 = 1e-6;

/// Slow down the profile that exceeded its limits least, and return this timing or `best`, whichever is faster. Without friction, or with a
/// start or end speed above zero, return `best`. Also return `best` if the profile exceeds a limit even with `SLOWEST`.
pub(super) fn slowed(
    problem: &mut PathProblem,
    samples: &mut Samples,
    profile: &mut Profile,
    mut best: Option<TimePath>,
) -> Result<Option<TimePath>> {
    let rows = &problem.rows;
    if problem.friction.is_none() || rows.x_start > 0.0 || rows.x_end > 0.0 || profile.kept.len() != rows.s.len() {
        return Ok(best);
    }
    let (kept, u_slope) = (profile.kept.clone(), rows.u_slope.clone());
    // First try the slopes of `u` of the faster profile, then zero slopes. With the slopes of the faster profile, `x`
    // may reach zero between two points. Then the duration is not finite, and only the motion with zero slopes counts.
    for u_slope in [u_slope, vec![0.0; kept.len() - 1]] {
        let Some(found) = slowed_with(problem, samples, profile, (&kept, &u_slope))? else { continue };
        let duration = found.motion.duration();
        if duration.is_finite() && best.as_ref().is_none_or(|best| duration < best.motion.duration()) {
            best = Some(found);
        }
    }
    Ok(best)
}

fn slowed_with(
    problem: &mut PathProblem,
    samples: &mut Samples,
    profile: &mut Profile,
    (kept, u_slope): (&[f64], &[f64]),
) -> Result<Option<TimePath>> {
    let mut margin = f64::NAN;
    let mut fits = |problem: &mut PathProblem, c: f64| {
        problem.rows.u_slope.iter_mut().zip(u_slope).for_each(|(to, from)| *to = c * from);
        profile.x.iter_mut().zip(kept).for_each(|(to, from)| *to = c * from);
        profile.moved.fill(true);
        let found = samples.examine(&problem.course(), &problem.rows, profile, |_, _, _, _| ());
        margin = found.margin;
        found.excess <= TOLERANCE
    };
    if !fits(problem, SLOWEST) {
        return Ok(None);
    }
    let (mut high, mut low) = (1.0, 1.0);
    while !fits(problem, low) {
        (high, low) = (low, (0.5 * low).max(SLOWEST));
    }
    while high > low * (1.0 + SHARE) {
        let middle = (low * high).sqrt();
        if fits(problem, middle) { low = middle } else { high = middle }
    }
    fits(problem, low);
    let motion = TimedPath::new(problem.path.clone(), problem.rows.s.clone(), profile.x.clone(), problem.rows.u_slope.clone())?;
    Ok(Some(TimePath { motion, margin, reason: None }))
}
