//! The limits of all rows, and the scales of their excesses.

/// The limits of all rows, in blocks of `BLOCK`. First are torques and accelerations of joints and frame, as in
/// [`LimitRows`](super::lines::LimitRows). Then follow speeds and norms if they are limited.
#[derive(Clone, Debug, Default)]
pub(super) struct Limits {
    pub lo: Vec<f64>,
    pub hi: Vec<f64>,
    /// The scales of relative excesses of the lower and upper limits. A scale is the absolute value of the limit, or of the opposite limit
    /// if the limit is zero.
    pub scale_lo: Vec<f64>,
    pub scale_hi: Vec<f64>,
    /// The reciprocals `1 / scale_lo` and `1 / scale_hi`.
    pub by_lo: Vec<f64>,
    pub by_hi: Vec<f64>,
}

impl Limits {
    pub fn push(&mut self, lo: f64, hi: f64) {
        let (a, b) = (lo.abs(), hi.abs());
        self.lo.push(lo);
        self.hi.push(hi);
        self.scale_lo.push(if a > 0.0 { a } else { b });
        self.scale_hi.push(if b > 0.0 { b } else { a });
        self.by_lo.push(1.0 / self.scale_lo[self.lo.len() - 1]);
        self.by_hi.push(1.0 / self.scale_hi[self.lo.len() - 1]);
    }
}
