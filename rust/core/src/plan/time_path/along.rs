//! Limits that vary along the path: values at its knots, linear in `s` between them.
//!
//! A row under such a limit `l(s)` is divided by it, so that its limit is one everywhere: `|row / l(s)| <= 1`.

use crate::motion::Path;

/// The limits at the knots of torques, accelerations and speeds, `(P + 1, n)` each; empty where they are constant.
#[derive(Clone, Debug, Default)]
pub(super) struct Along {
    pub limits: [Vec<f64>; 3],
    pub n: usize,
    /// The limits of a frame's acceleration and speed, `(P + 1,)` each.
    pub tip: [Vec<f64>; 2],
}

impl Along {
    /// Whether any limit of a joint varies.
    pub fn any(&self) -> bool {
        self.limits.iter().any(|limits| !limits.is_empty())
    }

    /// The limit of `joint` at `s` in piece `p`; one where it is constant.
    #[inline]
    pub fn limit(&self, path: &Path, kind: usize, joint: usize, p: usize, s: f64) -> f64 {
        let limits = &self.limits[kind];
        if limits.is_empty() { 1.0 } else { between(path, p, s, limits[p * self.n + joint], limits[(p + 1) * self.n + joint]) }
    }

    /// The limits of a frame's acceleration and speed at `s` in piece `p`; one where they are constant.
    #[inline]
    pub fn of_tip(&self, path: &Path, p: usize, s: f64) -> [f64; 2] {
        self.tip.each_ref().map(|limits| if limits.is_empty() { 1.0 } else { between(path, p, s, limits[p], limits[p + 1]) })
    }
}

/// The value at `s` in piece `p` that is linear from one knot to the next.
#[inline]
fn between(path: &Path, p: usize, s: f64, from: f64, to: f64) -> f64 {
    let knots = path.knots();
    let z = ((s - knots[p]) / (knots[p + 1] - knots[p])).clamp(0.0, 1.0);
    from + z * (to - from)
}
