//! The semi-implicit (symplectic) Euler method, order 1 (Hairer, Lubich and Wanner, Geometric Numerical Integration, I.1.4):
//!
//! First `v += h v'(t, q, v)`, then `q += h v` with the new `v`, where `v'` is the time derivative. All other components are computed as in
//! the explicit Euler method.
//!
//! The system reports the rate of each position: [`System::rate_of`].

use super::{Advance, Buffer, FixedStep, System};
use crate::error::{Error, Result};
use crate::scalar::Real;

/// The instants of the inputs, as fractions of the step.
pub(super) const INSTANTS: &[f64] = &[0.0];

/// The semi-implicit Euler method. `B` is the type of the state, and `U` the type of the input.
///
/// ```
/// use armlet_core::integrate::{FixedStep, SemiImplicit, System};
///
/// /// `q' = v`, `v' = -q`.
/// struct Oscillator;
/// impl System<f64> for Oscillator {
///     type Input = ();
///     fn input(&mut self, _: f64, _: &mut ()) {}
///     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) {
///         (dx[0], dx[1]) = (x[1], -x[0]);
///     }
///     fn rate_of(&self, i: usize) -> Option<usize> {
///         (i == 0).then_some(1)
///     }
/// }
/// let mut x = [1.0, 0.0];
/// SemiImplicit::new(&Oscillator, x, ())?.step(&mut Oscillator, 0.0, 0.5, 0.5, &mut x);
/// assert_eq!(x, [0.75, -0.5]); // the new speed moves the position
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct SemiImplicit<B, U> {
    k: B,
    u: U,
    /// The pairs `(index of a position, index of its rate)`.
    pairs: Vec<(usize, usize)>,
    /// 1, or -1 if the system's time runs backwards. Then positions change with minus their rates.
    sign: f64,
}

impl<B: Clone, U: Clone> SemiImplicit<B, U> {
    /// Return the method. Errors: [`Error::Input`] if the system has no pairs of positions and rates.
    pub fn new<S, F>(system: &F, state: B, input: U) -> Result<Self>
    where
        S: Real,
        F: System<S, Input = U>,
        B: Buffer<S>,
    {
        let n = state.as_ref().len();
        let pairs: Vec<_> = (0..n).filter_map(|i| system.rate_of(i).map(|k| (i, k))).collect();
        if pairs.is_empty() {
            let problem = "is semi_implicit: expected a system with positions and velocities, got one that names none";
            return Err(Error::input("method", problem));
        }
        Ok(SemiImplicit { k: state, u: input, pairs, sign: if system.is_reversed() { -1.0 } else { 1.0 } })
    }
}

impl<S: Real, F: System<S>, B: Buffer<S>> FixedStep<S, F, B> for SemiImplicit<B, F::Input> {
    fn step(&mut self, system: &mut F, t: f64, h: f64, end: f64, x: &mut B) {
        self.advance_anew(system, t, h, end, x);
    }

    fn restart(&mut self) {}
}

impl<S: Real, F: System<S>, B: Buffer<S>> Advance<S, F, B> for SemiImplicit<B, F::Input> {
    const INSTANTS: &'static [f64] = INSTANTS;

    fn input(&mut self, _: usize) -> &mut F::Input {
        &mut self.u
    }

    fn advance(&mut self, system: &mut F, h: S, x: &mut B) {
        let (x, k) = (x.as_mut(), self.k.as_mut());
        system.rhs(&self.u, x, k);
        // The slopes of positions use the old velocities, and are replaced below.
        for &(position, _) in &self.pairs {
            k[position] = S::zero();
        }
        for i in 0..x.len() {
            x[i] = h.mul_add(k[i], x[i]);
        }
        let signed = S::splat(self.sign) * h;
        for &(position, rate) in &self.pairs {
            x[position] = signed.mul_add(x[rate], x[position]);
        }
    }
}
