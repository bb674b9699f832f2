//! Saturation in the null space (Flacco, De Luca, Khatib 2015, `flacco2015saturation`). Each level searches for the largest scale `s <= 1`
//! with
//!
//! `J_i v = s v_i`,  `v = v_above + N z`,  `v_min <= v <= v_max`. `N` is the null basis of the levels above.
//!
//! The solution `v(s) = s a + b` is affine in `s`. As long as `s = 1` violates a bound, the joint that limits `s` most is fixed at its
//! bound. Its direction is removed from `N`, and the other joints take over. The search keeps the largest feasible scale. A level without a
//! feasible scale in `[0, 1]` does not change `v_above`. Ranks equal the ranks of `exact`, so that higher levels are never disturbed.

use super::workspace::Workspace;
use crate::error::Result;
use crate::linalg::householder::{reflect, reflector};
use crate::linalg::{axpy, dot};

/// A joint can be fixed if its row in the remaining null space is longer than this limit. A shorter row would amplify rounding errors more
/// than 1e10 times.
const LEAST_MOBILITY: f64 = 1e-10;

/// The relative rounding error of `v(s) = s a + b`. The product of this number and `max |a| + max |b|` is the rounding error of `v(s)`. A
/// joint's `a`, and its distance from a bound, count as zero if they are smaller than this error.
const NOISE: f64 = 64.0 * f64::EPSILON;

/// An excess over a velocity bound counts as a rounding error if it is at most the tolerance `edge`. Such an excess is removed. Divided by
/// the velocity of the fastest joint, the tolerance is at least `LEAST_EDGE` and at most `MOST_EDGE`.
const MOST_EDGE: f64 = 1e-11;
const LEAST_EDGE: f64 = 1e-13;

/// Scales whose relative difference is below this limit count as equal.
const SAME_SCALE: f64 = 1e-9;

/// Memory of the method, shape `(n,)` each.
#[derive(Debug, Clone)]
pub(super) struct Saturation {
    /// The coefficients `a` and `b` of `v(s) = s a + b`, in metric coordinates.
    a: Vec<f64>,
    b: Vec<f64>,
    /// `a` and `b` in joint coordinates: the joint velocity is `s va + vb`, rad/s or m/s.
    va: Vec<f64>,
    vb: Vec<f64>,
    base: Vec<f64>,
    best: Vec<f64>,
    row: Vec<f64>,
    fixed: Vec<bool>,
}

impl Saturation {
    pub fn new(n: usize) -> Self {
        let zero = || vec![0.0; n];
        Saturation { a: zero(), b: zero(), va: zero(), vb: zero(), base: zero(), best: zero(), row: zero(), fixed: vec![false; n] }
    }
}

impl Workspace {
    /// Solve all levels. The start is zero velocity or, if zero is out of bounds, the nearest velocity within the bounds.
    pub(super) fn solve_sns(&mut self, sat: &mut Saturation) -> Result<()> {
        self.begin();
        self.start_within(sat);
        let mut condition = 1.0;
        for i in 0..self.rows.len() {
            let k = self.project(i)?;
            let above = condition;
            let (rank, spent) = self.consume_exact_rank(i, &mut condition)?;
            let cut = self.rounding * self.spectral_norm(i)? * above;
            self.ranks[i] = rank;
            self.lost[i] = rank < self.rows[i].min(k);
            // After `consume`, the array `t` contains the rotated free basis. This level modifies `t`, and the next level reads the basis.
            self.consume(spent);
            self.task_scale[i] = self.saturate(i, k, rank, cut, sat)?;
        }
        Ok(())
    }

    /// Compute the velocity within the bounds with the smallest components, in metric coordinates.
    fn start_within(&mut self, sat: &mut Saturation) {
        let (lower, upper) = self.bounds.as_ref().expect("bounds are checked at construction");
        for ((v, l), u) in sat.vb.iter_mut().zip(lower).zip(upper) {
            *v = 0.0f64.max(*l).min(*u);
        }
        if let Some(metric) = &self.metric {
            metric.coordinates(&mut sat.vb);
        }
        self.y.copy_from_slice(&sat.vb);
    }

