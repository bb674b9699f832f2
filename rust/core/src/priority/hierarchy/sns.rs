//! Saturation in the null space (Flacco, De Luca, Khatib 2015, `flacco2015saturation`). Each level searches for the largest scale `s <= 1`
//! with
//!
//! `J_i v = s v_i`,  `v = v_above + N z`,  `v_min <= v <= v_max`. `N` is the null basis of the levels above.
//!
//! The solution `v(s) = s a + b` is affine in `s`. As long as `s = 1` violates a bound, the joint that limits `s` most is fixed at its
//! bound. Its direction is removed from `N`, and the other joints take over. The search keeps the largest feasible scale. A level without a
//! feasible scale in `[0, 1]` does not change `v_above`. Ranks equal the ranks of `exact`, so that higher levels are never disturbed.

use super::null_space::NullSpace;
use super::projected_level::ProjectedLevel;
use crate::error::Result;
use crate::linalg::householder::reflector;
use crate::linalg::{Svd, axpy, dot};
use crate::priority::settings::Settings;
use crate::priority::stack::Level;

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

/// The search for the scale of a level, with its memory.
#[derive(Debug, Clone)]
pub struct Saturation {
    /// The directions `N` of the levels above, in which no fixed joint moves.
    null_space: NullSpace,
    /// The coefficients `a` and `b` of `v(s) = s a + b`, in metric coordinates.
    a: Vec<f64>,
    b: Vec<f64>,
    /// `a` and `b` in joint coordinates: the joint velocity is `s va + vb`, rad/s or m/s.
    va: Vec<f64>,
    vb: Vec<f64>,
    /// The velocity of the levels above, with the fixed joints at their bounds.
    base: Vec<f64>,
    /// The velocity with the largest feasible scale.
    pub best: Vec<f64>,
    /// A velocity of the level, shape `(rows,)`.
    task: Vec<f64>,
    /// The row of the metric that maps coordinates to the velocity of one joint, and its product with `N`.
    row: Vec<f64>,
    mobility: Vec<f64>,
    fixed: Vec<bool>,
}

/// Write the velocity within the bounds with the smallest components, in metric coordinates.
pub fn start_within_bounds(settings: &Settings, y: &mut [f64]) {
    let (lower, upper) = settings.velocity_bounds();
    y.iter_mut().zip(lower).zip(upper).for_each(|((v, l), u)| *v = 0.0f64.max(*l).min(*u));
    settings.metric.iter().for_each(|metric| metric.coordinates(y));
}

impl Saturation {
    /// Allocate memory for `n` joints and at most `most` rows of a level.
    pub fn new(n: usize, most: usize) -> Self {
        let (null_space, task, fixed) = (NullSpace::new(n), vec![0.0; most], vec![false; n]);
        let [a, b, va, vb, base, best, row, mobility] = std::array::from_fn(|_| vec![0.0; n]);
        Saturation { null_space, a, b, va, vb, base, best, task, row, mobility, fixed }
    }

    /// Start a level with the null space and the velocity `y` of the levels above.
    pub fn start(&mut self, null_space: &NullSpace, y: &[f64]) {
        self.null_space.set(null_space);
        self.base.copy_from_slice(y);
        self.best.copy_from_slice(y);
        self.fixed.fill(false);
    }

    /// Solve one level of this `rank`, of which singular values up to `cut` count as zero. Return the scale, or 0 if no scale in `[0, 1]`
    /// is feasible. The velocity is in `best`.
    pub fn solve(&mut self, level: &Level, projected: &mut ProjectedLevel, (rank, cut): (usize, f64), settings: &Settings) -> Result<f64> {
        let mut scale = -1.0;
        loop {
            projected.decompose(level, &self.null_space)?;
            if projected.svd.rank(cut) < rank {
                break;
            }
            self.affine(level, &projected.svd, rank, settings);
            let noise = NOISE * (largest(&self.va) + largest(&self.vb));
            let (to, critical) = self.largest_scale(settings, noise);
            if to >= 0.0 && to > scale && self.candidate(level, &projected.svd, rank, settings, to, noise) {
                scale = to;
                self.best.copy_from_slice(&self.a);
            }
            let Some((joint, bound)) = critical else { break };
            if self.null_space.dim() == 0 || !bound.is_finite() || !self.fix(joint, bound, settings) {
                break;
            }
        }
        Ok(scale.max(0.0))
    }

