//! Rounding errors of implicit methods at tight tolerances.
//!
//! A stored state `x` has an error of `eps |x|`, where `eps` is the machine precision. A stiff slope then has an error of `eps |J| |x|`.
//! The error estimate of a step of size `h` has an error of `(s I - J)^-1 eps |J| |x|`, where `s ~ 1/h`. For velocities, this error can
//! increase when the step size decreases. If it exceeds the tolerance, smaller steps are rejected too. The method has two remedies, in this
//! order:
//!
//! 1. Compensated states. The state is `x + rest`. If the argument `x + z` of a stage is rounded to `y`, then
//!    `f(x + z) = f(y) + J (x + z - y)`.
//!    The difference `x + z - y` is exact (Knuth's sum), and `J` is accurate enough. Only the rounding error of `f` itself remains.
//! 2. If the remaining error also exceeds the tolerance, the run ends with [`Status::ExcessAccuracy`], and reports a feasible tolerance.

use super::accuracy::Accuracy;
use super::step_controller::StepController;
use super::{Buffer, System};
use crate::scalar::Real;
use crate::status::Status;

/// The counter of rejections: a rejected attempt adds `REJECTED`, and an accepted attempt subtracts one. When the counter reaches `MOST`,
/// the rounding error is measured. The counter reaches `MOST` after five rejections in a row, or within 30 attempts of which a third are
/// rejected.
const REJECTED: u32 = 4;
const MOST: u32 = 20;
/// A rounding error below this fraction of the method's smallest significant error is ignored (see `look`).
const NOTED: f64 = 0.05;
/// If the rounding error of the error estimate exceeds this fraction of the tolerance although states are compensated, the run ends.
/// Smaller steps would not help.
const EXCESS: f64 = 0.3;
/// The safety factor of the feasible tolerance.
const MARGIN: f64 = 100.0;
/// The number of measurements from which the feasible tolerance is computed.
const MEASUREMENTS: u64 = 16;
/// The feasible tolerance is computed for the present state multiplied by this factor. Close to rest, the rates are much smaller than now,
/// but the rounding errors of the positions are not.
const AT_REST: f64 = 1e-3;

/// The compensation and the measurement of rounding errors.
#[derive(Clone, Debug)]
pub(super) struct Rounding<B> {
    /// Whether states are compensated.
    pub compensated: bool,
    /// The compensation: the exact state minus the stored, rounded state `x`.
    pub remainder: B,
    /// The exact last argument of `f` minus the rounded numbers at which `f` was evaluated.
    pub lost: B,
    strain: u32,
    estimates: u64,
}

/// Return the rounded sum `a + b` and its rounding error.
pub(super) fn two_sum<S: Real>(a: S, b: S) -> (S, S) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

/// A random direction of rounding for component `c` in measurement `k` (splitmix64). With a regular pattern, two components such as a link
/// and its motor could always be rounded in the same direction.
fn random_sign(k: u64, c: u64) -> bool {
    let mut z = (k << 32 | c).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ (z >> 31)) & 1 == 0
}

/// `y += J x`, where `J` is row-major.
pub(super) fn add_product<S: Real>(j: &[S], x: &[S], y: &mut [S]) {
    let n = x.len();
    for (y, row) in y.iter_mut().zip(j.chunks_exact(n)) {
        for c in 0..n {
            *y = row[c].mul_add(x[c], *y);
        }
    }
}

impl<B> Rounding<B> {
    pub fn new(state: B) -> Self
    where
        B: Clone,
    {
        Rounding { compensated: false, remainder: state.clone(), lost: state, strain: 0, estimates: 0 }
    }

    /// Begin a segment. Its state has no compensation yet.
    pub fn begin<S: Real>(&mut self)
    where
        B: Buffer<S>,
    {
        self.remainder.as_mut().fill(S::zero());
    }

    /// Compute the rounded sum `y = x + z` and its rounding error `lost`. On entry, `y` contains `z`, which includes `rest`.
    pub fn place<S: Real>(&mut self, x: &[S], y: &mut [S])
    where
        B: Buffer<S>,
    {
        let lost = self.lost.as_mut();
        for c in 0..x.len() {
            (y[c], lost[c]) = two_sum(x[c], y[c]);
        }
    }

    /// Accept a step. The rounding error of the new state becomes its compensation.
    pub fn accepted(&mut self) {
        self.strain = self.strain.saturating_sub(1);
        if self.compensated {
            std::mem::swap(&mut self.remainder, &mut self.lost);
        }
    }

    /// Count a rejected step. Return true if the rounding error must be measured.
    pub fn rejected(&mut self) -> bool {
        self.strain += REJECTED;
        if self.strain < MOST {
            return false;
        }
        self.strain = 0;
        true
    }