    /// Solve one level. Return its scale, or 0 if no scale in `[0, 1]` is feasible.
    fn saturate(&mut self, i: usize, columns: usize, rank: usize, cut: f64, sat: &mut Saturation) -> Result<f64> {
        let (n, level) = (self.n, self.level(i));
        let m = level.len();
        let mut k = columns;
        let mut scale = -1.0;
        sat.base.copy_from_slice(&self.y);
        sat.fixed.fill(false);
        loop {
            for (r, row) in level.clone().enumerate() {
                for c in 0..k {
                    self.a[r * k + c] = dot(&self.j[row * n..(row + 1) * n], &self.t[c * n..(c + 1) * n]);
                }
            }
            self.svd.decompose(&self.a[..m * k], m, k)?;
            if self.svd.rank(cut) < rank {
                break;
            }
            self.affine(i, rank, k, sat);
            let (lower, upper) = self.bounds.as_ref().expect("bounds are checked at construction");
            let noise = NOISE * (largest(&sat.va) + largest(&sat.vb));
            let (mut to, mut critical, mut least, mut rate) = (1.0f64, None, f64::INFINITY, 0.0);
            for j in (0..n).filter(|&j| !sat.fixed[j]) {
                let (low, high) = interval(sat.va[j], sat.vb[j], lower[j], upper[j], noise);
                to = to.min(high);
                let violates = low > 1.0 || high < 1.0;
                // Several joints may limit the scale equally, for example joints that higher levels moved to their bounds. The fastest of
                // them is fixed.
                let alike = (high - least).abs() <= SAME_SCALE * least.abs() || high == least;
                if violates && (critical.is_none() || if alike { sat.va[j].abs() > rate } else { high < least }) {
                    let above = sat.va[j] + sat.vb[j] > upper[j];
                    (critical, least, rate) = (Some((j, if above { upper[j] } else { lower[j] })), high, sat.va[j].abs());
                }
            }
            if to >= 0.0 && to > scale && self.candidate(i, rank, k, to, noise, sat) {
                scale = to;
                sat.best.copy_from_slice(&sat.a);
            }
            let Some((joint, bound)) = critical else { break };
            if k == 0 || !bound.is_finite() || !self.fix(joint, bound, k, sat) {
                break;
            }
            k -= 1;
        }
        if scale >= 0.0 {
            self.y.copy_from_slice(&sat.best);
        }
        Ok(scale.max(0.0))
    }

    /// Compute `a = N (J N)# v_i` and `b = base - N (J N)# J base`, then `va` and `vb`.
    fn affine(&mut self, i: usize, rank: usize, k: usize, sat: &mut Saturation) {
        let (n, level) = (self.n, self.level(i));
        for (r, row) in level.clone().enumerate() {
            self.r[r] = dot(&self.j[row * n..(row + 1) * n], &sat.base);
        }
        sat.a.fill(0.0);
        sat.b.copy_from_slice(&sat.base);
        for l in 0..rank {
            let (s, u) = (self.svd.s()[l], self.svd.u(l));
            let (ga, gb) = (dot(u, &self.c[level.clone()]) / s, -dot(u, &self.r[..level.len()]) / s);
            for (c, v) in self.svd.v(l).iter().enumerate().take(k) {
                let x = &self.t[c * n..(c + 1) * n];
                axpy(ga * v, x, &mut sat.a);
                axpy(gb * v, x, &mut sat.b);
            }
        }
        sat.va.copy_from_slice(&sat.a);
        sat.vb.copy_from_slice(&sat.b);
        if let Some(metric) = &self.metric {
            metric.velocity(&mut sat.va);
            metric.velocity(&mut sat.vb);
        }
    }

