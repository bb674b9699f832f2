//! Copies between rows of the caller's arrays and lanes of a frame, which is the memory of a program. A row has the numbers of one
//! evaluation, and a lane holds one row. The copy is a transposition. With AVX2, complete groups of four lanes move in blocks of four by
//! four numbers.

use super::frame::Frame;
use crate::scalar::{Isa, isa};
use std::ops::Range;

/// The rows of one input, one after another. Each row has `width` numbers.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rows<'a> {
    pub numbers: &'a [f64],
    pub width: usize,
}

impl<'a> Rows<'a> {
    /// Return `count` rows from row `at` on, or `None` if there are fewer.
    #[inline]
    fn get(&self, at: usize, count: usize) -> Option<&'a [f64]> {
        self.numbers.get(at * self.width..(at + count) * self.width)
    }
}

/// Copy rows of each input to consecutive slots, the first of which is `first`. Row `at` goes to the first lane, and the next rows to the
/// next lanes. Lanes beyond the last row repeat the last row.
pub fn read(frame: &mut Frame, first: usize, inputs: &[Rows], at: usize) {
    let lanes = frame.lanes();
    let to = &mut frame.numbers_mut()[first * lanes..];
    #[cfg(target_arch = "x86_64")]
    if lanes.is_multiple_of(4) && isa() >= Isa::Avx2 {
        // SAFETY: the condition above checks that the processor has AVX2.
        return unsafe { avx2::read(to, lanes, inputs, at) };
    }
    read_each(to, lanes, inputs, at);
}

/// Do the work of [`read`], number by number. `to` begins with the first slot.
fn read_each(to: &mut [f64], lanes: usize, inputs: &[Rows], at: usize) {
    let mut slots = to.chunks_exact_mut(lanes);
    for &Rows { numbers, width } in inputs.iter().filter(|rows| rows.width > 0) {
        let last = numbers.len() / width - 1;
        for (k, slot) in slots.by_ref().take(width).enumerate() {
            slot.iter_mut().enumerate().for_each(|(lane, to)| *to = numbers[(at + lane).min(last) * width + k]);
        }
    }
}

