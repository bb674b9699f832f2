//! Interpolation between grid points, by polynomials through the nearest grid points of the same piece:
//!
//! ```text
//! f(z) = sum_k w_k f_k,   w_k = prod_(m != k) (z - m) / (k - m),   grid points z = 0 .. NODES - 1, a segment from z = o to o + 1
//! ```
//!
//! The rows are smooth within a piece, where the grid has equal steps. Across knots the third derivative of the path jumps.

use super::tuning::CHECK_STEPS;

/// The weights `w_k` for every offset `o` of a segment from the first grid point of the interpolation, and for every place in the segment.
pub(super) struct Stencil<const NODES: usize> {
    /// `weights[o][k]`: the `NODES` weights for the offset `o` of a segment and the place with index `k`.
    weights: Vec<Vec<[f64; NODES]>>,
}

impl<const NODES: usize> Stencil<NODES> {
    /// Compute the weights for the places `z` in (0, 1) of a segment.
    pub fn new(places: &[f64]) -> Self {
        let weight =
            |z: f64| std::array::from_fn(|k| (0..NODES).filter(|&m| m != k).map(|m| (z - m as f64) / (k as f64 - m as f64)).product());
        Stencil { weights: (0..NODES - 1).map(|o| places.iter().map(|z| weight(o as f64 + z)).collect()).collect() }
    }

    /// Return the first grid point of the interpolation in segment `i`, and the weights, one array per place. Segments `first..last` have
    /// equal lengths. `None` if these segments have fewer than `NODES` grid points.
    #[inline(always)]
    pub fn of(&self, i: usize, first: usize, last: usize) -> Option<(usize, &[[f64; NODES]])> {
        if last - first + 1 < NODES {
            return None;
        }
        let start = (i + 1).saturating_sub(NODES / 2).clamp(first, last + 1 - NODES);
        Some((start, &self.weights[i - start]))
    }
}

/// The places, as fractions of a segment, at which a check interpolates.
pub(super) fn inner_places() -> Vec<f64> {
    (1..CHECK_STEPS).map(|k| k as f64 / CHECK_STEPS as f64).collect()
}
