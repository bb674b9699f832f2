//! The samples of the segments of a grid, and their results. They are stored from one examination to the next (`check`).

use super::check::measure;
use super::passes::Profile;
use super::problem::PathProblem;
use super::tuning::{CHECK_NODES, INTERPOLATION, INTERPOLATION_SHARE};

/// The result of the last examination of a segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    /// The smallest relative distance of a sample to a limit.
    pub margin: f64,
    /// The largest relative excess of a row, including the estimate between samples; negative within all limits.
    pub excess: f64,
    /// The row with the largest excess.
    pub at: usize,
    /// An upper bound of the relative excesses of torques.
    pub torque: f64,
    /// Whether the interpolated torques were compared with the dynamics in the middle of the segment, and agreed.
    pub proven: bool,
}

/// A row that exceeds a limit on a segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Excess {
    pub segment: usize,
    pub row: usize,
    /// The excess over the lower and over the upper limit, in the unit of the row; zero within the limit.
    pub below: f64,
    pub above: f64,
}

/// The samples and their results, segment by segment.
#[derive(Default)]
pub(super) struct Samples {
    pub segments: Vec<Segment>,
    /// The largest relative excess of each segment before any limit was reduced.
    pub first_excess: Vec<f64>,
    /// The index in `spans` of the group that contains each segment.
    pub span: Vec<usize>,
    /// Whether each segment is sampled by the dynamics, without interpolation.
    pub exact: Vec<bool>,
    /// The rows that exceeded a limit in the last examination.
    pub exceeded: Vec<Excess>,
    /// Segments to be examined.
    pub list: Vec<usize>,
    /// Segments to sample by the dynamics.
    pub evaluated: Vec<usize>,
    /// The samples of the segments in `evaluated`.
    pub values: Vec<f64>,
    /// Interpolated torques in the middle of every interpolated segment, `(N, n)`.
    pub middles: Vec<f64>,
}

impl Samples {
    /// Create the samples of a grid, without results.
    pub fn new(problem: &PathProblem) -> Self {
        let count = problem.pieces.len();
        let unknown = Segment { margin: f64::NAN, excess: f64::INFINITY, at: 0, torque: f64::INFINITY, proven: false };
        let (segments, middles) = (vec![unknown; count], vec![0.0; count * problem.n]);
        let mut samples = Samples { segments, middles, ..Samples::default() };
        for (k, &(first, last)) in problem.spans.iter().enumerate() {
            samples.span.resize(last, k);
            // With friction, with limits that vary, or with a limited frame, no row is interpolated. If neighbouring segments
            // of equal length have too few points, they cannot be interpolated.
            let curved = problem.friction.is_some() || problem.along.any() || problem.tip.is_some();
            samples.exact.resize(last, curved || last - first + 1 < CHECK_NODES);
        }
        samples
    }

    /// Copy the excess of each segment to `first_excess`, before any limit is reduced.
    pub fn store_first_excess(&mut self) {
        self.first_excess = self.segments.iter().map(|segment| segment.excess).collect();
    }

    /// Whether the interpolated torques of the last examination agree with the dynamics. In segments where they disagree, the next
    /// examination computes all rows by the dynamics.
    pub fn confirm_interpolation(&mut self, problem: &PathProblem, profile: &Profile) -> bool {
        if !problem.kinds[0] {
            return true;
        }
        let n = problem.n;
        self.evaluated.clear();
        self.evaluated.extend((0..self.segments.len()).filter(|&i| !self.exact[i] && !self.segments[i].proven));
        measure(problem, &profile.x, &self.evaluated, 1, &mut self.values);
        let mut agrees = true;
        for (&i, measured) in self.evaluated.iter().zip(self.values.chunks_exact(problem.measured())) {
            // Far from the limits a larger error is allowed.
            let (segment, limits) = (&mut self.segments[i], &problem.rows.limits);
            let least = INTERPOLATION.max(-INTERPOLATION_SHARE * segment.torque);
            segment.proven = (0..n).all(|j| {
                let scale = limits.scale_lo[j].min(limits.scale_hi[j]);
                (measured[j] - self.middles[i * n + j]).abs() <= least * scale
            });
            if !segment.proven {
                self.exact[i] = true;
                segment.excess = f64::INFINITY;
                agrees = false;
            }
        }
        agrees
    }
}
