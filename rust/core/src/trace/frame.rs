//! The memory of a program. A frame is an array of slots, and a slot has one number per lane.

use super::decision::Decisions;

/// A cache line. Slots of one, two, four or eight lanes are aligned in it.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct CacheLine([f64; 8]);

/// Memory of `slots` slots with `lanes` numbers each. The lanes are independent evaluations of the same program: runs, rows of inputs, or
/// directions of derivatives.
#[derive(Clone, Debug)]
pub struct Frame {
    lines: Vec<CacheLine>,
    lanes: usize,
    decisions: Decisions,
}

impl Frame {
    /// Return a frame of zeros.
    pub fn new(slots: usize, lanes: usize) -> Self {
        Frame { lines: vec![CacheLine([0.0; 8]); (slots * lanes).div_ceil(8)], lanes, decisions: Decisions::default() }
    }

    pub fn lanes(&self) -> usize {
        self.lanes
    }

    /// The memory of native code at the cuts of programs.
    pub(super) fn decisions(&mut self) -> &mut Decisions {
        &mut self.decisions
    }

    /// All numbers of the frame. Slot `s` begins at index `s lanes`.
    pub fn numbers(&self) -> &[f64] {
        // SAFETY: a line is eight numbers without padding.
        unsafe { std::slice::from_raw_parts(self.lines.as_ptr().cast(), 8 * self.lines.len()) }
    }

    pub fn numbers_mut(&mut self) -> &mut [f64] {
        // SAFETY: a line is eight numbers without padding.
        unsafe { std::slice::from_raw_parts_mut(self.lines.as_mut_ptr().cast(), 8 * self.lines.len()) }
    }

    /// The numbers of slot `slot`, one per lane.
    pub fn slot_mut(&mut self, slot: usize) -> &mut [f64] {
        let lanes = self.lanes;
        &mut self.numbers_mut()[slot * lanes..(slot + 1) * lanes]
    }

    /// Write `x` to all lanes of a slot.
    pub fn fill(&mut self, slot: usize, x: f64) {
        self.slot_mut(slot).fill(x);
    }
}