    /// Compute `v(s)` as `base + N (J N)# (s v_i - J base)`, because `s a` and `b` are huge and cancel near singularities. Restrict it to
    /// the bounds. Return false if it is out of bounds by more than rounding.
    fn candidate(&mut self, i: usize, rank: usize, k: usize, s: f64, noise: f64, sat: &mut Saturation) -> bool {
        let (n, level) = (self.n, self.level(i));
        sat.a.copy_from_slice(&sat.base);
        for (r, row) in level.clone().enumerate() {
            self.r[r] = s * self.c[row] - dot(&self.j[row * n..(row + 1) * n], &sat.base);
        }
        for l in 0..rank {
            let gain = dot(self.svd.u(l), &self.r[..level.len()]) / self.svd.s()[l];
            for (c, v) in self.svd.v(l).iter().enumerate().take(k) {
                axpy(gain * v, &self.t[c * n..(c + 1) * n], &mut sat.a);
            }
        }
        sat.va.copy_from_slice(&sat.a);
        if let Some(metric) = &self.metric {
            metric.velocity(&mut sat.va);
        }
        let (lower, upper) = self.bounds.as_ref().expect("bounds are checked at construction");
        // The tolerance `edge` of the bounds is limited, because `noise` is large near singularities. A correction of that size would
        // change the results of higher levels.
        let fastest = largest(&sat.va);
        let edge = noise.min(MOST_EDGE * fastest).max(LEAST_EDGE * fastest);
        if !(0..n).all(|j| sat.va[j] >= lower[j] - edge && sat.va[j] <= upper[j] + edge) {
            return false;
        }
        let mut passes = false;
        for ((v, l), u) in sat.va.iter_mut().zip(lower).zip(upper) {
            passes |= *v < *l || *v > *u;
            *v = v.max(*l).min(*u);
        }
        if passes {
            if let Some(metric) = &self.metric {
                metric.coordinates(&mut sat.va);
            }
            sat.a.copy_from_slice(&sat.va);
        }
        true
    }

    /// Fix the velocity of `joint` at `bound`. Of the `k` free directions in the rows of `t`, remove the direction that moves this joint.
    /// Return false if no direction moves the joint.
    fn fix(&mut self, joint: usize, bound: f64, k: usize, sat: &mut Saturation) -> bool {
        let n = self.n;
        sat.row.fill(0.0);
        sat.row[joint] = 1.0;
        if let Some(metric) = &self.metric {
            metric.row(&mut sat.row);
        }
        for c in 0..k {
            self.z[c] = dot(&sat.row, &self.t[c * n..(c + 1) * n]);
        }
        if dot(&self.z[..k], &self.z[..k]).sqrt() <= LEAST_MOBILITY * dot(&sat.row, &sat.row).sqrt() {
            return false;
        }
        let (alpha, beta) = reflector(&mut self.z[..k]);
        if beta != 0.0 {
            // Apply H from the left to the rows of t, one column of t at a time.
            for col in 0..n {
                for c in 0..k {
                    sat.va[c] = self.t[c * n + col];
                }
                reflect(&self.z[..k], beta, &mut sat.va[..k]);
                for c in 0..k {
                    self.t[c * n + col] = sat.va[c];
                }
            }
        }
        let step = (bound - dot(&sat.row, &sat.base)) / alpha;
        axpy(step, &self.t[..n], &mut sat.base);
        self.t.copy_within(n..k * n, 0);
        sat.fixed[joint] = true;
        true
    }
}

fn largest(v: &[f64]) -> f64 {
    v.iter().fold(0.0, |most, v| most.max(v.abs()))
}

/// Return the interval of `s` with `lower <= s a + b <= upper`. An empty interval is `(inf, -inf)`. Rates and distances up to `noise` count
/// as zero.
fn interval(a: f64, b: f64, lower: f64, upper: f64, noise: f64) -> (f64, f64) {
    let [a, below, above] = [a, lower - b, upper - b].map(|x| if x.abs() <= noise { 0.0 } else { x });
    if a == 0.0 {
        return if below <= 0.0 && above >= 0.0 { (f64::NEG_INFINITY, f64::INFINITY) } else { (f64::INFINITY, f64::NEG_INFINITY) };
    }
    if a > 0.0 { (below / a, above / a) } else { (above / a, below / a) }
}
