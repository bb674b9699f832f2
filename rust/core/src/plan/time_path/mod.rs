//! The fastest timing of a path under limits of torque, acceleration and speed (`docs/time_path.md`).
//!
//! 1. The dynamics along the path on a grid: `tau = A u + B x + g` (`rows`).
//! 2. Reachability analysis on that grid (`reach`).
//! 3. A check ten times finer. Limits are narrowed, segment by segment, by what they are exceeded by between grid points, and 2
//!    is done again, until nothing exceeds a limit anywhere (`check`). Where the grid is too coarse for that it is halved.
//! 4. Where there is no timing: the joint, the place, the limit, and by how much it falls short (`reason`).

mod check;
mod lines;
mod reach;
mod reason;
mod rows;
mod setup;
mod stencil;

pub use check::FINE;
pub use reason::{Bound, PathReason, Shortfall};
pub use rows::{Friction, Mover};
pub use setup::{PathLimits, TimePathOptions};

use crate::error::Result;
use crate::motion::{Path, TimedPath};
use check::{Found, Samples, TOLERANCE};
use reach::{Profile, Stuck, bend, solve};
use setup::Problem;
use std::sync::Arc;

/// Corrections of one grid before it is halved.
const CORRECTIONS: usize = 8;
/// Grids tried.
const GRIDS: usize = 5;
/// Change of the duration, relative, at which a grid that was not asked for is fine enough.
const SETTLED: f64 = 1e-4;
/// Points of the first such grid.
pub(crate) const FIRST_GRID: usize = 201;
/// Excess between grid points, relative to the limit, above which a grid is halved for the sake of the duration.
const COARSE: f64 = 1e-3;
/// How far a limit is narrowed at first, in parts of what it was exceeded by; twice that every time after.
const BEYOND: f64 = 1.2;
/// Passes that give the path acceleration the slope of its limits.
const BENDS: usize = 1;

/// A timing, or why there is none.
#[derive(Clone, Debug, PartialEq)]
pub struct TimePath {
    /// Without a timing its duration is NaN.
    pub motion: TimedPath,
    /// Smallest relative distance to a limit, on ten points per grid segment; NaN without a timing.
    pub margin: f64,
    pub reason: Option<PathReason>,
}

/// What one grid gave.
enum Outcome {
    Done(Found),
    /// The grid is too coarse.
    Coarse(Found),
    Stuck(Stuck),
}

