//! The log of a group of lanes. Programs (recorded and compiled loops) write records to it during some steps. Then the records are copied
//! to the caller's arrays. A frame is the memory of a program for some lanes.

use crate::error::Result;
use crate::memory;
use crate::simulate::record::slots::StepSlots;
use crate::trace::{Frame, Slots, rows};
use std::ops::Range;

/// The number of lanes of the widest number type.
pub(in crate::simulate) const MOST_LANES: usize = 8;

/// The capacity of a log in records: a block of steps, and the last record of a run.
const CAPACITY: usize = 40;

/// The records that are not yet passed on, separately for each frame.
pub struct Log {
    /// The number of steps between two records.
    pub every: usize,
    /// The index of the first stored record.
    first: usize,
    /// The number of stored records.
    count: usize,
    /// For each frame, its records one after another. A record is the state, then its other numbers, with all lanes of each number.
    frames: Vec<Vec<f64>>,
    lanes: usize,
    /// The slots of the state in a frame.
    state: Slots,
    /// The slots of the other numbers of a record in a frame.
    noted: Slots,
}

impl Log {
    pub fn new(slots: &StepSlots, every: usize, frames: &[Frame]) -> Self {
        let lanes = frames[0].lanes();
        let width = slots.state.count + slots.record.count;
        Log {
            every,
            first: 0,
            count: 0,
            frames: frames.iter().map(|_| vec![0.0; CAPACITY * width * lanes]).collect(),
            lanes,
            state: slots.state,
            noted: slots.record,
        }
    }

    /// The number of values in a record.
    fn width(&self) -> usize {
        self.state.count + self.noted.count
    }

    /// Return the memory of record `i` of a frame. Records arrive in order. If steps are repeated, an earlier record arrives again, and
    /// replaces the records from its index on.
    fn row(&mut self, i: usize, frame: usize) -> &mut [f64] {
        if self.count == 0 {
            self.first = i;
        }
        let (row, size) = (i - self.first, self.width() * self.lanes);
        self.count = row + 1;
        &mut self.frames[frame][row * size..(row + 1) * size]
    }

    /// Store the state in `frame` as the state of record `i`, before the step replaces it.
    pub fn note_state(&mut self, i: usize, k: usize, frame: &Frame) {
        let numbers = frame.group(self.state);
        self.row(i, k)[..numbers.len()].copy_from_slice(numbers);
    }

    /// Store the other numbers of record `i` after they have been computed in `frame`.
    pub fn note_rest(&mut self, i: usize, k: usize, frame: &Frame) {
        let (states, numbers) = (self.state.count * self.lanes, frame.group(self.noted));
        self.row(i, k)[states..].copy_from_slice(numbers);
    }

    /// Pass all records to `take` and remove them. `time(k)` is the time at the start of step `k`, s.
    pub fn pass_on(&mut self, time: &dyn Fn(usize) -> f64, take: impl FnOnce(&Block)) {
        if self.count > 0 {
            let all = self.frames.len() * self.lanes;
            let lanes = std::array::from_fn(|lane| (lane < all).then_some(lane));
            take(&Block { log: self, time, first: self.first, count: self.count, lanes });
        }
        self.count = 0;
    }
}

/// Consecutive records of a group of lanes. A record has the numbers `[state, input, monitors]`.
pub struct Block<'a> {
    log: &'a Log,
    time: &'a dyn Fn(usize) -> f64,
    /// The index of the first record.
    pub first: usize,
    /// The number of records.
    pub count: usize,
    /// The run of each lane, or `None` for a lane without records.
    pub lanes: [Option<usize>; MOST_LANES],
}

impl Block<'_> {
    /// Return the records with each run `i` replaced by run `of(i)`.
    pub fn of_lanes(&self, of: impl Fn(usize) -> Option<usize>) -> Self {
        Block { log: self.log, time: self.time, first: self.first, count: self.count, lanes: self.lanes.map(|lane| lane.and_then(&of)) }
    }

    /// Return the time of record `i` of this block, s.
    pub fn time(&self, i: usize) -> f64 {
        (self.time)((self.first + i) * self.log.every)
    }

    /// The number of values in a record.
    pub fn width(&self) -> usize {
        self.log.width()
    }

    /// Return number `k` of record `i` of this block, in lane `lane`.
    pub fn number(&self, i: usize, k: usize, lane: usize) -> f64 {
        let lanes = self.log.lanes;
        self.log.frames[lane / lanes][(i * self.width() + k) * lanes + lane % lanes] + 0.0
    }

    /// Return the first record in which a number of the range `numbers` is not finite in lane `lane`.
    pub fn fault(&self, numbers: Range<usize>, lane: usize) -> Option<usize> {
        (0..self.count).find(|&i| numbers.clone().any(|k| !self.number(i, k, lane).is_finite()))
    }

    /// Copy the range `numbers` of all records to one row per lane, from lane `lane` on. Return whether all numbers are finite.
    pub fn write(&self, numbers: Range<usize>, lane: usize, out: &mut [&mut [f64]]) -> bool {
        let lanes = self.log.lanes;
        let series = rows::Series { numbers: &self.log.frames[lane / lanes], lanes, record: self.width(), count: self.count };
        series.write(numbers, lane % lanes, out)
    }

    /// Append the range `numbers` of all records of the first lane to `series`. Return whether all numbers are finite.
    pub fn append(&self, numbers: Range<usize>, series: &mut Vec<f64>) -> Result<bool> {
        let (before, more) = (series.len(), self.count * numbers.len());
        memory::more(series, more)?;
        series.resize(before + more, 0.0);
        Ok(self.write(numbers, 0, &mut [&mut series[before..]]))
    }

    /// The number of lanes that [`Block::write`] copies in one call.
    pub fn at_once(&self) -> usize {
        self.log.lanes.min(4)
    }
}
