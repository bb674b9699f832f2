//! The memory of a program. A frame is an array of slots, and a slot has one number per lane.

use super::decision::Decisions;
use super::signature::Slots;

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

    /// The numbers of a group of slots, with all lanes.
    pub fn group(&self, slots: Slots) -> &[f64] {
        &self.numbers()[slots.numbers(self.lanes)]
    }

    pub fn group_mut(&mut self, slots: Slots) -> &mut [f64] {
        let numbers = slots.numbers(self.lanes);
        &mut self.numbers_mut()[numbers]
    }

    /// Write `values` to all lanes of the first slots of a group.
    pub fn write(&mut self, slots: Slots, values: &[f64]) {
        let lanes = self.lanes;
        let slots = self.group_mut(slots.part(0, values.len()));
        if lanes == 1 {
            slots.copy_from_slice(values);
        } else {
            slots.chunks_exact_mut(lanes).zip(values).for_each(|(slot, &value)| slot.fill(value));
        }
    }

    /// Write `values` to lane `lane` of the first slots of a group.
    pub fn write_lane(&mut self, slots: Slots, lane: usize, values: &[f64]) {
        let lanes = self.lanes;
        let slots = self.group_mut(slots)[lane.min(slots.count * lanes)..].iter_mut().step_by(lanes);
        slots.zip(values).for_each(|(to, &from)| *to = from);
    }

    /// Read `values` from lane `lane` of the first slots of a group.
    pub fn read<'a>(&self, slots: Slots, lane: usize, values: impl Iterator<Item = &'a mut f64>) {
        let slots = self.group(slots)[lane..].iter().step_by(self.lanes);
        slots.zip(values).for_each(|(&from, to)| *to = from);
    }

    /// Write `x` to all lanes of a slot.
    pub fn fill(&mut self, slot: usize, x: f64) {
        self.slot_mut(slot).fill(x);
    }
}
