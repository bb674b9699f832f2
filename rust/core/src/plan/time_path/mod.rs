//! The fastest timing of a path under limits of torque, acceleration and speed (`docs/time_path.md`).
//!
//! The path is `q(s)`, with `q' = dq/ds`. A timing is `s(t)`, with the path speed `r = ds/dt`, its square `x = r^2`, and the path
//! acceleration `u = d^2 s/dt^2`.
//!
//! Terms of this folder:
//! - A *piece* is one polynomial of the path, between two knots.
//! - A *segment* is the interval between two neighbouring grid points.
//! - A *row* is one limited quantity, for example the torque of one joint. In `reach`, it is a linear function of `u` and `x`.
//! - A *profile* is `x` at all grid points.
//! - A *cap* is an upper bound of `x` at a grid point.
//!
//! Steps:
//! 1. Compute `A, B, g` of the torques `tau = A u + B x + g` on a grid (`rows`).
//! 2. Compute the fastest profile on this grid by reachability analysis (`reach`).
//! 3. Check the limits at samples, ten steps per segment (`check`). Reduce each exceeded limit in its segment by a multiple of the excess.
//!    Repeat step 2 until no limit is exceeded. If this does not succeed, halve segments.
//! 4. With friction, step 3 may end without a feasible speed. Then slow down the profile that exceeded its limits least (`slow`).
//! 5. With limits of the torque rate, average the timing over time and slow it down (`rate`).
//! 6. Further limits are part of these steps: speed and acceleration of a frame's origin (`tip`), and limits that vary along the path
//!    (`along`). Position limits are checked separately (`positions`).
//! 7. Without a feasible timing, report the joint or the frame, the path position, the limit, and the missing amount (`reason`,
//!    `infeasibility`).

mod along;
mod caps;
mod check;
mod examine;
mod friction;
mod given;
mod grid;
mod infeasibility;
mod lines;
mod magnitudes;
mod mover;
mod positions;
mod rate;
mod reach;
mod reason;
mod refine;
mod rows;
mod samples;
mod setup;
mod slow;
mod stencil;
mod timing;
mod tip;

pub use check::FINE;
pub use given::{PathLimits, TimePathOptions};
pub use mover::Mover;
pub use reason::{LimitKind, PathReason, Shortfall};
pub use rows::Friction;
pub use timing::TimePath;
pub use tip::TipLimits;

use crate::error::Result;
use crate::motion::{Path, TimedPath};
use check::{LimitCheck, TOLERANCE};
use friction::Line;
use lines::LimitRows;
use reach::{Profile, Stuck, losses, set_slopes, solve};
use samples::Samples;
use setup::PathProblem;
use std::sync::Arc;

/// The number of corrections on one grid before segments are halved. It is doubled under friction, and for the last grid if no timing was
/// found before.
const CORRECTIONS: usize = 8;
/// The largest number of doublings of a reduction without friction.
const MOST_DOUBLINGS: usize = 7;
/// The largest number of doublings of a reduction with friction. After these doublings, each correction reduces the limit on more
/// neighbouring segments.
const SPREAD: usize = 4;
/// The largest number of passes that replace viscous friction by its chord.
const CHORDS: usize = 40;
/// The largest number of passes that replace viscous friction by its tangent.
const TANGENTS: usize = 6;
/// The relative change of `x` below which tangents replace chords.
const NEAR: f64 = 0.03;
/// The relative change of `x` below which the profile has converged.
const CONVERGED: f64 = 1e-6;
/// The largest number of grids.
const GRIDS: usize = 9;
/// The largest number of times that all segments are halved.
const HALVINGS: usize = 4;
/// The relative change of the duration at which the automatic grid is fine enough.
const DURATION_CHANGE: f64 = 1e-4;
/// A relative excess between grid points above which segments are halved instead of corrected.
const COARSE_EXCESS: f64 = 1e-3;
/// A segment is halved if its loss of time, as a fraction of the duration, exceeds `LARGEST_LOSS * fine`. It is also halved if its relative
/// excess over a limit exceeds `fine`.
const LARGEST_LOSS: f64 = 0.02;
/// The reduction of a limit in the first correction, divided by the excess. This ratio doubles with each further correction, at most
/// `MOST_DOUBLINGS` times, or `SPREAD` times with friction.
const FIRST_REDUCTION: f64 = 1.2;
/// The number of passes that set the slope of `u` to the slope of the active limit.
const SLOPE_PASSES: usize = 1;

