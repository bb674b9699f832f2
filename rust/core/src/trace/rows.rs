//! Copies between rows of the caller's arrays, one run each, and lanes of a frame. They are transposes, four by four if the processor has
//! AVX2.

use super::frame::Frame;
use crate::scalar::lanes::{Isa, isa};
use std::ops::Range;

/// Write rows `at..` of `given`, `width` numbers each, to the slots from `first` on, one row per lane. Lanes beyond the last row repeat it.
pub fn read(frame: &mut Frame, first: usize, given: &[f64], width: usize, at: usize) {
    if width == 0 {
        return;
    }
    let (lanes, last) = (frame.lanes(), given.len() / width - 1);
    let to = &mut frame.numbers_mut()[first * lanes..(first + width) * lanes];
    #[cfg(target_arch = "x86_64")]
    if lanes.is_multiple_of(4) && at + lanes <= last + 1 && isa() >= Isa::Avx2 {
        for (k, four) in given[at * width..(at + lanes) * width].chunks_exact(4 * width).enumerate() {
            // SAFETY: the processor has AVX2.
            unsafe { avx2::read_four(four, width, 4 * k, lanes, to) };
        }
        return;
    }
    for lane in 0..lanes {
        let row = &given[(at + lane).min(last) * width..][..width];
        for (k, &x) in row.iter().enumerate() {
            to[k * lanes + lane] = x;
        }
    }
}

/// Write the `length` slots from `first` on as rows of `out`, up to its size. The result is true if every number is finite. No zero is
/// negative.
pub fn write(frame: &Frame, first: usize, length: usize, out: &mut [f64]) -> bool {
    let lanes = frame.lanes();
    let from = &frame.numbers()[first * lanes..(first + length) * lanes];
    let mut sound = true;
    for (group, rows) in out[..].chunks_mut(4 * length).enumerate() {
        #[cfg(target_arch = "x86_64")]
        if rows.len() == 4 * length && lanes.is_multiple_of(4) && isa() >= Isa::Avx2 {
            // SAFETY: the processor has AVX2.
            sound &= unsafe { avx2::write_four(from, 4 * group, lanes, length, rows) };
            continue;
        }
        for (lane, row) in rows.chunks_exact_mut(length).enumerate() {
            for (k, to) in row.iter_mut().enumerate() {
                *to = from[k * lanes + 4 * group + lane] + 0.0;
                sound &= to.is_finite();
            }
        }
    }
    sound
}

/// A series of records. Each has `record` numbers of all `lanes`.
pub struct Series<'a> {
    pub numbers: &'a [f64],
    pub lanes: usize,
    pub record: usize,
    pub count: usize,
}

