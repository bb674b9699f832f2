//! The grid of path positions: equal steps within each piece of the path, halved where a segment is too long.

use super::check::WINDOW;
use super::setup::PathProblem;
use crate::motion::Path;

/// The smallest number of segments of a piece, unless the path has too many pieces.
pub(super) const PIECE: usize = 5;
/// Number of neighbouring segments that are halved together: enough points for an interpolation.
const RUN: usize = WINDOW - 1;
/// The largest number of halvings of a segment from one grid to the next.
const MOST_HALVINGS: u32 = 3;

impl PathProblem<'_> {
    /// Halve segment `i` `times(i)` times, at most `MOST_HALVINGS`. A run of neighbouring segments is halved together, as often as its
    /// largest `times`, so that its rows can be interpolated. Return whether any segment was halved.
    pub fn refine(&mut self, times: impl Fn(usize) -> u32) -> bool {
        let (mut fine, mut pieces) = (Vec::new(), Vec::new());
        let s = &self.rows.s;
        for &(first, last) in &self.spans {
            let runs = ((last - first) / RUN).max(1);
            let end = |run: usize| first + (last - first) * run / runs;
            for run in 0..runs {
                // The neighbours of a run may require halvings as well.
                let near = end(run).saturating_sub(1).max(first)..(end(run + 1) + 1).min(last);
                let parts = 1_usize << near.map(&times).max().unwrap_or(0).min(MOST_HALVINGS);
                for i in end(run)..end(run + 1) {
                    for k in 0..parts {
                        let at = if k == 0 { s[i] } else { s[i] + (s[i + 1] - s[i]) * (k as f64 / parts as f64) };
                        if k == 0 || (at > fine[fine.len() - 1] && at < s[i + 1]) {
                            fine.push(at);
                            pieces.push(self.pieces[i]);
                        }
                    }
                }
            }
        }
        fine.push(s[s.len() - 1]);
        let more = fine.len() > s.len();
        (self.rows.s, self.pieces) = (fine, pieces);
        if more {
            self.fill();
        }
        more
    }
}

/// Find the runs of segments with equal length within each piece, as first index and end index.
pub(super) fn spans(s: &[f64], pieces: &[usize], spans: &mut Vec<(usize, usize)>) {
    spans.clear();
    let step = |i: usize| s[i + 1] - s[i];
    let mut first = 0;
    for i in 1..=pieces.len() {
        // Equal steps differ by rounding. Halved steps differ by a factor of two or more.
        if i == pieces.len() || pieces[i] != pieces[first] || !(1.5 * step(i) > step(first) && step(i) < 1.5 * step(first)) {
            spans.push((first, i));
            first = i;
        }
    }
}

/// A grid of about `points` points, with equal steps within each piece, and the index of the piece of each segment.
pub(super) fn grid(path: &Path, points: usize) -> (Vec<f64>, Vec<usize>) {
    let knots = path.knots();
    let total = knots[knots.len() - 1] - knots[0];
    let (mut s, mut pieces) = (Vec::new(), Vec::new());
    let fewest = if PIECE * (knots.len() - 1) < points { PIECE } else { 1 };
    for p in 0..knots.len() - 1 {
        let (a, b) = (knots[p], knots[p + 1]);
        let segments = (((b - a) / total * (points - 1) as f64).round() as usize).max(fewest);
        for k in 0..segments {
            let at = a + (b - a) * (k as f64 / segments as f64);
            if s.last().is_none_or(|last| at > *last) {
                s.push(at);
                pieces.push(p);
            }
        }
    }
    s.push(knots[knots.len() - 1]);
    (s, pieces)
}
