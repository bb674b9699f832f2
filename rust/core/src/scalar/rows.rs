//! Between rows of numbers, one configuration each, and values with a configuration per lane: transposes, eight by eight.

use crate::scalar::Real;

/// Numbers of a row that are moved at once.
const BLOCK: usize = 8;
/// Rows of this length are staged on their way to memory.
const LONG: usize = 128;

/// Rows `at..at + LANES` of `given`, `width` numbers each, into the lanes of `to`; lanes beyond row `count` repeat the last one.
#[inline(always)]
pub fn read_rows<S: Real>(given: &[f64], at: usize, count: usize, width: usize, to: &mut [S]) {
    let from = &given[at * width..];
    let mut k = 0;
    if S::LANES > 1 {
        // A block may reach into the next row, whose numbers are then not used: it must be there.
        while k < width && from.len() >= (S::LANES - 1) * width + k + BLOCK {
            let values = S::from_rows(|lane| {
                let mut row = [0.0; BLOCK];
                row.copy_from_slice(&from[lane * width + k..][..BLOCK]);
                row
            });
            let used = BLOCK.min(width - k);
            to[k..k + used].copy_from_slice(&values[..used]);
            k += BLOCK;
        }
    }
    let last = count - 1 - at;
    for i in k..width {
        to[i] = S::from_lanes(|lane| from[lane.min(last) * width + i]);
    }
}

/// The lanes of `values` as rows of `out`, as many as there is room for; whether every number is finite.
#[inline(always)]
pub fn write_rows<S: Real>(values: &[S], stage: &mut Vec<f64>, out: &mut [f64]) -> bool {
    let length = values.len();
    if S::LANES == 1 {
        const INFINITE: u64 = 0x7ff << 52;
        let mut bad = 0;
        for (to, from) in out[..length].iter_mut().zip(values) {
            *to = from.lane(0);
            bad |= u64::from(to.to_bits() & INFINITE == INFINITE);
        }
        return bad == 0;
    }
    // Zero, or NaN once a number was not finite; apart, so that no sum waits for another.
    let mut zeros = [S::zero(); BLOCK];
    let (mut k, full) = (0, out.len() >= S::LANES * length);
    // Long rows are put together in the cache and leave for memory in one stream: a line to each row in turn takes longer.
    let staged = full && length >= LONG;
    if staged && stage.len() < S::LANES * length {
        stage.resize(S::LANES * length, 0.0);
    }
    let to: &mut [f64] = if staged { &mut stage[..S::LANES * length] } else { &mut *out };
    let (blocks, _) = values.as_chunks::<BLOCK>();
    for block in blocks {
        for i in 0..BLOCK {
            zeros[i] = block[i].mul_add(S::zero(), zeros[i]);
        }
        if full {
            S::each_row(block, |lane, row| to[lane * length + k..][..BLOCK].copy_from_slice(&row));
        }
        k += BLOCK;
    }
    for x in &values[k..] {
        zeros[0] = x.mul_add(S::zero(), zeros[0]);
    }
    if !full {
        for (i, x) in to.iter_mut().enumerate() {
            *x = values[i % length].lane(i / length);
        }
    } else if length >= BLOCK && k < length {
        // The last block again from where it ends: some numbers are written twice.
        let first = length - BLOCK;
        let mut block = [S::zero(); BLOCK];
        block.copy_from_slice(&values[first..]);
        S::each_row(&block, |lane, row| to[lane * length + first..][..BLOCK].copy_from_slice(&row));
    } else if length < BLOCK && to.len() >= S::LANES * length + BLOCK {
        // Rows from the first to the last: what a block writes beyond its row is written over by the next.
        let mut block = [S::zero(); BLOCK];
        block[..length].copy_from_slice(values);
        S::each_row(&block, |lane, row| to[lane * length..][..BLOCK].copy_from_slice(&row));
    } else {
        for (i, from) in values.iter().enumerate().skip(k) {
            for lane in 0..S::LANES {
                to[lane * length + i] = from.lane(lane);
            }
        }
    }
    if staged {
        out[..S::LANES * length].copy_from_slice(&stage[..S::LANES * length]);
    }
    let zero = ((zeros[0] + zeros[1]) + (zeros[2] + zeros[3])) + ((zeros[4] + zeros[5]) + (zeros[6] + zeros[7]));
    // A comparison with NaN fails.
    S::all(zero.lt(S::splat(1.0)))
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
            let (mut values, mut stage, mut sound) = (vec![S::zero(); width], Vec::new(), true);
            for at in (0..count).step_by(S::LANES) {
                read_rows(&given, at, count, width, &mut values);
                sound &= write_rows(&values, &mut stage, &mut out[at * width..]);
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
        // Rows shorter than a block, whole blocks, blocks and a rest, and rows that are staged.
        for width in (1..=19).chain([LONG - 1, LONG, LONG + 3, 490]) {
            for count in [1, 2, 7, 8, 9, 16, 37] {
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