    /// Return the largest scale up to 1 that the bounds of the joints allow. If `s = 1` violates a bound, also return the joint that limits
    /// the scale most, and its bound.
    fn largest_scale(&self, settings: &Settings, noise: f64) -> (f64, Option<(usize, f64)>) {
        let (lower, upper) = settings.velocity_bounds();
        let Saturation { va, vb, .. } = self;
        let (mut to, mut critical, mut least, mut rate) = (1.0f64, None, f64::INFINITY, 0.0);
        for j in (0..va.len()).filter(|&j| !self.fixed[j]) {
            let (low, high) = interval(va[j], vb[j], lower[j], upper[j], noise);
            to = to.min(high);
            let violates = low > 1.0 || high < 1.0;
            // Several joints may limit the scale equally, for example joints that higher levels moved to their bounds. The fastest of
            // them is fixed.
            let alike = (high - least).abs() <= SAME_SCALE * least.abs() || high == least;
            if violates && (critical.is_none() || if alike { va[j].abs() > rate } else { high < least }) {
                let above = va[j] + vb[j] > upper[j];
                (critical, least, rate) = (Some((j, if above { upper[j] } else { lower[j] })), high, va[j].abs());
            }
        }
        (to, critical)
    }

    /// Compute `a = N (J N)# v_i` and `b = base - N (J N)# J base`, then `va` and `vb`.
    fn affine(&mut self, level: &Level, svd: &Svd, rank: usize, settings: &Settings) {
        let Saturation { null_space, a, b, va, vb, base, task, .. } = self;
        task.iter_mut().zip(level.jacobian_rows()).for_each(|(to, row)| *to = dot(row, base));
        a.fill(0.0);
        b.copy_from_slice(base);
        for l in 0..rank {
            let (s, u) = (svd.s()[l], svd.u(l));
            null_space.add(dot(u, level.command) / s, svd.v(l), a);
            null_space.add(-dot(u, &task[..level.rows()]) / s, svd.v(l), b);
        }
        va.copy_from_slice(a);
        vb.copy_from_slice(b);
        settings.metric.iter().for_each(|metric| metric.velocity(va));
        settings.metric.iter().for_each(|metric| metric.velocity(vb));
    }

    /// Compute `v(s)` as `base + N (J N)# (s v_i - J base)`, because `s a` and `b` are huge and cancel near singularities. Restrict it to
    /// the bounds. Return false if it is out of bounds by more than rounding.
    fn candidate(&mut self, level: &Level, svd: &Svd, rank: usize, settings: &Settings, s: f64, noise: f64) -> bool {
        let Saturation { null_space, a, va, base, task, .. } = self;
        a.copy_from_slice(base);
        for ((to, row), command) in task.iter_mut().zip(level.jacobian_rows()).zip(level.command) {
            *to = s * command - dot(row, base);
        }
        for l in 0..rank {
            null_space.add(dot(svd.u(l), &task[..level.rows()]) / svd.s()[l], svd.v(l), a);
        }
        va.copy_from_slice(a);
        settings.metric.iter().for_each(|metric| metric.velocity(va));
        let (lower, upper) = settings.velocity_bounds();
        // The tolerance `edge` of the bounds is limited, because `noise` is large near singularities. A correction of that size would
        // change the results of higher levels.
        let fastest = largest(va);
        let edge = noise.min(MOST_EDGE * fastest).max(LEAST_EDGE * fastest);
        if !(0..va.len()).all(|j| va[j] >= lower[j] - edge && va[j] <= upper[j] + edge) {
            return false;
        }
        let mut passes = false;
        for ((v, l), u) in va.iter_mut().zip(lower).zip(upper) {
            passes |= *v < *l || *v > *u;
            *v = v.max(*l).min(*u);
        }
        if passes {
            settings.metric.iter().for_each(|metric| metric.coordinates(va));
            a.copy_from_slice(va);
        }
        true
    }

    /// Fix the velocity of `joint` at `bound`. Remove the direction of `N` that moves this joint. Return false if no direction moves the
    /// joint.
    fn fix(&mut self, joint: usize, bound: f64, settings: &Settings) -> bool {
        let Saturation { null_space, base, row, mobility, fixed, .. } = self;
        row.fill(0.0);
        row[joint] = 1.0;
        settings.metric.iter().for_each(|metric| metric.row(row));
        let mobility = &mut mobility[..null_space.dim()];
        mobility.iter_mut().zip(null_space.directions()).for_each(|(to, x)| *to = dot(row, x));
        if dot(mobility, mobility).sqrt() <= LEAST_MOBILITY * dot(row, row).sqrt() {
            return false;
        }
        let (alpha, beta) = reflector(mobility);
        if beta != 0.0 {
            null_space.reflect(mobility, beta);
        }
        let step = (bound - dot(row, base)) / alpha;
        null_space.directions().take(1).for_each(|x| axpy(step, x, base));
        null_space.remove(1);
        fixed[joint] = true;
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
