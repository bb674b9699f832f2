//! Corrections of a profile on one grid.
//!
//! The profile obeys its rows at three points of a segment, and may exceed a limit between them. The excess times a factor reduces this
//! limit on the segment, and the passes are repeated. The factor doubles with each correction.

use super::lines::LimitRows;
use super::passes::{Infeasible, time_losses};
use super::problem::PathProblem;
use super::samples::Excess;
use super::search::{GridState, Search};
use super::tuning::{
    BOTH_CAPS_AFTER, CORRECTIONS, FIRST_ACCURACY, FIRST_REDUCTION, FRICTION_DOUBLINGS, LARGER_CAP, LOSS_PER_EXCESS, MOST_DOUBLINGS,
    TOLERANCE,
};

impl Search<'_> {
    /// Check the profile between grid points, and correct it until it satisfies all limits. The result is `Inaccurate` before the first
    /// correction if segments must be halved. On the last attempt the grid stays, and the number of corrections is doubled.
    pub fn correct(&mut self, last_attempt: bool) -> GridState {
        let corrections = if self.problem.friction.is_some() || last_attempt { 2 * CORRECTIONS } else { CORRECTIONS };
        let mut least_excess = f64::INFINITY;
        let mut k = 0;
        loop {
            let check = self.samples.examine(&self.problem, &mut self.profile);
            if check.excess < least_excess {
                least_excess = check.excess;
                self.profile.store_least_exceeding();
            }
            if k == 0 {
                self.samples.store_first_excess();
                time_losses(&self.problem.rows, &self.profile, &mut self.time_losses);
                let loses_time = self.time_losses.iter().any(|loss| *loss > LOSS_PER_EXCESS * self.accuracy);
                if !last_attempt && (check.excess > FIRST_ACCURACY || loses_time) {
                    return GridState::Inaccurate(check);
                }
            }
            if check.excess <= TOLERANCE {
                if self.samples.confirm_interpolation(&self.problem, &self.profile) {
                    return GridState::Feasible(check);
                }
            } else {
                self.problem.reduce_limits(&self.samples.exceeded, k, &mut self.profile.rows_changed);
                match self.corrected_profile() {
                    Err(infeasible) if last_attempt => return GridState::Infeasible(infeasible),
                    Err(_) => return GridState::Exceeding(check),
                    Ok(()) => {}
                }
            }
            k += 1;
            if k == corrections {
                return GridState::Exceeding(check);
            }
        }
    }

    /// Repeat the passes after limits were reduced. Viscous friction is replaced by its tangents.
    fn corrected_profile(&mut self) -> Result<(), Infeasible> {
        if self.problem.friction.is_some() { self.iterate_tangents() } else { self.passes() }
    }
}

impl PathProblem<'_> {
    /// Reduce the exceeded limits on their segments, in correction `k`. Mark the segments whose rows change in `rows_changed`.
    fn reduce_limits(&mut self, exceeded: &[Excess], k: usize, rows_changed: &mut [bool]) {
        let (width, count) = (self.rows.width, self.pieces.len());
        let doublings = if self.friction.is_some() { FRICTION_DOUBLINGS } else { MOST_DOUBLINGS };
        let factor = FIRST_REDUCTION * (1 << k.min(doublings)) as f64;
        // With large friction, a smaller limit on one segment moves the excess to the next one. So neighbours are reduced too.
        let neighbours = if self.friction.is_some() && k >= FRICTION_DOUBLINGS { 1_usize << (k - FRICTION_DOUBLINGS) } else { 0 };
        let earlier_caps = self.cap_tight.clone();
        for &Excess { segment: i, row, below, above } in exceeded {
            // For the norm of the frame's acceleration, the first of its three rows stores the reduction.
            let row = if self.norms == Some(row) { self.rows.ball.map_or(row, |(first, _)| first) } else { row };
            if row < width {
                let LimitRows { tight_lo, tight_hi, .. } = &mut self.rows;
                let (lo, hi) = (tight_lo[i * width + row] + factor * below, tight_hi[i * width + row] + factor * above);
                for at in i.saturating_sub(neighbours)..=(i + neighbours).min(count - 1) {
                    tight_lo[at * width + row] = tight_lo[at * width + row].max(lo);
                    tight_hi[at * width + row] = tight_hi[at * width + row].max(hi);
                    rows_changed[at] = true;
                }
            } else {
                // The cap bounds the squared speed. So the relative excess of the speed counts twice.
                let reduction = 2.0 * factor * below.max(above) / self.rows.limits.hi[row];
                self.reduce_caps(&earlier_caps, i, reduction, k);
            }
        }
        self.set_caps();
    }

    /// Reduce the caps at the ends of segment `i` by the relative amount `reduction`, in correction `k`. `earlier` are the reductions of
    /// the corrections before.
    fn reduce_caps(&mut self, earlier: &[f64], i: usize, reduction: f64, k: usize) {
        let rows = &self.rows;
        let (x0, x1) = (rows.cap[i], rows.cap[i + 1]);
        // Towards a point where the path turns back, a cap grows without limit. So if one cap is more than `LARGER_CAP` times the other,
        // reduce only the larger one. The larger cap has little effect on an excess next to the smaller cap. So later both are reduced.
        for (at, here, next, other) in [(i, x0, i + 1, x1), (i + 1, x1, i, x0)] {
            if here * LARGER_CAP >= other || k >= BOTH_CAPS_AFTER {
                // If the other end of the segment has a prescribed speed, its cap is never below this speed. Then the excess would decrease
                // slowly. So the reduction of the cap at this end grows by a further factor of two with each correction.
                let prescribed = (next == 0 && rows.x_start > 0.0) || (next + 1 == rows.cap.len() && rows.x_end > 0.0);
                let reduction = if prescribed { reduction * (1 << k.min(MOST_DOUBLINGS)) as f64 } else { reduction };
                self.cap_tight[at] = self.cap_tight[at].max(earlier[at] + reduction);
            }
        }
    }
}
