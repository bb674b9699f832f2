//! Copies between a row of `f64` numbers and an array of numbers with one lane, with a check for finite numbers.

use crate::scalar::Real;

/// The exponent bits of a number that is infinite or NaN.
const INFINITE: u64 = 0x7ff << 52;

/// Return one if `x` is not finite, otherwise zero, without a branch.
#[inline(always)]
fn infinite(x: f64) -> u64 {
    u64::from(x.to_bits() & INFINITE == INFINITE)
}

/// Copy a row to numbers with one lane. Return whether all numbers are finite.
#[inline(always)]
pub fn read_one<S: Real>(given: &[f64], to: &mut [S]) -> bool {
    let ((fours, rest), (to_fours, to_rest)) = (given.as_chunks::<4>(), to.as_chunks_mut::<4>());
    let mut bad = [0; 4];
    for (to, from) in to_fours.iter_mut().zip(fours) {
        for k in 0..4 {
            to[k] = S::splat(from[k]);
            bad[k] |= infinite(from[k]);
        }
    }
    for k in 0..to_rest.len().min(rest.len()).min(3) {
        to_rest[k] = S::splat(rest[k]);
        bad[k] |= infinite(rest[k]);
    }
    bad == [0; 4]
}

/// Copy numbers with one lane to a row. Return whether all numbers are finite. Negative zeros become positive, because programs (recorded,
/// compiled functions) do not keep the signs of zeros.
#[inline(always)]
pub fn write_one<S: Real>(values: &[S], out: &mut [f64]) -> bool {
    let ((fours, rest), (to_fours, to_rest)) = (values.as_chunks::<4>(), out.as_chunks_mut::<4>());
    let mut bad = [0; 4];
    for (to, from) in to_fours.iter_mut().zip(fours) {
        for k in 0..4 {
            to[k] = from[k].lane(0) + 0.0;
            bad[k] |= infinite(to[k]);
        }
    }
    for k in 0..to_rest.len().min(rest.len()).min(3) {
        to_rest[k] = rest[k].lane(0) + 0.0;
        bad[k] |= infinite(to_rest[k]);
    }
    bad == [0; 4]
}
