//! The constants of the planner.

// Magnitudes.

/// A number larger than every squared path speed: the cap where no speed limit exists.
pub(super) const FASTEST: f64 = 1e60;
/// A coefficient of `u` with a smaller absolute value counts as zero.
pub(super) const NONE: f64 = 1e-140;
/// The value of a bound of `u` that never limits.
pub(super) const FAR: f64 = 1e200;

// Tolerances.

/// The largest relative excess of a row over its limit: half of 1e-9, the documented tolerance.
pub(super) const TOLERANCE: f64 = 5e-10;
/// The largest error of interpolated torques near their limits, relative to the limit: a fifth of the difference between 1e-9 and
/// `TOLERANCE`.
pub(super) const INTERPOLATION: f64 = 1e-10;
/// Far from the limits, this fraction of the relative distance to the limit is the largest error of interpolated torques.
pub(super) const INTERPOLATION_SHARE: f64 = 0.1;
/// A static torque may exceed its limit by this fraction of the limit.
pub(super) const STATIC_EXCESS: f64 = 3e-10;
/// A prescribed squared speed may exceed its cap by this fraction: twice a relative 4e-10 of the speed.
pub(super) const PRESCRIBED_EXCESS: f64 = 8e-10;
/// The relative tolerance of a position limit, for rounding errors of the path.
pub(super) const POSITION_ROUNDING: f64 = 1e-12;
/// The largest relative distance to a cap at which `x` counts as equal to the cap.
pub(super) const ON_CAP: f64 = 1e-12;
/// The relative tolerance of the test `L <= U` of the bounds of `u`, for rounding errors.
pub(super) const ROUNDING: f64 = 1e-13;
/// A coefficient of `u` below this fraction of the largest coefficient in its row counts as a rounding error.
pub(super) const ROUNDED_COEFFICIENT: f64 = 1e-14;
/// The slope of the root `sqrt(A^2 - |c x + d|^2)` is infinite where the root is zero. So the slope is computed with a radicand of at least
/// this fraction of `A^2`.
pub(super) const STEEP: f64 = 1e-14;

// Grids.

/// The approximate number of points of the first automatic grid.
pub(super) const FIRST_GRID: usize = 201;
/// The largest number of points of the first grid.
pub(super) const MOST_POINTS: usize = 1_000_000;
/// The smallest number of segments of a piece, unless the path has too many pieces.
pub(super) const FEWEST_SEGMENTS: usize = 5;
/// The largest number of grids.
pub(super) const MOST_GRIDS: usize = 9;
/// The largest number of times that all segments are halved.
pub(super) const MOST_UNIFORM_HALVINGS: usize = 4;
/// The largest number of halvings of a segment from one grid to the next.
pub(super) const MOST_HALVINGS: u32 = 3;
/// The relative excess before the first correction above which segments are halved instead of corrected.
pub(super) const FIRST_ACCURACY: f64 = 1e-3;
/// The factor of the accuracy from one feasible timing to the next.
pub(super) const ACCURACY_FACTOR: f64 = 0.25;
/// The largest loss of time of a segment, as a fraction of the duration, divided by the accuracy.
pub(super) const LOSS_PER_EXCESS: f64 = 0.02;
/// The relative change of the duration at which the automatic grid is fine enough.
pub(super) const DURATION_CHANGE: f64 = 1e-4;

// The passes.

/// In the middle of a segment, a row is raised by this fraction of its rise above the chord between both ends. A parabola that is within
/// its limit at both ends and, raised, in the middle exceeds the limit by at most 0.141 of that rise.
pub(super) const MIDDLE_MARGIN: f64 = 0.25;
/// The largest number of Newton steps to an end of a controllable set.
pub(super) const NEWTON_STEPS: usize = 100;
/// `u` follows a limit if it is near the smaller of the limits at both ends. Near is `ACTIVE_RISE` times the difference of these limits,
/// plus `ACTIVE_LEVEL` times `u`.
pub(super) const ACTIVE_RISE: f64 = 1e-3;
pub(super) const ACTIVE_LEVEL: f64 = 1e-5;
/// `u` also follows a limit if its distance from the mean limit is at most this fraction of the difference of both ends.
pub(super) const ACTIVE_MEAN: f64 = 0.1;
/// `u` gets the slope of a limit if the limit changes by at most this fraction of the distance between both bounds of `u`.
pub(super) const LARGEST_RISE: f64 = 0.2;