fn plan(problem: &mut Problem, samples: &mut Samples, profile: &mut Profile, last: bool) -> Outcome {
    problem.rows.tight_lo.fill(0.0);
    problem.rows.tight_hi.fill(0.0);
    problem.cap_tight.fill(0.0);
    problem.rows.bend.fill(0.0);
    profile.forget();
    samples.begin(&problem.course());
    problem.set_caps();
    problem.forget_friction();
    if let Err(stuck) = solve(&problem.rows, profile) {
        return Outcome::Stuck(stuck);
    }
    for _ in 0..BENDS {
        bend(&mut problem.rows, profile);
        if solve(&problem.rows, profile).is_err() {
            problem.rows.bend.fill(0.0);
            profile.forget();
            if let Err(stuck) = solve(&problem.rows, profile) {
                return Outcome::Stuck(stuck);
            }
            break;
        }
    }
    let mut found = None;
    let mut cap_old = problem.cap_tight.clone();
    let mut narrowed = Vec::new();
    for k in 0..CORRECTIONS {
        if problem.friction.is_some() {
            problem.linearise_friction(&profile.x);
            profile.forget();
            if k == 0 && solve(&problem.rows, profile).is_err() {
                problem.linearise_friction(&profile.x);
            }
        }
        let beyond = BEYOND * (1 << k) as f64;
        let (mut tight_lo, mut tight_hi) = (std::mem::take(&mut problem.rows.tight_lo), std::mem::take(&mut problem.rows.tight_hi));
        let width = problem.rows.width;
        let mut caps = std::mem::take(&mut problem.cap_tight);
        narrowed.clear();
        let now = samples.examine(&problem.course(), &problem.rows, profile, |i, row, under, over| {
            if row < width {
                tight_lo[i * width + row] += beyond * under;
                tight_hi[i * width + row] += beyond * over;
                narrowed.push(i);
            } else {
                // The cap is on the square: twice the relative excess of the speed.
                let past = 2.0 * beyond * under.max(over) / problem.limits.hi[row];
                // Of two bounds far apart the larger one is to blame: where the path turns back it has no bound of its own. But
                // a speed that peaks beside the smaller one goes down with the square of what the larger one does.
                let (x0, x1) = (problem.rows.cap[i], problem.rows.cap[i + 1]);
                for (at, here, other) in [(i, x0, x1), (i + 1, x1, x0)] {
                    if here * 1.2 >= other || k >= 2 {
                        caps[at] = caps[at].max(cap_old[at] + past);
                    }
                }
            }
        });
        (problem.rows.tight_lo, problem.rows.tight_hi) = (tight_lo, tight_hi);
        cap_old.copy_from_slice(&caps);
        problem.cap_tight = caps;
        found = Some(now);
        if !(now.excess > TOLERANCE) && !now.excess.is_nan() {
            if samples.stands(&problem.course(), &problem.rows, profile) {
                return Outcome::Done(now);
            }
            continue;
        }
        if !last && k == 0 && now.excess > COARSE {
            return Outcome::Coarse(now);
        }
        narrowed.iter().for_each(|&i| profile.touch(i));
        problem.set_caps();
        if let Err(stuck) = solve(&problem.rows, profile) {
            return match found {
                Some(found) if !last => Outcome::Coarse(found),
                _ => Outcome::Stuck(stuck),
            };
        }
    }
    match found {
        Some(found) => Outcome::Coarse(found),
        None => Outcome::Stuck(Stuck::Empty(0)),
    }
}

/// The fastest timing of `path` for `mover` under `limits`.
pub fn time_path(mover: Mover, path: Arc<Path>, limits: &PathLimits, options: &TimePathOptions) -> Result<TimePath> {
    let mut problem = Problem::new(mover, path, limits, options)?;
    if problem.path.is_point() {
        return problem.hold();
    }
    let (mut samples, mut profile) = (Samples::default(), Profile::default());
    let grids = if options.refine || options.grid.is_none() { GRIDS } else { 1 };
    let mut best: Option<TimePath> = None;
    for grid in 0..grids {
        let last = grid + 1 == grids;
        let outcome = plan(&mut problem, &mut samples, &mut profile, last && best.is_none());
        let reason = match outcome {
            Outcome::Done(found) => {
                let rows = &problem.rows;
                let motion = TimedPath::new(problem.path.clone(), rows.s.clone(), profile.x.clone(), rows.bend.clone())?;
                if motion.duration().is_finite() {
                    let settled = match &best {
                        None => options.grid.is_some(),
                        Some(before) => (before.motion.duration() - motion.duration()).abs() <= SETTLED * motion.duration(),
                    };
                    let better = best.as_ref().is_none_or(|before| motion.duration() < before.motion.duration());
                    if better {
                        best = Some(TimePath { motion, margin: found.margin, reason: None });
                    }
                    if settled {
                        break;
                    }
                }
                PathReason::standstill(&problem, &profile)
            }
            Outcome::Coarse(found) => PathReason::unresolved(&problem, &found),
            Outcome::Stuck(stuck) => PathReason::find(&problem, &profile, stuck),
        };
        if last && best.is_none() {
            return problem.refuse(reason);
        }
        if !last {
            problem.halve();
        }
    }
    match best {
        Some(best) => Ok(best),
        None => problem.refuse(PathReason::standstill(&problem, &profile)),
    }
}
