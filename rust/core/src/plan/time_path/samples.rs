//! The samples of the segments of a grid, and their results. They are stored from one examination to the next (`check`).

use super::check::{Course, INTERPOLATION, WINDOW, measure};
use super::lines::LimitRows;
use super::reach::Profile;

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

/// The samples and their results, segment by segment.
#[derive(Default)]
pub(super) struct Samples {
    pub segments: Vec<Segment>,
    /// The largest relative excess of each segment before any limit was reduced.
    pub first: Vec<f64>,
    /// The index in `spans` of the group that contains each segment.
    pub span: Vec<usize>,
    /// Whether each segment is sampled by the dynamics, without interpolation.
    pub exact: Vec<bool>,
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
    /// Discard all results, for a new problem or a new grid.
    pub fn begin(&mut self, course: &Course) {
        let count = course.pieces.len();
        let unknown = Segment { margin: f64::NAN, excess: f64::INFINITY, at: 0, torque: f64::INFINITY, proven: false };
        self.segments.clear();
        self.first.clear();
        self.first.resize(count, 0.0);
        self.segments.resize(count, unknown);
        self.span.clear();
        self.exact.clear();
        for (k, &(first, last)) in course.spans.iter().enumerate() {
            self.span.resize(last, k);
            // With friction, with limits that vary, or with a limited frame, no row is interpolated. If neighbouring segments
            // of equal length have too few points, they cannot be interpolated.
            let curved = course.friction.is_some() || course.along.any() || course.tip.is_some();
            self.exact.resize(last, curved || last - first + 1 < WINDOW);
        }
        self.middles.clear();
        self.middles.resize(count * course.n, 0.0);
    }

    /// Copy the excess of each segment to `first`, before any limit is reduced.
    pub fn remember(&mut self) {
        self.first.clear();
        self.first.extend(self.segments.iter().map(|segment| segment.excess));
    }

    /// Whether the interpolated torques of the last examination agree with the dynamics. In segments where they disagree, the next
    /// examination computes all rows by the dynamics.
    pub fn stands(&mut self, course: &Course, rows: &LimitRows, profile: &Profile) -> bool {
        if !course.kinds[0] {
            return true;
        }
        let n = course.n;
        self.evaluated.clear();
        self.evaluated.extend((0..self.segments.len()).filter(|&i| !self.exact[i] && !self.segments[i].proven));
        measure(course, rows, &profile.x, &self.evaluated, 1, &mut self.values);
        let mut stands = true;
        for (&i, measured) in self.evaluated.iter().zip(self.values.chunks_exact(course.measured())) {
            // Far from the limits a larger error is allowed.
            let segment = &mut self.segments[i];
            let least = INTERPOLATION.max(-0.1 * segment.torque);
            segment.proven = (0..n).all(|j| {
                let scale = course.limits.scale_lo[j].min(course.limits.scale_hi[j]);
                (measured[j] - self.middles[i * n + j]).abs() <= least * scale
            });
            if !segment.proven {
                self.exact[i] = true;
                segment.excess = f64::INFINITY;
                stands = false;
            }
        }
        stands
    }
}