/// The result of the corrections on one grid.
enum Outcome {
    /// All limits are satisfied.
    Done(LimitCheck),
    /// The grid is too coarse. With `true`, all segments must be halved; with `false`, only some of them.
    Coarse(LimitCheck, bool),
    /// No feasible profile was found on this grid.
    Stuck(Stuck),
}

/// The largest relative change of an entry from `old` to `new`.
fn change(new: &[f64], old: &[f64]) -> f64 {
    new.iter().zip(old).map(|(new, old)| (new - old).abs() / new.max(*old).max(f64::MIN_POSITIVE)).fold(0.0, f64::max)
}

/// Compute the profile with viscous friction. Chords come first, because low speeds remain feasible under a chord. When the profile changes
/// little, or after `CHORDS` passes, tangents follow. The error of a tangent is proportional to the square of the change.
fn with_friction(problem: &mut PathProblem, profile: &mut Profile) -> std::result::Result<(), Stuck> {
    if problem.friction.is_none() {
        return Ok(());
    }
    let mut start = profile.x.clone();
    for _ in 0..CHORDS {
        problem.linearise_friction(&start, Line::Chord);
        profile.forget();
        match solve(&problem.rows, profile) {
            Ok(()) => {
                let change = change(&profile.x, &start);
                start.copy_from_slice(&profile.x);
                if change < NEAR {
                    break;
                }
            }
            // No profile is feasible with this chord. Try the chord at a quarter of `x`.
            Err(_) => start.iter_mut().for_each(|x| *x *= 0.25),
        }
    }
    profile.x.copy_from_slice(&start);
    tangents(problem, profile)
}

/// Compute the profile with tangents of viscous friction. Repeat until the profile converges, at most `TANGENTS` times. The repetition is
/// necessary, because the check of the limits counts the error of a tangent as an excess.
fn tangents(problem: &mut PathProblem, profile: &mut Profile) -> std::result::Result<(), Stuck> {
    for _ in 0..TANGENTS {
        let x = profile.x.clone();
        problem.linearise_friction(&x, Line::Tangent);
        profile.forget();
        if solve(&problem.rows, profile).is_err() {
            // With this tangent no speed is feasible. Return to the chord.
            problem.linearise_friction(&x, Line::Chord);
            profile.forget();
            return solve(&problem.rows, profile);
        }
        if change(&profile.x, &x) < CONVERGED {
            break;
        }
    }
    Ok(())
}

/// Compute the profile again, after limits were reduced. Viscous friction is replaced by its tangents.
fn again(problem: &mut PathProblem, profile: &mut Profile) -> std::result::Result<(), Stuck> {
    if problem.friction.is_none() { solve(&problem.rows, profile) } else { tangents(problem, profile) }
}

/// Reduce the caps at the ends of segment `i` by the relative amount `past`, in correction `k`.
fn reduce_caps(rows: &LimitRows, caps: &mut [f64], old: &[f64], i: usize, past: f64, k: usize) {
    let (x0, x1) = (rows.cap[i], rows.cap[i + 1]);
    // Towards a point where the path turns back, a cap grows without limit. So if one cap is more than 1.2 times the other, reduce only the
    // larger one. The larger cap has little effect on an excess next to the smaller cap. So reduce both from the third correction on.
    for (at, here, next, other) in [(i, x0, i + 1, x1), (i + 1, x1, i, x0)] {
        if here * 1.2 >= other || k >= 2 {
            // If the other end of the segment has a prescribed speed, its cap is never below this speed. Then the excess would decrease
            // slowly. So the reduction of the cap at this end grows by a further factor of two with each correction.
            let prescribed = (next == 0 && rows.x_start > 0.0) || (next + 1 == rows.cap.len() && rows.x_end > 0.0);
            let past = if prescribed { past * (1 << k.min(MOST_DOUBLINGS)) as f64 } else { past };
            caps[at] = caps[at].max(old[at] + past);
        }
    }
}

