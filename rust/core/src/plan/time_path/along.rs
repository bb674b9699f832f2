//! Limits that vary along the path: given at its knots, linear in `s` between them.
//!
//! A row under such a limit `l(s)` is divided by it, so that its limit is one everywhere: `|row / l(s)| <= 1`.

use crate::motion::Path;

/// The limits at the knots of torques, accelerations and speeds, `(P + 1, n)` each; empty where they are constant.
#[derive(Clone, Debug, Default)]
pub(super) struct Along {
    pub limits: [Vec<f64>; 3],
    pub n: usize,
}

impl Along {
    /// Whether any limit varies.
    pub fn any(&self) -> bool {
        self.limits.iter().any(|limits| !limits.is_empty())
    }

    /// The limit of `joint` at `s` in piece `p`; one where it is constant.
    #[inline]
    pub fn limit(&self, path: &Path, kind: usize, joint: usize, p: usize, s: f64) -> f64 {
        let (limits, knots) = (&self.limits[kind], path.knots());
        if limits.is_empty() {
            return 1.0;
        }
        let z = ((s - knots[p]) / (knots[p + 1] - knots[p])).clamp(0.0, 1.0);
        let (from, to) = (limits[p * self.n + joint], limits[(p + 1) * self.n + joint]);
        from + z * (to - from)
    }
}