    /// Measure the rounding error of the error estimate at the state `x` with slope `slope`. For this purpose, multiply each component of
    /// the state by `1 + 2 eps` or `1 - 2 eps`, at random, and compare the slopes.
    ///
    /// `solve` multiplies by the method's `(s I - J)^-1`, with `s ~ 1/h` and the Jacobian `J`. `gain` is the Euclidean norm of the weights
    /// of all slopes in the error estimate. `finest` is the smallest significant error of the method, divided by the tolerance. `y`, `dy`
    /// and `u` are memory for states and for the input.
    ///
    /// The measured error is ignored if it is below `NOTED finest`. Otherwise, states are compensated from now on. If they are compensated
    /// already, return the error divided by the tolerance. Error: [`Status::ExcessAccuracy`] if this quotient is `EXCESS` or more.
    #[cold]
    pub fn estimate<S, F, A>(
        &mut self,
        system: &mut F,
        controller: &mut StepController<A>,
        (x, slope, j): (&B, &B, &[S]),
        (y, dy, u): (&mut B, &mut B, &mut F::Input),
        (gain, finest): (f64, f64),
        mut solve: impl FnMut(&mut [S]),
    ) -> Result<Option<f64>, Status>
    where
        S: Real,
        F: System<S>,
        B: Buffer<S>,
        A: Accuracy,
    {
        let (x, n) = (x.as_ref(), x.as_ref().len());
        system.input(controller.input_time(controller.t), u);
        // Write the effect of rounding on the error estimate to `dy`.
        let mut measure = |rounding: &mut Self, y: &mut B, dy: &mut B| {
            rounding.estimates += 1;
            for c in 0..n {
                let by = if random_sign(rounding.estimates, c as u64) { 2.0 } else { -2.0 } * f64::EPSILON;
                y.as_mut()[c] = S::splat(by).mul_add(x[c], x[c]);
                rounding.lost.as_mut()[c] = (x[c] - y.as_ref()[c]) + rounding.remainder.as_ref()[c];
            }
            system.rhs(u, y.as_ref(), dy.as_mut());
            if rounding.compensated {
                add_product(j, rounding.lost.as_ref(), dy.as_mut());
            }
            for c in 0..n {
                dy.as_mut()[c] = dy.as_ref()[c] - slope.as_ref()[c];
            }
            solve(dy.as_mut());
        };
        measure(self, y, dy);
        controller.work.evaluations += 1;
        let left = gain * controller.norm(x, x, |c| dy.as_ref()[c]);
        if left < NOTED * finest {
            return Ok(None);
        }
        if !self.compensated {
            self.compensated = true;
            return Ok(None);
        }
        if left < EXCESS {
            return Ok(Some(left));
        }
        // One measurement may be small by chance, so the feasible tolerance follows from the largest of several.
        for _ in 0..MEASUREMENTS {
            for c in 0..n {
                y.as_mut()[c] = S::splat(AT_REST) * x[c];
            }
            let coarsen = MARGIN * gain * controller.norm(y.as_ref(), y.as_ref(), |c| dy.as_ref()[c]);
            controller.work.coarsen = controller.work.coarsen.max(coarsen);
            measure(self, y, dy);
        }
        controller.work.evaluations += MEASUREMENTS;
        Err(Status::ExcessAccuracy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sum_and_what_it_loses_are_the_exact_sum() {
        for (a, b) in [(1.0, 1e-17), (1e-17, 1.0), (0.1, 0.2), (-1.6, 1e-3), (3.0, -3.0), (0.0, 5.0)] {
            let (sum, lost) = two_sum(a, b);
            assert_eq!(sum, a + b);
            // As integers in units of 2^-110, the sums of these numbers are exact.
            let whole = |x: f64| (x * 2f64.powi(110)) as i128;
            assert_eq!(whole(sum) + whole(lost), whole(a) + whole(b), "{a} {b}");
        }
        assert_eq!(two_sum(1.0, 1e-17), (1.0, 1e-17));
    }

    #[test]
    fn five_rejections_in_a_row_or_a_third_of_all_are_a_strain() {
        let attempts = |accepted: usize| {
            let mut rounding = Rounding::new(vec![0.0f64; 1]);
            (1..200).find(|k| {
                if k % (accepted + 1) == 0 {
                    rounding.rejected()
                } else {
                    rounding.accepted();
                    false
                }
            })
        };
        assert_eq!(attempts(0), Some(5));
        assert!(attempts(2).unwrap() <= 30);
        // One rejection in five attempts is usual for a step-size controller, and does not cause a measurement.
        assert_eq!(attempts(4), None);
    }
}