/// Compute the profile on the present grid, and correct it until it satisfies all limits, with a limited number of corrections.
fn plan(problem: &mut PathProblem, samples: &mut Samples, profile: &mut Profile, lost: &mut Vec<f64>, fine: f64, last: bool) -> Outcome {
    problem.rows.tight_lo.fill(0.0);
    problem.rows.tight_hi.fill(0.0);
    problem.cap_tight.fill(0.0);
    problem.rows.u_slope.fill(0.0);
    profile.forget();
    samples.begin(&problem.course());
    problem.set_caps();
    problem.forget_friction();
    if let Err(stuck) = solve(&problem.rows, profile) {
        return Outcome::Stuck(stuck);
    }
    for _ in 0..SLOPE_PASSES {
        let caps = problem.cap_slopes(profile);
        set_slopes(&mut problem.rows, profile, &caps);
        if solve(&problem.rows, profile).is_err() {
            problem.rows.u_slope.fill(0.0);
            profile.forget();
            if let Err(stuck) = solve(&problem.rows, profile) {
                return Outcome::Stuck(stuck);
            }
            break;
        }
    }
    profile.keep();
    if let Err(stuck) = with_friction(problem, profile) {
        return Outcome::Stuck(stuck);
    }
    let (mut found, mut nearest) = (None, f64::INFINITY);
    let mut cap_old = problem.cap_tight.clone();
    let mut narrowed = Vec::new();
    for k in 0..if problem.friction.is_some() || last { 2 * CORRECTIONS } else { CORRECTIONS } {
        let beyond = FIRST_REDUCTION * (1 << k.min(if problem.friction.is_some() { SPREAD } else { MOST_DOUBLINGS })) as f64;
        let (mut tight_lo, mut tight_hi) = (std::mem::take(&mut problem.rows.tight_lo), std::mem::take(&mut problem.rows.tight_hi));
        let (width, count) = (problem.rows.width, problem.pieces.len());
        // With large friction, a smaller limit on one segment moves the excess to the next one. So neighbours are reduced too.
        let spread = if problem.friction.is_some() && k >= SPREAD { 1_usize << (k - SPREAD) } else { 0 };
        let mut caps = std::mem::take(&mut problem.cap_tight);
        narrowed.clear();
        let now = samples.examine(&problem.course(), &problem.rows, profile, |i, row, under, over| {
            // For the norm of the frame's acceleration, the first of its three rows stores the reduction.
            let row = if problem.norms == Some(row) { problem.rows.ball.map_or(row, |(first, _)| first) } else { row };
            if row < width {
                let (lo, hi) = (tight_lo[i * width + row] + beyond * under, tight_hi[i * width + row] + beyond * over);
                for at in i.saturating_sub(spread)..=(i + spread).min(count - 1) {
                    tight_lo[at * width + row] = tight_lo[at * width + row].max(lo);
                    tight_hi[at * width + row] = tight_hi[at * width + row].max(hi);
                    narrowed.push(at);
                }
            } else {
                // The cap bounds the squared speed. So the relative excess of the speed counts twice.
                let past = 2.0 * beyond * under.max(over) / problem.limits.hi[row];
                reduce_caps(&problem.rows, &mut caps, &cap_old, i, past, k);
            }
        });
        (problem.rows.tight_lo, problem.rows.tight_hi) = (tight_lo, tight_hi);
        cap_old.copy_from_slice(&caps);
        problem.cap_tight = caps;
        found = Some(now);
        if now.excess < nearest {
            nearest = now.excess;
            profile.keep();
        }
        if k == 0 {
            samples.remember();
            losses(&problem.rows, profile, lost);
        }
        if !last && k == 0 && (now.excess > COARSE_EXCESS || lost.iter().any(|lost| *lost > LARGEST_LOSS * fine)) {
            return Outcome::Coarse(now, false);
        }
        if !(now.excess > TOLERANCE) && !now.excess.is_nan() {
            if samples.stands(&problem.course(), &problem.rows, profile) {
                return Outcome::Done(now);
            }
            continue;
        }
        narrowed.iter().for_each(|&i| profile.touch(i));
        problem.set_caps();
        if let Err(stuck) = again(problem, profile) {
            return match found {
                Some(found) if !last => Outcome::Coarse(found, true),
                _ => Outcome::Stuck(stuck),
            };
        }
    }
    match found {
        Some(found) => Outcome::Coarse(found, true),
        None => Outcome::Stuck(Stuck::Empty(0)),
    }
}

/// The number of halvings of a segment whose error is `over` times too large. The error is proportional to the square of the segment's
/// length.
fn halvings(over: f64) -> u32 {
    if over > 1.0 { (0.5 * over.log2()).ceil().min(9.0) as u32 } else { 0 }
}

