//! The explicit Euler method, order 1: `x += h f(t, x)`.

use super::{EqualSteps, Stage};

/// The tableau of the explicit Euler method, for [`Explicit`](super::Explicit).
///
/// ```
/// use armlet_core::integrate::{EqualSteps, Euler};
///
/// assert_eq!((Euler::INSTANTS, Euler::STAGES.len()), (&[0.0][..], 1));
/// assert_eq!(Euler::STAGES[0].weight / Euler::DIVISOR, 1.0);
/// ```
pub struct Euler;

impl EqualSteps for Euler {
    const INSTANTS: &'static [f64] = &[0.0];
    const STAGES: &'static [Stage] = &[Stage { instant: 0, part: 0.0, weight: 1.0 }];
    const DIVISOR: f64 = 1.0;
}
