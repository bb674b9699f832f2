//! Between rows of numbers, one configuration each, and values with a configuration per lane: transposes, eight by eight.

use crate::scalar::Real;
use crate::scalar::lanes::prefetch;

/// Numbers of a row that are moved at once.
const BLOCK: usize = 8;

/// Rows `at..at + LANES` of `given`, `width` numbers each, into the lanes of `to`; lanes beyond row `count` repeat the last one.
#[inline(always)]
pub fn read_rows<S: Real>(given: &[f64], at: usize, count: usize, width: usize, to: &mut [S]) {
    let from = &given[at * width..];
    let mut k = 0;
    // A block may reach into the next row, whose numbers are then not used: it must be there.
    while S::LANES > 1 && k < width && from.len() >= (S::LANES - 1) * width + k + BLOCK {
        let values = S::of_rows(&from[k..], width);
        let used = BLOCK.min(width - k);
        to[k..k + used].copy_from_slice(&values[..used]);
        k += BLOCK;
    }
    if k < width {
        read_last(from, k, count - 1 - at, width, to);
    }
}

/// The end of the array, number by number: out of the way of the others.
#[cold]
#[inline(never)]
fn read_last<S: Real>(from: &[f64], first: usize, last: usize, width: usize, to: &mut [S]) {
    for i in first..width {
        to[i] = S::from_lanes(|lane| from[lane.min(last) * width + i]);
    }
}

/// The exponent of what is not finite.
const INFINITE: u64 = 0x7ff << 52;

/// One if not finite, without a branch.
#[inline(always)]
fn infinite(x: f64) -> u64 {
    u64::from(x.to_bits() & INFINITE == INFINITE)
}

/// One row into single numbers, as many; whether all of them are finite. Four at a time, and no more: rows are short.
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

/// Single numbers as one row, of as many; whether all of them are finite. No zero is negative: programs keep no signs of zeros.
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

/// The lanes of `values` as rows of `out`, as many as there is room for; whether every number is finite. Memory is asked for the rows
/// that come next.
#[inline(always)]
pub fn write_rows<S: Real>(values: &[S], out: &mut [f64]) -> bool {
    let length = values.len();
    // Zero, or NaN once a number was not finite; apart, so that no sum waits for another.
    let mut zeros = [S::zero(); BLOCK];
    let (mut k, full) = (0, out.len() >= S::LANES * length);
    let (blocks, _) = values.as_chunks::<BLOCK>();
    for block in blocks {
        for i in 0..BLOCK {
            zeros[i] = block[i].mul_add(S::zero(), zeros[i]);
        }
        if full {
            for lane in 0..S::LANES {
                prefetch(out.as_ptr().wrapping_add(S::LANES * (length + k) + BLOCK * lane));
            }
            S::to_rows(block, &mut out[k..], length);
        }
        k += BLOCK;
    }
    for x in &values[k..] {
        zeros[0] = x.mul_add(S::zero(), zeros[0]);
    }
    if !full {
        write_last(values, out);
    } else if length >= BLOCK && k < length {
        // The last block again from where it ends: some numbers are written twice.
        let first = length - BLOCK;
        let mut block = [S::zero(); BLOCK];
        block.copy_from_slice(&values[first..]);
        S::to_rows(&block, &mut out[first..], length);
    } else if length < BLOCK && out.len() >= S::LANES * length + BLOCK {
        // Rows from the first to the last: what a block writes beyond its row is written over by the next.
        let mut block = [S::zero(); BLOCK];
        block[..length].copy_from_slice(values);
        S::to_rows(&block, out, length);
    } else if k < length {
        write_last(values, &mut out[..S::LANES * length]);
    }
    let zero = ((zeros[0] + zeros[1]) + (zeros[2] + zeros[3])) + ((zeros[4] + zeros[5]) + (zeros[6] + zeros[7]));
    // A comparison with NaN fails.
    S::all(zero.lt(S::splat(1.0)))
}

/// The last rows, number by number.
#[cold]
#[inline(never)]
fn write_last<S: Real>(values: &[S], to: &mut [f64]) {
    let length = values.len();
    for (i, x) in to.iter_mut().enumerate() {
        *x = values[i % length].lane(i / length);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::{Array8, Kernel, run_lanes};

    /// `width` numbers a row: all of them through the lanes and back, in groups, the last one not full.
    struct Through {
        width: usize,
        count: usize,
        bad: Option<usize>,
    }

    impl Through {
        fn run_on<S: Real>(&self) {
            let Through { width, count, bad } = *self;
            let mut given: Vec<f64> = (0..count * width).map(|k| k as f64 + 0.5).collect();
            if let Some(k) = bad {
                given[k] = f64::INFINITY;
            }
            let mut out = vec![f64::NAN; count * width];
            let (mut values, mut sound) = (vec![S::zero(); width], true);
            for at in (0..count).step_by(S::LANES) {
                read_rows(&given, at, count, width, &mut values);
                sound &= write_rows(&values, &mut out[at * width..]);
            }
            assert_eq!(out, given, "{width} {count} {}", S::LANES);
            assert_eq!(sound, bad.is_none(), "{width} {count} {bad:?} {}", S::LANES);
        }
    }

    impl crate::scalar::Task for &Through {
        type Output = ();
        #[inline(always)]
        fn run<S: Real>(self) {
            self.run_on::<S>();
        }
    }

    struct Plain<'a>(&'a Through);
    impl Kernel for Plain<'_> {
        type Output = ();
        fn run(self) {
            self.0.run_on::<f64>();
            self.0.run_on::<Array8<false>>();
        }
    }

    #[test]
    fn rows_pass_through_lanes() {
        // Rows shorter than a block, whole blocks, blocks and a rest.
        for width in (1..=19).chain([128, 131, 490]) {
            for count in [1, 2, 7, 8, 9, 16, 37, 48, 50] {
                let last = count * width - 1;
                for bad in [None, Some(0), Some(last / 2), Some(last)] {
                    let through = Through { width, count, bad };
                    run_lanes(&through);
                    Plain(&through).run();
                }
            }
        }
    }
}
