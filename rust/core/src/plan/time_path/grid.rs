//! The grid of path positions: equal steps within each piece of the path. `refine` halves segments.

use crate::motion::Path;

/// The smallest number of segments of a piece, unless the path has too many pieces.
pub(super) const PIECE: usize = 5;

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
