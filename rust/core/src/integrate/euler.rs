//! The explicit Euler method, order 1: `x += h f(t, x)`.

use super::{EqualSteps, Explicit, Stage};

/// The tableau of the explicit Euler method.
///
/// ```
/// use armlet_core::integrate::{EqualSteps, Forward1};
///
/// assert_eq!((Forward1::INSTANTS, Forward1::STAGES.len()), (&[0.0][..], 1));
/// assert_eq!(Forward1::STAGES[0].weight / Forward1::DIVISOR, 1.0);
/// ```
pub struct Forward1;

impl EqualSteps for Forward1 {
    const INSTANTS: &'static [f64] = &[0.0];
    const STAGES: &'static [Stage] = &[Stage { instant: 0, part: 0.0, weight: 1.0 }];
    const DIVISOR: f64 = 1.0;
}

/// The explicit Euler method.
pub type Euler<B, U> = Explicit<Forward1, B, U>;
