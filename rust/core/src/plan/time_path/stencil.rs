//! Values between grid points from those on the grid, by polynomials through the nearest points of the same piece:
//!
//! ```text
//! f(z) = sum_k w_k f_k,   w_k = prod_(m != k) (z - m) / (k - m),   points k = 0 .. NODES - 1, a segment from o to o + 1
//! ```
//!
//! The rows are smooth within a piece, where the grid is even; across knots the third derivative of the path jumps.

/// Weights of each point, for every offset of the segment in its window and every place in the segment.
pub(super) struct Stencil<const NODES: usize> {
    /// By offset: one row of weights per place.
    weights: Vec<Vec<[f64; NODES]>>,
}

impl<const NODES: usize> Stencil<NODES> {
    /// The interpolation weights for the places `z` in (0, 1) of a segment.
    pub fn new(places: &[f64]) -> Self {
        let weight =
            |z: f64| std::array::from_fn(|k| (0..NODES).filter(|&m| m != k).map(|m| (z - m as f64) / (k as f64 - m as f64)).product());
        Stencil { weights: (0..NODES - 1).map(|o| places.iter().map(|z| weight(o as f64 + z)).collect()).collect() }
    }

    /// The first point of the stencil of segment `i` in a piece of segments `first..last`, and the weights. None if the piece has too
    /// few points.
    #[inline(always)]
    pub fn of(&self, i: usize, first: usize, last: usize) -> Option<(usize, &[[f64; NODES]])> {
        if last - first + 1 < NODES {
            return None;
        }
        let start = (i + 1).saturating_sub(NODES / 2).clamp(first, last + 1 - NODES);
        Some((start, &self.weights[i - start]))
    }
}