// The check between grid points.

/// The number of steps of a segment in the check; it has `CHECK_STEPS + 1` samples.
pub(super) const CHECK_STEPS: usize = 10;
/// The number of grid points in one interpolation of the check.
pub(super) const CHECK_NODES: usize = 6;
/// The smallest relative distance to the limits, estimated from three samples, at which a block of rows may be skipped.
pub(super) const FAR_ENOUGH: f64 = 0.01;

// Corrections.

/// The number of corrections on one grid before segments are halved. It is doubled under friction, and for the last grid if no timing was
/// found before.
pub(super) const CORRECTIONS: usize = 8;
/// The reduction of a limit in the first correction, divided by the excess. This ratio doubles with each further correction.
pub(super) const FIRST_REDUCTION: f64 = 1.2;
/// The largest number of doublings of this ratio without friction.
pub(super) const MOST_DOUBLINGS: usize = 7;
/// The largest number of doublings with friction. Each correction after them reduces the limit on more neighbouring segments.
pub(super) const FRICTION_DOUBLINGS: usize = 4;
/// Only the larger of the two caps of a segment is reduced if it is at least this factor times the other.
pub(super) const LARGER_CAP: f64 = 1.2;
/// The number of corrections after which both caps are reduced.
pub(super) const BOTH_CAPS_AFTER: usize = 2;

// Viscous friction.

/// The largest number of passes with a chord in place of the root.
pub(super) const CHORD_PASSES: usize = 40;
/// The largest number of passes with a tangent in place of the root.
pub(super) const TANGENT_PASSES: usize = 6;
/// The factor of `x` for the next chord if no profile is feasible with the last one.
pub(super) const CHORD_SHORTENING: f64 = 0.25;
/// The relative change of `x` below which tangents replace chords.
pub(super) const TANGENTS_FROM: f64 = 0.03;
/// The relative change of `x` below which the profile has converged.
pub(super) const FRICTION_CONVERGED: f64 = 1e-6;
/// The smallest factor of the squared path speed of a slowed profile.
pub(super) const SLOWEST_SHARE: f64 = 1e-12;
/// The relative accuracy of this factor.
pub(super) const SLOWING_ACCURACY: f64 = 1e-6;

// Limits of the torque rate.

/// Exponents `j`: the search tries windows of `2^j` times the duration of the fastest timing.
pub(super) const WINDOW_EXPONENTS: std::ops::RangeInclusive<i32> = -8..=1;
/// Factors for the finer search around the best window.
pub(super) const WINDOW_FACTORS: [f64; 4] = [1.5, 1.2, 1.1, 1.05];
/// The relative accuracy of the factor `k` of a window, in the search of windows and at the end.
pub(super) const WINDOW_ACCURACY: f64 = 1e-3;
pub(super) const FACTOR_ACCURACY: f64 = 1e-7;
/// Least number of nodes per window.
pub(super) const NODES_PER_WINDOW: f64 = 8.0;
/// Least number of nodes per piece of the path.
pub(super) const NODES_PER_PIECE: usize = 40;
/// The smallest and the largest total number of nodes. The largest number overrides the numbers per window and per piece.
pub(super) const NODES: (usize, usize) = (200, 4000);
/// Steps from one node to the next during the search, and in the final check.
pub(super) const STEPS_OF_SEARCH: usize = 4;
pub(super) const STEPS_OF_CHECK: usize = 20;
/// The largest factor `k` by which the motion is slowed down.
pub(super) const SLOWEST_FACTOR: f64 = 1e6;