impl Series<'_> {
    /// Write the numbers `which` of every record as a row of `out`, for each lane from `lane` on. The result is true if all are finite. No
    /// zero is negative.
    pub fn write(&self, which: Range<usize>, lane: usize, out: &mut [&mut [f64]]) -> bool {
        let Series { numbers, lanes, record, count } = *self;
        let length = which.len() * count;
        assert!(which.end <= record && lane + out.len() <= lanes && numbers.len() >= record * lanes * count);
        assert!(out.iter().all(|row| row.len() == length), "rows of another length");
        #[cfg(target_arch = "x86_64")]
        if let ([a, b, c, d], true) = (&mut *out, length >= 4 && isa() >= Isa::Avx2) {
            // SAFETY: the processor has AVX2.
            return unsafe { avx2::write_series(self, which, lane, [a, b, c, d]) };
        }
        let mut sound = true;
        if let ([row], 1) = (&mut *out, lanes) {
            for (to, from) in row.chunks_exact_mut(which.len().max(1)).zip(numbers.chunks_exact(record)) {
                for (to, from) in to.iter_mut().zip(&from[which.clone()]) {
                    let x = from + 0.0;
                    sound &= x.is_finite();
                    *to = x;
                }
            }
            return sound;
        }
        for (offset, row) in out.iter_mut().enumerate() {
            let places = (0..count).flat_map(|i| which.clone().map(move |k| (i * record + k) * lanes + lane + offset));
            for (to, place) in row.iter_mut().zip(places) {
                let x = numbers[place] + 0.0;
                sound &= x.is_finite();
                *to = x;
            }
        }
        sound
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::Series;
    use std::arch::x86_64::*;
    use std::ops::Range;

    /// Load two numbers from `low` into the lower lanes, and two from `high` into the upper lanes.
    ///
    /// # Safety
    /// They can be read.
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn pairs(low: *const f64, high: *const f64) -> __m256d {
        // SAFETY: the caller's.
        unsafe { _mm256_insertf128_pd::<1>(_mm256_castpd128_pd256(_mm_loadu_pd(low)), _mm_loadu_pd(high)) }
    }

    /// The columns of four rows of four numbers.
    ///
    /// # Safety
    /// They can be read.
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn columns(rows: [*const f64; 4]) -> [__m256d; 4] {
        let [a, b, c, d] = rows;
        // SAFETY: the caller's.
        let (left, right) = unsafe { ([pairs(a, c), pairs(b, d)], [pairs(a.add(2), c.add(2)), pairs(b.add(2), d.add(2))]) };
        [
            _mm256_unpacklo_pd(left[0], left[1]),
            _mm256_unpackhi_pd(left[0], left[1]),
            _mm256_unpacklo_pd(right[0], right[1]),
            _mm256_unpackhi_pd(right[0], right[1]),
        ]
    }

    /// The columns of four rows of fewer than four numbers, followed by zeros.
    ///
    /// # Safety
    /// `width` numbers of each row can be read.
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn short_columns(rows: [*const f64; 4], width: usize) -> [__m256d; 4] {
        let mask = _mm256_cmpgt_epi64(_mm256_set1_epi64x(width as i64), _mm256_set_epi64x(3, 2, 1, 0));
        let [a, b, c, d] = rows;
        // SAFETY: lanes outside of the mask are not read.
        unsafe {
            transposed([_mm256_maskload_pd(a, mask), _mm256_maskload_pd(b, mask), _mm256_maskload_pd(c, mask), _mm256_maskload_pd(d, mask)])
        }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn transposed([a, b, c, d]: [__m256d; 4]) -> [__m256d; 4] {
        let (even, odd) = ([_mm256_unpacklo_pd(a, b), _mm256_unpacklo_pd(c, d)], [_mm256_unpackhi_pd(a, b), _mm256_unpackhi_pd(c, d)]);
        [
            _mm256_permute2f128_pd::<0x20>(even[0], even[1]),
            _mm256_permute2f128_pd::<0x20>(odd[0], odd[1]),
            _mm256_permute2f128_pd::<0x31>(even[0], even[1]),
            _mm256_permute2f128_pd::<0x31>(odd[0], odd[1]),
        ]
    }

    /// Write four consecutive rows of `width` numbers to lanes `lane..lane + 4` of slots of `lanes`.
    #[target_feature(enable = "avx2")]
    pub fn read_four(rows: &[f64], width: usize, lane: usize, lanes: usize, to: &mut [f64]) {
        assert!(rows.len() == 4 * width && lane + 4 <= lanes && to.len() == width * lanes);
        // SAFETY: row `i` begins at `i` times the width, and there are four lanes of as many slots.
        unsafe {
            let row = |i: usize, k: usize| rows.as_ptr().add(i * width + k);
            let slot = to.as_mut_ptr().add(lane);
            if width < 4 {
                let columns = short_columns([row(0, 0), row(1, 0), row(2, 0), row(3, 0)], width);
                for (k, &column) in columns.iter().enumerate().take(width) {
                    _mm256_storeu_pd(slot.add(k * lanes), column);
                }
                return;
            }
            for k in (0..width).step_by(4) {
                // The last block overlaps the previous one.
                let k = k.min(width - 4);
                for (i, column) in columns([row(0, k), row(1, k), row(2, k), row(3, k)]).into_iter().enumerate() {
                    _mm256_storeu_pd(slot.add((k + i) * lanes), column);
                }
            }
        }
    }

    /// As [`Series::write`], for four lanes with at least four numbers in total.
    #[target_feature(enable = "avx2")]
    pub fn write_series(series: &Series, which: Range<usize>, lane: usize, out: [&mut [f64]; 4]) -> bool {
        let &Series { numbers, lanes, record, count } = series;
        let length = which.len() * count;
        assert!(lane + 4 <= lanes && which.end <= record && numbers.len() >= record * lanes * count);
        assert!(length >= 4 && out.iter().all(|row| row.len() == length));
        let zero = _mm256_setzero_pd();
        // Zero, or NaN after a number that is not finite.
        let mut zeros = [zero; 4];
        let gap = (record - which.len()) * lanes;
        let (mut place, mut number) = (which.start * lanes + lane, 0);
        let mut next = || {
            let here = place;
            (place, number) = (place + lanes, number + 1);
            if number == which.len() {
                (place, number) = (place + gap, 0);
            }
            here
        };
        let mut places = [next(), next(), next(), next()];
        let mut at = 0;
        loop {
            // SAFETY: four lanes of numbers that are there, and four numbers of each row from `at` on.
            unsafe {
                let rows = columns(places.map(|place| numbers.as_ptr().add(place)));
                for (i, row) in rows.into_iter().enumerate() {
                    let row = _mm256_add_pd(row, zero);
                    zeros[i] = _mm256_add_pd(zeros[i], _mm256_mul_pd(row, zero));
                    _mm256_storeu_pd(out[i].as_mut_ptr().add(at), row);
                }
            }
            let left = length - at - 4;
            if left == 0 {
                break;
            }
            // The last block overlaps the previous one.
            let step = left.min(4);
            places.rotate_left(step);
            for place in &mut places[4 - step..] {
                *place = next();
            }
            at += step;
        }
        let all = _mm256_add_pd(_mm256_add_pd(zeros[0], zeros[1]), _mm256_add_pd(zeros[2], zeros[3]));
        _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_EQ_OQ>(all, zero)) == 15
    }

    /// Write lanes `lane..lane + 4` of some slots to four rows. The result is true if every number is finite.
    #[target_feature(enable = "avx2")]
    pub fn write_four(from: &[f64], lane: usize, lanes: usize, length: usize, out: &mut [f64]) -> bool {
        assert!(length > 0 && lane + 4 <= lanes && from.len() == length * lanes && out.len() == 4 * length);
        let zero = _mm256_setzero_pd();
        // Zero, or NaN after a number that is not finite.
        let mut zeros = [zero; 4];
        if length < 4 {
            let mut slots = [zero; 4];
            for k in 0..length {
                // SAFETY: four lanes of a slot.
                slots[k] = _mm256_add_pd(unsafe { _mm256_loadu_pd(from.as_ptr().add(k * lanes + lane)) }, zero);
                zeros[k] = _mm256_mul_pd(slots[k], zero);
            }
            let rows = if length == 1 { slots } else { transposed(slots) };
            let mut last = [0.0; 4];
            // SAFETY: four numbers from the start of a row on, of which the next row overwrites what is not its own; the last row is apart.
            unsafe {
                for (i, &row) in rows.iter().enumerate().take(if length == 1 { 1 } else { 3 }) {
                    _mm256_storeu_pd(out.as_mut_ptr().add(i * length), row);
                }
                _mm256_storeu_pd(last.as_mut_ptr(), rows[3]);
            }
            if length > 1 {
                out[3 * length..].copy_from_slice(&last[..length]);
            }
        }
        for k in (0..length).step_by(4).filter(|_| length >= 4) {
            // The last block overlaps the previous one.
            let k = k.min(length - 4);
            // SAFETY: four lanes of the slots from `k` on, and four numbers of each row from `k` on.
            unsafe {
                let slot = |i: usize| from.as_ptr().add((k + i) * lanes + lane);
                for (i, row) in columns([slot(0), slot(1), slot(2), slot(3)]).into_iter().enumerate() {
                    let row = _mm256_add_pd(row, zero);
                    zeros[i] = _mm256_add_pd(zeros[i], _mm256_mul_pd(row, zero));
                    _mm256_storeu_pd(out.as_mut_ptr().add(i * length + k), row);
                }
            }
        }
        let all = _mm256_add_pd(_mm256_add_pd(zeros[0], zeros[1]), _mm256_add_pd(zeros[2], zeros[3]));
        _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_EQ_OQ>(all, zero)) == 15
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_are_a_row_of_each_lane() {
        for (lanes, at_once) in [(1, 1), (2, 2), (4, 4), (4, 3), (8, 4)] {
            for (record, which, count) in [(3, 0..2, 7), (5, 4..5, 9), (5, 1..2, 3), (9, 2..8, 4), (4, 0..4, 1), (2, 1..1, 5)] {
                let numbers: Vec<f64> = (0..record * count * lanes).map(|k| if k == 3 { -0.0 } else { k as f64 }).collect();
                for lane in (0..=lanes - at_once).step_by(at_once) {
                    let mut rows = vec![vec![f64::NAN; which.len() * count]; at_once];
                    let mut out: Vec<&mut [f64]> = rows.iter_mut().map(Vec::as_mut_slice).collect();
                    assert!(Series { numbers: &numbers, lanes, record, count }.write(which.clone(), lane, &mut out));
                    for (offset, row) in rows.iter().enumerate() {
                        let places = (0..count).flat_map(|i| which.clone().map(move |k| (i * record + k) * lanes + lane + offset));
                        let expected: Vec<u64> = places.map(|place| (numbers[place] + 0.0).to_bits()).collect();
                        let got: Vec<u64> = row.iter().map(|x| x.to_bits()).collect();
                        assert_eq!(got, expected, "{lanes} {record} {which:?} {count} {lane}");
                    }
                    for bad in which.clone().map(|k| ((count - 1) * record + k) * lanes + lane) {
                        let mut numbers = numbers.clone();
                        numbers[bad] = f64::INFINITY;
                        let mut out: Vec<&mut [f64]> = rows.iter_mut().map(Vec::as_mut_slice).collect();
                        assert!(!Series { numbers: &numbers, lanes, record, count }.write(which.clone(), lane, &mut out));
                    }
                }
            }
        }
    }

    #[test]
    fn rows_pass_through_frames() {
        // Fewer rows than lanes, remainders, and rows shorter than a block.
        for lanes in [1, 2, 4, 8] {
            for (width, count) in [(1, 9), (1, 16), (2, 17), (3, 8), (4, 7), (5, 1), (7, 12), (8, 16), (49, 5)] {
                for bad in [None, Some(0), Some(count * width - 1)] {
                    let mut given: Vec<f64> = (0..count * width).map(|k| k as f64 + 0.5).collect();
                    given[width / 2] = -0.0;
                    if let Some(k) = bad {
                        given[k] = f64::NEG_INFINITY;
                    }
                    let (mut out, mut sound) = (vec![f64::NAN; count * width], true);
                    let mut frame = Frame::new(width + 3, lanes);
                    for at in (0..count).step_by(lanes) {
                        read(&mut frame, 2, &given, width, at);
                        let rows = lanes.min(count - at);
                        sound &= write(&frame, 2, width, &mut out[at * width..][..rows * width]);
                    }
                    let same = out.iter().zip(&given).all(|(x, y)| x.to_bits() == (y + 0.0).to_bits());
                    assert!(same, "{lanes} {width} {count}: {out:?}");
                    assert_eq!(sound, bad.is_none(), "{lanes} {width} {count} {bad:?}");
                    assert!(frame.numbers()[..2 * lanes].iter().all(|x| *x == 0.0), "slots before the first are left alone");
                }
            }
        }
    }
}
