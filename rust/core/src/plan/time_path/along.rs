//! Limits that vary along the path: one value per knot, linear in `s` between knots.
//!
//! A row is one limited quantity, for example the torque of one joint. A row under such a limit `l(s)` is divided by `l(s)`. Then its limit
//! is one everywhere: `|row / l(s)| <= 1`.

use crate::motion::Path;

/// Limits of torques, accelerations and speeds at the `P + 1` knots, `(P + 1, n)` each; empty where a limit is constant.
#[derive(Clone, Debug, Default)]
pub(super) struct Along {
    pub limits: [Vec<f64>; 3],
    pub n: usize,
    /// Limits of a frame's acceleration and speed at the knots, `(P + 1,)` each; empty where a limit is constant.
    pub tip: [Vec<f64>; 2],
}

impl Along {
    /// Whether any limit of a joint varies.
    pub fn any(&self) -> bool {
        self.limits.iter().any(|limits| !limits.is_empty())
    }

    /// The limit of `joint` at `s` in piece `p` if it varies along the path. If it is constant, the result is 1, not the limit. `kind` is 0
    /// for torque, 1 for acceleration, 2 for speed.
    #[inline]
    pub fn limit(&self, path: &Path, kind: usize, joint: usize, p: usize, s: f64) -> f64 {
        let limits = &self.limits[kind];
        if limits.is_empty() { 1.0 } else { between(path, p, s, limits[p * self.n + joint], limits[(p + 1) * self.n + joint]) }
    }

    /// The limits of a frame's acceleration and speed at `s` in piece `p`. For a constant limit, the result is 1, not the limit.
    #[inline]
    pub fn of_tip(&self, path: &Path, p: usize, s: f64) -> [f64; 2] {
        self.tip.each_ref().map(|limits| if limits.is_empty() { 1.0 } else { between(path, p, s, limits[p], limits[p + 1]) })
    }
}

/// Interpolate linearly at `s` in piece `p`, with the values `from` and `to` at its two knots.
#[inline]
fn between(path: &Path, p: usize, s: f64, from: f64, to: f64) -> f64 {
    let knots = path.knots();
    let z = ((s - knots[p]) / (knots[p + 1] - knots[p])).clamp(0.0, 1.0);
    from + z * (to - from)
}