/// Compute the fastest timing of `path` for the arm `mover` under `limits`.
///
/// If no timing is found, the result has the reason. Errors: `Input` or `WrongShape` for an invalid argument, `Memory` for a grid that does
/// not fit.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Functions;
/// use armlet_core::motion::{Ends, Path};
/// use armlet_core::plan::{Mover, PathLimits, TimePathOptions, time_path};
/// use std::sync::Arc;
///
/// // One uniform rod of 1 m and 1 kg without gravity: I = 1/3, so that T = 2 sqrt(I D / tau) for D = 1 rad and tau = 3 N m.
/// let arm = Functions::new(Arc::new(Arm::planar(&[1.0], None, None, None, [0.0, 0.0])?));
/// let (path, _) = Path::waypoints(&[0.0, 1.0], 1, None, Ends::Natural)?;
/// let limits = PathLimits { torque: Some((vec![-3.0], vec![3.0])), ..PathLimits::default() };
/// let plan = time_path(Mover::Tree(&arm), Arc::new(path), &limits, &TimePathOptions::default())?;
/// assert!(plan.reason.is_none() && (plan.motion.duration() - 2.0 / 3.0).abs() < 1e-9);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub fn time_path(mover: Mover, path: Arc<Path>, limits: &PathLimits, options: &TimePathOptions) -> Result<TimePath> {
    let mut problem = PathProblem::new(mover, path, limits, options)?;
    if let Some((lower, upper)) = &limits.position
        && let Some(reason) = positions::beyond(mover, &problem.path, lower, upper)
    {
        return problem.refuse(reason);
    }
    if problem.path.is_point() {
        return problem.hold();
    }
    problem.require_motion()?;
    let (mut samples, mut profile) = (Samples::default(), Profile::default());
    let (mut grids, mut halvings_left) = if options.refine || options.grid.is_none() { (GRIDS, HALVINGS) } else { (1, 0) };
    let (mut best, mut spare): (Option<TimePath>, Option<TimePath>) = (None, None);
    let (mut fine, mut lost) = (COARSE_EXCESS, Vec::new());
    loop {
        grids -= 1;
        let last = grids == 0 || halvings_left == 0;
        let outcome = plan(&mut problem, &mut samples, &mut profile, &mut lost, fine, last && best.is_none());
        let (reason, whole) = match outcome {
            Outcome::Done(found) => {
                let rows = &problem.rows;
                let motion = TimedPath::new(problem.path.clone(), rows.s.clone(), profile.x.clone(), rows.u_slope.clone())?;
                let moving = motion.duration().is_finite();
                if moving {
                    let settled = match &best {
                        None => options.grid.is_some(),
                        Some(before) => (before.motion.duration() - motion.duration()).abs() <= DURATION_CHANGE * motion.duration(),
                    };
                    let better = best.as_ref().is_none_or(|before| motion.duration() < before.motion.duration());
                    if better {
                        best = Some(TimePath { motion, margin: found.margin, reason: None });
                    }
                    if settled {
                        break;
                    }
                    fine *= 0.25;
                }
                (PathReason::standstill(&problem, &profile), !moving)
            }
            Outcome::Coarse(found, whole) => (PathReason::unresolved(&problem, &found), whole),
            Outcome::Stuck(stuck) => (PathReason::find(&problem, &profile, stuck), true),
        };
        if whole && best.is_none() {
            spare = slow::slowed(&mut problem, &mut samples, &mut profile, spare)?;
        }
        if last {
            best = best.or(spare);
            if best.is_none() {
                return problem.refuse(reason);
            }
            break;
        }
        if whole {
            halvings_left -= 1;
            problem.refine(|_| 1);
        } else {
            let finer = problem.refine(|i| halvings(samples.first[i] / fine).max(halvings(lost[i] / (LARGEST_LOSS * fine))));
            if !finer && best.is_some() {
                break;
            }
            if !finer {
                halvings_left -= 1;
                problem.refine(|_| 1);
            }
        }
    }
    match (best, &options.torque_rate) {
        (Some(best), None) => Ok(best),
        (Some(best), Some(rates)) => rate::limit_rate(&problem, best, rates, options),
        (None, _) => problem.refuse(PathReason::standstill(&problem, &profile)),
    }
}
