//! Caps: upper bounds of the squared path speed `x` from speed limits `V`, and the slope `b = du/ds` on a segment where `x` follows a cap.
//!
//! ```text
//! x <= C(s) = (V / q')^2   for a joint,   x <= C(s) = (V / |p'|)^2   for a frame's origin p
//! u(s) = u_i + b (s - s_i - h/2)   on a segment of length h
//! b = 2 (C_i - 2 C_m + C_(i+1)) / h^2   gives x = C at both ends and at the midpoint, where C = C_m
//! ```
//!
//! `'` is `d/ds`, `u` is the path acceleration, and `C_i` is the cap at grid point `i`. With this slope `b`, the squared speed `x` differs
//! from the cap between grid points only by a term of order `h^3`. With a constant `u`, `x` would equal the cap only at grid points, and
//! `u` would jump at each of them.

use super::passes::Profile;
use super::problem::PathProblem;
use super::tuning::{FASTEST, ON_CAP, PRESCRIBED_EXCESS};

impl PathProblem<'_> {
    /// The strictest speed limit at grid point `i`: its row in `limits`, and the largest path speed that it allows, infinite without a
    /// limit.
    pub fn strictest_speed_limit(&self, i: usize) -> (usize, f64) {
        let mut most = (self.speeds.unwrap_or(0), f64::INFINITY);
        for j in 0..self.n {
            let slope = self.slopes[i * self.stride + j].abs();
            let limit = self.hi[2 * self.n + j] * self.along_at(2, i, j);
            if slope > 0.0 && limit / slope < most.1 {
                most = (self.speeds.unwrap_or(0) + j, limit / slope);
            }
        }
        if let (Some(row), Some(speed)) = (self.norms, self.tip.as_ref().and_then(|tip| tip.speed)) {
            let slope = self.slopes[i * self.stride + self.n];
            if slope > 0.0 && speed / slope < most.1 {
                most = (row + 1, speed / slope);
            }
        }
        most
    }

    /// Set `speed_caps`: the bounds of `x` at the grid points from the speed limits without reduction.
    pub fn set_speed_caps(&mut self) {
        let bound = |i: usize| {
            let (row, speed) = self.strictest_speed_limit(i);
            (row, speed.powi(2).min(FASTEST))
        };
        self.speed_caps = (0..self.rows.s.len()).map(bound).collect();
    }

    /// Set the caps at the grid points from the reduced speed limits and the stops. At an end of the path, the reduced cap is at least the
    /// prescribed squared speed, if the unreduced limit allows this speed.
    pub fn set_caps(&mut self) {
        let points = self.rows.s.len();
        self.rows.cap.resize(points, FASTEST);
        for i in 0..points {
            let cap = self.speed_caps[i].1;
            let mut narrow = cap / (1.0 + self.cap_tight[i]);
            for (at, x) in [(0, self.rows.x_start), (points - 1, self.rows.x_end)] {
                if i == at && x <= cap * (1.0 + PRESCRIBED_EXCESS) {
                    narrow = narrow.max(x);
                }
            }
            self.rows.cap[i] = narrow;
        }
        for stop in &self.stops {
            if let Ok(i) = self.rows.s.binary_search_by(|s| s.total_cmp(stop)) {
                self.rows.cap[i] = 0.0;
            }
        }
    }

    /// `(N,)`: the slope `du/ds` on each segment where `x` follows the cap of one speed limit at both ends. It is NaN on other segments,
    /// and where there are too few grid points to interpolate.
    pub fn cap_slopes(&self, profile: &Profile) -> Vec<f64> {
        let on = |i: usize| profile.x[i] >= self.speed_caps[i].1 * (1.0 - ON_CAP);
        let mut slopes = vec![f64::NAN; self.pieces.len()];
        for &(first, last) in &self.spans {
            for i in first..last {
                let (row, from) = self.speed_caps[i];
                let (other, to) = self.speed_caps[i + 1];
                if row == other && from.max(to) < FASTEST && on(i) && on(i + 1) {
                    let h = self.rows.s[i + 1] - self.rows.s[i];
                    slopes[i] = 2.0 * ((from + to) - 2.0 * self.between(row, i, first, last)) / (h * h);
                }
            }
        }
        slopes
    }

    /// The cap at the midpoint of segment `i`, from the speed limit with the index `row`. It is NaN if there are too few grid points to
    /// interpolate.
    fn between(&self, row: usize, i: usize, first: usize, last: usize) -> f64 {
        let Some((start, [weights])) = self.stencils.0.of(i, first, last) else { return f64::NAN };
        let (joint, limit) = match self.norms {
            Some(norms) if row == norms + 1 => (self.n, self.rows.limits.hi[row]),
            _ => {
                let joint = row - self.speeds.unwrap_or(0);
                let middle = 0.5 * (self.rows.s[i] + self.rows.s[i + 1]);
                (joint, self.rows.limits.hi[row] * self.along.limit(&self.path, 2, joint, self.pieces[i], middle))
            }
        };
        let slope: f64 = (0..4).map(|k| weights[k] * self.slopes[(start + k) * self.stride + joint]).sum();
        (limit / slope).powi(2)
    }
}
