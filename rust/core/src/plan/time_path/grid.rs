//! The grid of path positions: equal steps within each piece of the path, and segments that are halved.

use super::tuning::{CHECK_NODES, FEWEST_SEGMENTS, MOST_HALVINGS};
use crate::motion::Path;

/// The smallest number of neighbouring segments that are halved together, unless the group of equal segments has fewer. A run of this
/// length has enough points for an interpolation.
const RUN: usize = CHECK_NODES - 1;

/// Find the groups of consecutive segments with equal length within each piece, as first index and end index.
pub(super) fn spans(s: &[f64], pieces: &[usize], spans: &mut Vec<(usize, usize)>) {
    spans.clear();
    let step = |i: usize| s[i + 1] - s[i];
    let mut first = 0;
    for i in 1..=pieces.len() {
        // Steps of the same length differ only by rounding errors. Halved steps differ by a factor of two or more.
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
    let fewest = if FEWEST_SEGMENTS * (knots.len() - 1) < points { FEWEST_SEGMENTS } else { 1 };
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

/// Halve every segment `i` of the grid `s` at least `times(i)` times, but at most `MOST_HALVINGS` times. All segments of a run are halved
/// equally often, so that their rows can be interpolated. This number is the largest of `times` in the run and in the two segments next to
/// it. `groups`: the groups of segments with equal length ([`spans`]). Return the grid, and the index of the piece of each segment.
pub(super) fn halved(s: &[f64], pieces: &[usize], groups: &[(usize, usize)], times: impl Fn(usize) -> u32) -> (Vec<f64>, Vec<usize>) {
    let (mut points, mut pieces_of) = (Vec::new(), Vec::new());
    for &(first, last) in groups {
        let runs = ((last - first) / RUN).max(1);
        let end = |run: usize| first + (last - first) * run / runs;
        for run in 0..runs {
            // The neighbours of a run may require halvings as well.
            let near = end(run).saturating_sub(1).max(first)..(end(run + 1) + 1).min(last);
            let parts = 1_usize << near.map(&times).max().unwrap_or(0).min(MOST_HALVINGS);
            for i in end(run)..end(run + 1) {
                for k in 0..parts {
                    let at = if k == 0 { s[i] } else { s[i] + (s[i + 1] - s[i]) * (k as f64 / parts as f64) };
                    if k == 0 || (at > points[points.len() - 1] && at < s[i + 1]) {
                        points.push(at);
                        pieces_of.push(pieces[i]);
                    }
                }
            }
        }
    }
    points.push(s[s.len() - 1]);
    (points, pieces_of)
}
