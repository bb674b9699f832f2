//! The constants of the planner, with what was measured of them.
//!
//! All constants are ratios or counts without unit, except the magnitudes. Each was halved and doubled, or changed to the values below, while
//! the others stayed. `num` is the number of timings that changed. `mean` and `largest` are relative changes of their durations: positive is
//! slower. `time` is the processor time of all timings, divided by the time with the present constants. It was measured on a build with
//! optimisation level 1, and varies by 0.05 from run to run. No timing became infeasible or exceeded a limit by more than `TOLERANCE`.
//! Constants without a line were not measured.
//!
//! 118 feasible random paths of planar arms, of the planar PR arm and of the seven-axis arm. They have 2 to 7 waypoints, and limits of torque, speed
//! and acceleration. Some have limits that vary, a fixed grid, friction, a stop, speeds at the ends, or a limited tip:
//!
//! ```text
//! name                     value  num    mean largest  time      value  num    mean largest  time
//! FIRST_GRID                 101   96   +7e-5   +3e-3  1.07        401   96   -5e-5   -3e-3  1.20
//! MOST_UNIFORM_HALVINGS        2    0       0       0  1.01          8    0       0       0  1.12
//! MOST_GRIDS                   4   55   +2e-4   +4e-3  0.56         18   41   -3e-4   -3e-3  2.78
//! FIRST_ACCURACY            5e-4  102   -1e-4   -2e-3  1.21       2e-3   98   +2e-4   +3e-3  0.98
//! ACCURACY_FACTOR          0.125   64   -1e-4   -2e-3  1.30        0.5   58   +5e-5   +8e-4  0.90
//! LOSS_PER_EXCESS           0.01  102   -1e-4   -2e-3  1.16       0.04   96   +1e-4   +3e-3  1.04
//! DURATION_CHANGE           5e-5   13   -1e-5   -3e-4  1.23       2e-4   12   +1e-5   +3e-4  0.90
//! MOST_HALVINGS                1   72   +3e-4   +4e-3  0.79          6   45   -2e-5   -1e-3  1.16
//! MIDDLE_MARGIN            0.125  109   -4e-6   +3e-4  1.03        0.5  109   +1e-5   +3e-4  0.97
//! CORRECTIONS                  4    8   +1e-6   +7e-4  1.00         16    0       0       0  0.98
//! FIRST_REDUCTION            0.6  109   +1e-5   +1e-3  1.13        2.4  109   -1e-5   -2e-3  1.00
//! MOST_DOUBLINGS               3    3   -4e-9   -4e-7  0.99         14    0       0       0  0.98
//! FRICTION_DOUBLINGS           2    9   +1e-8   +2e-6  0.99          8    2  -1e-11   -1e-9  1.00
//! LARGER_CAP                 1.0   62   -1e-6   -8e-5  1.06        2.4   12   +2e-5   +2e-3  1.03
//! BOTH_CAPS_AFTER              1    4   +3e-5   +3e-3  1.02          4    3   -3e-5   -2e-3  1.03
//! CHORD_PASSES                20    1  -2e-10   -2e-8  1.03         80    0       0       0  1.02
//! TANGENT_PASSES               3    1  -2e-10   -2e-8  1.00         12    1  -2e-10   -2e-8  0.99
//! CHORD_SHORTENING         0.125    2   +1e-7   +2e-5  0.99        0.5    2   +1e-7   +2e-5  0.99
//! TANGENTS_FROM            0.015    6  +4e-17  +4e-15  1.04       0.06    5  +4e-17  +2e-15  0.97
//! FRICTION_CONVERGED        5e-7    4  -9e-17  -7e-15  1.00       2e-6    2  +5e-18  +1e-15  1.00
//! ACTIVE_RISE               5e-4    0       0       0  1.00       2e-3    3   +2e-8   +2e-6  0.99
//! ACTIVE_LEVEL              5e-6    5  +7e-11   +1e-8  0.99       2e-5    6   +2e-8   +2e-6  0.99
//! ACTIVE_MEAN               0.05    0       0       0  1.00        0.2    0       0       0  1.01
//! LARGEST_RISE               0.1   60   +1e-5   +1e-3  1.07        0.4   37   -5e-6   +1e-3  1.01
//! FAR_ENOUGH               0.005    0       0       0  1.01       0.02    0       0       0  0.98
//! FEWEST_SEGMENTS              3    4   +3e-5   +4e-3  1.00         10   12   -1e-4   -7e-3  1.01
//! SLOWING_ACCURACY          2e-6    0       0       0  0.97
//! NEWTON_STEPS                50    0       0       0  0.96
//! TOLERANCE              2.5e-10   33  +1e-12  +5e-11  0.97       1e-9   34  -2e-12  -2e-11  0.98
//! INTERPOLATION            5e-11    0       0       0  0.94      2e-10    0       0       0  0.97
//! INTERPOLATION_SHARE       0.05    0       0       0  0.98        0.2    0       0       0  0.97
//! ON_CAP                   5e-13    0       0       0  0.98      2e-12    0       0       0  0.99
//! ROUNDING                 5e-14   16  -6e-15  -7e-13  1.01      2e-13   17  -2e-16  -6e-15  0.99
//! ROUNDED_COEFFICIENT      5e-15    0       0       0  1.01      2e-14    0       0       0  0.98
//! STATIC_EXCESS          1.5e-10    0       0       0  0.98      6e-10    0       0       0  0.99
//! STEEP                    5e-15   11  -1e-17  -2e-15  0.99      2e-14   10  -2e-17  -1e-15  0.99
//! ```
//!
//! 40 feasible random paths of a planar arm with two joints, gravity and a limited torque rate:
//!
//! ```text
//! name                     value  num    mean largest  time      value  num    mean largest  time
//! NODES_PER_WINDOW             4   13   +3e-3   +6e-2  0.73         16   22   +2e-3   -6e-2  1.55
//! NODES_PER_PIECE             20    3   -3e-3   -1e-1  1.00         80   24   -3e-3   +2e-1  1.16
//! STEPS_OF_SEARCH              2   15   +7e-3   +1e-1  0.70          8   21   -2e-3   +2e-1  1.57
//! STEPS_OF_CHECK              10   40   -9e-3   -1e-1  0.91         40   39   +5e-3   +1e-1  1.16
//! WINDOW_ACCURACY           5e-4    2   +6e-6   +3e-3  1.03       2e-3    1   +3e-4   +1e-2  1.01
//! FACTOR_ACCURACY           5e-8   19   -2e-8   -4e-8  1.02       2e-7   20   +4e-8   +8e-8  0.99
//! SLOWEST_FACTOR             5e5    0       0       0  1.01        2e6    0       0       0  0.97
//! ```
//!
//! Durations and time depend mostly on the refinement: `MOST_GRIDS`, `MOST_HALVINGS`, `FIRST_GRID` and the accuracies. The corrections and
//! the iteration of friction end before their caps in nearly all problems. The search of a window for the torque rate is coarse: its
//! constants change single durations by up to 20 %.

// Magnitudes.

/// A number larger than every squared path speed, 1/s^2 for a path parameter without unit: the cap where no speed limit exists.
pub(super) const FASTEST: f64 = 1e60;
/// A coefficient of `u` with a smaller absolute value counts as zero. The unit is the unit of the row, times s^2.
pub(super) const NONE: f64 = 1e-140;
/// The value of a bound of `u` that never limits, 1/s^2.
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
