//! The tangents of all records, in the layout of the result. A *tangent* is the derivative of a number with respect to one parameter.
//!
//! A record `[x, tau]` has the numbers of the state and the input at one time. A *series* is one quantity at all records, such as `q`.

use crate::error::Result;
use crate::memory;
use std::ops::Range;

/// The tangents, with one array for each series. The array has the shape `(records, numbers, parameters)`, where `numbers` is the size of
/// the quantity in one record.
pub struct Series {
    parts: Vec<(Range<usize>, Vec<f64>)>,
    parameters: usize,
}

/// Copy the first `M` numbers of each row of `from` to the start of a row of `to`. Rows of `from` have `lanes` numbers, and rows of `to`
/// have `width` numbers.
fn columns<const M: usize>(from: &[f64], lanes: usize, to: &mut [f64], width: usize) {
    for (from, to) in from.chunks_exact(lanes).zip(to.chunks_mut(width)) {
        if let (Some(from), Some(to)) = (from.first_chunk::<M>(), to.first_chunk_mut::<M>()) {
            *to = *from;
        }
    }
}

impl Series {
    /// Return arrays of zeros for `records` records. `parts` are the ranges of the quantities in a record.
    pub fn zeros(parts: impl Iterator<Item = Range<usize>>, records: usize, parameters: usize) -> Result<Self> {
        let part = |range: Range<usize>| {
            let numbers = records.saturating_mul(range.len()).saturating_mul(parameters);
            Ok((range, memory::zeros(numbers)?))
        };
        Ok(Series { parts: parts.map(part).collect::<Result<_>>()?, parameters })
    }

    /// Write the tangents of record `i` along the directions from `first` on. `rows` has one row for each number of the record, from number
    /// `first_number` on. A row has one direction per lane.
    pub fn put(&mut self, i: usize, first: usize, lanes: usize, first_number: usize, rows: &[f64]) {
        let (width, numbers) = (self.parameters, first_number + rows.len() / lanes);
        let own = width.saturating_sub(first).min(lanes);
        for (range, rates) in &mut self.parts {
            let (begin, end) = (range.start.max(first_number), range.end.min(numbers));
            if begin >= end || own == 0 {
                continue;
            }
            let to = &mut rates[(i * range.len() + begin - range.start) * width + first..(i * range.len() + end - range.start) * width];
            let from = &rows[(begin - first_number) * lanes..(end - first_number) * lanes];
            match own {
                1 => columns::<1>(from, lanes, to, width),
                2 => columns::<2>(from, lanes, to, width),
                3 => columns::<3>(from, lanes, to, width),
                4 => columns::<4>(from, lanes, to, width),
                5 => columns::<5>(from, lanes, to, width),
                6 => columns::<6>(from, lanes, to, width),
                7 => columns::<7>(from, lanes, to, width),
                _ => columns::<8>(from, lanes, to, width),
            }
        }
    }

    /// Return the tangents of each series.
    pub fn into_rates(self) -> Vec<Vec<f64>> {
        self.parts.into_iter().map(|(_, rates)| rates).collect()
    }
}