/// Copy the `length` slots from `first` on to rows of `out`, one row per lane, until `out` is full. Return whether every number is finite.
/// Negative zeros become positive.
pub fn write(frame: &Frame, first: usize, length: usize, out: &mut [f64]) -> bool {
    let lanes = frame.lanes();
    let from = &frame.numbers()[first * lanes..(first + length) * lanes];
    let mut sound = true;
    for (group, rows) in out[..].chunks_mut(4 * length).enumerate() {
        #[cfg(target_arch = "x86_64")]
        if rows.len() == 4 * length && lanes.is_multiple_of(4) && isa() >= Isa::Avx2 {
            // SAFETY: the condition above checks that the processor has AVX2.
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

/// A series of records in memory. Each of the `count` records has `record` numbers for each of `lanes` lanes.
pub struct Series<'a> {
    pub numbers: &'a [f64],
    pub lanes: usize,
    pub record: usize,
    pub count: usize,
}

impl Series<'_> {
    /// Copy a part of the series to the rows of `out`. The first row is for lane `lane`, and the next rows are for the next lanes. A row
    /// contains the numbers with the indices `which` of every record, record by record. Return whether all numbers are finite. Negative
    /// zeros become positive.
    pub fn write(&self, which: Range<usize>, lane: usize, out: &mut [&mut [f64]]) -> bool {
        let Series { numbers, lanes, record, count } = *self;
        let length = which.len() * count;
        assert!(which.end <= record && lane + out.len() <= lanes && numbers.len() >= record * lanes * count);
        assert!(out.iter().all(|row| row.len() == length), "rows of another length");
        #[cfg(target_arch = "x86_64")]
        if let ([a, b, c, d], true) = (&mut *out, length >= 4 && isa() >= Isa::Avx2) {
            // SAFETY: the condition above checks that the processor has AVX2.
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
    use super::{Rows, Series};
    use std::arch::x86_64::*;
    use std::ops::Range;

    /// Load two numbers from `low` into the lower lanes, and two from `high` into the upper lanes.
    ///
    /// # Safety
    /// Two numbers can be read at `low`, and two at `high`.
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn pairs(low: *const f64, high: *const f64) -> __m256d {
        // SAFETY: the caller guarantees that these numbers can be read.
        unsafe { _mm256_insertf128_pd::<1>(_mm256_castpd128_pd256(_mm_loadu_pd(low)), _mm_loadu_pd(high)) }
    }

    /// Load four rows of four numbers, and return their columns.
    ///
    /// # Safety
    /// Four numbers can be read at each pointer.
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn columns(rows: [*const f64; 4]) -> [__m256d; 4] {
        let [a, b, c, d] = rows;
        // SAFETY: the caller guarantees that these numbers can be read.
        let (left, right) = unsafe { ([pairs(a, c), pairs(b, d)], [pairs(a.add(2), c.add(2)), pairs(b.add(2), d.add(2))]) };
        [
            _mm256_unpacklo_pd(left[0], left[1]),
            _mm256_unpackhi_pd(left[0], left[1]),
            _mm256_unpacklo_pd(right[0], right[1]),
            _mm256_unpackhi_pd(right[0], right[1]),
        ]
    }

    /// Load four rows of two numbers, and return their columns.
    ///
    /// # Safety
    /// Two numbers can be read at each pointer.
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn two_columns([a, b, c, d]: [*const f64; 4]) -> [__m256d; 2] {
        // SAFETY: the caller guarantees that these numbers can be read.
        let (even, odd) = unsafe { (pairs(a, c), pairs(b, d)) };
        [_mm256_unpacklo_pd(even, odd), _mm256_unpackhi_pd(even, odd)]
    }

    /// Write the four rows of two columns.
    ///
    /// # Safety
    /// Two numbers can be written at each pointer.
    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn write_two_columns([left, right]: [__m256d; 2], [a, b, c, d]: [*mut f64; 4]) {
        let (even, odd) = (_mm256_unpacklo_pd(left, right), _mm256_unpackhi_pd(left, right));
        // SAFETY: the caller guarantees that these numbers can be written.
        unsafe {
            _mm_storeu_pd(a, _mm256_castpd256_pd128(even));
            _mm_storeu_pd(b, _mm256_castpd256_pd128(odd));
            _mm_storeu_pd(c, _mm256_extractf128_pd::<1>(even));
            _mm_storeu_pd(d, _mm256_extractf128_pd::<1>(odd));
        }
    }

    /// Do the work of [`read`](super::read). `to` begins with the first slot, and `lanes` is a multiple of four.
    #[target_feature(enable = "avx2")]
    pub fn read(to: &mut [f64], lanes: usize, inputs: &[Rows], at: usize) {
        let mut slot = 0;
        for input in inputs {
            let to = &mut to[slot * lanes..(slot + input.width) * lanes];
            match input.get(at, lanes) {
                Some(rows) => (0..lanes).step_by(4).for_each(|lane| read_four(rows, input.width, lane, lanes, to)),
                None => super::read_each(to, lanes, &[*input], at),
            }
            slot += input.width;
        }
    }

    /// Copy the rows `lane..lane + 4` to these lanes of the slots `to`. There is one row of `width` numbers per lane.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn read_four(rows: &[f64], width: usize, lane: usize, lanes: usize, to: &mut [f64]) {
        assert!(rows.len() == width * lanes && lane + 4 <= lanes && to.len() == width * lanes);
        // SAFETY: row `i` begins at index `i width`, and each of the `width` slots has the four lanes. The assertion checks both lengths.
        unsafe {
            let row = |i: usize, k: usize| rows.as_ptr().add((lane + i) * width + k);
            let slot = to.as_mut_ptr().add(lane);
            match width {
                0 => {}
                1 => _mm256_storeu_pd(slot, _mm256_loadu_pd(row(0, 0))),
                2 | 3 => {
                    // With three numbers, the two blocks overlap.
                    for k in 0..width - 1 {
                        let columns = two_columns([row(0, k), row(1, k), row(2, k), row(3, k)]);
                        _mm256_storeu_pd(slot.add(k * lanes), columns[0]);
                        _mm256_storeu_pd(slot.add((k + 1) * lanes), columns[1]);
                    }
                }
                _ => {
                    for k in (0..width).step_by(4) {
                        // The last block has four numbers too, and may overlap the previous one.
                        let k = k.min(width - 4);
                        for (i, column) in columns([row(0, k), row(1, k), row(2, k), row(3, k)]).into_iter().enumerate() {
                            _mm256_storeu_pd(slot.add((k + i) * lanes), column);
                        }
                    }
                }
            }
        }
    }

    /// Do the work of [`Series::write`] for four lanes. The row of each lane has at least four numbers.
    #[target_feature(enable = "avx2")]
    pub fn write_series(series: &Series, which: Range<usize>, lane: usize, out: [&mut [f64]; 4]) -> bool {
        let &Series { numbers, lanes, record, count } = series;
        let length = which.len() * count;
        assert!(lane + 4 <= lanes && which.end <= record && numbers.len() >= record * lanes * count);
        assert!(length >= 4 && out.iter().all(|row| row.len() == length));
        let zero = _mm256_setzero_pd();
        // Zero if all numbers so far are finite, otherwise NaN.
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
            // SAFETY: the assertions check that the four lanes of each record exist, and that each row of `out` has four numbers from `at`
            // on.
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
            // The last block has four numbers too, and may overlap the previous one.
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

    /// Copy lanes `lane..lane + 4` of `length` slots to four rows. Return whether every number is finite.
    #[target_feature(enable = "avx2")]
    pub fn write_four(from: &[f64], lane: usize, lanes: usize, length: usize, out: &mut [f64]) -> bool {
        assert!(length > 0 && lane + 4 <= lanes && from.len() == length * lanes && out.len() == 4 * length);
        let zero = _mm256_setzero_pd();
        // Zero if all numbers so far are finite, otherwise NaN.
        let mut zeros = [zero; 4];
        // SAFETY: `k < length` in every call, so that the four lanes of the slot exist.
        let slot = |k: usize| unsafe { from.as_ptr().add(k * lanes + lane) };
        if length < 4 {
            let mut slots = [zero; 3];
            for k in 0..length {
                // SAFETY: see `slot`.
                slots[k] = _mm256_add_pd(unsafe { _mm256_loadu_pd(slot(k)) }, zero);
                zeros[k] = _mm256_mul_pd(slots[k], zero);
            }
            // SAFETY: the assertion checks the length of `out`: row `i` begins at index `i length`. With three numbers, the two blocks overlap.
            unsafe {
                let to = out.as_mut_ptr();
                if length == 1 {
                    _mm256_storeu_pd(to, slots[0]);
                }
                for k in 0..length - 1 {
                    write_two_columns([slots[k], slots[k + 1]], std::array::from_fn(|i| to.add(i * length + k)));
                }
            }
        }
        for k in (0..length).step_by(4).filter(|_| length >= 4) {
            // The last block has four numbers too, and may overlap the previous one.
            let k = k.min(length - 4);
            // SAFETY: `k + 4 <= length`, so that the four slots and the four numbers of each row exist.
            unsafe {
                for (i, row) in columns([slot(k), slot(k + 1), slot(k + 2), slot(k + 3)]).into_iter().enumerate() {
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
        // The cases include fewer rows than lanes, incomplete groups, and rows shorter than a block.
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
                        read(&mut frame, 2, &[Rows { numbers: &given, width }], at);
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
