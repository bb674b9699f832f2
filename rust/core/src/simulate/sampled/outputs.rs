//! The queue of the results of the law at the last samples. An entry has the output and the other results, with the numbers of all lanes.

use super::sensors::CAPACITY;
use crate::error::all_finite;
use crate::simulate::problem::sampling::Sampling;
use std::ops::Range;

#[derive(Clone, Debug)]
pub struct Outputs {
    /// The numbers in an output, and in the other results.
    sizes: [usize; 2],
    numbers: Vec<f64>,
    /// For each place in `numbers`, the sample that is stored there, if any.
    stored: Vec<Option<u64>>,
}

impl Outputs {
    /// Create a queue that is long enough for the delays of `sampling`.
    pub fn new(sampling: &Sampling, sizes: [usize; 2]) -> Self {
        let samples = CAPACITY + sampling.delayed() as usize;
        Outputs { sizes, numbers: vec![0.0; samples * (sizes[0] + sizes[1])], stored: vec![None; samples] }
    }

    fn place(&self, k: u64) -> usize {
        (k % self.stored.len() as u64) as usize
    }

    fn range(&self, k: u64) -> Range<usize> {
        let size = self.sizes[0] + self.sizes[1];
        let first = self.place(k) * size;
        first..first + size
    }

    /// Return the output and the other results of sample `k`; `None` if they are not stored.
    pub fn get(&self, k: u64) -> Option<[&[f64]; 2]> {
        (self.stored[self.place(k)] == Some(k)).then(|| self.numbers[self.range(k)].split_at(self.sizes[0]).into())
    }

    /// Store sample `k`, and return the memory for its output and its other results.
    pub fn store(&mut self, k: u64) -> [&mut [f64]; 2] {
        let (place, range) = (self.place(k), self.range(k));
        self.stored[place] = Some(k);
        self.numbers[range].split_at_mut(self.sizes[0]).into()
    }

    /// Discard sample `k`, so that it is taken again. With `failed`, discard it only if a result is not finite.
    pub fn discard(&mut self, k: u64, failed: bool) {
        if self.get(k).is_some_and(|results| !(failed && results.into_iter().all(all_finite))) {
            let place = self.place(k);
            self.stored[place] = None;
        }
    }

    /// Discard all samples, because the run restarts.
    pub fn clear(&mut self) {
        self.stored.fill(None);
    }
}
