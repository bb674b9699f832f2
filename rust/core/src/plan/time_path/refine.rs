//! Halves the segments of the grid that are too long.

use super::check::WINDOW;
use super::setup::PathProblem;

/// The smallest number of neighbouring segments that are halved together, unless the group of equal segments has fewer. A run of this
/// length has enough points for an interpolation.
const RUN: usize = WINDOW - 1;
/// The largest number of halvings of a segment from one grid to the next.
const MOST_HALVINGS: u32 = 3;

impl PathProblem<'_> {
    /// Halve every segment `i` at least `times(i)` times, but at most `MOST_HALVINGS` times. All segments of a run are halved equally
    /// often, so that their rows can be interpolated. This number is the largest of `times` in the run and in the two segments next to it.
    /// Return whether any segment was halved.
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
